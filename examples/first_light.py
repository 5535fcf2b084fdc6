"""First light: one shape, three deviations. Suzanne from nearly a surface to nearly a cloud, under a sun and a sky.

    ./dev render        or        blender -b --python examples/first_light.py

writes first_light.png, first_light.exr (all passes) and first_light.json (statistics) into out/.
"""

import argparse
import importlib
import math
import sys
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler, Vector

ROOT = Path(__file__).resolve().parents[1]
INSTALLED = "bl_ext.user_default.gpis"

# From crisp to fuzzy: standard deviation and length scale in units of an object two metres wide, colour, place, turn.
FIGURES = (
    ("Crisp", 0.012, 0.06, (0.70, 0.24, 0.08), (-2.35, 0.0), 22),
    ("Rough", 0.05, 0.16, (0.70, 0.24, 0.08), (0.0, 0.35), 2),
    ("Soft", 0.15, 0.28, (0.70, 0.24, 0.08), (2.4, 0.0), -20),
)
SUN = Euler((math.radians(58), 0, math.radians(-52)))  # where the sun shines from, and the bright side of the sky


def arguments():
    own = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:] if not bpy.app.binary_path else []
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--output", type=Path, default=ROOT / "out", help="folder of the three files")
    parser.add_argument("--width", type=int, default=560, help="pixels; the height is 9/16 of it")
    parser.add_argument("--seconds", type=float, default=50, help="time limit of the render")
    parser.add_argument("--resolution", type=int, default=128, help="grid nodes along the longest side of a figure")
    return parser.parse_args(own)


def enable_addon():
    """The installed extension if there is one, else the add-on of this checkout."""
    if INSTALLED in bpy.context.preferences.addons:
        return
    sys.path.insert(0, str(ROOT))
    importlib.import_module("addon").register()


def diffuse(name, color):
    result = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        result.use_nodes = True
    nodes = result.node_tree.nodes
    shader = nodes.new("ShaderNodeBsdfDiffuse")
    shader.inputs["Color"].default_value = (*color, 1)
    output = next(node for node in nodes if node.type == "OUTPUT_MATERIAL")
    result.node_tree.links.new(shader.outputs[0], output.inputs["Surface"])
    return result


def add_figures():
    """Three Suzannes, each made into a GPIS by the operator an artist would use."""
    for name, sigma, length_scale, color, (x, y), turn in FIGURES:
        bpy.ops.mesh.primitive_monkey_add(location=(x, y, 0.78), rotation=(math.radians(-18), 0, math.radians(turn)))
        mesh = bpy.context.object
        mesh.name = name
        mesh.modifiers.new("Subdivision", "SUBSURF").render_levels = 2
        mesh.modifiers["Subdivision"].levels = 2
        mesh.data.materials.append(diffuse(name, color))
        yield mesh, sigma, length_scale


def make_gpis(mesh, sigma, length_scale, resolution):
    bpy.ops.object.select_all(action="DESELECT")
    mesh.select_set(True)
    bpy.context.view_layer.objects.active = mesh
    bpy.ops.gpis.make(resolution=resolution, margin=4 * sigma)
    settings = bpy.context.object.gpis
    settings.sigma = sigma
    settings.length_scale = length_scale
    settings.memory = "RENEWAL_PLUS"


def add_floor():
    bpy.ops.mesh.primitive_plane_add(size=4000)
    floor = bpy.context.object
    floor.name = "Floor"
    floor.data.materials.append(diffuse("Sand", (0.50, 0.42, 0.33)))


def sky_image(width=512):
    """A clear sky in the late afternoon, equirectangular: pale at the horizon, blue above, bright by the sun."""
    height = width // 2
    u, v = np.meshgrid((np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height)
    azimuth, elevation = math.pi - 2 * math.pi * u, math.pi * (v - 0.5)
    direction = np.stack(
        (np.cos(elevation) * np.cos(azimuth), np.cos(elevation) * np.sin(azimuth), np.sin(elevation)), axis=-1
    )
    toward_sun = direction @ np.array(SUN.to_matrix() @ Vector((0, 0, 1)))
    up = np.clip(direction[..., 2:], 0, 1)
    horizon, zenith = np.array([0.66, 0.77, 0.90]), np.array([0.05, 0.16, 0.52])
    color = zenith + (horizon - zenith) * np.exp(-up * 6)
    color += np.array([1.0, 0.72, 0.45]) * 0.8 * np.exp((toward_sun[..., None] - 1) * 14)
    color[direction[..., 2] < -0.015] = 0  # under the floor: rays sent there would be lost
    pixels = np.concatenate((color, np.ones((height, width, 1))), axis=-1)
    image = bpy.data.images.new("Sky", width, height, float_buffer=True)
    image.pixels.foreach_set(np.ascontiguousarray(pixels, dtype=np.float32).reshape(-1))
    return image


def add_light(scene):
    world = bpy.data.worlds.new("Sky")
    scene.world = world
    if bpy.app.version < (5, 0):
        world.use_nodes = True
    nodes, links = world.node_tree.nodes, world.node_tree.links
    texture = nodes.new("ShaderNodeTexEnvironment")
    texture.image = sky_image()
    background = next(node for node in nodes if node.type == "BACKGROUND")
    links.new(texture.outputs["Color"], background.inputs["Color"])
    background.inputs["Strength"].default_value = 0.75
    bpy.ops.object.light_add(type="SUN", rotation=SUN)
    sun = bpy.context.object.data
    sun.energy = 4.2
    sun.color = (1.0, 0.84, 0.66)
    sun.angle = math.radians(1.5)


def add_camera(scene):
    data = bpy.data.cameras.new("Camera")
    camera = bpy.data.objects.new("Camera", data)
    scene.collection.objects.link(camera)
    scene.camera = camera
    camera.location = (0, -11.5, 0.95)
    camera.rotation_euler = (Vector((0, 0, 1.05)) - camera.location).to_track_quat("-Z", "Y").to_euler()
    data.lens = 50
    data.clip_end = 5000


def build(width, seconds):
    bpy.ops.wm.read_homefile(use_factory_startup=True, use_empty=True)
    scene = bpy.context.scene
    add_floor()
    add_light(scene)
    add_camera(scene)
    scene.render.engine = "GPIS"
    scene.render.resolution_x, scene.render.resolution_y = width, width * 9 // 16
    scene.render.resolution_percentage = 100
    scene.gpis.use_samples = False
    scene.gpis.time_limit = seconds
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = True
    layer.gpis.use_pass_albedo = layer.gpis.use_pass_variance = layer.gpis.use_pass_sample_count = True
    scene.view_settings.view_transform = "AgX"
    scene.view_settings.look = "AgX - Medium High Contrast"
    scene.view_settings.exposure = 0.2
    return scene


def render(scene, folder):
    """F12 once: the EXR is written by the render, the PNG and the statistics from what it left."""
    folder.mkdir(parents=True, exist_ok=True)
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since 5.0
        settings.media_type = "MULTI_LAYER_IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER"
    scene.render.filepath = str(folder / "first_light.exr")
    bpy.ops.render.render(write_still=True)
    if hasattr(settings, "media_type"):
        settings.media_type = "IMAGE"
    settings.file_format = "PNG"
    bpy.data.images["Render Result"].save_render(str(folder / "first_light.png"), scene=scene)
    bpy.ops.gpis.save_statistics(filepath=str(folder / "first_light.json"))


def main():
    options = arguments()
    enable_addon()
    scene = build(options.width, options.seconds)
    for mesh, sigma, length_scale in list(add_figures()):
        make_gpis(mesh, sigma, length_scale, options.resolution)
    render(scene, options.output)
    print(f"wrote {options.output}/first_light.png, .exr and .json")


if __name__ == "__main__":
    main()
