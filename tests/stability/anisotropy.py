"""Length scales whose ratio reaches 1000, at any rotation, over a constant mean.

Exact answer: with A = R diag(ℓᵢ²) Rᵀ, the line along d is that of an isotropic process of length scale
ℓ_d = 1/√(dᵀA⁻¹d), and the whitened gradient A^½ ∇f at the hit has that one's law with d̂ = ℓ_d A^{-½} d for its
direction: along d̂ and in the plane across it. Every sampler is compared with the isotropic convolution.
"""

from math import pi

import gpis_native as gn
import numpy as np

from stability.verdicts import Cell, first_hits, of_sample

RATIOS = [1, 3, 10, 100, 1000]
MEAN, LENGTHS = 0.7, 6.0  # in deviations, of the line in its own length scales


def quaternion(axis, angle):
    axis = np.asarray(axis, float) / np.linalg.norm(axis)
    return (np.cos(angle / 2), *(np.sin(angle / 2) * axis))


ROTATIONS = {
    "along the axes": quaternion([0, 0, 1], 0.0),
    "1e-6 off": quaternion([1, -2, 0.5], 1e-6),
    "45 degrees": quaternion([0, 0, 1], pi / 4),
    "oblique": quaternion([1, 2, -0.5], 1.1),
    "upside down": quaternion([0.3, -1, 2], 3.0),
}
SHAPES = {"sheet": lambda r: (1, 1, 1 / r), "needle": lambda r: (1, 1 / r, 1 / r), "blade": lambda r: (1, r**-0.5, 1 / r)}
SERVED = ["convolution", "spectral", "dense", "nystrom", "A(x), nystrom"]
DIRECTION = np.array([0.36, 0.48, 0.8])


def rotation_matrix(q):
    w, x, y, z = q
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def process(sampler, lengths, q, far):
    bounds = (tuple(np.minimum(0, far) - 1e-3), tuple(np.maximum(0, far) + 1e-3))
    if sampler != "A(x), nystrom":
        return gn.GaussianProcess(MEAN, 1, gn.SquaredExponential(lengths, rotation=q), bounds=bounds)
    a = rotation_matrix(q) @ np.diag(np.square(lengths)) @ rotation_matrix(q).T
    entries = [a[0, 0], a[1, 1], a[2, 2], a[0, 1], a[0, 2], a[1, 2]]
    low, size = np.array(bounds[0]), np.array(bounds[1]) - bounds[0]
    field = gn.TensorGridField(np.tile(entries, (3, 3, 3, 1)), tuple(size / 2), tuple(low))
    return gn.GaussianProcess(MEAN, 1, gn.SquaredExponential(1), anisotropy=field, bounds=bounds)


def whitened(hits, lengths, q, d):
    """t per length scale, slope along the ray, and one component across it."""
    hit = np.isfinite(hits["t"])
    r = rotation_matrix(q)
    root = r @ np.diag(lengths) @ r.T
    inward = np.linalg.solve(root, d)
    ell = 1 / np.linalg.norm(inward)
    inward = inward * ell
    across = np.cross(inward, np.roll(inward, 1) + [1, 0, 0])
    across /= np.linalg.norm(across)
    g = hits["gradient"][hit] @ root
    return hits["t"] / ell, g @ inward, g @ across


def cell(shape, rotation, ratio, sampler):
    def run(n):
        n = max(200, n // 5) if "nystrom" in sampler else n
        lengths, q = SHAPES[shape](ratio), ROTATIONS[rotation]
        inward = np.diag(1 / np.array(lengths)) @ rotation_matrix(q).T @ DIRECTION
        ell = 1 / np.linalg.norm(inward)
        t_max = LENGTHS * ell
        gp = process(sampler, lengths, q, DIRECTION * t_max)
        hits = first_hits(gp, n, [0, 0, 0], DIRECTION, t_max, sampler=sampler.split(", ")[-1], seed=5)
        isotropic = gn.GaussianProcess(MEAN, 1, gn.SquaredExponential(1), bounds=((-1,) * 3, (7,) * 3))
        reference = first_hits(isotropic, n, [0, 0, 0], DIRECTION, LENGTHS, sampler="convolution", seed=7)
        ours = whitened(hits, lengths, q, DIRECTION)
        theirs = whitened(reference, (1, 1, 1), (1, 0, 0, 0), DIRECTION)
        names = ("t", "slope", "gradient across")
        parts = [
            of_sample(a, b, f"isotropic: {name}", [hits, reference] if i == 0 else None)
            for i, (a, b, name) in enumerate(zip(ours, theirs, names, strict=True))
        ]
        return parts[0].joined(parts[1]).joined(parts[2])

    return Cell("anisotropy, 1 : ratio", f"{shape}, {rotation}, {sampler}", ratio, run)


def cells():
    return [
        cell(shape, rotation, ratio, sampler)
        for sampler in SERVED
        for shape in SHAPES
        for rotation in (ROTATIONS if sampler in ("convolution", "A(x), nystrom") else ["along the axes", "oblique"])
        for ratio in RATIOS
    ]
