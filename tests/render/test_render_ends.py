"""How a render ends and what it tells on the way: error, time, cancelling, exceptions, Ctrl-C, several at once."""

import os
import threading
import time

import gpis_native as gn
import numpy as np
import pytest
from pictures import same


def test_noise_threshold_ends_the_render(noisy):
    result = gn.render(noisy, 16, 12, noise_threshold=0.009)
    assert result.stats["stopped_by"] == "noise" and result.stats["samples"] > 64
    assert np.sqrt(result.stats["estimated_error"]) <= 0.009 < np.sqrt(result.history[-2]["estimated_error"])
    samples = result.stats["samples"]
    same(result, gn.render(noisy, 16, 12, samples=int(samples)))


def test_time_limit_gives_every_pixel_a_sample(noisy):
    result = gn.render(noisy, 200, 200, time_limit=1e-6)
    assert result.stats["stopped_by"] == "time"
    assert (result.passes["sample_count"] == 1).all()
    assert result.stats["camera_paths"] == 200 * 200
    # A limit in the middle of a round: whole blocks only, whichever pixels got them, those of a whole render.
    result = gn.render(noisy, 64, 64, time_limit=0.3)
    counts = result.passes["sample_count"][..., 0]
    assert (counts.min() >= 16) <= (counts % 16 == 0).all()
    assert np.isfinite(result.stats["estimated_error"]) == (counts.min() >= 2)
    done = int(counts.min())
    if done >= 16:
        whole, where = gn.render(noisy, 64, 64, samples=done), counts == done
        assert where.any() and np.array_equal(result.passes["combined"][where], whole.passes["combined"][where])


def test_time_limited_sums_are_those_of_whole_blocks(noisy):
    """The first block comes in pieces (1, 1, 2, 4, 8 samples): the film must not show it."""
    limited = gn.render(noisy, 12, 12, samples=48, time_limit=1e6)
    assert [row["samples"] for row in limited.history][:6] == [1, 2, 4, 8, 16, 32]
    same(limited, gn.render(noisy, 12, 12, samples=48))


def test_progress_runs_forward_and_tells_what_is_left(noisy):
    calls = []
    here = threading.get_ident()

    def progress(fraction, stats):
        assert threading.get_ident() == here
        calls.append((fraction, stats))

    result = gn.render(noisy, 300, 300, time_limit=1.0, progress=progress)
    fractions = [f for f, _ in calls]
    assert fractions == sorted(fractions) and fractions[0] >= 0 and fractions[-1] <= 1
    assert 2 <= len(calls) <= 12 * result.stats["seconds"] + 3
    assert set(calls[0][1]) == {"seconds", "samples", "estimated_error", "remaining", "error_left"}
    known = [s for _, s in calls if np.isfinite(s["estimated_error"])]
    for stats in known:
        assert stats["error_left"] == pytest.approx(np.sqrt(stats["estimated_error"]))


def test_false_cancels(noisy):
    began = []

    def progress(fraction, stats):
        began.append(time.monotonic())
        return False

    result = gn.render(noisy, 700, 700, samples=1000000, progress=progress)
    assert time.monotonic() - began[0] < 5  # seconds of a render that takes days
    assert len(began) == 1
    assert result.stats["cancelled"] is True and result.stats["stopped_by"] is None
    assert result.passes["combined"].shape == (700, 700, 4)
    assert np.isfinite(result.passes["combined"]).all()


def test_a_line_that_takes_long_ends_with_the_render():
    """A length scale of a millionth of the bounds: a ray that notices nothing marches to the bound on its steps."""
    eye = np.eye(4)
    eye[2, 3] = 4
    mean = gn.ConstantField(1.0) + gn.PlaneField([0, 0, 0], [1, 0, 0], 1e-9)  # a constant one would be refused
    process = gn.GaussianProcess(mean, 0.1, gn.LocallyPeriodic(1e-6, 1e-6, [0, 0, 1], 0.1), bounds=([-1, -1, -1], [1, 1, 1]))
    scene = {
        "version": 1,
        "settings": {"missed_root": 1e-300},
        "camera": {"type": "orthographic", "matrix": eye, "width": 1},
        "world": {"color": (1, 1, 1)},
        "materials": {"grey": {"type": "lambert", "color": (0.5, 0.5, 0.5)}},
        "objects": [{"name": "Dust", "type": "gpis", "process": process, "materials": ["grey"]}],
    }
    result = gn.render(gn.Scene(scene), 4, 4, samples=16, threads=1, progress=lambda fraction, stats: False)
    assert result.stats["cancelled"] is True
    assert result.stats["line_evaluations"] > 0 and result.stats["line_step_limit"] == 0


def test_an_exception_in_progress_ends_the_render(noisy):
    class Stop(Exception):
        pass

    def progress(fraction, stats):
        raise Stop("now")

    with pytest.raises(Stop, match="now"):
        gn.render(noisy, 700, 700, samples=1000000, progress=progress)


def test_ctrl_c_ends_the_render(noisy):
    import signal

    # A shell's background jobs start with the signal ignored: say that Ctrl-C interrupts.
    previous = signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        timer = threading.Timer(0.3, os.kill, (os.getpid(), signal.SIGINT))
        timer.start()
        with pytest.raises(KeyboardInterrupt):
            gn.render(noisy, 700, 700, samples=1000000, time_limit=60)
        timer.join()
    finally:
        signal.signal(signal.SIGINT, previous)


def test_python_runs_while_rendering_and_renders_run_at_once(noisy):
    """Two renders that end only when the other one has begun: with the lock held they would never return."""
    begun = [threading.Event(), threading.Event()]
    results = [None, None]

    def run(i):
        def progress(fraction, stats):
            begun[i].set()
            return not begun[1 - i].is_set()

        results[i] = gn.render(noisy, 500, 500, samples=100000, seed=i, progress=progress)

    threads = [threading.Thread(target=run, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join(timeout=60)
        assert not thread.is_alive()
    assert all(r.stats["cancelled"] for r in results)
    # And with both at work at once the images are what they are alone.
    pair = [None, None]

    def short(i):
        pair[i] = gn.render(noisy, 40, 40, samples=32, seed=i)

    threads = [threading.Thread(target=short, args=(i,)) for i in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    for i in range(2):
        same(pair[i], gn.render(noisy, 40, 40, samples=32, seed=i))
