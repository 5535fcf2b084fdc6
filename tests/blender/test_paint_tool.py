"""The paint tool without a window: what its settings paint, what is under the brush, what the overlay shows."""

import importlib
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Vector

CHANNELS = ("MEAN", "DEVIATION", "LENGTH_SCALE", "ANISOTROPY", "ALBEDO")


@pytest.fixture
def module(extension):
    return lambda name: importlib.import_module(f"{extension}.{name}")


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
    lines = channels.axes(bake.fields(sphere), surface).reshape(-1, 2, 3)
    assert len(lines) and np.all(lines[:, :, 2] > 0.7), "only where it is combed"
    along = np.abs((lines[:, 1] - lines[:, 0]) / np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1, keepdims=True))
    assert np.median(along[:, 0]) > 0.95


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
