"""The loop between a session and Blender: progress, pictures and Esc, with a stand-in for Blender's engine.

In the window they were looked at; in the background Blender never asks to stop.
"""

import importlib
from types import SimpleNamespace

import pytest

from .test_session import Counting


class StandIn:
    """A RenderEngine that writes down what it is told; `esc_at`: the progress at which Esc is pressed."""

    def __init__(self, esc_at=2.0):
        self.esc_at, self.fractions, self.texts, self.pictures, self.ended, self.stamps = esc_at, [], [], 0, None, {}

    def test_break(self):
        return bool(self.fractions) and self.fractions[-1] >= self.esc_at

    def update_progress(self, fraction):
        self.fractions.append(fraction)

    def update_stats(self, _, text):
        self.texts.append(text)

    def begin_result(self, *_, **__):
        layer = SimpleNamespace(passes=SimpleNamespace(find_by_name=lambda *_: None))
        return SimpleNamespace(layers=[layer])

    def update_result(self, _):
        self.pictures += 1

    def end_result(self, _, cancel=False):
        self.ended = "cancelled" if cancel else "kept"

    def get_result(self):
        return SimpleNamespace(stamp_data_add_field=self.stamps.__setitem__)


@pytest.fixture
def run(extension, monkeypatch):
    engine = importlib.import_module(extension + ".engine")
    monkeypatch.setattr(engine, "_POLL", 0.005)

    def run(stand_in, renderer, **limits):
        session = engine.Session(renderer, None, 8, 8, engine.Limits(**limits))
        layer = SimpleNamespace(name="Layer")
        return engine._run(stand_in, session, layer, 8, 8), session

    return run


def test_progress_and_pictures_on_the_way(run):
    blender = StandIn()
    result, session = run(blender, Counting(pace=0.002), samples=128)
    assert result.stats["samples"] == 128 and session.stop == "samples" and blender.ended == "kept"
    assert blender.fractions == sorted(blender.fractions) and blender.fractions[-1] > 0.5
    # A slow machine draws a sketch before the 16, 32, 64 and 128 samples; one look may find two rounds done.
    assert 1 <= blender.pictures <= session.progress().rounds
    assert any("Remaining" in text and "Error left" in text for text in blender.texts)
    assert blender.stamps["gpis.samples"] == "128"


def test_esc_stops_and_keeps_what_is_there(run):
    blender, renderer = StandIn(esc_at=0.1), Counting(pace=0.002)
    result, session = run(blender, renderer, samples=5000)
    assert session.stop == "cancelled" and blender.ended == "kept"
    assert 48 <= result.stats["samples"] < 5000


def test_esc_before_there_is_a_picture(run):
    blender = StandIn(esc_at=0.0)
    result, session = run(blender, Counting(pace=0.01), samples=100)
    assert result is None and session.stop == "cancelled" and blender.ended is None


def test_failure_on_the_way_takes_the_picture_back(run):
    blender = StandIn()
    with pytest.raises(ValueError, match="out of luck"):
        run(blender, Counting(pace=0.002, fail_at=60), samples=100)
    assert blender.ended == "cancelled"
