"""Volume datablocks and their .vdb files: where the file is, which grids it holds."""

import hashlib
import os
import re
from pathlib import Path

import bpy

from .native import native

# Grids of A(x), the squared length scales: (xx, yy, zz) and (xy, xz, yz).
ANISOTROPY_GRIDS = ("anisotropy_diagonal", "anisotropy_offdiagonal")

_BASE_PREFIX = "gpis_base_"

# (path, time of change, size) -> list of grids: panels ask at every redraw.
_grids = {}


def path_of(data):
    """Absolute path of a Volume's file at the current frame; ValueError or FileNotFoundError with a sentence."""
    if not data.filepath:
        raise ValueError(f'Volume "{data.name}" has no file: choose a .vdb in its Object Data properties.')
    path = bpy.path.abspath(data.filepath, library=data.library)
    if data.is_sequence:
        data.grids.load()  # Blender's own rule of which file a frame has
        path = bpy.path.abspath(data.grids.frame_filepath, library=data.library)
    path = os.path.normpath(path)
    if not os.path.isfile(path):
        if data.packed_file:
            return unpacked(data)
        raise FileNotFoundError(f'the file "{path}" of volume "{data.name}" is not there.')
    return path


def unpacked(data):
    """Path of a packed file's bytes, written out under Blender's temporary folder: Blender packs volumes, but cannot
    read what it has packed. Other bytes get another path, for it caches files by their paths."""
    content = data.packed_file.data
    name = re.sub(r"(\.v\d{4,})?(\.vdb)?$", ".v0001.vdb", bpy.path.basename(data.filepath), count=1)
    path = Path(bpy.app.tempdir, "gpis", hashlib.sha256(content).hexdigest()[:16], name)
    if not path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_bytes(content)
    return str(path)


def _all_grids(path):
    stat = os.stat(path)
    key = (path, stat.st_mtime_ns, stat.st_size)
    if key not in _grids:
        _grids[key] = [grid for grid in native().vdb_grids(path) if grid["min"] is not None]
    return _grids[key]


def grids(path):
    """The scalar grids of a .vdb that hold anything, as the native `vdb_grids` describes them; without what a painted
    file keeps of them to go back to."""
    return [
        grid
        for grid in _all_grids(path)
        if grid["type"] in {"float", "double"} and not grid["name"].startswith(_BASE_PREFIX)
    ]


def all_grid_names(path):
    return [grid["name"] for grid in _all_grids(path)]


def vector_grid_names(path):
    """Names of the grids of a .vdb that hold vectors, and anything at all."""
    return [grid["name"] for grid in _all_grids(path) if grid["type"].startswith("vec3")]


def grid_names(data):
    """Names for the lists of a panel: empty where the file cannot be read (the panel says why)."""
    try:
        return [grid["name"] for grid in grids(path_of(data))]
    except (ValueError, OSError, RuntimeError):
        return []


def least(path, name):
    """The least value of a grid of numbers; None where there is no such grid or file."""
    if not os.path.isfile(path):
        return None
    return next((grid["value_range"][0] for grid in grids(path) if grid["name"] == name), None)


def size(path, name):
    """Longest side of a grid's bounds in object units."""
    for grid in grids(path):
        if grid["name"] == name:
            return max(high - low for low, high in zip(grid["min"], grid["max"], strict=True))
    raise ValueError(f'There is no grid "{name}" in "{path}".')
