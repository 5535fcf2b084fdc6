"""Every setting of the panels, lights, camera and GPIS objects arrives in the description as the number it is.

The comparisons with Cycles show that such numbers mean the same; this shows that none is forgotten, in milliseconds.
"""

import importlib
import math
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Euler, Matrix

from . import support


@pytest.fixture
def stage(empty_scene):
    support.camera(empty_scene)
    return empty_scene


@pytest.fixture
def describe(extension):
    sync = importlib.import_module(extension + ".sync")

    def describe():
        bpy.context.view_layer.update()
        return sync.describe(bpy.context.evaluated_depsgraph_get(), 64, 48).description

    return describe


def test_settings(stage, describe):
    gpis = stage.gpis
    assert describe()["settings"]["max_bounces"] is None
    gpis.use_max_bounces, gpis.max_bounces = True, 7
    gpis.missed_root, gpis.clamp, gpis.light_sampling = 0.01, 3.0, False
    gpis.filter_type, gpis.filter_width = "BOX", 2.0
    settings = describe()["settings"]
    assert settings["max_bounces"] == 7 and settings["light_sampling"] is False
    assert (settings["missed_root"], settings["clamp"]) == pytest.approx((0.01, 3.0))
    assert settings["filter"] == {"type": "box", "width": 2.0}


@pytest.mark.parametrize(
    "switch, word", [("use_freestyle", "Freestyle"), ("use_motion_blur", "Motion blur"), ("film_transparent", "Transparent")]
)
def test_what_is_not_rendered_is_said(stage, extension, switch, word):
    setattr(stage.render, switch, True)
    sync = importlib.import_module(extension + ".sync")
    state = sync.describe(bpy.context.evaluated_depsgraph_get(), 64, 48)
    assert [word in sentence for sentence in state.warnings] == [True]


def test_limits(stage, extension):
    limits_of = importlib.import_module(extension + ".engine").limits_of
    gpis, render = stage.gpis, stage.render
    gpis.samples, gpis.seed, render.threads_mode = 77, 5, "AUTO"
    limits = limits_of(stage, stage.view_layers[0])
    assert (limits.samples, limits.time_limit, limits.noise_threshold, limits.seed, limits.threads) == (77, None, None, 5, 0)
    gpis.use_samples, gpis.time_limit, gpis.use_noise_threshold, gpis.noise_threshold = False, 12.0, True, 0.25
    render.threads_mode, render.threads = "FIXED", 3
    limits = limits_of(stage, stage.view_layers[0])
    assert (limits.samples, limits.time_limit, limits.noise_threshold, limits.threads) == (None, 12.0, 0.25, 3)


def test_overrides_of_a_view_layer(stage, describe, extension):
    """Its material is that of every object, its samples are those of the render; so is its world from Blender 5 on."""
    support.cube(stage, "Box", 1, support.diffuse("Own", (0.1, 0.2, 0.3)))
    layer = stage.view_layers[0]
    layer.material_override, layer.samples = support.diffuse("Clay", (0.5, 0.6, 0.7)), 9
    limits_of = importlib.import_module(extension + ".engine").limits_of
    assert limits_of(stage, layer).samples == 9
    description = describe()
    assert description["materials"].keys() == {"Clay"}
    assert {name for entry in description["objects"] for name in entry["materials"]} == {"Clay"}
    if hasattr(layer, "world_override"):
        layer.world_override = bpy.data.worlds.new("Night")
        layer.world_override.color = (0.0, 0.0, 0.25)
        layer.world_override.use_nodes = False
        assert describe()["world"] != description["world"]


def test_camera(stage, describe):
    camera = stage.camera
    camera.matrix_world = Matrix.LocRotScale((1, 2, 3), Euler((0.3, 0.2, 0.1)), (2, 3, 4))
    camera.data.clip_start, camera.data.clip_end = 0.5, 77.0
    entry = describe()["camera"]
    assert entry["clip"] == (0.5, 77.0)
    assert np.allclose(entry["matrix"][:3, :3], Euler((0.3, 0.2, 0.1)).to_matrix(), atol=1e-6), "without the scale"
    assert np.allclose(entry["matrix"][:3, 3], (1, 2, 3))


def test_lights(stage, describe):
    support.light(stage, "SUN", 3.0, angle=0.2)
    support.light(stage, "SPOT", 40.0, spot_size=1.0, spot_blend=0.3, shadow_soft_size=0.25)
    support.light(stage, "AREA", 50.0, shape="RECTANGLE", size=2.0, size_y=0.5, scale=(3, 2, 1))
    point = support.light(stage, "POINT", 10.0).data
    point.color = (1.0, 0.5, 0.25)
    if hasattr(point, "exposure"):
        point.exposure = 2.0
    factor = 4.0 if hasattr(point, "exposure") else 1.0
    entries = {entry["name"]: entry for entry in describe()["lights"]}
    assert (entries["Sun"]["power"], entries["Sun"]["angle"]) == pytest.approx((3.0, 0.2))
    spot = entries["Spot"]
    assert (spot["power"], spot["angle"], spot["blend"], spot["radius"]) == pytest.approx((40.0, 1.0, 0.3, 0.25))
    assert entries["Area"]["size"] == pytest.approx((6.0, 1.0)) and entries["Area"]["shape"] == "rectangle"
    assert entries["Point"]["power"] == pytest.approx(10.0 * factor)
    assert entries["Point"]["color"] == pytest.approx((1.0, 0.5, 0.25))


def test_light_temperature_and_emission(stage, describe):
    light = support.light(stage, "POINT", 10.0).data
    light.use_nodes = True
    emission = next(node for node in light.node_tree.nodes if node.type == "EMISSION")
    emission.inputs["Strength"].default_value, emission.inputs["Color"].default_value = 3.0, (0.5, 1, 1, 1)
    warm = hasattr(light, "use_temperature")
    if warm:
        light.use_temperature, light.temperature = True, 3000
    (entry,) = describe()["lights"]
    tint = np.array(light.temperature_color) if warm else np.ones(3)
    assert entry["power"] == pytest.approx(30.0)
    assert entry["color"] == pytest.approx(tint * (0.5, 1, 1))


@pytest.fixture
def cloud(stage, extension, tmp_path):
    """A GPIS of a .vdb whose mean is 0.5 and whose other grid is 0.25 everywhere."""
    values = np.full((8, 8, 8), 0.25)
    grids = {"mean": 2 * values, "sigma": values, "origin": (-1.0,) * 3, "voxel_size": 2 / 7}
    importlib.import_module("gpis_native").write_vdb(str(tmp_path / "cloud.vdb"), grids)
    data = bpy.data.volumes.new("Cloud")
    data.filepath = str(tmp_path / "cloud.vdb")
    obj = support.link(stage, "Cloud", data)
    obj.gpis.enabled, obj.gpis.mean_grid = True, "mean"
    obj.gpis.sigma, obj.gpis.length_scale = 0.1, 0.3
    return obj


def test_gpis(cloud, describe):
    settings = cloud.gpis
    cloud.matrix_world = Matrix.LocRotScale((1, 2, 3), Euler((0.3, 0.2, 0.1)), (2, 3, 4))
    for memory, name in (("NONE", "none"), ("RENEWAL", "renewal"), ("RENEWAL_PLUS", "renewal+")):
        settings.memory = memory
        (entry,) = describe()["objects"]
        assert entry["memory"] == name
    assert np.allclose(entry["matrix"], cloud.matrix_world)
    x, y = np.zeros((1, 3)), np.array([[0.3, 0, 0]])
    assert entry["process"].mean(x) == pytest.approx(0.5)
    assert entry["process"].covariance(x, x) == pytest.approx(0.1**2)
    assert entry["process"].covariance(x, y) == pytest.approx(0.1**2 * math.exp(-0.5)), "ℓ = 0.3"


def test_deviation_from_a_grid(cloud, describe):
    settings = cloud.gpis
    settings.sigma_source, settings.sigma_grid = "GRID", "sigma"
    x = np.zeros((1, 3))
    for meaning, factor, sigma in (("STANDARD_DEVIATION", 1, 0.25), ("VARIANCE", 1, 0.5), ("VARIANCE", 3, 1.5)):
        settings.sigma_meaning, settings.sigma_factor = meaning, factor
        (entry,) = describe()["objects"]
        assert entry["process"].covariance(x, x) == pytest.approx(sigma**2)


def test_switching_gpis_on_shows_bounds(cloud):
    assert cloud.display_type == "BOUNDS"


def test_world_lengths_follow_scale_and_units(stage, extension):
    """Under a length in object units: what it is along the object's axes, in the scene's units."""
    panel = importlib.import_module(extension + ".ui.object_panel")
    matrix = Matrix.LocRotScale(None, Euler((0.3, 0.2, 0.1)), (1, 2, 3))
    assert panel.world_lengths(matrix, 0.5) == pytest.approx((0.5, 1.0, 1.5))
    stage.unit_settings.system, stage.unit_settings.scale_length = "METRIC", 0.01
    assert panel._length(SimpleNamespace(scene=stage), 2.0) == "2 cm"


def test_an_instancer_that_is_not_shown_is_left_out(stage, describe):
    crowd = support.cube(stage, "Crowd")
    support.cube(stage, "Member", size=0.1).parent = crowd
    crowd.instance_type = "VERTS"
    names = [entry["name"] for entry in describe()["objects"]]
    assert names.count("Crowd") == 1 and names.count("Member") >= 8
    crowd.show_instancer_for_render = crowd.show_instancer_for_viewport = False
    names = [entry["name"] for entry in describe()["objects"]]
    assert names.count("Crowd") == 0 and names.count("Member") >= 8
