"""Cameras: the silhouette of black bodies before a white world is where Cycles has it."""

import importlib

import bpy
import numpy as np
import pytest

from . import support

CAMERAS = {
    "perspective": {},
    "shifted": {"shift_x": 0.21, "shift_y": -0.13},
    "vertical fit": {"sensor_fit": "VERTICAL", "sensor_height": 30, "shift_x": 0.1, "shift_y": 0.15},
    "horizontal fit": {"sensor_fit": "HORIZONTAL", "shift_x": 0.1, "shift_y": 0.15},
    "wide": {"lens": 18},
    "orthographic": {"type": "ORTHO", "ortho_scale": 7},
    "orthographic shifted": {"type": "ORTHO", "ortho_scale": 7, "shift_x": -0.2, "shift_y": 0.1},
    "clipped": {"clip_start": 5.2, "clip_end": 6.9},
}


@pytest.fixture
def silhouettes(empty_scene):
    """A slanted cube and a second one off the axis; nothing in the picture is symmetrical."""
    support.settings(empty_scene, samples=64, bounces=0)
    support.world(empty_scene, (1, 1, 1))
    black = support.diffuse("Black", (0, 0, 0))
    support.cube(empty_scene, "Slanted", 1.6, black, location=(0.3, 0, 0.2), rotation=(0.9, 0.3, 0.6, 0.1))
    support.cube(empty_scene, "Aside", 0.7, black, location=(-1.6, 0.5, -0.9))
    return empty_scene


def compare(scene, path):
    """Edges are sampled: a pixel half covered has a standard deviation of .5/8 in each picture."""
    ours, cycles = (support.picture(scene, path, engine)[..., 0] for engine in ("GPIS", "CYCLES"))
    assert ours.shape == cycles.shape
    assert 0.02 < np.mean(cycles < 0.5) < 0.9, "the test must show an edge"
    assert np.abs(ours - cycles).max() < 5 * np.sqrt(2) * 0.5 / 8
    assert abs(ours.mean() - cycles.mean()) < 2e-3
    # A shift of a twentieth of a pixel would show here.
    for axis in (0, 1):
        places = np.arange(cycles.shape[1 - axis])
        centres = [((1 - image).sum(axis=axis) * places).sum() / (1 - image).sum() for image in (ours, cycles)]
        assert abs(centres[0] - centres[1]) < 0.05


@pytest.mark.parametrize("values", CAMERAS.values(), ids=CAMERAS.keys())
@pytest.mark.parametrize("size", [(64, 48), (40, 64)], ids=["landscape", "portrait"])
def test_silhouette_is_that_of_cycles(silhouettes, tmp_path, values, size):
    support.camera(silhouettes, (0.5, -6, 1.2), (0, 0, 0), **values)
    silhouettes.render.resolution_x, silhouettes.render.resolution_y = size
    compare(silhouettes, tmp_path)


def test_rolled_and_scaled_camera(silhouettes, tmp_path):
    camera = support.camera(silhouettes, (0.5, -6, 1.2))
    camera.rotation_mode = "XYZ"
    camera.rotation_euler.rotate_axis("Z", 0.4)
    camera.scale = (2, 3, 0.5)
    compare(silhouettes, tmp_path)


def test_percentage_and_border(silhouettes, tmp_path):
    support.camera(silhouettes, (0.5, -6, 1.2), shift_x=0.1)
    render = silhouettes.render
    render.resolution_x, render.resolution_y, render.resolution_percentage = 130, 97, 50
    whole = support.picture(silhouettes, tmp_path)
    assert whole.shape == (48, 65, 3)
    compare(silhouettes, tmp_path)
    render.use_border = render.use_crop_to_border = True
    render.border_min_x, render.border_max_x, render.border_min_y, render.border_max_y = 0.25, 0.8, 0.3, 0.9
    compare(silhouettes, tmp_path)


def test_no_camera(silhouettes, tmp_path):
    assert "no camera" in support.failure(silhouettes, tmp_path)


def test_panoramic_camera(silhouettes, tmp_path):
    support.camera(silhouettes, type="PANO")
    assert "perspective and orthographic" in support.failure(silhouettes, tmp_path)


def test_pixel_aspect(silhouettes, tmp_path):
    support.camera(silhouettes)
    silhouettes.render.pixel_aspect_x = 2
    assert "square pixels" in support.failure(silhouettes, tmp_path)


def test_description_of_the_default_camera(silhouettes, extension):
    """The numbers of a 50 mm lens on 36 mm, without a renderer between."""
    sync = importlib.import_module(extension + ".sync")
    support.camera(silhouettes, (0, -6, 0))
    bpy.context.view_layer.update()
    camera = sync.describe(bpy.context.evaluated_depsgraph_get(), 64, 48).description["camera"]
    assert camera["fov_x"] == pytest.approx(2 * np.arctan(18 / 50), abs=1e-6)
    assert np.allclose(camera["matrix"][:3, :3], [[1, 0, 0], [0, 0, -1], [0, 1, 0]], atol=1e-6)
    assert np.allclose(camera["matrix"][:3, 3], (0, -6, 0))
