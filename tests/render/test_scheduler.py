"""What to render next: decided without pixels."""

import gpis_native as gn
import numpy as np
import pytest


def rounds(samples_per_second=1e9, error_at_one=np.inf, **rules):
    """All rounds of a render whose error is error_at_one / samples: the counts and why it stopped."""
    done, counts = 0, []
    while True:
        error = error_at_one / done if done > 1 else np.inf
        count, stop, fraction = gn._next_round(done, done / samples_per_second, error, **rules)
        assert 0 <= fraction <= 1
        if count == 0:
            return counts, stop
        assert stop == "none"
        counts.append(count)
        done += count


@pytest.mark.parametrize("samples", [1, 7, 16, 17, 100, 1000, 4096])
def test_samples_are_met_exactly_by_whole_blocks(samples):
    counts, stop = rounds(samples=samples)
    assert sum(counts) == samples and stop == "samples"
    assert all(count % 16 == 0 for count in counts[:-1])
    assert len(counts) < 40


def test_rounds_grow_by_a_quarter():
    counts, _ = rounds(samples=100000)
    starts = np.cumsum([0] + counts)
    for start, count in zip(starts[1:-1], counts[1:], strict=True):
        assert count <= max(16, start / 4 + 16)


def test_a_time_limit_starts_with_one_sample_and_completes_its_block():
    counts, stop = rounds(samples_per_second=100, time_limit=10)
    assert counts[:6] == [1, 1, 2, 4, 8, 16] and stop == "time"
    assert 1000 <= sum(counts) < 1300
    # The first sample alone takes longer than the limit: nothing more is begun.
    assert rounds(samples_per_second=0.1, time_limit=1) == ([1], "time")


def test_noise_stops_where_the_threshold_is_met():
    # sqrt(4 / n) <= .05 from n = 1600 on.
    counts, stop = rounds(error_at_one=4.0, noise_threshold=0.05)
    assert stop == "noise" and 1600 <= sum(counts) <= 1616


def test_noise_is_not_trusted_below_four_blocks():
    counts, stop = rounds(error_at_one=1e-9, noise_threshold=0.05)
    assert stop == "noise" and sum(counts) == 64


def test_the_first_rule_that_holds_stops():
    assert rounds(samples=64, time_limit=1e9, noise_threshold=1e-9, error_at_one=1.0)[1] == "samples"
    assert rounds(samples=10**6, time_limit=1, samples_per_second=50)[1] == "time"
    assert rounds(samples=10**6, noise_threshold=0.1, error_at_one=1.0)[1] == "noise"


def test_fraction_follows_the_nearest_rule():
    assert gn._next_round(25, 1.0, np.inf, samples=100)[2] == pytest.approx(0.25)
    assert gn._next_round(25, 1.0, np.inf, samples=100, time_limit=2.0)[2] == pytest.approx(0.5)
    # 100 samples have error .04, the threshold .1 needs 400.
    assert gn._next_round(100, 1.0, 0.04, noise_threshold=0.1)[2] == pytest.approx(0.25)


def test_a_threshold_whose_square_is_nothing_ends():
    """Of a picture without noise; 0 / 0 samples were none that could be counted."""
    assert gn._next_round(16, 1, 0.0, noise_threshold=1e-200)[0] > 0
    assert gn._next_round(64, 1, 0.0, noise_threshold=1e-200)[:2] == (0, "noise")
    assert gn._next_round(64, 1, 1e-3, noise_threshold=1e-200)[0] == 16
