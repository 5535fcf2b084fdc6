"""Condition points: places that every realisation of the surface goes through, with this normal. They are properties of
the object, so undo, copies and files carry them."""

import numpy as np

from ..viewport.channels import matrices
from . import bake

# Of the deviation there: as good as exact to the eye. For points within a length scale of another one: they all but
# determine one another where the kernel is smooth, and the last digits of a grid would contradict it. Others are exact.
_NOISE = 0.02


def pin(obj, locations, normals=None, slope=None):
    """Pin the surface at places in object space; normals (N, 3), or those of the mean there. `slope`: how steeply the
    process rises, or as the mean does."""
    bake.check(obj)
    locations = _points(locations)
    fields = bake.fields(obj)
    gradients = _gradients(fields, locations)
    deviations = fields.values("deviation", locations)
    reach = np.sqrt(np.linalg.eigvalsh(matrices(fields.values("anisotropy", locations)))[:, 2])
    steepness = np.linalg.norm(gradients, axis=1)
    normals = gradients if normals is None else _points(normals)
    lengths = np.linalg.norm(normals, axis=1)
    if len(normals) != len(locations):
        raise ValueError(f"{len(locations)} condition points have {len(normals)} normals.")
    for place, length in zip(locations, lengths, strict=True):
        if not length > 0:
            words = ", ".join(f"{part:.3g}" for part in place)
            raise ValueError(f"{bake.owner_of(obj)}: the mean has no normal at ({words}); say which one to pin there.")
    for i, place in enumerate(locations):
        known = np.array([point.location for point in obj.gpis.conditions]).reshape(-1, 3)
        crowded = np.any(np.linalg.norm(known - place, axis=1) < reach[i])
        point = obj.gpis.conditions.add()
        point.location = place
        point.normal = normals[i] / lengths[i]
        point.noise = _NOISE * deviations[i] if crowded else 0.0
        point.slope = slope if slope is not None else (steepness[i] if steepness[i] > 0 else 1.0)


def erase(obj, locations, radius):
    """Remove the points within `radius` of one of the places; how many."""
    bake.check(obj)
    locations = _points(locations)
    if not radius > 0:
        raise ValueError(f"The radius to erase in is {radius}: it must be above 0.")
    points = obj.gpis.conditions
    gone = [i for i, point in enumerate(points) if np.any(np.linalg.norm(locations - np.array(point.location), axis=1) < radius)]
    for i in reversed(gone):
        points.remove(i)
    return len(gone)


def arrays(obj):
    """The points as the native process takes them, None where there are none."""
    points = obj.gpis.conditions
    if not points:
        return None
    return {
        "points": np.array([point.location for point in points], dtype=np.float64),
        "values": np.zeros(len(points)),
        "normals": np.array([point.normal for point in points], dtype=np.float64),
        "slopes": np.array([point.slope for point in points], dtype=np.float64),
        "noise": np.array([point.noise for point in points], dtype=np.float64),
    }


def _points(values):
    points = np.asarray(values, dtype=np.float64).reshape(-1, 3)
    if not np.all(np.isfinite(points)):
        raise ValueError("A place or normal of a condition point is not a number.")
    return points


def _gradients(fields, points):
    """∇μ by central differences over a voxel."""
    steps = np.array(fields.voxel_size()) / 2
    columns = []
    for axis in range(3):
        offset = np.zeros(3)
        offset[axis] = steps[axis]
        columns.append((fields.values("mean", points + offset) - fields.values("mean", points - offset)) / (2 * steps[axis]))
    return np.stack(columns, axis=1)
