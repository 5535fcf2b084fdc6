"""What a cell of the bench says of its set-up and its memory, and what its default is called."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

gn = pytest.importorskip("gpis_native")
from bench.error import analysis, runner  # noqa: E402
from bench.error.methods import drawn_by  # noqa: E402
from bench.error.scenes import LAMBERT, STANDARD_VIEW, WHITE, csg, describe, stochastic  # noqa: E402

# In a process of its own, as cells are: tables are kept in a process, and so is its peak.
CELLS = """
import json, time
import gpis_native as gn
import numpy as np
from bench.error.measure import Effort, measure
from bench.error.methods import Method
from bench.error.scenes import LAMBERT, STANDARD_VIEW, WHITE, BenchScene, describe, stochastic

def crumbs(sampler, memory, folder):
    np.ones(8 << 20)  # 64 MB
    process = gn.GaussianProcess(gn.ConstantField(1.5), 1.0, gn.SquaredExponential(0.25), bounds=([-1] * 3, [1] * 3))
    return describe(STANDARD_VIEW, WHITE, {"m": LAMBERT}, [stochastic("Crumbs", process, ["m"], sampler, memory)])

np.ones(32 << 20)  # a peak before
scene = BenchScene("crumbs", "", "", crumbs, "first_passage", "dense")
effort, cells = Effort("small", 4, 4, 0.02, 0.02, 16, 2, 2, 2), {}
for name in ("convolution", "first_passage"):
    cells[name] = measure(scene, Method("default", "", "sampler", sampler=name), effort, None)[0]
    description = crumbs(name, "renewal+", None)
    start = time.process_time()
    gn.Scene(description)
    cells[name]["scene_seconds"] = time.process_time() - start
print(json.dumps(cells))
"""


@pytest.fixture(scope="module")
def cells():
    tests = Path(__file__).parents[1]
    done = subprocess.run([sys.executable, "-c", CELLS], cwd=tests, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return json.loads(done.stdout)


def test_memory_is_what_the_cell_held_itself(cells):
    for cell in cells.values():
        if not Path("/proc/self/status").exists():
            assert cell["memory_mb"] is None
        else:
            assert 60 < cell["memory_mb"] < 128


def test_set_up_has_the_table(cells):
    """Drawing it takes some thousand times as long as making the scene."""
    table, marched = cells["first_passage"], cells["convolution"]
    assert table["setup_seconds"] > 20 * table["scene_seconds"]
    assert table["setup_seconds"] > marched["setup_seconds"] > 0
    assert [c["drawn_by"] for c in cells.values()] == [["convolution"], ["first_passage"]]


def test_nothing_is_there_before_the_set_up_is_over():
    table = {"floor": 0.0, "cost": 1e-4, "setup": 2.0}
    marched = {"floor": 0.0, "cost": 3e-4, "setup": 0.5}
    assert analysis.error_after(table, 2.0) is None
    assert analysis.ratio_at_equal_time(marched, table, 1) is analysis.ratio_at_equal_time(table, marched, 1) is None
    assert analysis.ratio_at_equal_time(marched, table, 3.5) == pytest.approx(1.5)
    assert analysis.ratio_at_equal_error(marched, table, 1e-4) == pytest.approx(3.5 / 3)


def test_a_default_is_called_by_what_draws_it():
    """A constant mean that a plane cuts comes out of a table, though its leaf alone is marched; a name is said once."""
    bounds = ([-1] * 3, [1] * 3)
    filling = gn.GaussianProcess(gn.ConstantField(0), 0.01, gn.SquaredExponential(0.1), bounds=bounds)
    half = gn.GaussianProcess(gn.PlaneField((0, 0, 0), (0, 0, 1)), 0.0, gn.SquaredExponential(1), bounds=bounds)
    wedge = describe(STANDARD_VIEW, WHITE, {"m": LAMBERT}, [stochastic("Wedge", gn.intersection(filling, half), ["m", "m"])])
    assert drawn_by(gn.Scene(wedge).plan()) == ["first_passage"]
    assert drawn_by(gn.Scene(csg()).plan()) == ["convolution"]


@pytest.mark.parametrize("change", ["module_hash", "sources_hash", "again", None])
def test_a_changed_bench_begins_anew(tmp_path, monkeypatch, change):
    monkeypatch.setattr(runner.rates, "yardstick", lambda: 1e8)
    runner.begin(tmp_path, False)
    kept = [tmp_path / name / "one" for name in ("cells", "references", "files")]
    for path in kept:
        path.parent.mkdir(exist_ok=True)
        path.write_text("")
    if change not in ("again", None):
        monkeypatch.setattr(runner, change, lambda: "another")
    known = runner.begin(tmp_path, change == "again")
    assert [path.exists() for path in kept] == [change is None] * 3
    runner.end(tmp_path, known, {"one"})
    assert runner.begin(tmp_path, False)["yardstick_end"] == 1e8
