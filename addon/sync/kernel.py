"""Kernel settings of a GPIS object -> a native kernel."""

import math

import numpy as np
from mathutils import Euler

from ..native import native
from .state import SyncError

# What an infinity that is typed into a panel becomes: Blender keeps the largest number of single precision.
_INFINITE = float(np.finfo(np.float32).max)


def describe(owner, settings):
    """The native kernel; `owner` begins the sentences of what is refused."""
    gn = native()
    length_scale, rotation = length_scales(owner, settings)
    if settings.kernel == "MATERN_3_2":
        return gn.Matern(1.5, length_scale, rotation=rotation)
    if settings.kernel == "MATERN_5_2":
        return gn.Matern(2.5, length_scale, rotation=rotation)
    if settings.kernel == "RATIONAL_QUADRATIC":
        check_positive(owner, "alpha α", settings.alpha)
        return gn.RationalQuadratic(settings.alpha, length_scale, rotation=rotation)
    if settings.kernel == "LOCALLY_PERIODIC":
        return _locally_periodic(owner, settings, length_scale, rotation)
    if settings.kernel == "WONG":
        return gn.Wong(length_scale, rotation=rotation)
    return gn.SquaredExponential(length_scale, rotation=rotation)


def _locally_periodic(owner, settings, length_scale, rotation):
    if settings.anisotropy == "GRID":
        raise SyncError(
            f"{owner}: the kernel Locally Periodic takes no anisotropy from grids: choose another kernel, or Uniform or "
            "Axes (Object properties, GPIS, Anisotropy)."
        )
    check_positive(owner, "period", settings.period)
    axis = np.array(settings.axis, dtype=np.float64)
    if not np.linalg.norm(axis) > 0:
        raise SyncError(f"{owner}: the axis of the ridges is (0, 0, 0), it must point somewhere.")
    return native().LocallyPeriodic(
        length_scale, settings.period, axis / np.linalg.norm(axis), settings.periodic_scale, rotation=rotation
    )


def length_scales(owner, settings):
    """(number or three numbers, quaternion (w, x, y, z) or None) as the native kernels take them."""
    if settings.anisotropy == "GRID":
        # The grid holds lengths, the kernel's own is then a factor on them.
        check_positive(owner, "factor on the length scales", settings.anisotropy_factor)
        return settings.anisotropy_factor, None
    check_positive(owner, "length scale ℓ", settings.length_scale)
    if settings.anisotropy == "UNIFORM":
        return settings.length_scale, None
    if all(settings.infinite):
        raise SyncError(f"{owner}: its length scale is infinite along all three axes, one of them must be finite.")
    lengths = []
    for axis, ratio, infinite in zip("XYZ", settings.ratios, settings.infinite, strict=True):
        if not infinite:
            check_positive(owner, f"ratio of the length scale along {axis}", ratio)
        lengths.append(math.inf if infinite else settings.length_scale * ratio)
    return tuple(lengths), tuple(Euler(settings.rotation).to_quaternion())


def check_positive(owner, what, value):
    if not value > 0:
        raise SyncError(f"{owner}: the {what} is {value:g}, it must be above 0.")
    if value >= _INFINITE:
        raise SyncError(f"{owner}: the {what} is infinite, it must be a finite number.")
