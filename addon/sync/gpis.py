"""GPIS objects: Volume objects with `gpis.enabled` -> a native process and an entry of `objects`."""

import numpy as np

from .. import volume
from ..native import native
from ..paint import conditions
from . import csg, kernel, materials
from .kernel import check_positive
from .state import SyncError, array

# Deviations between the surface and the bounds below which a visible part of the surfaces is cut off (one in 740).
_SAFE_DEVIATIONS = 3.0
# … beyond which the surface is at a point once in a billion, for the whole space that a narrow band leaves constant.
_NARROW_BAND_DEVIATIONS = 6.0


def add(sync, obj, matrix_world):
    if not obj.gpis.enabled:
        sync.warn(f'Volume object "{obj.name}" is left out: switch GPIS on in its Object properties to render it.')
        return
    matrix = array(matrix_world)
    owner = f'GPIS object "{obj.name}"'
    scale = np.linalg.norm(matrix[:3, :3], axis=0)
    if abs(np.linalg.det(matrix[:3, :3])) <= 1e-12 * max(scale.max(), 1e-30) ** 3:
        raise SyncError(f"{owner} is scaled to zero along an axis (scale {_words(scale)}): clear its scale.")
    composed = composed_of(sync, obj)
    slots = len(materials.of_object(sync, obj))
    if slots > 1:
        sync.warn(f"{owner} has {slots} material slots: the first is its micro-BRDF, the others are not used.")
    entry = {} if not obj.gpis.use_albedo else {"albedo": _albedo(owner, obj)}
    sync.description["objects"].append(
        entry
        | {
            "name": obj.name,
            "type": "gpis",
            "process": composed.process,
            "matrix": matrix,
            "materials": composed.materials,
            "memory": obj.gpis.memory.lower().replace("_plus", "+"),
            "sampler": obj.gpis.sampler.lower(),
        }
    )


def composed_of(sync, obj):
    """The object with the operands of its CSG list, as a sync.csg.Composed in its own space."""

    def process_and_bounds(one):
        return process_of(sync, one), bounds_of(one)

    return csg.compose(sync, f'GPIS object "{obj.name}"', obj, array(obj.matrix_world), process_and_bounds)


def process_of(sync, obj):
    """The native process of a GPIS object; SyncError with a sentence that names it."""
    owner = f'GPIS object "{obj.name}"'
    try:
        return _process(sync, owner, obj)
    except (ValueError, RuntimeError, OSError) as error:
        text = str(error)
        raise SyncError(text if text.startswith(owner) else f"{owner}: {text}") from error


def bounds_of(obj):
    """The corners of the box outside of which a GPIS object has no surface, in its space."""
    path = volume.path_of(obj.data)
    grid = next(grid for grid in volume.grids(path) if grid["name"] == obj.gpis.mean_grid)
    return grid["min"], grid["max"]


def _process(sync, owner, obj):
    settings = obj.gpis
    path = volume.path_of(obj.data)
    grids = {grid["name"]: grid for grid in volume.grids(path)}
    mean_grid = _grid(owner, "mean", settings.mean_grid, grids, path)
    gn = native()
    mean = gn.VdbField(path, settings.mean_grid, meaning="value")
    if settings.sigma_source == "CONSTANT":
        check_positive(owner, "standard deviation σ", settings.sigma)
        sigma = gn.ConstantField(settings.sigma)
        _warn_if_cut(sync, owner, obj, settings.sigma)
    else:
        _grid(owner, "standard deviation", settings.sigma_grid, grids, path)
        if settings.sigma_meaning == "UNSET":
            raise SyncError(
                f'{owner}: say whether grid "{settings.sigma_grid}" holds the standard deviation σ or the variance σ² '
                "(Object properties, GPIS). Files differ, and names do not tell."
            )
        check_positive(owner, "factor on σ", settings.sigma_factor)
        meaning = "variance" if settings.sigma_meaning == "VARIANCE" else "value"
        sigma = gn.VdbField(path, settings.sigma_grid, meaning=meaning)
        if settings.sigma_factor != 1:
            sigma = settings.sigma_factor * sigma
    return gn.GaussianProcess(
        mean,
        sigma,
        kernel.describe(owner, settings),
        anisotropy=_anisotropy(owner, settings, path),
        conditions=conditions.arrays(obj),
        bounds=(mean_grid["min"], mean_grid["max"]),
    )


def _anisotropy(owner, settings, path):
    """The tensor field of squared length scales, or None where they are the same everywhere."""
    if settings.anisotropy != "GRID":
        return None
    missing = [name for name in volume.ANISOTROPY_GRIDS if name not in volume.vector_grid_names(path)]
    if missing:
        raise SyncError(
            f'{owner}: its anisotropy is to come from grids, but "{path}" holds no '
            f"{' and no '.join(missing)}: paint it, or choose Uniform or Axes (Object properties, GPIS, Anisotropy)."
        )
    return native().VdbTensorField(path)


def _albedo(owner, obj):
    path = volume.path_of(obj.data)
    if "albedo" not in volume.vector_grid_names(path):
        raise SyncError(
            f'{owner}: its albedo is to come from a grid, but "{path}" holds no albedo: paint it, or switch Albedo Grid off '
            "(Object properties, GPIS)."
        )
    try:
        return native().VdbColorField(path, "albedo")
    except (ValueError, OSError) as error:
        raise SyncError(f"{owner}: {error}") from error


def _grid(owner, what, name, grids, path):
    if not name:
        raise SyncError(f"{owner}: choose the grid of the {what} (Object properties, GPIS); {_list(grids)}.")
    if name not in grids:
        raise SyncError(f'{owner}: there is no grid "{name}" for the {what} in "{path}"; {_list(grids)}.')
    return grids[name]


def _warn_if_cut(sync, owner, obj, sigma):
    band, margin = obj.gpis.bake_narrow_band, obj.gpis.bake_margin
    if 0 < band < _NARROW_BAND_DEVIATIONS * sigma:
        sync.warn(
            f"{owner}: its narrow band of {band:.3g} is less than {_NARROW_BAND_DEVIATIONS:g} σ, and the mean is constant beyond: "
            f"the surface also appears there. Bake with a narrow band of {_NARROW_BAND_DEVIATIONS * sigma:.3g} or more."
        )
    if not 0 < margin < _SAFE_DEVIATIONS * sigma:
        return
    again = " Bake again: the margin then follows σ." if obj.gpis.source is not None else ""
    sync.warn(
        f"{owner}: σ = {sigma:.3g} reaches beyond the baked margin of {margin:.3g}, the surface is cut off at the bounds.{again}"
    )


def _list(grids):
    return "the file holds " + (", ".join(f'"{name}"' for name in sorted(grids)) or "no grids")


def _words(vector):
    return ", ".join(f"{part:.3g}" for part in vector)
