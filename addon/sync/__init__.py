"""Blender's evaluated scene -> the scene description of the native renderer (a plain dict), one file per kind.

Whatever cannot be expressed is said: a sentence in `Sync.warnings` where the picture is still what an artist would
accept, a SyncError where it is not.
"""

import re

from . import camera, csg, gpis, lights, meshes, settings, world
from .state import Sync, SyncError

__all__ = ["Sync", "SyncError", "describe", "explain"]


def describe(depsgraph, width, height, view=None):
    """The description of a frame of `width` × `height` pixels, as a Sync (its `description`, `warnings`).

    view: the description of the camera of a viewport. It shows what a render of the frame would: not the mesh that a
    GPIS object was made of, though Blender has both there.
    """
    sync = Sync(depsgraph)
    sync.description["settings"] = settings.describe(sync)
    sync.description["camera"] = camera.describe(sync, width, height) if view is None else view
    sync.description["world"] = world.describe(sync)
    # Objects of a collection that is instanced need not be in the scene.
    instanced = [i.object.original for i in depsgraph.object_instances if i.is_instance and i.object.type == "VOLUME"]
    operands = csg.operands([*depsgraph.scene.objects, *instanced])
    for instance in depsgraph.object_instances:
        hidden = view is not None and instance.object.hide_render
        if instance.show_self and not hidden and instance.object.name_full not in operands:
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


def explain(sync, text):
    """A sentence of the native renderer with the names an artist knows in place of paths such as `objects[2].matrix`."""
    for path, owner, name in _owners(sync):
        if path in text:
            text = re.sub(rf"(?<![\w.]){re.escape(path)}\.(?=\w)", lambda _, owner=owner: f"{owner}: ", text)
            text = text.replace(f" of '{name}'", "")
    return text


def _owners(sync):
    """(path in the description, what the artist calls it, the description's own name of it)."""
    description = sync.description
    for i, entry in enumerate(description["objects"]):
        kind = "GPIS object" if entry["type"] == "gpis" else "Object"
        yield f"objects[{i}]", f'{kind} "{entry["name"]}"', entry["name"]
    for i, entry in enumerate(description["lights"]):
        yield f"lights[{i}]", f'Light "{entry["name"]}"', entry["name"]
    for i, name in enumerate(description["materials"]):
        yield f"materials[{i}]", f'Material "{name}"', name
        yield f"materials['{name}']", f'Material "{name}"', name
    for key, name in sync.mesh_owners.items():
        yield f"meshes['{key}']", f'Object "{name}"', key
    yield "camera", f'Camera "{sync.scene.camera.name}"' if sync.scene.camera is not None else "The view", ""
    seen = world.of_frame(sync)
    if seen is not None:
        yield "world", f'World "{seen.name}"', ""
