"""Each kind of light lights a floor with a shadow as in Cycles."""

import math

import pytest
from mathutils import Euler

from . import support

SLANTED = Euler((0.5, 0.2, 0.3)).to_quaternion()

LIGHTS = {
    "point": {"kind": "POINT", "energy": 300, "shadow_soft_size": 0.3},
    "small point": {"kind": "POINT", "energy": 300, "shadow_soft_size": 0.0},
    "coloured point": {"kind": "POINT", "energy": 300, "color": (1, 0.4, 0.1), "shadow_soft_size": 0.2},
    "sun": {"kind": "SUN", "energy": 3, "rotation": SLANTED, "angle": math.radians(10)},
    "sharp sun": {"kind": "SUN", "energy": 3, "rotation": SLANTED, "angle": 0.0},
    "square": {"kind": "AREA", "energy": 200, "rotation": SLANTED, "size": 1.5},
    "rectangle": {"kind": "AREA", "energy": 200, "rotation": SLANTED, "shape": "RECTANGLE", "size": 2, "size_y": 0.5},
    "scaled rectangle": {
        "kind": "AREA",
        "energy": 200,
        "rotation": SLANTED,
        "scale": (0.5, 2, 3),
        "shape": "RECTANGLE",
        "size": 2,
        "size_y": 0.5,
    },
    "disk": {"kind": "AREA", "energy": 200, "rotation": SLANTED, "shape": "DISK", "size": 1.5},
    "ellipse": {"kind": "AREA", "energy": 200, "rotation": SLANTED, "shape": "ELLIPSE", "size": 2, "size_y": 0.7},
    "widest sun": {"kind": "SUN", "energy": 3, "rotation": SLANTED, "angle": math.pi},
    "widest spot": {"kind": "SPOT", "energy": 500, "rotation": SLANTED, "spot_size": math.pi, "spot_blend": 0.4},
    "spot": {"kind": "SPOT", "energy": 500, "rotation": SLANTED, "spot_size": 1.2, "spot_blend": 0.4},
}


@pytest.fixture
def stage(empty_scene):
    support.settings(empty_scene, samples=64, bounces=0)  # what a light gives directly
    support.world(empty_scene)
    grey = support.diffuse("Grey", (0.6, 0.5, 0.4))
    support.plane(empty_scene, size=30, material=grey)
    support.cube(empty_scene, "Box", 1, grey, location=(0.6, 0.2, 0.5))
    support.camera(empty_scene, (0, -7, 5), (0, 0, 0.5), lens=35)
    return empty_scene


@pytest.mark.parametrize("values", LIGHTS.values(), ids=LIGHTS.keys())
def test_light_is_that_of_cycles(stage, tmp_path, values):
    support.light(stage, location=(-1, -0.5, 3.5), **values)
    ours, _ = support.same_pictures(stage, tmp_path)
    assert ours.max() > 0.05, "the test must show light"


def test_all_lights_at_once(stage, tmp_path):
    """Choosing among lights must not change what they give together, nor what comes from it by way of the floor."""
    support.settings(stage, samples=64)
    for index, values in enumerate((LIGHTS["point"], LIGHTS["sun"], LIGHTS["disk"], LIGHTS["spot"])):
        support.light(stage, location=(-2 + 1.3 * index, -0.5, 3.5), **values)
    support.same_pictures(stage, tmp_path)


def test_light_nodes_are_read(stage, tmp_path):
    light = support.light(stage, "POINT", 200, (-1, -0.5, 3.5), shadow_soft_size=0.2).data
    light.use_nodes = True
    emission = next(node for node in light.node_tree.nodes if node.type == "EMISSION")
    emission.inputs["Color"].default_value = (0.2, 0.9, 0.5, 1)
    emission.inputs["Strength"].default_value = 1.7
    support.same_pictures(stage, tmp_path)
