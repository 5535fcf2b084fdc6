"""The world -> `world` of the description: a Background node with a colour or an Environment Texture."""

import bpy
import numpy as np

from . import nodes
from .state import SyncError, array


def of_frame(sync):
    """The world that this view layer sees; Blender 5 can replace the scene's."""
    return getattr(sync.depsgraph.view_layer, "world_override", None) or sync.scene.world


def describe(sync):
    world = of_frame(sync)
    if world is None:
        return {"color": (0.0, 0.0, 0.0), "strength": 1.0}
    owner = f'World "{world.name}"'
    tree = nodes.tree_of(world)
    if tree is None:
        return {"color": tuple(world.color), "strength": 1.0}
    background = nodes.shader_of(tree)
    if background is None:
        return {"color": (0.0, 0.0, 0.0), "strength": 1.0}
    if background.type != "BACKGROUND":
        sync.warn(f'{owner}: node "{background.name}" is not converted, the world is black. A Background node is read.')
        return {"color": (0.0, 0.0, 0.0), "strength": 1.0}
    strength = nodes.value(sync, owner, background.inputs["Strength"])
    texture = nodes.source(background.inputs["Color"])
    if texture is None or texture.type != "TEX_ENVIRONMENT":
        if texture is not None and texture.type == "TEX_SKY":
            sync.warn(
                f"{owner}: the Sky Texture is not converted. Bake it to an equirectangular image and use an "
                "Environment Texture with a sun light."
            )
        return {"color": nodes.value(sync, owner, background.inputs["Color"]), "strength": strength}
    return {
        "image": _pixels(sync, owner, texture),
        "matrix": _image_to_world(sync, owner, texture),
        "strength": strength,
    }


def _pixels(sync, owner, node):
    """(H, W, 3) linear colours, row 0 at the bottom."""
    image = node.image
    if image is None:
        raise SyncError(f'{owner}: node "{node.name}" has no image: choose one, or remove the node.')
    if node.projection != "EQUIRECTANGULAR":
        raise SyncError(f'{owner}: node "{node.name}" is a mirror ball: the GPIS engine reads equirectangular images.')
    width, height = image.size
    if width == 0 or height == 0:
        path = bpy.path.abspath(image.filepath, library=image.library)
        raise SyncError(f'{owner}: image "{image.name}" cannot be read from "{path}": is the file there?')
    pixels = np.empty(width * height * image.channels, dtype=np.float32)
    image.pixels.foreach_get(pixels)
    pixels = pixels.reshape(height, width, image.channels)[:, :, :3]
    if image.channels < 3:
        pixels = np.repeat(pixels[:, :, :1], 3, axis=2)
    # Blender converts float images to scene linear when it loads them, images of bytes stay as they are stored.
    if not image.is_float:
        name = image.colorspace_settings.name
        if name == "sRGB":
            pixels = np.where(pixels <= 0.04045, pixels / 12.92, ((pixels + 0.055) / 1.055) ** 2.4)
        elif name not in {"Non-Color", "Raw", "Linear Rec.709"}:
            sync.warn(f'{owner}: image "{image.name}" in colour space {name} is read as if it were linear.')
    return np.ascontiguousarray(pixels, dtype=np.float32)


# Blender's equirectangular image has the direction −x in its middle column; ours is the description's (see api.md).
def _image_to_world(sync, owner, node):
    """(3,3): directions of the image -> directions of the world, from a Mapping node's rotation."""
    lookup = np.eye(3)  # world -> image, the way Blender's nodes go
    mapping = nodes.source(node.inputs["Vector"])
    if mapping is not None and mapping.type == "MAPPING":
        lookup = _rotation(sync, owner, mapping)
        mapping = nodes.source(mapping.inputs["Vector"])
    if mapping is not None and not _is_generated(mapping, node):
        sync.warn(f'{owner}: node "{mapping.name}" before the Environment Texture is not converted.')
    return np.linalg.inv(lookup)


def _is_generated(node, texture):
    """Generated, and Object of no object, are the world's direction; so is no link at all."""
    if node.type != "TEX_COORD":
        return False
    names = {link.from_socket.name for output in node.outputs for link in output.links}
    return names <= {"Generated"} or (names <= {"Generated", "Object"} and node.object is None)


def _rotation(sync, owner, node):
    for name, plain in (("Location", 0.0), ("Scale", 1.0)):
        socket = node.inputs[name]
        if socket.enabled and (socket.is_linked or any(part != plain for part in socket.default_value)):
            sync.warn(f'{owner}: {name} of node "{node.name}" is not converted, only its Rotation is.')
    socket = node.inputs["Rotation"]
    if socket.is_linked:
        sync.warn(f'{owner}: the link on Rotation of node "{node.name}" is not converted.')
    rotation = array(socket.default_value.to_matrix())
    return rotation.T if node.vector_type == "TEXTURE" else rotation
