"""A realisation of an object for the viewport: sampled on a thread, again after each change. No Blender type on the
thread: the process is made before it starts."""

import threading

import bpy
import numpy as np

from .. import sync
from ..native import native
from .areas import tag_redraw

# Nodes along the longest side, and the seed: the same noise after each stroke, so that only what was painted changes.
_RESOLUTION = 64
_SEED = 0
_POLL = 0.1

# name of the object -> Sampling, the last one asked for.
_of = {}


class Sampling:
    """vertices, normals (N, 3) and triangles (M, 3) when `done`; None if there was nothing to sample."""

    def __init__(self, key, process, bounds):
        self.key = key
        self.done = False
        self.vertices = self.normals = self.triangles = None
        self._stop = False
        self._thread = threading.Thread(target=self._work, args=(process, bounds), name="gpis-sample", daemon=True)
        self._thread.start()

    def stop(self):
        self._stop = True

    def _work(self, process, bounds):
        try:
            grid = process.realisation(bounds, _RESOLUTION, _SEED, progress=lambda fraction: not self._stop)
            if grid is None:
                return
            shape = grid["realisation"], grid["voxel_size"], grid["origin"]
            vertices, self.triangles = native().level_set_mesh(*shape)
            gradients = native().GridField(*shape).gradient(vertices)
            self.normals = gradients / np.maximum(np.linalg.norm(gradients, axis=1, keepdims=True), 1e-12)
            self.vertices = vertices
        finally:
            self.done = True


def of(context, obj):
    """The Sampling of an object as it is now, perhaps not done yet; None where it has no process (the render says why)."""
    key = _key(obj)
    known = _of.get(obj.name_full)
    if known is not None:
        if known.key == key:
            return known
        known.stop()
    try:
        process = sync.gpis.process_of(sync.Sync(context.evaluated_depsgraph_get()), obj)
        _of[obj.name_full] = Sampling(key, process, sync.gpis.bounds_of(obj))
    except (ValueError, OSError, RuntimeError):
        return None
    if not bpy.app.timers.is_registered(_poll):
        bpy.app.timers.register(_poll, first_interval=_POLL)
    return _of[obj.name_full]


def _key(obj):
    """All that a realisation depends on: the file and the settings."""
    settings = obj.gpis
    values = [obj.data.filepath, len(settings.conditions)]
    for prop in settings.bl_rna.properties:
        if prop.type not in {"POINTER", "COLLECTION"}:
            value = getattr(settings, prop.identifier)
            values.append(tuple(value) if getattr(prop, "is_array", False) else value)
    return tuple(values)


def _poll():
    if all(sampling.done for sampling in _of.values()):
        tag_redraw()
        return None
    return _POLL


def forget():
    for sampling in _of.values():
        sampling.stop()
    _of.clear()
