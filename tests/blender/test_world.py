"""The world: constant colour, images and their orientation, as in Cycles."""

import bpy
import numpy as np
import pytest

from . import support


@pytest.fixture
def ball(empty_scene):
    """A cube lit by the world alone, with much of the world in the picture."""
    support.settings(empty_scene, samples=64)
    support.cube(empty_scene, "Box", 1.5, support.diffuse("Grey", (0.6, 0.6, 0.6)), rotation=(0.9, 0.2, 0.3, 0.1))
    support.camera(empty_scene, (1, -5, 1.5), lens=20)
    return empty_scene


def test_colour_and_strength(ball, tmp_path):
    support.world(ball, (0.2, 0.5, 0.9), 1.5)
    support.same_pictures(ball, tmp_path)


def test_no_world_is_black(ball, tmp_path):
    ball.world = None
    assert np.all(support.picture(ball, tmp_path) == 0)


def lopsided(width=64, spot=True):
    """An image that is different in every direction: colours by direction, one bright spot."""
    height = width // 2
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    pixels = np.stack((0.2 + 0.8 * u, 0.1 + v, 0.6 + 0.4 * np.sin(6 * u + 3 * v), np.ones_like(u)), axis=-1)
    if spot:
        pixels[height // 2 : height // 2 + 4, width // 8 : width // 8 + 4, :3] = (20, 15, 5)
    return pixels.astype(np.float32)


def environment(scene, pixels, float_buffer=True):
    support.world(scene)
    image = bpy.data.images.new("Sky", pixels.shape[1], pixels.shape[0], float_buffer=float_buffer)
    image.pixels.foreach_set(pixels.reshape(-1))
    tree = scene.world.node_tree
    texture = tree.nodes.new("ShaderNodeTexEnvironment")
    texture.image = image
    tree.links.new(texture.outputs["Color"], support.background_node(scene).inputs["Color"])
    return tree, texture


def test_image_stands_as_in_cycles(ball, tmp_path):
    environment(ball, lopsided())
    support.same_pictures(ball, tmp_path, systematic=0.02)


@pytest.mark.parametrize("vector_type", ["POINT", "TEXTURE"])
def test_image_turned_by_a_mapping_node(ball, tmp_path, vector_type):
    tree, texture = environment(ball, lopsided())
    mapping = tree.nodes.new("ShaderNodeMapping")
    mapping.vector_type = vector_type
    mapping.inputs["Rotation"].default_value = (0.3, -0.5, 1.1)
    coordinates = tree.nodes.new("ShaderNodeTexCoord")
    tree.links.new(coordinates.outputs["Generated"], mapping.inputs["Vector"])
    tree.links.new(mapping.outputs["Vector"], texture.inputs["Vector"])
    support.same_pictures(ball, tmp_path, systematic=0.02)


def test_bytes_are_read_in_their_colour_space(ball, tmp_path):
    # Without the spot: Cycles interpolates bytes before it makes them linear, which shows at an edge only.
    environment(ball, np.clip(lopsided(spot=False), 0, 1), float_buffer=False)
    support.same_pictures(ball, tmp_path, systematic=0.02)


def test_missing_image(ball, tmp_path):
    _, texture = environment(ball, lopsided())
    texture.image = None
    assert "has no image" in support.failure(ball, tmp_path)
