"""The session alone: its scheduler as a table, its thread with a renderer that only counts."""

import importlib
import threading
import time
from types import SimpleNamespace

import pytest


@pytest.fixture
def session(extension):
    return importlib.import_module(extension + ".session")


class Counting:
    """Pretends to render: one sample takes `pace` seconds, relMSE is 1/samples."""

    def __init__(self, pace=0.0, fail_at=None):
        self.pace, self.fail_at, self.calls = pace, fail_at, []

    def render(self, scene, width, height, *, samples, time_limit, first_sample, seed, threads, progress):
        self.calls.append((first_sample, samples))
        self.thread = threading.current_thread()
        began, done, reason = time.monotonic(), 0, "samples"
        while done < samples:
            time.sleep(self.pace)
            done += 1
            if first_sample + done == self.fail_at:
                raise ValueError("objects[0].process: out of luck")
            if not progress(done / samples, {"samples": done}):
                return self.result(done, None, cancelled=True)
            if time_limit is not None and time.monotonic() - began > time_limit:
                reason = "time"
                break
        return self.result(done, reason)

    def merge(self, results):
        return self.result(sum(entry.stats["samples"] for entry in results), None)

    @staticmethod
    def result(samples, reason, cancelled=False):
        stats = {"samples": samples, "estimated_error": 1 / samples, "cancelled": cancelled, "stopped_by": reason}
        return SimpleNamespace(stats=stats)


def run(session, renderer, **limits):
    running = session.Session(renderer, None, 4, 4, session.Limits(**limits))
    running.start()
    return running, running.finish()


@pytest.mark.parametrize(
    "limits, state, expected",
    [
        ({"samples": 100}, (0, 0, None), 16),
        ({"samples": 100}, (16, 1, 0.1), 16),
        ({"samples": 100}, (64, 1, 0.1), 36),
        ({"samples": 100}, (100, 1, 0.1), "samples"),
        ({"samples": 4096}, (1024, 40, 0.1), 512),
        ({"samples": 4096}, (16, 90, 0.1), 16),
        ({"samples": None, "time_limit": 5}, (0, 9, None), 16),
        ({"samples": None, "time_limit": 5}, (32, 4, 0.1), 32),
        ({"samples": None, "time_limit": 5}, (32, 5.1, 0.1), "time limit"),
        ({"samples": None, "noise_threshold": 0.1}, (16, 1, 0.001), 16),
        ({"samples": None, "noise_threshold": 0.1}, (64, 1, 0.009), "noise threshold"),
        ({"samples": None, "noise_threshold": 0.1}, (64, 1, 0.011), 16),
        ({"samples": None, "noise_threshold": 0.1}, (64, 1, None), 64),
    ],
)
def test_schedule(session, limits, state, expected):
    step = session.next_round(session.Limits(**limits), *state)
    if isinstance(expected, str):
        assert (step.samples, step.stop) == (0, expected)
    else:
        assert step.samples == expected


def test_rounds_are_slices_of_whole_blocks(session):
    renderer = Counting()
    running, result = run(session, renderer, samples=100)
    assert renderer.calls == [(0, 16), (16, 16), (32, 32), (64, 36)]
    assert result.stats["samples"] == 100 and running.stop == "samples"
    assert [entry["samples"] for entry in running.history] == [16, 32, 64, 100]
    assert renderer.thread is not threading.current_thread()


@pytest.mark.parametrize(
    "limits, made, seconds, paths, expected",
    [
        ({"samples": 128}, [], 0, 1920 * 1080, 1),
        ({"samples": 128}, [1], 8, 1920 * 1080, 4),
        ({"samples": 128}, [1], 0.1, 1920 * 1080, 0),  # the block is there in 1.6 s
        ({"samples": 128}, [1, 4], 40, 1920 * 1080, 0),
        ({"samples": 128}, [], 0, 320 * 240, 0),
        ({"samples": 16}, [], 0, 1920 * 1080, 0),
        ({"samples": None, "time_limit": 10}, [], 0, 1920 * 1080, 0),  # it would take from the picture itself
        ({"samples": None, "time_limit": 100}, [], 0, 1920 * 1080, 1),
    ],
)
def test_sketches_come_where_the_first_block_takes_long(session, limits, made, seconds, paths, expected):
    assert session.next_sketch(session.Limits(**limits), made, seconds, paths) == expected


def test_a_viewport_waits_for_nothing(session):
    """Its pictures are small, but their samples may take long, and nothing says so before the first."""
    assert session.next_sketch(session.Limits(samples=64), [], 0.0, 10_000) == 0
    assert session.next_sketch(session.Limits(samples=64), [], 0.0, 10_000, patience=0.0) == 1


def test_sketches_are_shown_and_thrown_away(session):
    renderer = Counting(pace=0.002)
    running = session.Session(renderer, None, 1000, 1000, session.Limits(samples=100), patience=0.02)
    running.start()
    fractions, pictures = [], set()
    while not running.wait(0.001):
        fractions.append(running.progress().fraction)
        if running.latest() is not None:
            pictures.add(running.latest().stats["samples"])
    assert renderer.calls == [(0, 1), (0, 4), (0, 16), (16, 16), (32, 32), (64, 36)]
    assert running.finish().stats["samples"] == 100
    assert {1, 4, 16} <= pictures and fractions == sorted(fractions)


def test_no_sketches_where_nobody_looks(session):
    renderer = Counting()
    running = session.Session(renderer, None, 10_000, 10_000, session.Limits(samples=32), False)
    running.start()
    running.finish()
    assert renderer.calls == [(0, 16), (16, 16)]


def test_cancel_in_the_first_block_keeps_the_sketch(session):
    renderer = Counting(pace=0.01)
    running = session.Session(renderer, None, 1000, 1000, session.Limits(samples=100), patience=0.02)
    running.start()
    while len(renderer.calls) < 3:
        time.sleep(0.001)
    running.cancel()
    assert running.finish().stats["samples"] == 4 and running.stop == "cancelled"


def test_noise_threshold_is_met_without_much_overshoot(session):
    running, result = run(session, Counting(), samples=None, noise_threshold=0.05)
    assert running.stop == "noise threshold"
    assert 400 <= result.stats["samples"] <= 416


def test_time_limit(session):
    running, result = run(session, Counting(pace=0.002), samples=None, time_limit=0.2)
    assert running.stop == "time limit"
    assert result.stats["samples"] > 0


def test_cancel_keeps_what_is_there(session):
    running = session.Session(Counting(pace=0.002), None, 4, 4, session.Limits(samples=2000))
    running.start()
    while running.latest() is None:
        time.sleep(0.005)
    progress = running.progress()
    assert 0 < progress.fraction < 1 and progress.remaining > 0 and "Remaining" in progress.text()
    running.cancel()
    result = running.finish()
    assert running.stop == "cancelled"
    assert 16 <= result.stats["samples"] < 2000


def test_cancel_before_the_first_round_leaves_nothing(session):
    running = session.Session(Counting(pace=0.01), None, 4, 4, session.Limits(samples=100))
    running.cancel()
    running.start()
    assert running.finish() is None
    assert running.stop == "cancelled"


def test_failure_of_the_worker_is_raised_in_the_caller(session):
    with pytest.raises(ValueError, match="out of luck"):
        run(session, Counting(fail_at=20), samples=100)


def test_a_render_must_end(session):
    with pytest.raises(ValueError, match="Nothing ends"):
        session.Limits(samples=None)
