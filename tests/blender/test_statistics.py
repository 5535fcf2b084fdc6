"""The statistics beside an image and in the panel: whose file is whose, and the plot of error against seconds."""

import importlib
import json

import bpy
import numpy as np
import pytest

from . import support


@pytest.fixture
def written(stage, tmp_path):
    """written(): renders to GPIS-0.exr and gives the .json files there, by name."""
    stage.gpis.write_statistics = True

    def render():
        support.picture(stage, tmp_path)
        return {path.name: path.read_text() for path in tmp_path.glob("*.json")}

    return render


def test_a_file_of_somebody_else_is_never_written_over(written, tmp_path):
    (tmp_path / "GPIS-0.json").write_text('{"mine": 1}')
    files = written()
    assert files["GPIS-0.json"] == '{"mine": 1}'
    assert json.loads(files["GPIS-0.gpis.json"])["stop"] == "samples"
    # Nor where both names are taken: then nothing is written.
    (tmp_path / "GPIS-0.gpis.json").write_text("")
    assert written() == {"GPIS-0.json": '{"mine": 1}', "GPIS-0.gpis.json": ""}


def test_a_file_of_ours_is_written_anew(written):
    first = written()
    second = written()
    assert list(first) == list(second) == ["GPIS-0.json"] and first != second


@pytest.fixture
def plot(extension):
    return importlib.import_module(f"{extension}.error_plot")


def history(*rows):
    return [{"seconds": s, "samples": 16, "estimated_error": e} for s, e in rows]


def test_the_plot_takes_two_rounds_of_known_error(plot):
    for rows in ((), ((1, 0.1),), ((1, None), (2, 0.1)), ((1, 0.0), (2, 0.1))):
        assert plot.picture(history(*rows)) is None


def test_the_plot_shows_every_round_where_it_belongs(plot):
    """relMSE that halves as the seconds double lies on the grey line; three rounds are three dots on it."""
    rows = plot.points(history((1, 0.04), (2, 0.02), (4, None), (8, 0.005)))
    assert plot.slope(rows) == pytest.approx(-0.5)
    assert plot.slope(rows[:1]) is None
    picture = plot.picture(history((1, 0.04), (2, 0.02), (8, 0.005)))
    assert picture.shape == (plot.SIZE, plot.SIZE, 4) and picture.min() >= 0 and (picture[..., 3] == 1).all()
    blue = picture[..., 2] > 0.9
    bottom = [np.flatnonzero(blue[:, x])[0] for x in np.flatnonzero(blue.any(axis=0))]
    assert bottom[0] > bottom[-1] + 0.6 * plot.SIZE  # from the top left to the bottom right
    assert blue.any(axis=0).sum() > 0.6 * plot.SIZE and np.argmax(blue.any(axis=0)) > 40


def test_equal_distances_of_the_plot_are_equal_factors(plot):
    """Dots at 1, 2 and 8 seconds, where the curve is higher than its line: the second a third of the way."""
    picture = plot.picture(history((1, 0.04), (2, 0.02), (8, 0.005)))
    dots = np.flatnonzero((picture[..., 2] > 0.9).sum(axis=0) >= 5)
    first, second, third = (group.mean() for group in np.split(dots, np.flatnonzero(np.diff(dots) > 1) + 1))
    assert (second - first) / (third - first) == pytest.approx(1 / 3, abs=0.02)


def test_the_grey_line_halves_the_error_in_four_times_the_seconds(plot):
    """From the last dot of an error of 20 % that does not fall: at the first, a quarter of the seconds, it is at twice that."""
    picture = plot.picture(history((1, 0.04), (4, 0.04)))
    red, blue = picture[..., 0], picture[..., 2]
    curve = np.flatnonzero((blue > 0.9).any(axis=1)).mean()
    [ten_percent] = np.flatnonzero((np.abs(red - 0.2) < 1e-3).mean(axis=1) > 0.6)  # a line of the grid
    dots = np.flatnonzero((blue > 0.9).sum(axis=0) >= 5)
    grey = (np.ptp(picture[..., :3], axis=-1) < 0.01) & (red > 0.25) & (red < 0.5)
    above = np.flatnonzero(grey[:, dots[0] : dots[0] + 6].any(axis=1))
    assert above.mean() - curve == pytest.approx(curve - ten_percent, abs=4)


@pytest.mark.parametrize("seconds", [(1e-3, 2e-3), (1, 1.001), (0.5, 90_000), (3, 7200)])
def test_the_plot_takes_any_history(plot, seconds):
    for errors in ((1e-8, 1e-9), (4.0, 2.0), (0.01, 0.01), (1e3, 1e3), (1e4, 1e-14)):
        assert plot.picture(history(*zip(seconds, errors, strict=True))) is not None


def test_the_plot_is_drawn_anew_for_a_new_render(stage, written, extension):
    panels = importlib.import_module(f"{extension}.ui.render_panels")
    statistics = importlib.import_module(f"{extension}.statistics")
    icons = []
    for seconds in (2.0, 4.0, 4.0):
        written()
        statistics.last(stage.name)["history"][:] = history((1.0, 0.04), (seconds, 0.02))
        icon = panels._plot_icon(stage.name, statistics.last(stage.name)["history"])
        shown = np.empty(4 * 256 * 256, np.float32)
        panels._previews[stage.name].image_pixels_float.foreach_get(shown)
        icons.append((icon, shown))
    assert icons[0][0] == icons[1][0] and not np.array_equal(icons[0][1], icons[1][1])
    assert np.array_equal(icons[1][1], icons[2][1])
    assert bpy.types.GPIS_PT_error_plot.poll(bpy.context) == (bpy.context.engine == "GPIS")


def test_what_the_light_lacks_is_a_sentence(stage, written):
    """A camera in a closed white box in the dark: every path bounces until the longest way that is followed has ended."""
    support.settings(stage, width=2, height=2, samples=1)
    support.cube(stage, "Box", 20.0, support.diffuse("White", (1, 1, 1)))
    entry = json.loads(written()["GPIS-0.json"])
    paths = entry["stats"]["camera_paths"]
    assert entry["stats"]["path_length_limit"] == paths
    assert entry["warnings"][-1].startswith(f"{paths} of {paths} paths were ended after 100,000 bounces: their light is missing.")


def test_a_render_that_lacks_nothing_says_nothing(written):
    assert json.loads(written()["GPIS-0.json"])["warnings"] == []
