"""Colour maps and numbers of the overlay: which colour a value has, and how it is written."""

import bpy
import numpy as np

# Viridis (van der Walt and Smith 2015), at nine equal distances: equal steps look equally large, also to the colour-blind.
_VIRIDIS = np.array(
    [
        (0.267, 0.005, 0.329),
        (0.279, 0.175, 0.483),
        (0.230, 0.322, 0.546),
        (0.173, 0.449, 0.558),
        (0.128, 0.567, 0.551),
        (0.158, 0.684, 0.502),
        (0.369, 0.789, 0.383),
        (0.678, 0.864, 0.190),
        (0.993, 0.906, 0.144),
    ]
)


def of(parts):
    """Colours (N, 3) of numbers 0 to 1."""
    at = np.clip(parts, 0.0, 1.0) * (len(_VIRIDIS) - 1)
    low = np.minimum(at.astype(int), len(_VIRIDIS) - 2)
    part = (at - low)[:, None]
    return (1 - part) * _VIRIDIS[low] + part * _VIRIDIS[low + 1]


def log_range(values, *others):
    """(low, high) around positive values, at least a factor of two wide, for a map of their logarithms."""
    known = np.concatenate([np.ravel(values), np.array(others, dtype=np.float64)])
    known = known[np.isfinite(known) & (known > 0)]
    if known.size == 0:
        return 0.5, 2.0
    low, high = float(known.min()), float(known.max())
    if high < 2 * low:
        middle = np.sqrt(low * high)
        low, high = middle / np.sqrt(2), middle * np.sqrt(2)
    return low, high


def widened(span, values):
    """A range that holds these values too, with room for more of them, as each change of it recolours all."""
    low, high = span
    least, most = float(values.min(initial=np.inf)), float(values.max(initial=0))
    if 0 < least < 0.99 * low:
        low = least / 2
    if 1.01 * high < most < np.inf:
        high = 2 * most
    return low, high


def log_parts(values, low, high):
    return np.log(np.maximum(values, 1e-300) / low) / np.log(high / low)


def length(scene, value):
    """A length in the scene's units."""
    units = scene.unit_settings
    return bpy.utils.units.to_string(units.system, "LENGTH", float(value) * units.scale_length, precision=3).strip()
