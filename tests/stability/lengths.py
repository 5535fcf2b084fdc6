"""Lengths that change within a voxel, and kernels of two scales: what the joint samplers have to follow.

Short at one node among long ones (as where a fit has operands meet), a smooth dab of a brush, tensors that are
independent from node to node, and waves or periods that turn many times within a length. First hits at a mean of .6
deviations against paths drawn by numpy from the covariance (test_covariance.py) at points a few to each local length.
"""

import gpis_native as gn
import numpy as np
from tensor_grids import along_x, isotropic, random_tensors

from stability.verdicts import Cell, first_hits, of_sample

KERNELS = {
    "squared exponential": gn.SquaredExponential(1),
    "rational quadratic": gn.RationalQuadratic(1, 1),
    "matern 3/2": gn.Matern(1.5, 1),
    "matern 5/2": gn.Matern(2.5, 1),
    "wong": gn.Wong(1),
    "sum": 0.5 * gn.SquaredExponential(1) + 0.5 * gn.Matern(2.5, 1),
}
SHORT = [1.0, 0.1, 1e-2, 1e-3, 1e-4]
DABS = [0.5, 0.1, 0.05, 0.02]
TENSORS = [3.0, 8.0, 30.0]
TURNS = [3.0, 10.0, 30.0, 100.0]
MEAN, CLOSE = 0.6, 0.06  # of points, in local lengths
CUBE = ((-1,) * 3, (1,) * 3)
PLACE, DIRECTION = np.array([0.3, -0.2, 0.1]), np.array([0.8, 0.36, 0.48])


def cube(entries_at, nodes):
    axis = np.linspace(-1, 1, nodes)
    entries = entries_at(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1))
    return gn.TensorGridField(entries, axis[1] - axis[0], [-1] * 3)


def spheres(length):
    return np.concatenate([np.repeat((length**2)[..., None], 3, -1), np.zeros((*length.shape, 3))], -1)


def dab(x, short):
    """Lengths of .5, painted short with a brush of radius .3."""
    q = np.clip(np.linalg.norm(x - PLACE, axis=-1) / 0.3, 0, 1)
    return 0.5 * short ** ((1 - q * q) ** 2)


def by_length(length_at, end):
    """Points from 0 to end, CLOSE local lengths apart."""
    t = [0.0]
    while t[-1] < end:
        t.append(t[-1] + CLOSE * length_at(t[-1]))
    return np.array(t)


def cell(family, row, column, process, ray, sampler="auto"):
    """ray(): origin, direction and the points (T,) of the reference, from 0."""

    def run(n):
        n = max(100, n // 2)
        gp, (origin, direction, t) = process(), ray()
        hits = first_hits(gp, n, origin, direction, t[-1], sampler=sampler, seed=5)
        x = origin + t[:, None] * direction
        values, vectors = np.linalg.eigh(gp.covariance(x, x))
        root = (vectors * np.sqrt(np.maximum(values, 0))).T
        paths = MEAN + np.random.default_rng(6).normal(size=(3 * n, len(t))) @ root
        paths = paths[paths[:, 0] > 0]
        below = paths < 0
        reference = np.where(below.any(axis=1), t[np.argmax(below, axis=1)], np.inf)
        stated = 2e-2  # roots between the points of the reference
        return of_sample(hits["t"], reference, "paths from the covariance", [hits], stated=stated)

    return Cell(family, row, column, run)


def at_one_node(kernel, short):
    direction = np.array([0.96, 0.28, 0])

    def process():
        field = along_x(lambda x: isotropic(short if abs(x - 2) < 0.05 else 1.0), 8, 101)
        return gn.GaussianProcess(MEAN, 1, KERNELS[kernel], anisotropy=field, bounds=((-2, -2, -2), (8, 2, 2)))

    def ray():
        # Within a voxel lengths fall in proportion to the distance, down to short² voxels.
        near = np.geomspace(0.02 * short**2, 0.5, int(np.log(25 / short**2) / CLOSE))
        t = np.concatenate([-near[::-1], [0], near]) + near[-1]
        return np.array([2, 0, 0]) - near[-1] * direction, direction, t

    return cell("length at one node, of the others", kernel, f"{short:g}", process, ray)


def under_a_dab(kernel, short):
    def process():
        field = cube(lambda x: spheres(dab(x, short)), 41)
        return gn.GaussianProcess(MEAN, 1, KERNELS[kernel], anisotropy=field, bounds=CUBE)

    def ray():
        origin = PLACE - 0.5 * DIRECTION
        return origin, DIRECTION, by_length(lambda t: dab(origin + t * DIRECTION, short), 1.0)

    return cell("length under a dab, of the others", kernel, f"{short:g}", process, ray)


def between_nodes(kernel, ratio):
    def process():
        field = cube(lambda x: random_tensors(x.shape[:3], ratio=ratio) * 0.04, 11)
        return gn.GaussianProcess(MEAN, 1, KERNELS[kernel], anisotropy=field, bounds=CUBE)

    def ray():
        return PLACE - 0.5 * DIRECTION, DIRECTION, np.linspace(0, 0.6, 600)

    return cell("independent A(x) at nodes: ratio of lengths", kernel, f"{ratio:g}", process, ray)


def of_two_scales(name, turns):
    wave = gn.PlaneWave([turns, 0, 0])
    kernel, sampler = {
        "matern 5/2 × wave": (gn.Matern(2.5, 1) * wave, "auto"),
        "matern 3/2 × wave": (gn.Matern(1.5, 1) * wave, "auto"),
        "matern 5/2 × periodic": (gn.Matern(2.5, 1) * gn.LocallyPeriodic(1, 6 / turns, [1, 0, 0], 1), "auto"),
        "squared exponential + wave, nystrom": (0.5 * gn.SquaredExponential(1) + 0.5 * wave, "nystrom"),
    }[name]

    def process():
        return gn.GaussianProcess(MEAN, 1, kernel, bounds=CUBE)

    def ray():
        end = 1.0 if turns <= 30 else 0.5
        return np.array([-0.6, 0.1, 0.05]), np.array([0.96, 0.28, 0]), np.linspace(0, end, 1 + int(end * max(turns, 10) / 0.05))

    return cell("two scales: turns in a length", name, f"{turns:g}", process, ray, sampler)


def cells():
    return (
        [at_one_node(k, s) for k in KERNELS for s in SHORT]
        + [under_a_dab(k, s) for k in KERNELS for s in DABS]
        + [between_nodes(k, r) for k in KERNELS for r in TENSORS]
        + [
            of_two_scales(name, turns)
            for name in (
                "matern 5/2 × wave",
                "matern 3/2 × wave",
                "matern 5/2 × periodic",
                "squared exponential + wave, nystrom",
            )
            for turns in TURNS
        ]
    )
