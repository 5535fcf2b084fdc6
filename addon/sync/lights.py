"""Lights -> `lights` of the description."""

import math

import numpy as np

from . import nodes
from .state import array


def add(sync, obj, matrix_world):
    light = obj.data
    matrix = array(matrix_world)
    color, strength = _color(sync, obj)
    power = light.energy * strength * 2.0 ** getattr(light, "exposure", 0.0)
    if not getattr(light, "normalize", True):
        sync.warn(f'Light "{obj.name}" is rendered normalised: the GPIS engine has no other way. Switch Normalize on.')
    if power <= 0 or not np.any(color > 0):
        return  # gives no light
    if not light.use_shadow:
        sync.warn(f'Light "{obj.name}" casts shadows all the same: the GPIS engine has no light without shadows.')
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    placed = matrix.copy()
    placed[:3, :3] /= np.where(scale > 0, scale, 1)
    entry = {"name": obj.name, "type": light.type.lower(), "matrix": placed, "color": color, "power": power}
    if light.type == "SUN":
        entry["angle"] = min(light.angle, math.pi)  # Blender's greatest is π in single precision
    elif light.type == "AREA":
        if not np.all(scale[:2] > 0):
            sync.warn(f'Light "{obj.name}" gives no light: it is scaled to zero.')
            return
        if light.spread < np.pi - 1e-4:
            sync.warn(f'Light "{obj.name}" shines with its full spread: the GPIS engine does not narrow it.')
        size_y = light.size_y if light.shape in {"RECTANGLE", "ELLIPSE"} else light.size
        entry["size"] = (light.size * scale[0], size_y * scale[1])
        entry["shape"] = "ellipse" if light.shape in {"DISK", "ELLIPSE"} else "rectangle"
    else:
        entry["radius"] = light.shadow_soft_size
        if light.type == "SPOT":
            entry["angle"] = min(light.spot_size, math.pi)
            entry["blend"] = light.spot_blend
    sync.description["lights"].append(entry)


def _color(sync, obj):
    """Colour and the factor that a light's nodes put on its power: one Emission node is read."""
    light = obj.data
    color = np.array(light.color, dtype=np.float64)
    if getattr(light, "use_temperature", False):
        color = color * np.array(light.temperature_color, dtype=np.float64)
    tree = nodes.tree_of(light)
    if tree is None:
        return color, 1.0
    node = nodes.shader_of(tree)
    if node is None or node.type != "EMISSION" or any(socket.is_linked for socket in node.inputs):
        sync.warn(f'Light "{obj.name}": its nodes are not read, only one Emission node with plain values is.')
        return color, 1.0
    return color * np.array(node.inputs["Color"].default_value[:3]), node.inputs["Strength"].default_value
