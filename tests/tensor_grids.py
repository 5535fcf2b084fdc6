"""Grids of symmetric positive definite matrices for the tests, and what they mean, independent of the implementation."""

import gpis_native as gn
import numpy as np

VOXEL, ORIGIN = np.array([0.4, 0.2, 0.3]), np.array([-1.2, -1.1, -0.9])


def matrices(entries):
    xx, yy, zz, xy, xz, yz = np.moveaxis(entries, -1, 0)
    return np.stack([np.stack([xx, xy, xz], -1), np.stack([xy, yy, yz], -1), np.stack([xz, yz, zz], -1)], -2)


def entries(m):
    return np.stack([m[..., 0, 0], m[..., 1, 1], m[..., 2, 2], m[..., 0, 1], m[..., 0, 2], m[..., 1, 2]], -1)


def random_tensors(shape, seed=3, ratio=8.0):
    """Symmetric positive definite, with eigenvalues over a range of ratio², in single precision as a grid keeps them."""
    rng = np.random.default_rng(seed)
    q, _ = np.linalg.qr(rng.normal(size=(*shape, 3, 3)))
    scale = ratio ** rng.uniform(-1, 1, (*shape, 3))
    return entries(q * scale[..., None, :] @ np.swapaxes(q, -1, -2)).astype(np.float32).astype(float)


VALUES = random_tensors((6, 11, 12))
VALUES[:, :, 9:] = [2, 1, 0.5, 0.25, 0, -0.125]


def trilinear(x, values=VALUES):
    shape = np.array(values.shape[:3])
    u = np.clip((x - ORIGIN) / VOXEL, 0, shape - 1)
    cell = np.minimum(u.astype(int), shape - 2)
    w = u - cell
    total = np.zeros((len(x), 6))
    for corner in np.ndindex(2, 2, 2):
        total += np.prod(np.where(corner, w, 1 - w), axis=1)[:, None] * values[tuple((cell + corner).T)]
    return total


def points(n=2000, seed=1):
    return np.random.default_rng(seed).uniform(-1.6, 2.6, (n, 3))


GRID = gn.TensorGridField(VALUES, VOXEL, ORIGIN)


def along_x(entries_at, end, nodes=97):
    """A tensor field that varies along x alone, from -2 to end: entries_at(x) -> (6,)."""
    x = np.linspace(-2, end, nodes)
    values = np.array([entries_at(a) for a in x])[:, None, None, :]
    return gn.TensorGridField(np.broadcast_to(values, (nodes, 2, 2, 6)), [x[1] - x[0], 10, 10], [-2, -5, -5])


def isotropic(length):
    return np.array([length**2] * 3 + [0, 0, 0])


def rotating(x):
    """Length scales 3 : 1, turning about z by a right angle in 3 units."""
    c, s = np.cos(x * np.pi / 6), np.sin(x * np.pi / 6)
    r = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]])
    return entries(r @ np.diag([3, 1 / 3, 1]) @ r.T)


def smooth_step(x):
    x = np.clip(x, 0, 1)
    return x * x * (3 - 2 * x)


# Length scales that vary as strongly as the samplers are asked to follow.
VARYING = {
    "length e^{x/4}": along_x(lambda x: isotropic(np.exp(0.25 * x)), 8),
    "length times 4 within one": along_x(lambda x: isotropic(4 ** smooth_step(x - 2)), 8, 641),
    "rotating 3:1": along_x(rotating, 8),
}
