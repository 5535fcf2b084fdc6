"""Blender's evaluated scene -> the scene description of the native renderer (a plain dict), one file per kind.

Whatever cannot be expressed is said: a sentence in `Sync.warnings` where the picture is still what an artist would
accept, a SyncError where it is not.
"""

import re

from . import camera, gpis, lights, meshes, settings, world
from .state import Sync, SyncError

__all__ = ["Sync", "SyncError", "describe", "explain"]


def describe(depsgraph, width, height):
    """The description of a frame of `width` × `height` pixels, as a Sync (its `description`, `warnings`)."""
    sync = Sync(depsgraph)
    sync.description["settings"] = settings.describe(sync)
    sync.description["camera"] = camera.describe(sync, width, height)
    sync.description["world"] = world.describe(sync)
    for instance in depsgraph.object_instances:
        if instance.show_self:
            _add(sync, instance.object, instance.matrix_world)
    return sync


def _add(sync, obj, matrix_world):
    if obj.type == "LIGHT":
        lights.add(sync, obj, matrix_world)
    elif obj.type == "MESH":
        meshes.add(sync, obj, matrix_world)
    elif obj.type == "VOLUME":
        gpis.add(sync, obj, matrix_world)
    elif obj.type in {"CURVES", "POINTCLOUD", "GPENCIL", "GREASEPENCIL"}:
        sync.warn(f'Object "{obj.name}" is left out: the GPIS engine does not render objects of type {obj.type}.')


def explain(sync, error):
    """The sentence of a native error, with the names an artist knows in place of paths such as `objects[2]`."""
    text = str(error)
    for group in ("objects", "lights"):

        def name(match, entries=sync.description[group]):
            index = int(match.group(1))
            return f'"{entries[index]["name"]}"' if index < len(entries) else match.group(0)

        text = re.sub(rf"\b{group}\[(\d+)\]", name, text)
    return text
