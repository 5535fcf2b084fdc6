"""The mean surface of a GPIS object as triangles, made once for each file, and what its points hold."""

import os

import numpy as np

from .. import volume
from ..native import native

# More triangles than a viewport needs: larger grids are read at every second, third … node.
_MOST_NODES = 2_000_000

# (path, time of change, grid) -> Surface
_cache = {}


class Surface:
    """vertices (N, 3), normals (N, 3) towards the outside, triangles (M, 3), in object space."""

    def __init__(self, path, grid):
        read = native().read_vdb(path, names=[grid])
        step = max(1, int(np.ceil((read[grid].size / _MOST_NODES) ** (1 / 3))))
        values = np.ascontiguousarray(read[grid][::step, ::step, ::step])
        voxel_size = tuple(np.broadcast_to(np.asarray(read["voxel_size"], dtype=np.float64) * step, 3))
        self.path = path
        self.low, self.high = np.asarray(read["origin"]), None
        self.high = self.low + np.asarray(voxel_size) * (np.array(values.shape) - 1)
        self.vertices, self.triangles = native().level_set_mesh(values, voxel_size, tuple(read["origin"]))
        self.gradients = native().GridField(values, voxel_size, tuple(read["origin"])).gradient(self.vertices)
        length = np.linalg.norm(self.gradients, axis=1, keepdims=True)
        self.normals = self.gradients / np.maximum(length, 1e-12)


def of(obj):
    """The Surface of an object's mean, or None where there is none to show (the panel says why)."""
    settings = obj.gpis
    try:
        path = volume.path_of(obj.data)
        key = (path, os.stat(path).st_mtime_ns, settings.mean_grid)
        if key not in _cache:
            for old in [known for known in _cache if known[2] == settings.mean_grid and not _shown(known[0])]:
                del _cache[old]
            _cache[key] = Surface(path, settings.mean_grid) if settings.mean_grid else None
        return _cache[key]
    except (ValueError, OSError, RuntimeError):
        return None


def _shown(path):
    import bpy

    return any(
        data.filepath and os.path.normpath(bpy.path.abspath(data.filepath, library=data.library)) == path
        for data in bpy.data.volumes
    )


def forget():
    _cache.clear()
