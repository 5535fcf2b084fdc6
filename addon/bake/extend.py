"""More room around a mean: a larger σ sends the surface further out than the grid goes."""

import numpy as np

from ..paint import bake as painting

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
    """The object's grids with `by` more room on all sides, in a new file; what was painted stays."""
    before = np.array(painting.fields(obj).bounds())
    painting.extend(obj, by)
    after = np.array(painting.fields(obj).bounds())
    obj.gpis.bake_margin += float(np.abs(after - before).min())
