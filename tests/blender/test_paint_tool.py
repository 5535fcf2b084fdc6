"""The paint tool without a window: what its settings paint, what is under the brush, what the overlay shows."""

from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

CHANNELS = ("MEAN", "DEVIATION", "LENGTH_SCALE", "ANISOTROPY", "ALBEDO")


@pytest.fixture
def sphere(stage):
    bpy.ops.gpis.add(kind="SPHERE", radius=1.0, resolution=32)
    return bpy.context.object


@pytest.fixture
def brush(sphere):
    return bpy.context.scene.gpis.paint


@pytest.mark.parametrize("channel", CHANNELS)
def test_every_brush_of_the_header_paints(module, sphere, brush, channel):
    """With each operation, turned round by Ctrl, and smoothing by Shift."""
    bake, stroke = module("paint.bake"), module("paint.stroke")
    brush.channel = channel
    items = brush.bl_rna.properties[brush.operation_name].enum_items
    for operation in [item.identifier for item in items]:
        setattr(brush, brush.operation_name, operation)
        if brush.value_name:
            assert hasattr(brush, brush.value_name)
        for mode in ("NORMAL", "INVERT", "SMOOTH"):
            painting = bake.Painting(sphere, stroke.Brush(**brush.brush(sphere, mode)))
            spacing = stroke.Spacing(0.3, 0.5, 0.1, drag=operation == "GRAB" and mode != "SMOOTH")
            for place in ((0, 0, 1), (0.2, 0, 0.98)):
                painting.add(spacing.add(place))
            painting.add(spacing.finish())
            assert len(painting.stroke.dabs) > 1
            painting.cancel()


def test_ctrl_is_the_opposite(sphere, brush):
    brush.channel = "MEAN"
    assert brush.brush(sphere)["operation"] == "inflate" and brush.brush(sphere, "INVERT")["operation"] == "deflate"
    brush.channel, brush.deviation_operation, brush.factor = "DEVIATION", "ADD", 1.25
    assert brush.brush(sphere, "INVERT")["value"] == pytest.approx(0.8)
    brush.deviation_operation, brush.sigma = "SET", 0.3
    assert brush.brush(sphere)["value"] == pytest.approx(0.3)
    assert brush.brush(sphere, "INVERT")["value"] == pytest.approx(sphere.gpis.sigma)
    brush.channel = "ANISOTROPY"
    assert brush.brush(sphere, "INVERT")["ratios"] == (1.0, 1.0, 1.0)
    assert brush.brush(sphere, "SMOOTH")["operation"] == "smooth"


def test_lengths_of_the_brush_follow_the_object_until_one_is_typed(sphere, brush, tmp_path):
    """A brush that was never told how much is of use on an object of any size; what was typed is never changed."""

    def set_to(channel, obj):
        brush.channel = channel
        return brush.brush(obj)["value"]

    name = sphere.name
    assert (brush.sigma, brush.length_scale) == pytest.approx((0.1, 0.1))
    bpy.ops.gpis.add(kind="SPHERE", radius=0.05, resolution=32)
    small = bpy.context.object
    assert (brush.sigma, brush.length_scale) == pytest.approx((0.005, 0.005))
    small.gpis.sigma, small.gpis.length_scale = 0.004, 0.02  # as a preset does
    assert (brush.sigma, brush.length_scale) == pytest.approx((0.01, 0.01))
    # Of the object that is painted, whichever is active.
    assert set_to("DEVIATION", sphere) == pytest.approx(0.1) and set_to("DEVIATION", small) == pytest.approx(0.01)
    brush.sigma = 0.03
    for obj in (sphere, small):
        bpy.context.view_layer.objects.active = obj
        assert brush.sigma == pytest.approx(0.03) and set_to("DEVIATION", obj) == pytest.approx(0.03)
    assert set_to("LENGTH_SCALE", sphere) == pytest.approx(0.1), "the other one still follows"
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    brush, sphere = bpy.context.scene.gpis.paint, bpy.data.objects[name]
    assert brush.sigma == pytest.approx(0.03)
    brush.sigma = 0
    assert set_to("DEVIATION", sphere) == pytest.approx(0.1), "none is typed any more"


def test_a_radius_in_the_scene_begins_as_it_was_on_the_screen(module, sphere, brush):
    module("paint.settings").set_pixel_size(0.0005)
    brush.view_radius = 40
    brush.radius_unit = "SCENE"
    assert brush.radius == pytest.approx(0.02) and brush.view_radius == pytest.approx(40)
    brush.radius, brush.radius_unit = 0.3, "VIEW"
    brush.radius_unit = "SCENE"
    assert brush.radius == pytest.approx(0.3), "one that was chosen stays"


def test_custom_falloff_is_that_of_the_curve(sphere, brush):
    brush.falloff = "CUSTOM"
    given = brush.brush(sphere)
    values = np.array(given["curve"])
    assert given["falloff"] == "smooth" and values[0] == pytest.approx(1, abs=0.01) and values[-1] < 0.01
    assert np.all(np.diff(values) <= 1e-6), "it falls"
    brush.falloff = "SHARP"
    assert brush.brush(sphere)["falloff"] == "sharp" and "curve" not in brush.brush(sphere)


def view(matrix, width=400, height=300):
    """A region and its view: perspective, at the origin of `matrix`, looking along its -z."""
    window = Matrix(((1.5, 0, 0, 0), (0, 2.0, 0, 0), (0, 0, -1.002, -0.02), (0, 0, -1, 0)))
    data = SimpleNamespace(
        view_matrix=matrix.inverted(),
        window_matrix=window,
        perspective_matrix=window @ matrix.inverted(),
        is_perspective=True,
    )
    return SimpleNamespace(width=width, height=height), data


@pytest.mark.parametrize("scale", [1.0, 2.5])
def test_the_ring_lies_on_the_mean_surface(module, sphere, brush, scale):
    bake, hover = module("paint.bake"), module("paint.hover")
    sphere.matrix_world = Matrix.LocRotScale((1, 2, 3), None, (scale,) * 3)
    region, data = view(Matrix.Translation((1, 2, 3 + 6 * scale)))
    fields = bake.fields(sphere)
    found = hover.under(region, data, sphere, fields, (200, 150))
    assert found.location == pytest.approx((0, 0, 1), abs=5e-3)
    assert tuple(found.world) == pytest.approx((1, 2, 3 + scale), abs=0.01)
    assert found.world_normal @ Vector((0, 0, 1)) == pytest.approx(1, abs=1e-3)
    # 400 pixels are 2 / 1.5 of the distance.
    assert found.metres_per_pixel == pytest.approx(5 * scale * 2 / 1.5 / 400, rel=0.01)
    brush.radius_unit, brush.view_radius = "VIEW", 30
    radius = hover.radius_of(brush, found)
    assert radius * scale == pytest.approx(30 * found.metres_per_pixel)
    ring = hover.ring(found, radius)
    assert np.linalg.norm(ring - np.array(found.world), axis=1) == pytest.approx(radius * scale)
    pixels = hover.projected(region, data, ring)[:, :2]
    assert np.linalg.norm(pixels - (200, 150), axis=1) == pytest.approx(30, rel=0.02)
    brush.radius_unit, brush.radius = "SCENE", 0.25
    assert hover.radius_of(brush, found) == pytest.approx(0.25 / scale)
    assert hover.under(region, data, sphere, fields, (2, 2)) is None


def test_radial_control_changes_either_radius(module, brush):
    """One property in pixels, whatever the unit: F works in both."""
    module("paint.settings").set_pixel_size(0.01)
    brush.radius_unit = "SCENE"
    brush.view_radius = 40
    assert brush.radius == pytest.approx(0.4) and brush.view_radius == pytest.approx(40)
    brush.radius_unit = "VIEW"
    brush.view_radius = 70
    assert brush.view_radius == 70 and brush.radius == pytest.approx(0.4)


def test_what_the_overlay_shows(module, sphere, brush):
    bake, stroke = module("paint.bake"), module("paint.stroke")
    surface, channels = module("viewport.surface").of(sphere), module("viewport.channels")
    assert np.linalg.norm(surface.vertices, axis=1) == pytest.approx(1, abs=0.01)
    assert np.sum(surface.normals * surface.vertices, axis=1) == pytest.approx(1, abs=0.02)
    brush.channel, brush.sigma, brush.falloff = "DEVIATION", 0.4, "CONSTANT"
    painting = bake.Painting(sphere, stroke.Brush(**brush.brush(sphere)))
    painting.add(stroke.Dabs([(0, 0, 1)], [0.5], [1.0], [(0, 0, 0)]))
    painting.finish()
    fields = bake.fields(sphere)
    shown = channels.shown(bpy.context.scene, brush, fields, surface.vertices)
    assert shown.legend.span == pytest.approx((0.04, 0.4), rel=0.02) and shown.legend.high == "40 cm"
    top, bottom = np.argmax(surface.vertices[:, 2]), np.argmin(surface.vertices[:, 2])
    assert shown.colours[top] == pytest.approx((0.993, 0.906, 0.144), abs=0.1)
    assert shown.colours[bottom] == pytest.approx((0.267, 0.005, 0.329), abs=0.1)
    brush.channel = "ANISOTROPY"
    painting = bake.Painting(sphere, stroke.Brush(**brush.brush(sphere)))
    painting.add(stroke.Dabs([(0, 0, 1)], [0.6], [1.0], [(1, 0, 0)]))
    painting.finish()
    drawn = ellipses(module, sphere)
    assert len(drawn) and np.all(drawn[:, :, 2] > 0.7), "only where it is combed"
    assert np.median(extents(drawn)[:, 0] / extents(drawn)[:, 1]) == pytest.approx(6, rel=0.1)


def ellipses(module, obj):
    """Corners of what the overlay draws: (ellipses, sides, 3)."""
    bake, channels = module("paint.bake"), module("viewport.channels")
    surface = module("viewport.surface").of(obj)
    lines, seen = channels.ellipses(bake.fields(obj), surface, channels.some_vertices(surface))
    lines = lines[seen]
    assert np.allclose(lines[:, :, 1], np.roll(lines[:, :, 0], -1, axis=1)), "closed"
    return lines[:, :, 0]


def extents(corners):
    return np.ptp(corners, axis=1)


@pytest.mark.parametrize(
    ("lengths", "seen"),
    # At the top of the sphere, combed along x: in x, y and z, against the longest of them.
    [
        ((6, 1, 1), (1, 1 / 6, 0)),
        ((1, 6, 1), (1 / 6, 1, 0)),
        ((6, 6, 1), (1, 1, 0)),
        ((1, 1, 6), (1 / 6, 1 / 6, 1)),
        ((6, 1, 6), (1, 0, 1)),
    ],
)
def test_every_anisotropy_is_seen(module, sphere, brush, lengths, seen):
    """Needles, discs and bumps that stand on the surface; without one nothing is drawn."""
    assert len(ellipses(module, sphere)) == 0
    comb(module, sphere, lengths)
    drawn = ellipses(module, sphere)
    top = drawn[np.linalg.norm(drawn.mean(axis=1)[:, :2], axis=1) < 0.1]
    assert len(top)
    size = extents(top) / extents(top).max(axis=1, keepdims=True)
    if lengths == (1, 1, 6):  # the second axis is any in the surface
        size[:, 0] = size[:, 1] = np.linalg.norm(size[:, :2], axis=1)
    assert np.median(size, axis=0) == pytest.approx(seen, abs=0.1)


def comb(module, obj, lengths, direction=(1, 0, 0), symmetry=(False, False, False)):
    bake, stroke = module("paint.bake"), module("paint.stroke")
    brush = stroke.Brush("anisotropy", "comb", ratios=lengths, falloff="constant", symmetry=symmetry)
    painting = bake.Painting(obj, brush)
    painting.add(stroke.Dabs([(0, 0, 1)], [0.6], [1.0], [direction]))
    painting.finish()


def take(module, obj, location=(0, 0, 1), fields=None):
    """What the eyedropper says it took at a place of the unit sphere."""
    bake, hover = module("paint.bake"), module("paint.hover")
    place = np.array(location, dtype=float)
    found = hover.Hover(place, place, Vector(location), Vector(location), 0.01, 1.0)
    scene = bpy.context.scene
    return module("paint.eyedropper").take(scene, obj, scene.gpis.paint, fields or bake.fields(obj), found)


@pytest.mark.parametrize("lengths", [(6, 1, 1), (1, 6, 1), (1, 1, 6), (2, 4, 1), (1, 4, 2), (6, 6, 1)])
@pytest.mark.parametrize("direction", [(1, 0, 0), (0.6, -0.8, 0)])
def test_the_eyedropper_takes_what_was_combed_with(module, sphere, brush, lengths, direction):
    """Along the stroke, across it and along the normal stay what they are, however long."""
    brush.channel = "ANISOTROPY"
    comb(module, sphere, lengths, direction)
    said = take(module, sphere)
    # Nodes about the place were combed in their own planes: over a voxel the normal turns by .08.
    assert tuple(brush.ratios) == pytest.approx(lengths, rel=0.06)
    assert said.endswith("(along, across, normal)")


def test_the_eyedropper_of_mirrored_and_unknown_strokes(module, sphere, brush):
    brush.channel = "ANISOTROPY"
    bake, stroke = module("paint.bake"), module("paint.stroke")
    mirrored = stroke.Brush("anisotropy", "comb", ratios=(1, 5, 2), falloff="constant", symmetry=(True, False, False))
    painting = bake.Painting(sphere, mirrored)
    painting.add(stroke.Dabs([(0.8, 0, 0.6)], [0.5], [1.0], [(0.48, 0.6, -0.64)]))
    painting.finish()
    for side in (1, -1):
        brush.ratios = (1, 1, 1)
        take(module, sphere, (0.8 * side, 0, 0.6))
        assert tuple(brush.ratios) == pytest.approx((1, 5, 2), rel=0.05), side
    # The strokes are gone: the longer one in the surface is along.
    sphere.data.gpis_strokes = ""
    take(module, sphere, (0.8, 0, 0.6))
    assert tuple(brush.ratios) == pytest.approx((5, 1, 2), rel=0.05)


def test_the_eyedropper_takes_values(module, sphere, brush):
    bake, stroke = module("paint.bake"), module("paint.stroke")
    for channel, value, name in (
        ("DEVIATION", 0.25, "sigma"),
        ("LENGTH_SCALE", 0.5, "length_scale"),
        ("ALBEDO", (0.2, 0.4, 0.6), "color"),
    ):
        painting = bake.Painting(sphere, stroke.Brush(channel.lower(), "set", value=value, falloff="constant"))
        painting.add(stroke.Dabs([(0, 0, 1)], [0.5], [1.0], [(0, 0, 0)]))
        painting.finish()
        brush.channel = channel
        said = take(module, sphere)
        got = getattr(brush, name)
        assert (tuple(got) if channel == "ALBEDO" else got) == pytest.approx(value, rel=1e-4)
        assert said == {"DEVIATION": "σ 25 cm", "LENGTH_SCALE": "ℓ 50 cm", "ALBEDO": "albedo 0.20, 0.40, 0.60"}[channel]
    # None at all is not "as the object has it", which a brush without a value means.
    class Certain:
        values = staticmethod(lambda channel, places: np.zeros(len(places)))

    brush.channel = "DEVIATION"
    assert take(module, sphere, fields=Certain) == "σ 0 m" and brush.brush(sphere)["value"] == pytest.approx(1e-6)
    brush.sigma = 1e-30
    assert brush.sigma == pytest.approx(1e-6)
    for channel, sentence in (("MEAN", "The mean has no value to take"), ("CONDITION", "Condition points have no value")):
        brush.channel = channel
        with pytest.raises(ValueError, match=sentence):
            take(module, sphere)


def test_what_the_header_says_of_the_place_under_the_mouse(module, sphere, brush):
    said = module("paint.modal").value_text
    fields = module("paint.bake").fields(sphere)

    def of(channel):
        brush.channel = channel
        return said(bpy.context.scene, brush, fields, (0, 0, 1), 0.2)

    sphere.gpis.sigma = 0.05
    fields = module("paint.bake").fields(sphere)
    brush.strength, brush.displacement = 0.5, 0.05
    assert of("MEAN") == "5 mm a dab"
    brush.mean_operation = "SMOOTH"
    assert of("MEAN") == "radius 20 cm"
    assert of("DEVIATION") == "σ 5 cm"
    assert of("LENGTH_SCALE").startswith("ℓ ") and of("ANISOTROPY") == "1 : 1 : 1"
    assert of("ALBEDO") == "albedo 1.00, 1.00, 1.00"


def test_a_moved_mean_moves_what_is_shown(module, sphere, brush):
    bake, stroke, channels = module("paint.bake"), module("paint.stroke"), module("viewport.channels")
    surface = module("viewport.surface").of(sphere)
    painting = bake.Painting(sphere, stroke.Brush("mean", "inflate", value=0.1, falloff="constant"))
    painting.add(stroke.Dabs([(0, 0, 1)], [0.5], [1.0], [(0, 0, 0)]))
    moved = channels.moved(painting.fields, surface)
    top = np.argmax(surface.vertices[:, 2])
    assert moved[top, 2] == pytest.approx(1.05, abs=0.01)
    painting.cancel()


def test_condition_points_are_shown_as_pins(module, sphere):
    module("paint.conditions").pin(sphere, [(0, 0, 1), (1, 0, 0)])
    surface, channels = module("viewport.surface").of(sphere), module("viewport.channels")
    ends = channels.pins(sphere.gpis.conditions, surface).reshape(-1, 2, 3)
    assert ends[:, 0] == pytest.approx(np.array([(0, 0, 1), (1, 0, 0)]))
    way = ends[:, 1] - ends[:, 0]
    assert way / np.linalg.norm(way, axis=1, keepdims=True) == pytest.approx(ends[:, 0], abs=1e-3), "outwards"


def test_realisation_as_a_mesh(sphere):
    sphere.location = (0, 0, 3)
    bpy.context.view_layer.update()
    before = len(bpy.data.objects)
    assert bpy.ops.gpis.realise(seed=3, resolution=32) == {"FINISHED"}
    made = bpy.context.object
    assert made.type == "MESH" and made.hide_render and len(bpy.data.objects) == before + 1
    assert tuple(made.matrix_world.translation) == (0, 0, 3)
    points = np.array([vertex.co for vertex in made.data.vertices])
    radius = np.linalg.norm(points, axis=1)
    assert radius.mean() == pytest.approx(1, abs=0.05) and 0.01 < radius.std() < 0.1


def test_the_realisation_of_the_overlay(module, sphere):
    """Sampled once, again after a change, and then with the same noise."""
    sampling = module("viewport.sampling")
    first = sampling.of(bpy.context, sphere)
    assert sampling.of(bpy.context, sphere) is first
    first._thread.join()
    assert first.done and 0.01 < np.linalg.norm(first.vertices, axis=1).std() < 0.1
    assert np.median(np.sum(first.normals * first.vertices, axis=1)) > 0.7, "outwards"
    sphere.gpis.sigma *= 0.1
    second = sampling.of(bpy.context, sphere)
    assert second is not first
    second._thread.join()
    bumps = [np.linalg.norm(entry.vertices, axis=1).std() for entry in (first, second)]
    assert bumps[1] < 0.3 * bumps[0]
    sampling.forget()


def test_views_are_cameras(module):
    """A viewport's camera: the lens and the shift of its window matrix."""
    camera = module("sync.camera")
    _, data = view(Matrix.Translation((1, 2, 3)))
    given = camera.of_view(data)
    assert given["type"] == "perspective" and given["fov_x"] == pytest.approx(2 * np.arctan(1 / 1.5))
    assert given["matrix"][:3, 3] == pytest.approx((1, 2, 3)) and given["shift"] == pytest.approx((0, 0))
    data.window_matrix = Matrix(((1.5, 0, 0.3, 0), (0, 2.0, 0, 0), (0, 0, -1.002, -0.02), (0, 0, -1, 0)))
    assert camera.of_view(data)["shift"] == pytest.approx((0.15, 0))
    data.is_perspective = False
    data.window_matrix = Matrix(((0.25, 0, 0, 0), (0, 0.5, 0, 0), (0, 0, -0.01, 0), (0, 0, 0, 1)))
    given = camera.of_view(data)
    assert given["type"] == "orthographic" and given["width"] == pytest.approx(8)
