"""Mean fields of the Add menu: signed distances on grids, positive outside, around the origin of the object."""

from dataclasses import dataclass

import bmesh
import numpy as np
from mathutils import Matrix

from ..native import native

# Of the length over which two lobes of a cloud melt together, in radii of the cloud.
_MELT = 0.12
# Lobes of a cloud: centre and radius, in radii of the cloud.
_LOBES = (
    ((0.0, 0.0, 0.0), 0.55),
    ((0.5, 0.1, -0.08), 0.42),
    ((-0.48, 0.12, -0.1), 0.44),
    ((0.12, -0.35, 0.02), 0.40),
    ((-0.12, 0.36, 0.05), 0.40),
    ((0.2, 0.05, 0.34), 0.36),
    ((-0.24, -0.1, 0.26), 0.32),
    ((0.82, 0.02, -0.18), 0.24),
    ((-0.8, -0.04, -0.2), 0.26),
)


@dataclass(frozen=True)
class Shape:
    """`size` (3,) is that of the surface for a radius of 1; sigma and length_scale start at these parts of the radius."""

    size: tuple
    centre: tuple = (0.0, 0.0, 0.0)
    sigma: float = 0.04
    length_scale: float = 0.2
    kernel: str = "SQUARED_EXPONENTIAL"
    infinite: tuple = (False, False, False)


SHAPES = {
    "SPHERE": Shape((2.0, 2.0, 2.0)),
    "BOX": Shape((2.0, 2.0, 2.0)),
    "SUZANNE": Shape((2.0, 2.0, 2.0)),
    "HEIGHT_FIELD": Shape((2.0, 2.0, 0.2), (0.0, 0.0, -0.1), length_scale=0.1, infinite=(False, False, True)),
    "CLOUD": Shape((2.2, 1.6, 1.4), sigma=0.16, length_scale=0.16, kernel="RATIONAL_QUADRATIC"),
}


def write(kind, radius, path, *, resolution, margin, narrow_band=0.0):
    """Write the grid `mean` of a shape to a new .vdb, `resolution` nodes along its longest side; returns the voxel size.

    Distances beyond `narrow_band` (0: none) are cut off there.
    """
    if kind == "SUZANNE":
        return _write_suzanne(radius, path, resolution, margin, narrow_band)
    shape = SHAPES[kind]
    half = radius * np.array(shape.size) / 2 + margin
    voxel_size = 2 * half.max() / (resolution - 1)
    counts = np.ceil(2 * half / voxel_size - 1e-9).astype(int) + 1
    origin = radius * np.array(shape.centre) - voxel_size * (counts - 1) / 2
    axes = [start + voxel_size * np.arange(count) for start, count in zip(origin, counts, strict=True)]
    x, y, z = np.meshgrid(*axes, indexing="ij", sparse=True)
    if kind == "SPHERE":
        mean = np.sqrt(x * x + y * y + z * z) - radius
    elif kind == "CLOUD":
        mean = _cloud(x / radius, y / radius, z / radius) * radius
    else:
        mean = _box((x, y, z), radius * np.array(shape.centre), radius * np.array(shape.size) / 2)
    if narrow_band:
        check_narrow_band(narrow_band, voxel_size)
        mean = np.clip(mean, -narrow_band, narrow_band)
    native().write_vdb(str(path), {"mean": mean, "origin": tuple(origin), "voxel_size": float(voxel_size)})
    return float(voxel_size)


def check_narrow_band(narrow_band, voxel_size):
    if narrow_band < 3 * voxel_size:
        raise ValueError(
            f"the narrow band is {narrow_band:.3g}; with voxels of {voxel_size:.3g} it takes at least three of them, "
            f"{3 * voxel_size:.3g}, or 0 for the whole box."
        )


def _box(at, centre, half):
    outside, inside = 0.0, -np.inf
    for coordinate, middle, extent in zip(at, centre, half, strict=True):
        beyond = np.abs(coordinate - middle) - extent
        outside = outside + np.maximum(beyond, 0) ** 2
        inside = np.maximum(inside, beyond)
    return np.sqrt(outside) + np.minimum(inside, 0)


def _cloud(x, y, z):
    """Spheres melted together: a smooth minimum of their distances, -m log Σ exp(-d/m)."""
    total = 0.0
    for (a, b, c), radius in _LOBES:
        distance = np.sqrt((x - a) ** 2 + (y - b) ** 2 + (z - c) ** 2) - radius
        total = total + np.exp(-distance / _MELT)
    return -_MELT * np.log(total)


def _write_suzanne(radius, path, resolution, margin, narrow_band):
    mesh = bmesh.new()
    try:
        bmesh.ops.create_monkey(mesh, matrix=Matrix.Scale(radius, 4))
        bmesh.ops.subdivide_edges(mesh, edges=mesh.edges, cuts=2, use_grid_fill=True, smooth=1.0, smooth_falloff="LINEAR")
        bmesh.ops.triangulate(mesh, faces=mesh.faces)
        mesh.verts.index_update()
        vertices = np.array([vertex.co for vertex in mesh.verts], dtype=np.float64)
        triangles = np.array([[vertex.index for vertex in face.verts] for face in mesh.faces])
    finally:
        mesh.free()
    report = native().bake_mesh_distance(
        vertices, triangles, str(path), resolution=resolution, margin=margin, narrow_band=narrow_band
    )
    return report["voxel_size"]
