"""More room around a mean: a larger σ sends the surface further out than the grid goes."""

import bpy
import numpy as np

from .. import volume
from ..native import native
from . import files

# Deviations of room below which a grid is extended, and up to which.
_LEAST_DEVIATIONS = 3.0
_DEVIATIONS = 4.0


def ensure_margin(obj, sigma):
    """Room for a surface of this deviation, where the file is one that was baked here; True where it grew."""
    settings = obj.gpis
    if not obj.data.gpis_baked or not 0 < settings.bake_margin < _LEAST_DEVIATIONS * sigma:
        return False
    extend(obj, _DEVIATIONS * sigma - settings.bake_margin)
    return True


def extend(obj, by):
    """Write the object's grids with `by` more room on all sides into a new file."""
    path = volume.path_of(obj.data)
    grids = native().read_vdb(path)
    voxel_size = np.broadcast_to(np.asarray(grids.pop("voxel_size"), dtype=np.float64), 3)
    origin = np.asarray(grids.pop("origin"), dtype=np.float64)
    counts = np.ceil(by / voxel_size).astype(int)
    mean_grid = obj.gpis.mean_grid
    wider = {name: _padded(values, counts) for name, values in grids.items()}
    wider[mean_grid] = wider[mean_grid] + _distance(wider[mean_grid].shape, counts, voxel_size)
    target = files.new_path(obj.data.name)
    native().write_vdb(str(target), {**wider, "origin": tuple(origin - counts * voxel_size), "voxel_size": tuple(voxel_size)})
    if len([other for other in bpy.data.objects if other.data == obj.data]) > 1:
        obj.data = obj.data.copy()
    files.point(obj.data, target)
    obj.gpis.bake_margin += float(min(counts * voxel_size))


def _padded(values, counts):
    width = [(count, count) for count in counts] + [(0, 0)] * (values.ndim - 3)
    return np.pad(values, width, mode="edge")


def _distance(shape, counts, voxel_size):
    """How far the nodes are from the former grid: what a signed distance gains outside of it, at most."""
    total = 0.0
    for axis, (nodes, count, step) in enumerate(zip(shape, counts, voxel_size, strict=True)):
        index = np.arange(nodes)
        beyond = step * np.maximum(np.maximum(count - index, index - (nodes - 1 - count)), 0)
        total = total + beyond.reshape([-1 if i == axis else 1 for i in range(3)]) ** 2
    return np.sqrt(total)
