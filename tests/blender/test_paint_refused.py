"""Painting what cannot be painted: a sentence, and nothing is lost."""

import bpy
import numpy as np
import pytest

from .painting import arc, grids_of, paint, points

NAN = float("nan")


@pytest.mark.parametrize(
    ("arguments", "sentence"),
    [
        ({"stroke": []}, "The stroke has no points"),
        ({"channel": "DEVIATION", "operation": "SET"}, "Deviation is to be set: say which value above 0"),
        ({"channel": "MEAN", "operation": "COMB"}, 'The channel "mean" has no operation "comb": it takes inflate'),
        ({"channel": "ANISOTROPY", "stroke": points([(1, 0, 0)])}, "it takes two points that differ"),
        ({"channel": "MEAN", "stroke": points([(50, 0, 0)])}, "away from the grid, which is"),
        ({"channel": "LENGTH_SCALE", "operation": "ADD", "value": 1e9}, r"value \(factor\) is 1e\+09"),
        ({"operation": "ADD", "stroke": points([(NAN, 0, 1), (0, 0, 1)])}, "A point of the stroke is .* not numbers"),
        ({"operation": "ADD", "stroke": [{"name": "", "location": (0, 0, 1), "pressure": NAN}]}, "with pressure nan: not numbers"),
        ({"operation": "SET", "value": NAN}, "value is nan; it takes a number"),
        ({"operation": "ADD", "radius": NAN}, "The radius of the brush is nan"),
        ({"operation": "ADD", "strength": NAN}, "The strength of the brush is nan"),
        ({"operation": "ADD", "spacing": NAN}, "The spacing of the brush is nan"),
        ({"channel": "ANISOTROPY", "ratios": (NAN, 1, 1)}, r"ratios is \(nan, 1, 1\)"),
        ({"operation": "ADD", "falloff": "CUSTOM", "curve": [NAN] * 32}, "curve holds nan"),
        ({"channel": "CONDITION", "stroke": points([(NAN, 0, 1)])}, "of a condition point is not a number"),
        # Before a dab is made: these would take hours, and all memory.
        ({"operation": "ADD", "spacing": 1e-7}, "dabs, at most 100000 are painted"),
        ({"operation": "ADD", "radius": 1e-6}, "dabs, at most 100000 are painted"),
        ({"operation": "ADD", "stroke": points([(0, 0, 1), (1e30, 0, 1)])}, "The next point of the stroke is 1e.30 away"),
    ],
)
def test_bad_strokes(painted_sphere, arguments, sentence):
    before = painted_sphere.data.filepath
    with pytest.raises(RuntimeError, match=sentence):
        bpy.ops.gpis.paint_stroke(**({"stroke": points(arc(0))} | arguments))
    assert painted_sphere.data.filepath == before and not painted_sphere.data.gpis_strokes
    paint("DEVIATION", "SET", arc(0), value=0.2)  # and the next one works


def test_what_cannot_be_painted_says_why(painted_sphere):
    painted_sphere.gpis.enabled = False
    with pytest.raises(RuntimeError, match="is switched off"):
        paint("MEAN", "SMOOTH", arc(0))
    painted_sphere.gpis.enabled = True
    painted_sphere.gpis.sigma = 0
    with pytest.raises(RuntimeError, match="standard deviation σ is 0, painting takes one above 0"):
        paint("MEAN", "SMOOTH", arc(0))
    painted_sphere.gpis.sigma = 0.1
    painted_sphere.gpis.sigma_source, painted_sphere.gpis.sigma_grid = "GRID", "mean"
    painted_sphere.gpis.sigma_meaning = "STANDARD_DEVIATION"
    with pytest.raises(RuntimeError, match='its grid "mean" of σ holds -.*: a deviation is 0 or more'):
        paint("MEAN", "SMOOTH", arc(0))
    painted_sphere.gpis.sigma_source = "CONSTANT"
    painted_sphere.data.gpis_strokes = "no strokes"
    with pytest.raises(RuntimeError, match="The strokes of this object are damaged"):
        bpy.ops.gpis.paint_rebuild()
    bpy.context.view_layer.objects.active = painted_sphere.gpis.source
    with pytest.raises(RuntimeError, match="is no GPIS: select one"):
        paint("MEAN", "SMOOTH", arc(0))


@pytest.mark.parametrize("matrix", ["sheared", "flat", "mirrored"])
def test_strokes_are_in_object_space_whatever_the_object_does(painted_sphere, gn, matrix):
    paint("DEVIATION", "SET", arc(0), value=0.2)
    expected = grids_of(gn, painted_sphere)["sigma"]
    bpy.ops.gpis.paint_reset(channel="DEVIATION")
    painted_sphere.parent = None
    painted_sphere.matrix_world = {
        "sheared": ((1, 0.7, 0, 0), (0, 1, 0.3, 0), (0, 0, 2, 0), (0, 0, 0, 1)),
        "flat": ((1, 0, 0, 0), (0, 0, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
        "mirrored": ((-1, 0, 0, 1e6), (0, 1, 0, 0), (0, 0, 1, 0), (0, 0, 0, 1)),
    }[matrix]
    paint("DEVIATION", "SET", arc(0), value=0.2)
    np.testing.assert_array_equal(grids_of(gn, painted_sphere)["sigma"], expected)


def test_a_radius_beyond_all_paints_all(painted_sphere, gn):
    paint("DEVIATION", "SET", arc(0), value=0.2, radius=1e30, falloff="CONSTANT", strength=1.0)
    np.testing.assert_allclose(grids_of(gn, painted_sphere)["sigma"], 0.2, rtol=1e-6)


def test_strokes_along_the_ends_do_not_extend_the_grid_for_ever(painted_sphere, bake):
    """However large the brush: a dab at c asks for a quarter of the side 2 h beyond it, of which the limit is h = 2 c, and
    the grid grows by whole leaves of 8 voxels."""
    before = np.ptp(bake.fields(painted_sphere).bounds(), axis=0)
    leaf, furthest = 8 * max(bake.fields(painted_sphere).voxel_size()), 1.4
    for seed in range(4):
        paint("DEVIATION", "SET", furthest * arc(seed, 6), value=0.2, radius=50.0, symmetry=(True, True, True))
    low, high = np.array(bake.fields(painted_sphere).bounds())
    assert np.all(high - low > before) and max(-low.min(), high.max()) < 2 * (furthest + leaf) + leaf
    # A small brush asks for no more than itself.
    paint("DEVIATION", "SET", [(high[0], 0, 0)], value=0.2, radius=0.1)
    wider_low, wider_high = np.array(bake.fields(painted_sphere).bounds())
    assert wider_high[0] > high[0] and np.all(wider_high - high < 0.1 + leaf)
    assert np.all(wider_low == low) and np.all(wider_high[1:] == high[1:])


@pytest.mark.parametrize(
    ("path", "sentence"), [("", 'Volume "Sphere GPIS" has no file: choose'), ("/nowhere/x.vdb", "is not there|is not a file|no file")]
)
def test_without_its_file(painted_sphere, path, sentence):
    """Each operator says so, and what was painted is not lost: with the file it goes on."""
    paint("DEVIATION", "SET", arc(0), value=0.2)
    strokes, before = painted_sphere.data.gpis_strokes, painted_sphere.data.filepath
    painted_sphere.data.filepath = path
    for call in (
        lambda: paint("DEVIATION", "ADD", arc(1), value=2.0),
        lambda: paint("CONDITION", "PIN", [(0, 0, 1)]),
        lambda: bpy.ops.gpis.paint_reset(channel="DEVIATION"),
        lambda: bpy.ops.gpis.paint_mirror(channel="DEVIATION"),
        lambda: bpy.ops.gpis.paint_resample(resolution=40),
        bpy.ops.gpis.paint_rebuild,
    ):
        with pytest.raises(RuntimeError, match=sentence):
            call()
    assert painted_sphere.data.gpis_strokes == strokes and painted_sphere.data.filepath == path
    painted_sphere.data.filepath = before
    paint("DEVIATION", "ADD", arc(1), value=2.0)
    assert painted_sphere.data.gpis_strokes.startswith(strokes)


def test_undo_across_a_save(painted_sphere, bake, tmp_path):
    name, places = painted_sphere.name, [(0, 1, 0), (0, 0, 1)]

    def values():
        return bake.fields(bpy.data.objects[name]).values("deviation", places)

    bpy.ops.ed.undo_push(message="made")
    paint("DEVIATION", "SET", [places[0]], value=0.2)
    one = values()
    paint("DEVIATION", "SET", [places[1]], value=0.3)
    two = values()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.ed.undo()
    np.testing.assert_array_equal(values(), one)
    bpy.ops.wm.save_mainfile()
    bpy.ops.ed.redo()
    np.testing.assert_array_equal(values(), two)
    bpy.ops.ed.undo()
    bpy.ops.ed.undo()
    assert np.ptp(values()) < 1e-7
    # What was saved last is what a new session finds.
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    np.testing.assert_array_equal(values(), one)


def test_a_dead_folder_loses_nothing(painted_sphere, bake, tmp_path):
    """The folder of the .blend cannot be written to: the stroke is refused, the one before stays."""
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    paint("DEVIATION", "SET", arc(0), value=0.2)
    strokes, before = painted_sphere.data.gpis_strokes, bake.fields(painted_sphere).values("deviation", [(0, 0, 1)])
    bake.fields(painted_sphere)
    (tmp_path / "a_gpis").rename(tmp_path / "moved")
    (tmp_path / "a_gpis").write_text("a file in its place")
    with pytest.raises(RuntimeError, match="a_gpis"):
        paint("DEVIATION", "ADD", arc(1), value=2.0)
    (tmp_path / "a_gpis").unlink()
    (tmp_path / "moved").rename(tmp_path / "a_gpis")
    assert painted_sphere.data.gpis_strokes == strokes
    np.testing.assert_array_equal(bake.fields(painted_sphere).values("deviation", [(0, 0, 1)]), before)
