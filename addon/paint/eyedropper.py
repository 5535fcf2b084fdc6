"""Takes the value of a brush from the surface."""

import numpy as np

from ..viewport import colour
from . import stroke as strokes
from .settings import LEAST_LENGTH


def take(scene, obj, brush, fields, found):
    """Give the brush the value of its channel under the mouse; what it was given, in words. ValueError with a sentence
    where a channel has none."""
    if brush.channel == "MEAN":
        raise ValueError("The mean has no value to take: its brushes move the surface from where it is. Type their height.")
    if brush.channel == "CONDITION":
        raise ValueError("Condition points have no value to take: a click pins the surface, with Ctrl it erases.")
    channel = brush.channel.lower()
    value = fields.values(channel, [found.location])[0]
    if channel == "albedo":
        brush.color = value
        return "albedo " + ", ".join(f"{part:.2f}" for part in brush.color)
    if channel == "anisotropy":
        direction = combed_along(strokes.read(obj.data.gpis_strokes), found.location)
        brush.ratios = ratios(value, found.normal, direction)
        return " : ".join(f"{length:.3g}" for length in brush.ratios) + " (along, across, normal)"
    # 0 in the brush would follow the object.
    setattr(brush, "sigma" if channel == "deviation" else "length_scale", max(value, LEAST_LENGTH))
    return f"{'σ' if channel == 'deviation' else 'ℓ'} {colour.length(scene, value)}"


def ratios(entries, normal, direction=None):
    """Lengths along a stroke, across it and along the normal, the shortest 1, with which a comb in this direction makes
    the tensor A (xx, yy, zz, xy, xz, yz). Without a direction the longer one in the surface counts as along."""
    xx, yy, zz, xy, xz, yz = entries
    a = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    third = np.asarray(normal) / np.linalg.norm(normal)
    along = None if direction is None else np.asarray(direction) - third * (third @ np.asarray(direction))
    if along is None or np.linalg.norm(along) < 1e-6 * np.linalg.norm(direction):
        plane = np.linalg.svd(third[None])[2][1:]  # two directions in the surface
        along = np.linalg.eigh(plane @ a @ plane.T)[1][:, 1] @ plane
    along = along / np.linalg.norm(along)
    axes = np.array([along, np.cross(third, along), third])
    lengths = np.sqrt(np.einsum("ij,jk,ik->i", axes, a, axes))
    return lengths / lengths.min()


def combed_along(painted, location):
    """The direction in which a place in object space was last combed; None where it was not."""
    for stroke in reversed(painted):
        brush, dabs = stroke.brush, stroke.dabs
        if brush.channel == "anisotropy" and brush.operation in strokes.WHOLE:
            return None  # made anew, mirrored or copied: by other strokes than those before
        if brush.operation != "comb":
            continue
        signs = [np.ones(3)]
        for axis in np.flatnonzero(brush.symmetry):
            signs += [sign * np.where(np.arange(3) == axis, -1.0, 1.0) for sign in signs]
        distances = np.array([np.linalg.norm(location - dabs.centers * sign, axis=1) for sign in signs])
        nearest = distances.argmin(axis=0)
        reached = np.flatnonzero(distances.min(axis=0) < dabs.radii)
        if len(reached):
            return dabs.directions[reached[-1]] * signs[nearest[reached[-1]]]
    return None
