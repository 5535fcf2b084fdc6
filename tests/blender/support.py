"""Scenes, renders and comparisons that the Blender tests share."""

import struct
import sys

import bpy
import numpy as np
import pytest
from mathutils import Matrix, Quaternion, Vector

_SIZES = {1: ("<f2", 2), 2: ("<f4", 4)}  # half, float


def read_exr(path):
    """(channels: name -> (H, W) array with row 0 at the bottom, attributes: name -> bytes) of an uncompressed EXR."""
    data = path.read_bytes()
    assert struct.unpack_from("<i", data)[0] == 20000630, f"{path} is not an EXR"
    position, attributes = 8, {}
    while data[position]:
        end = data.index(b"\0", position)
        name = data[position:end].decode()
        type_end = data.index(b"\0", end + 1)
        (size,) = struct.unpack_from("<i", data, type_end + 1)
        attributes[name] = data[type_end + 5 : type_end + 5 + size]
        position = type_end + 5 + size
    assert attributes["compression"] == b"\0", "render with exr_codec NONE to read it here"
    x0, y0, x1, y1 = struct.unpack("<4i", attributes["dataWindow"])
    width, height = x1 - x0 + 1, y1 - y0 + 1
    names, listing, place = [], attributes["channels"], 0
    while listing[place]:
        end = listing.index(b"\0", place)
        names.append((listing[place:end].decode(), struct.unpack_from("<i", listing, end + 1)[0]))
        place = end + 17
    channels = {name: np.empty((height, width), np.float32) for name, _ in names}
    for offset in struct.unpack_from(f"<{height}q", data, position + 1):
        row = struct.unpack_from("<i", data, offset)[0] - y0
        offset += 8
        for name, kind in names:
            dtype, size = _SIZES[kind]
            channels[name][height - 1 - row] = np.frombuffer(data, dtype, width, offset)
            offset += size * width
    return channels, attributes


def command(script):
    """Runs a script in a new Blender of the same kind."""
    if not bpy.app.binary_path:  # the module; bpy.app.module is younger than 4.3
        return [sys.executable, "-c", f"import bpy, runpy; runpy.run_path({str(script)!r}, run_name='__main__')"]
    return [bpy.app.binary_path, "-b", "--factory-startup", "--python-exit-code", "1", "--python", str(script)]


def image_settings(scene, multilayer=False):
    settings = scene.render.image_settings
    if hasattr(settings, "media_type"):  # since 5.0
        settings.media_type = "MULTI_LAYER_IMAGE" if multilayer else "IMAGE"
    settings.file_format = "OPEN_EXR_MULTILAYER" if multilayer else "OPEN_EXR"
    if hasattr(settings, "use_exr_interleave"):
        settings.use_exr_interleave = True
    settings.color_depth = "32"
    settings.exr_codec = "NONE"


def picture(scene, path, engine="GPIS", seed=0):
    """(H, W, 3) linear colours of an F12 with this engine, row 0 at the bottom."""
    scene.render.engine = engine
    scene.gpis.seed = scene.cycles.seed = seed
    image_settings(scene)
    scene.render.filepath = str(path / f"{engine}-{seed}.exr")
    bpy.ops.render.render(write_still=True)
    channels, _ = read_exr(path / f"{engine}-{seed}.exr")
    return np.stack([channels[name] for name in "RGB"], axis=-1)


def same_pictures(scene, path, block=8, significance=4.5, systematic=0.01):
    """The scene by both engines, in blocks of pixels; the noise of each is that between two seeds.

    Each block differs by at most `significance` combined standard errors (pooled over the picture, so that two seeds
    are enough) and 1% of its value (of a hundredth of the brightest block, where it is darker): filters, light sizes
    and shading normals are not the same in every digit.
    """
    pairs = []
    for engine in ("GPIS", "CYCLES"):
        pictures = [picture(scene, path, engine, seed) for seed in (1, 2)]
        pairs.append([_blocks(entry, block) for entry in pictures])
    (a1, a2), (b1, b2) = pairs
    a, b = (a1 + a2) / 2, (b1 + b2) / 2
    # Of the mean of two: half of the standard deviation of their difference; relative, as Monte Carlo noise is.
    scale = np.maximum((a + b) / 2, 0.01 * max(b.max(), 1e-6))
    noise = scale * np.sqrt(np.mean(((a1 - a2) / 2 / scale) ** 2) + np.mean(((b1 - b2) / 2 / scale) ** 2))
    excess = np.abs(a - b) - significance * noise - systematic * scale
    worst = np.unravel_index(excess.argmax(), excess.shape)
    assert excess.max() <= 0, f"block {worst}: GPIS {a[worst]:.5f}, Cycles {b[worst]:.5f}, noise {noise[worst]:.5f}"
    return a, b


def _blocks(image, size):
    height, width, channels = image.shape
    return image.reshape(height // size, size, width // size, size, channels).mean(axis=(1, 3))


def settings(scene, width=64, height=48, samples=64, bounces=None):
    """Both engines alike: box filter, no clamping, no adaptive sampling, no denoising."""
    scene.render.resolution_x, scene.render.resolution_y = width, height
    scene.render.resolution_percentage = 100
    scene.render.threads_mode, scene.render.threads = "FIXED", 2
    gpis = scene.gpis
    gpis.samples, gpis.filter_type, gpis.filter_width = samples, "BOX", 1.0
    gpis.use_max_bounces, gpis.max_bounces = bounces is not None, bounces or 0
    cycles = scene.cycles
    cycles.device = "CPU"
    cycles.samples, cycles.use_adaptive_sampling, cycles.use_denoising = samples, False, False
    cycles.pixel_filter_type, cycles.filter_width = "BOX", 1.0
    cycles.sample_clamp_indirect = cycles.sample_clamp_direct = 0
    cycles.light_sampling_threshold = 0
    cycles.blur_glossy = 0
    for name in ("max_bounces", "diffuse_bounces", "glossy_bounces", "transmission_bounces"):
        setattr(cycles, name, 64 if bounces is None else bounces)


def link(scene, name, data, **placed):
    """`location`, `rotation` (Euler, Quaternion or its four numbers), `scale`."""
    rotation = placed.get("rotation")
    rotation = Quaternion(rotation).normalized() if isinstance(rotation, tuple) else rotation
    obj = bpy.data.objects.new(name, data)
    obj.matrix_world = Matrix.LocRotScale(placed.get("location"), rotation, placed.get("scale"))
    scene.collection.objects.link(obj)
    return obj


def camera(scene, location=(0, -6, 0), target=(0, 0, 0), **values):
    data = bpy.data.cameras.new("Camera")
    for name, value in values.items():
        setattr(data, name, value)
    rotation = (Vector(target) - Vector(location)).to_track_quat("-Z", "Y")
    scene.camera = link(scene, "Camera", data, location=location, rotation=rotation)
    return scene.camera


def diffuse(name, color):
    return node_material(name, "ShaderNodeBsdfDiffuse", Color=(*color, 1))


def node_material(name, node_type, **inputs):
    """A material of one shader node with these inputs (spaces in names as underscores)."""
    material = bpy.data.materials.new(name)
    material.use_nodes = True
    tree = material.node_tree
    tree.nodes.clear()
    shader = tree.nodes.new(node_type)
    for key, value in inputs.items():
        shader.inputs[key.replace("_", " ")].default_value = value
    tree.links.new(shader.outputs[0], tree.nodes.new("ShaderNodeOutputMaterial").inputs["Surface"])
    return material


def cube(scene, name="Cube", size=2.0, material=None, **placed):
    half = size / 2
    corners = [(x * half, y * half, z * half) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)]
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return mesh(scene, name, corners, faces, material, **placed)


def plane(scene, name="Floor", size=20.0, material=None, **placed):
    half = size / 2
    corners = [(-half, -half, 0), (half, -half, 0), (half, half, 0), (-half, half, 0)]
    return mesh(scene, name, corners, [(0, 1, 2, 3)], material, **placed)


def mesh(scene, name, vertices, faces, material=None, **placed):
    data = bpy.data.meshes.new(name)
    data.from_pydata(vertices, [], faces)
    if material is not None:
        data.materials.append(material)
    return link(scene, name, data, **placed)


def light(scene, kind, energy, location=(0, 0, 4), rotation=None, scale=None, **values):
    data = bpy.data.lights.new(kind.title(), kind)
    data.energy = energy
    for name, value in values.items():
        setattr(data, name, value)
    return link(scene, kind.title(), data, location=location, rotation=rotation, scale=scale)


def world(scene, color=(0, 0, 0), strength=1.0):
    scene.world = bpy.data.worlds.new("World")
    scene.world.use_nodes = True
    background = background_node(scene)
    background.inputs["Color"].default_value = (*color, 1)
    background.inputs["Strength"].default_value = strength
    return scene.world


def background_node(scene):
    tree = scene.world.node_tree
    node = next((node for node in tree.nodes if node.type == "BACKGROUND"), None)
    if node is None:
        node = tree.nodes.new("ShaderNodeBackground")
        output = tree.nodes.new("ShaderNodeOutputWorld")
        tree.links.new(node.outputs[0], output.inputs["Surface"])
    return node


def failure(scene, path, **keywords):
    """The sentence of an F12 that must fail, and must not write an image."""
    with pytest.raises(RuntimeError) as caught:
        picture(scene, path, **keywords)
    assert not list(path.glob("*.exr")), "a failed render must not write an image"
    return str(caught.value)


def coverage(scene, path):
    """Per pixel: how much of the white world a black body hides."""
    return 1 - picture(scene, path)[..., 0]
