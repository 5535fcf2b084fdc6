"""Painting by operators: the grids are what plain numpy makes of the same strokes, undo and redo go back and forth, and
the render shows them."""

import importlib

import bpy
import numpy as np
import pytest
from brush_reference import Reference, full

from . import support
from .painting import RADIUS, STRENGTH, arc, file_of, grids_of, paint, points

# (channel, operation) -> other properties of the operator.
STROKES = {
    ("MEAN", "INFLATE"): {"value": 0.2},
    ("MEAN", "GRAB"): {},
    ("MEAN", "FLATTEN"): {"falloff": "SPHERE"},
    ("MEAN", "SMOOTH"): {},
    ("MEAN", "DEFLATE"): {"value": 0.1, "falloff": "SHARP"},
    ("DEVIATION", "SET"): {"value": 0.15},
    ("DEVIATION", "ADD"): {"value": 1.7, "falloff": "CUSTOM", "curve": tuple(np.linspace(1, 0, 32) ** 2)},
    ("DEVIATION", "SMOOTH"): {},
    ("LENGTH_SCALE", "SET"): {"value": 0.4, "falloff": "ROOT"},
    ("LENGTH_SCALE", "ADD"): {"value": 0.6},
    ("LENGTH_SCALE", "SMOOTH"): {},
    ("ANISOTROPY", "COMB"): {"ratios": (4, 1, 0.5)},
    ("ANISOTROPY", "SMOOTH"): {},
    ("ALBEDO", "SET"): {"color": (0.9, 0.2, 0.1), "falloff": "LINEAR"},
    ("ALBEDO", "SMOOTH"): {},
}


def reference_of(gn, obj):
    base = gn.read_vdb(file_of(obj), names=["mean"])
    return Reference(base["mean"], base["origin"], base["voxel_size"], obj.gpis.sigma, obj.gpis.length_scale)


def apply_reference(reference, channel, operation, locations, symmetry=(False, False, False), **brush):
    """The same stroke in numpy: a dab at each place, directions from one to the next."""
    locations = np.asarray(locations, np.float64)
    steps = np.diff(locations, axis=0)
    first = np.zeros(3) if operation == "GRAB" else steps[0]
    value = brush.get("color") if channel == "ALBEDO" else brush.get("value")
    falloff = brush.get("falloff", "SMOOTH")
    reference.apply(
        channel.lower(),
        operation.lower(),
        locations,
        np.float32(RADIUS),
        np.float32(STRENGTH),
        directions=np.vstack([first, steps]).astype(np.float32),
        value=None if value is None else np.float32(value).astype(float),
        ratios=np.float32(brush.get("ratios", (1, 1, 1))).astype(float),
        falloff="constant" if falloff == "CUSTOM" else falloff.lower(),
        curve=np.float32(brush["curve"]) if falloff == "CUSTOM" else None,
        symmetry=symmetry,
    )


def check_grids(got, reference):
    """To the rounding of single precision; the grid may have been extended by whole leaves."""
    start = np.rint((reference.origin - np.array(got["origin"])) / reference.voxel_size).astype(int)
    part = tuple(slice(first, first + size) for first, size in zip(start, reference.mean.shape, strict=True))
    for name, expected in (
        ("mean", reference.mean),
        ("sigma", reference.deviation),
        ("anisotropy", reference.tensor),
        ("albedo", reference.albedo),
    ):
        scale = np.abs(expected).max()
        np.testing.assert_allclose(got[name][part], expected, rtol=5e-5, atol=5e-6 * scale, err_msg=name)


def test_all_channels_by_script(stage, painted_sphere, gn, fresh_blender, extension_zip, tmp_path):
    """Paint, undo, redo, save, reopen in a new process, paint again from the strokes, render."""
    reference = reference_of(gn, painted_sphere)
    symmetry = (True, False, False)
    seen = []
    bpy.ops.ed.undo_push(message="before")
    for seed, ((channel, operation), brush) in enumerate(STROKES.items()):
        paint(channel, operation, arc(seed), symmetry=symmetry, **brush)
        apply_reference(reference, channel, operation, arc(seed), symmetry=symmetry, **brush)
        seen.append((bpy.context.object.data.filepath, bpy.context.object.data.gpis_strokes))
    obj = bpy.context.object
    assert len(set(seen)) == len(STROKES)
    settings = obj.gpis
    assert (settings.sigma_source, settings.sigma_grid, settings.anisotropy, settings.use_albedo) == (
        "GRID",
        "sigma",
        "GRID",
        True,
    )
    check_grids(grids_of(gn, obj), reference)

    for state in reversed(seen[:-1]):
        bpy.ops.ed.undo()
        data = bpy.context.object.data
        assert (data.filepath, data.gpis_strokes) == state and file_of(bpy.context.object).is_file()
    assert not bpy.context.object.gpis.use_albedo
    for state in seen[1:]:
        bpy.ops.ed.redo()
        assert (bpy.context.object.data.filepath, bpy.context.object.data.gpis_strokes) == state
    check_grids(grids_of(gn, bpy.context.object), reference)
    paint("CONDITION", "PIN", [(0, -1, 0)])
    assert len(bpy.context.object.gpis.conditions) == 1
    bpy.ops.ed.undo()
    assert len(bpy.context.object.gpis.conditions) == 0
    bpy.ops.ed.redo()

    blend = tmp_path / "painted.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    np.savez(tmp_path / "here.npz", **grids_of(gn, bpy.context.object))
    script = f"""
import bpy, sys, numpy as np, pathlib
assert bpy.ops.extensions.package_install_files(
    filepath={str(extension_zip)!r}, repo="user_default", enable_on_install=True) == {{"FINISHED"}}
import gpis_native as gn
bpy.ops.wm.open_mainfile(filepath={str(blend)!r})
obj = bpy.context.object
def grids():
    path = pathlib.Path(bpy.path.abspath(obj.data.filepath))
    assert path.parent == pathlib.Path({str(tmp_path / "painted_gpis")!r}), path
    return gn.read_vdb(path, names=[g["name"] for g in gn.vdb_grids(path) if "gpis_base" not in g["name"]])
here = np.load({str(tmp_path / "here.npz")!r})
before = grids()
assert [tuple(point.location) for point in obj.gpis.conditions] == [(0, -1, 0)]
obj.gpis.conditions.clear()  # test_condition_points_are_rendered
strokes = obj.data.gpis_strokes
assert bpy.ops.gpis.paint_rebuild() == {{"FINISHED"}}
after = grids()
assert obj.data.gpis_strokes == strokes
for name in here.files:
    assert np.array_equal(before[name], here[name]), name
    assert np.array_equal(after[name], here[name]), "painted again: " + name
bpy.context.scene.render.filepath = {str(tmp_path / "render.exr")!r}
bpy.ops.render.render(write_still=True)
print("painted again and rendered", flush=True)
"""
    support.image_settings(stage)
    bpy.ops.wm.save_mainfile()
    done = fresh_blender(script)
    assert done.returncode == 0 and "painted again and rendered" in done.stdout, done.stdout
    channels, _ = support.read_exr(tmp_path / "render.exr")
    picture = np.stack([channels[name] for name in "RGB"], axis=-1)
    assert np.isfinite(picture).all() and picture.std() > 0.01


def test_a_painted_albedo_is_seen(stage, painted_sphere, tmp_path):
    """In white light, on a white surface: red is what was painted."""
    painted_sphere.gpis.sigma = 0.005
    painted_sphere.data.materials.append(support.diffuse("White", (1, 1, 1)))
    before = support.picture(stage, tmp_path)
    paint("ALBEDO", "SET", [(0, -1, 0)], radius=3.0, strength=1.0, color=(1, 0.25, 0), falloff="CONSTANT")
    after = support.picture(stage, tmp_path)
    middle = np.s_[14:22, 20:28]
    np.testing.assert_allclose(before[middle].mean(axis=(0, 1)), (1, 1, 1), rtol=0.02)
    np.testing.assert_allclose(after[middle].mean(axis=(0, 1)), (1, 0.25, 0), atol=0.03)


def test_a_painted_deviation_is_rendered(stage, painted_sphere, tmp_path):
    """Half of the sphere is made fuzzy; the other half stays crisp."""
    painted_sphere.gpis.sigma = 0.01
    painted_sphere.data.materials.append(support.diffuse("Black", (0, 0, 0)))
    paint("DEVIATION", "SET", [(1.2, 0, 0)], radius=1.2, strength=1.0, value=0.2, falloff="CONSTANT")
    cover = support.coverage(stage, tmp_path)
    soft = (cover > 0.1) & (cover < 0.9)
    assert soft[:, 24:].sum() > 2 * soft[:, :24].sum()


def test_symmetric_strokes(painted_sphere, gn):
    paint("DEVIATION", "SET", arc(1), symmetry=(True, False, True), value=0.2)
    x = np.random.default_rng(0).uniform(-1, 1, (200, 3))
    field = gn.VdbField(str(file_of(painted_sphere)), "sigma")
    assert np.ptp(field(x)) > 0.05
    for sign in ((-1, 1, 1), (1, 1, -1), (-1, 1, -1)):
        np.testing.assert_allclose(field(x * sign), field(x), atol=2e-3)


def test_spacing_is_along_the_path(painted_sphere, bake):
    """However densely the hand was sampled, dabs stand at the same distance."""
    stroke = importlib.import_module(bake.__name__.rpartition(".")[0] + ".stroke")
    for count in (2, 7, 40):
        spacing = stroke.Spacing(0.1, spacing=0.25)
        made = stroke.Dabs()
        for x in np.linspace(0, 1, count):
            made = made + spacing.add((x, 0, 0))
        made = made + spacing.finish()
        np.testing.assert_allclose(made.centers[:, 0], 0.05 * np.arange(len(made)), atol=1e-6)
        assert len(made) in (20, 21) and np.all(made.directions[:, 0] > 0)


def test_pressure(painted_sphere, bake):
    stroke = importlib.import_module(bake.__name__.rpartition(".")[0] + ".stroke")
    spacing = stroke.Spacing(0.4, 0.8, 0.0, pressure_radius=True, pressure_strength=True)
    made = spacing.add((0, 0, 0), 0.5) + spacing.add((1, 0, 0), 0.25) + spacing.finish()
    np.testing.assert_allclose(made.radii, (0.2, 0.1))
    np.testing.assert_allclose(made.strengths, (0.4, 0.2))


@pytest.mark.parametrize("pressed", ["radius", "strength"])
def test_pressure_of_a_stroke(painted_sphere, gn, pressed):
    """The pen's pressure at each dab scales the one or the other, by the operator as by numpy."""
    reference = reference_of(gn, painted_sphere)
    pressures = np.float32((0.3, 1.0, 0.6))
    stroke = [entry | {"pressure": float(p)} for entry, p in zip(points(arc(3, 3)), pressures, strict=True)]
    brush = {"radius": RADIUS, "strength": STRENGTH, "spacing": 0.0, "value": 0.2, f"use_pressure_{pressed}": True}
    assert bpy.ops.gpis.paint_stroke(stroke=stroke, channel="DEVIATION", operation="SET", **brush) == {"FINISHED"}
    radius, strength = np.float32(RADIUS) * np.ones(3), np.float32(STRENGTH) * np.ones(3)
    scaled = radius if pressed == "radius" else strength
    scaled *= pressures
    reference.apply("deviation", "set", arc(3, 3).astype(float), radius, strength, value=float(np.float32(0.2)))
    check_grids(grids_of(gn, painted_sphere) | {"anisotropy": reference.tensor, "albedo": reference.albedo}, reference)


def test_in_portions_or_at_once(painted_sphere, gn, bake):
    """A tool that adds dabs as the hand moves makes what the operator makes, also where the grid is extended."""
    stroke = importlib.import_module(bake.__name__.rpartition(".")[0] + ".stroke")
    places = np.linspace((0, 0, 1), (0, 0, 2.2), 6)
    brush = {"radius": RADIUS, "strength": STRENGTH, "spacing": 10.0, "value": 0.3}
    copy = painted_sphere.copy()
    copy.data = painted_sphere.data.copy()
    bpy.context.collection.objects.link(copy)
    paint("MEAN", "INFLATE", places, **brush)
    spacing = stroke.Spacing(RADIUS, STRENGTH, 0.1)
    painting = bake.Painting(copy, stroke.Brush("mean", "inflate", value=float(np.float32(0.3))))
    for place in places:
        painting.add(spacing.add(place.astype(np.float32)))
        assert len(painting.fields.values("mean", [place])) == 1
    painting.add(spacing.finish())
    counts = painting.finish()
    assert counts["nodes"] > 0
    a, b = grids_of(gn, painted_sphere), grids_of(gn, copy)
    assert a["mean"].shape == b["mean"].shape and a["mean"].shape[2] > 32
    assert np.array_equal(a["mean"], b["mean"])


def test_a_cancelled_stroke_changes_nothing(painted_sphere, gn, bake):
    stroke = importlib.import_module(bake.__name__.rpartition(".")[0] + ".stroke")
    before = painted_sphere.data.filepath, painted_sphere.data.gpis_strokes, grids_of(gn, painted_sphere)["mean"]
    painting = bake.Painting(painted_sphere, stroke.Brush("mean", "inflate", value=0.3))
    painting.add(stroke.Dabs([(1, 0, 0)], [0.3], [1.0], [(0, 0, 0)]))
    painting.cancel()
    assert (painted_sphere.data.filepath, painted_sphere.data.gpis_strokes) == before[:2]
    x = [(1.0, 0.0, 0.0)]
    expected = gn.VdbField(str(file_of(painted_sphere)), "mean")(x)
    np.testing.assert_allclose(bake.fields(painted_sphere).values("mean", x), expected, rtol=1e-6)


def test_reset_mirror_resample(painted_sphere, gn, bake):
    base = bake.fields(painted_sphere).values("mean", arc(3).astype(float))
    paint("MEAN", "INFLATE", arc(3), value=0.3)
    paint("DEVIATION", "SET", arc(3), value=0.2)
    assert bpy.ops.gpis.paint_mirror(channel="DEVIATION", axis="Y", from_positive=bool(arc(3)[0, 1] > 0)) == {"FINISHED"}
    x = arc(3).astype(float)
    field = gn.VdbField(str(file_of(painted_sphere)), "sigma")
    np.testing.assert_allclose(field(x * (1, -1, 1)), field(x), rtol=0.1)
    before = bake.fields(painted_sphere).values("mean", x), bake.fields(painted_sphere).values("deviation", x)
    assert bpy.ops.gpis.paint_resample(resolution=48) == {"FINISHED"}
    after = bake.fields(painted_sphere).values("mean", x), bake.fields(painted_sphere).values("deviation", x)
    np.testing.assert_allclose(after[0], before[0], atol=0.02)
    np.testing.assert_allclose(after[1], before[1], rtol=0.1)
    assert bpy.ops.gpis.paint_reset(channel="DEVIATION") == {"FINISHED"}
    assert np.ptp(bake.fields(painted_sphere).values("deviation", x)) < 1e-7
    assert bpy.ops.gpis.paint_resample(resolution=32) == {"FINISHED"}
    assert bpy.ops.gpis.paint_reset(channel="MEAN") == {"FINISHED"}
    np.testing.assert_allclose(bake.fields(painted_sphere).values("mean", x), base, atol=0.02)


def test_copy_to_selected(painted_sphere, bake):
    paint("ANISOTROPY", "COMB", arc(4), ratios=(5, 1, 1))
    bpy.ops.object.duplicate()
    other = bpy.context.object
    bpy.ops.gpis.paint_reset(channel="ANISOTROPY")
    assert other.data != painted_sphere.data, "painting on a copy leaves the original alone"
    x = arc(4).astype(float)
    a = full(bake.fields(other).values("anisotropy", x))
    np.testing.assert_allclose(a[:, 0, 1], 0, atol=1e-7)
    painted_sphere.select_set(True)
    bpy.context.view_layer.objects.active = painted_sphere
    paint("DEVIATION", "SET", arc(5), value=0.3)
    for channel in ("ANISOTROPY", "DEVIATION"):
        assert bpy.ops.gpis.paint_copy(channel=channel) == {"FINISHED"}
    for channel in ("anisotropy", "deviation"):
        np.testing.assert_allclose(
            bake.fields(other).values(channel, x), bake.fields(painted_sphere).values(channel, x), rtol=1e-4, atol=1e-6
        )
    # Painted again from its strokes, the copied channel is where it starts.
    before = bake.fields(other).values("deviation", x)
    bpy.context.view_layer.objects.active = other
    assert bpy.ops.gpis.paint_rebuild() == {"FINISHED"}
    np.testing.assert_allclose(bake.fields(other).values("deviation", x), before, rtol=1e-6)


def test_baking_the_mesh_again_keeps_the_strokes(painted_sphere, bake):
    paint("ALBEDO", "SET", arc(1), color=(0, 0, 1))
    x = arc(1).astype(float)
    before = bake.fields(painted_sphere).values("albedo", x)
    assert before[0, 0] < 0.5
    assert bpy.ops.gpis.rebake(resolution=40) == {"FINISHED"}
    np.testing.assert_allclose(bake.fields(painted_sphere).values("albedo", x), before, atol=0.1)
    assert painted_sphere.gpis.use_albedo


def test_condition_points(painted_sphere):
    paint("CONDITION", "PIN", [(1, 0, 0), (0, 0, 1)], symmetry=(True, False, False))
    conditions = painted_sphere.gpis.conditions
    assert sorted(tuple(point.location) for point in conditions) == [(-1, 0, 0), (0, 0, 1), (1, 0, 0)]
    for point in conditions:
        np.testing.assert_allclose(point.normal, point.location, atol=0.05)
        assert point.slope == pytest.approx(1, abs=0.1)
    bpy.ops.ed.undo_push(message="pinned")
    paint("CONDITION", "ERASE", [(1, 0.1, 0)], radius=0.2)
    assert len(bpy.context.object.gpis.conditions) == 2
    bpy.ops.ed.undo()
    assert len(bpy.context.object.gpis.conditions) == 3
    assert bpy.ops.gpis.erase_conditions() == {"FINISHED"} and not bpy.context.object.gpis.conditions


def test_a_pinned_point_is_exact_unless_others_are_near(painted_sphere, describe):
    painted_sphere.gpis.sigma, painted_sphere.gpis.length_scale = 0.1, 0.3
    paint("CONDITION", "PIN", [(1, 0, 0), (0, 0, 1)])
    paint("CONDITION", "PIN", [(np.cos(0.2), 0, np.sin(0.2))])
    assert [point.noise for point in painted_sphere.gpis.conditions] == pytest.approx([0, 0, 0.002])
    (entry,), _ = describe()
    mean, variance = entry["process"].posterior([(1, 0, 0), (0, 0, 1), (0, 1, 0)])
    np.testing.assert_allclose(mean[:2], 0, atol=1e-6)
    np.testing.assert_allclose(variance, [0, 0, 0.01], atol=1e-6)
    # Of bumps that are longer in one direction, the longest length counts.
    bpy.ops.gpis.erase_conditions()
    painted_sphere.gpis.anisotropy, painted_sphere.gpis.ratios = "AXES", (1, 3, 1)
    paint("CONDITION", "PIN", [(1, 0, 0), (np.cos(0.7), 0, np.sin(0.7)), (-1, 0, 0)])
    assert [point.noise for point in painted_sphere.gpis.conditions] == pytest.approx([0, 0.002, 0])


def test_condition_points_are_rendered(stage, painted_sphere, tmp_path):
    """A fuzzy disk's edge, pinned all along: it becomes crisper there, and only there."""
    painted_sphere.data.materials.append(support.diffuse("Black", (0, 0, 0)))
    painted_sphere.gpis.sigma, painted_sphere.gpis.length_scale = 0.15, 0.3
    soft = []
    for pinned in (False, True):
        if pinned:
            angle = np.linspace(-0.6, 0.6, 9)
            paint("CONDITION", "PIN", np.column_stack([np.cos(angle), 0 * angle, np.sin(angle)]))
        cover = support.coverage(stage, tmp_path)
        edge = (cover > 0.1) & (cover < 0.9)
        soft.append((edge[12:24, 24:].sum(), edge[12:24, :24].sum()))
    assert soft[1][0] < 0.8 * soft[0][0]
    assert soft[1][1] > 0.8 * soft[0][1]
