"""The benchmarks' results.json keeps what other calls measured, and compares like with like."""

import json

import pytest
from bench import results

ROW = {"case": "a", "count": 3, "s": 2.0}


def known(rows, quick=False, name="one"):
    return results.kept(results.NOTHING, name, rows, {"quick": quick, "day": "then"})


def test_a_call_keeps_the_results_of_the_others(tmp_path):
    both = results.kept(known([ROW]), "two", [{"s": 1.0}], {"quick": True})
    path = tmp_path / "results.json"
    path.write_text(json.dumps(both))
    again = results.kept(results.load(path), "two", [{"s": 5.0}], {"quick": False})
    assert again["benchmarks"] == {"one": [ROW], "two": [{"s": 5.0}]}
    assert again["measured"] == {"one": {"quick": False, "day": "then"}, "two": {"quick": False}}
    assert results.NOTHING == {"benchmarks": {}, "measured": {}}


def test_ratios_are_of_the_fractions_of_the_same_rows():
    rows = [ROW | {"case": "new"}, ROW | {"s": 3.0}, ROW | {"count": 4}]
    assert results.ratios(rows, known([ROW]), "one", False) == [{"case": "a", "s": pytest.approx(1.5)}]


def test_a_quick_run_is_not_compared_with_a_full_one():
    assert results.ratios([ROW], known([ROW], quick=True), "one", False) == []
    assert results.ratios([ROW], results.NOTHING, "one", False) == []


@pytest.mark.parametrize("text", ["", '{"bench', '{"machine": {}, "benchmarks": {"one": [{"case": "a", "count": 3, "s": 2.0}]}}'])
def test_what_cannot_be_compared_with_is_no_error(tmp_path, text):
    path = tmp_path / "results.json"
    assert results.load(path) == results.NOTHING
    path.write_text(text)
    assert results.ratios([ROW], results.load(path), "one", False) == []
