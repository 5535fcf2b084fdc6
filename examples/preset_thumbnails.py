"""The thumbnails of the presets, rendered by the engine itself: a ball on a floor, under a sun and a sky.

    .venv/bin/python examples/preset_thumbnails.py [PRESET...]        or        blender -b --python …

writes addon/presets/thumbnails/*.png. Run it again after a change of a preset.
"""

import argparse
import importlib
import math
import sys
from pathlib import Path

import bpy
from mathutils import Vector

ROOT = Path(__file__).resolve().parents[1]
INSTALLED = "bl_ext.user_default.gpis"


def arguments():
    own = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else sys.argv[1:] if not bpy.app.binary_path else []
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("presets", nargs="*", metavar="PRESET", help="names in lower case; all of them without one")
    parser.add_argument("--output", type=Path, help="folder, instead of that of the add-on")
    parser.add_argument("--size", type=int, default=96, help="pixels along a side")
    parser.add_argument("--samples", type=int, default=96, help="samples per pixel")
    return parser.parse_args(own)


def enable_addon():
    """The installed extension if there is one, else the add-on of this checkout; gives the module's name."""
    if INSTALLED in bpy.context.preferences.addons:
        return INSTALLED
    sys.path.insert(0, str(ROOT))
    importlib.import_module("addon").register()
    return "addon"


def link(name, data, location=(0, 0, 0), towards=None):
    obj = bpy.data.objects.new(name, data)
    obj.location = location
    if towards is not None:
        obj.rotation_euler = (Vector(towards) - Vector(location)).to_track_quat("-Z", "Y").to_euler()
    bpy.context.scene.collection.objects.link(obj)
    return obj


def shaded(name, node_type, **inputs):
    material = bpy.data.materials.new(name)
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new(node_type)
    for key, value in inputs.items():
        shader.inputs[key].default_value = value
    tree.links.new(shader.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def stage(size, samples):
    bpy.ops.wm.read_homefile(use_factory_startup=False, use_empty=True)
    scene = bpy.context.scene
    scene.render.engine = "GPIS"
    scene.render.resolution_x = scene.render.resolution_y = size
    scene.gpis.samples = samples
    scene.gpis.clamp = 2.0  # light that metals throw onto the floor: bright specks at so few samples
    scene.render.image_settings.file_format = "PNG"
    scene.render.image_settings.color_mode = "RGB"
    scene.render.image_settings.compression = 100
    scene.view_settings.view_transform = "Standard"

    camera = bpy.data.cameras.new("Camera")
    camera.lens = 70
    scene.camera = link("Camera", camera, (0, -2.6, 0.75), (0, 0, -0.03))
    floor = bpy.data.meshes.new("Floor")
    floor.from_pydata([(-30, -30, -0.5), (30, -30, -0.5), (30, 30, -0.5), (-30, 30, -0.5)], [], [(0, 1, 2, 3)])
    floor.materials.append(shaded("Floor", "ShaderNodeBsdfDiffuse", Color=(0.16, 0.165, 0.18, 1)))
    link("Floor", floor)
    for name, energy, size, location in (("Key", 42, 1.8, (-1.8, -1.5, 2.2)), ("Rim", 45, 1.2, (2.0, 1.4, 1.5))):
        light = bpy.data.lights.new(name, "AREA")
        light.shape, light.size, light.energy = "DISK", size, energy
        link(name, light, location, (0, 0, 0))
    scene.world = bpy.data.worlds.new("Sky")
    if bpy.app.version < (5, 0):
        scene.world.use_nodes = True
    tree = scene.world.node_tree
    background = next((node for node in tree.nodes if node.type == "BACKGROUND"), None)
    if background is None:
        background = tree.nodes.new("ShaderNodeBackground")
        tree.links.new(background.outputs[0], tree.nodes.new("ShaderNodeOutputWorld").inputs["Surface"])
    background.inputs["Color"].default_value = (0.42, 0.46, 0.52, 1)
    background.inputs["Strength"].default_value = 1.0
    return scene


def render(name, path, size, samples):
    scene = stage(size, samples)
    bpy.ops.gpis.add(kind="SPHERE", radius=0.5, resolution=64)
    ball = bpy.context.object
    ball.rotation_euler = (math.radians(8), math.radians(-14), math.radians(20))
    assert bpy.ops.gpis.apply_preset(preset=name) == {"FINISHED"}
    scene.render.filepath = str(path)
    bpy.ops.render.render(write_still=True)


def main():
    options = arguments()
    addon = enable_addon()
    previews = importlib.import_module(addon + ".presets.previews")
    table = importlib.import_module(addon + ".presets.table")
    for name in [name.upper() for name in options.presets] or table.PRESETS:
        path = previews.thumbnail(name)
        path = options.output / path.name if options.output else path
        render(name, path, options.size, options.samples)
        print(path, f"{path.stat().st_size / 1024:.0f} KB")


main()
