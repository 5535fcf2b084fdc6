"""Rays at odds with the geometry: along voxel faces, edges and diagonals, grazing, from far away, from the surface.

Exact answer: a plane is the same field from a grid (trilinear interpolation keeps it) and from its formula, so first
hits have one law; a ray along the plane, 5 deviations above it or more, has next to none. Grazing rays at a plane:
where the path is that of a sloping mean m = sin(angle), compared with the formula's plane at the same angle.
"""

import gpis_native as gn
import numpy as np
from statistics_checks import normal_cdf

from stability.verdicts import Cell, few_hits, first_hits, of_cdf, of_sample, within

NODES, VOXEL = 17, 0.25
LENGTH = 0.5
DIRECTIONS = {
    "along a face": ([-2, 0.0, 1.0], [1, 0, 0]),
    "along an edge": ([-2, 0.25, 0.5], [1, 0, 0]),
    "against the axis": ([2, 0.0, 0.75], [-1, 0, 0]),
    "through the nodes": ([-1, -1, 1.5], [1, 1, -1]),
    "in a face, diagonal": ([-2, 0.5, 1.5], [1, 0, -0.6]),
    "down a node line": ([0, 0, 2], [0, 0, -1]),
    "1e-9 off a face": ([-2, 1e-9, 1.0], [1, 1e-9, 0]),
    "1e-15 off the axis": ([-2, 0.0, 1.0], [1, 1e-15, -1e-15]),
    "from far away": ([-2e6, 0.3, 1e6 + 0.9], [2, 0, -1]),
}
ANGLES = [0.0, 1e-12, 1e-9, 1e-6, 1e-3, 0.1, -1e-9]
SPREADS = [1e-6, 1e-3, 0.1, 1.0]


def plane_grid(shift=(0, 0, 0)):
    low = np.full(3, -2.0) + shift
    z = low[2] + VOXEL * np.arange(NODES)
    return gn.GridField(np.broadcast_to(z, (NODES,) * 3).copy(), VOXEL, tuple(low))


BOUNDS = ((-2,) * 3, (2,) * 3)


def process(mean, sigma):
    return gn.GaussianProcess(mean, sigma, gn.SquaredExponential(LENGTH), bounds=BOUNDS)


def grid_cell(name, sigma):
    origin, direction = DIRECTIONS[name]

    def run(n):
        t_max = 1e7 if "far" in name else 8
        grid = first_hits(process(plane_grid(), sigma), n, origin, direction, t_max, seed=5)
        height = origin[2] / sigma
        if abs(direction[2]) < 1e-9 and height >= 5:
            return few_hits(grid, 4 / LENGTH / (2 * np.pi) * np.exp(-0.5 * height**2), "Rice: no hit")
        plane = first_hits(process(gn.PlaneField([0, 0, 0], [0, 0, 1]), sigma), n, origin, direction, t_max, seed=7)
        # float nodes, and positions so far away in double, are off by some 1e-9.
        if sigma <= 1e-6 and np.isfinite(grid["t"]).all() and np.isfinite(plane["t"]).all():
            return within(np.median(grid["t"]), np.median(plane["t"]), 1e-5, "the plane's formula", [grid, plane])
        return of_sample(grid["t"], plane["t"], "the plane's formula", [grid, plane])

    return Cell("rays on a grid, σ/m", name, f"{sigma:g}", run, refusal=False)


def grazing_cell(sigma, angle):
    """From a height of 1.5 σ, as if the plane went on: f falls by the angle alone."""

    def run(n):
        length = 4.0
        gp = gn.GaussianProcess(
            gn.PlaneField([0, 0, 0], [0, 0, 1]), sigma, gn.SquaredExponential(0.5), bounds=((-1, -1, -9), (5, 1, 9))
        )
        direction = [np.cos(angle), 0, -np.sin(angle)]
        hits = first_hits(gp, n, [0, 0, 1.5 * sigma], direction, length, seed=5)
        # The same process seen as one constant mean along the line plus a slope: another field, another march.
        tilted = gn.PlaneField([0, 0, -1.5 * sigma], [-np.sin(angle), 0, np.cos(angle)])
        flat = gn.GaussianProcess(tilted, sigma, gn.SquaredExponential(0.5), bounds=((-1, -1, -9), (5, 1, 9)))
        reference = first_hits(flat, n, [0, 0, 0], [1, 0, 0], length, seed=7, sampler="spectral")
        return of_sample(hits["t"], reference["t"], "spectral, the plane tilted", [hits, reference])

    return Cell("grazing rays, σ/m against the angle", f"{sigma:g}", f"{angle:g}", run, refusal=False)


def leaving_cell(sigma, angle):
    """From the surface, at a grazing angle to the remembered gradient: the slope is tiny, but the ray leaves. Without
    another crossing the path stays outside up to the first return, which two samplers must put at one place. Half of
    the paths of a ray along the surface bend back at once: roots so close are told apart to 1e-4 m, not better."""

    def run(n):
        gp = gn.GaussianProcess(
            gn.PlaneField([0, 0, 0], [0, 0, 1]), sigma, gn.SquaredExponential(0.5), bounds=((-1, -1, -9), (5, 1, 9))
        )
        start = {"value": np.zeros(n), "gradient": np.tile([0.0, 0, 1], (n, 1))}
        direction = [np.cos(angle), 0, np.sin(angle)]
        hits, reference = (
            first_hits(gp, n, [0, 0, 0], direction, 4, start=start, seed=seed, sampler=s)
            for s, seed in (("convolution", 5), ("dense", 7))
        )
        t, other = (np.maximum(h["t"], 1e-4) for h in (hits, reference))
        return of_sample(t, other, "dense", [hits, reference], stated=0.005)

    return Cell("rays that leave the surface, σ/m against the angle", f"{sigma:g}", f"{angle:g}", run, refusal=False)


def starts_cell(offset):
    """From outside, beginning a distance above or below a surface that is all but certain."""

    def run(n):
        sigma = 1e-6
        gp = gn.GaussianProcess(gn.PlaneField([0, 0, 0], [0, 0, 1]), sigma, gn.SquaredExponential(0.5), bounds=BOUNDS)
        hits = first_hits(gp, n, [0, 0, offset * sigma], [0, 0, -1], 1, seed=5)

        def cdf(t):
            # P(no hit before t | outside at the start), f falls with slope 1.
            return 1 - np.exp(log_cdf(offset - t / sigma) - log_cdf(offset))

        return of_cdf(hits["t"], cdf, "Φ(μ/σ) of a falling f", [hits], stated=0.001)

    return Cell("rays that start z σ above the surface", "σ = 1e-6 m", f"{offset:g}", run, refusal=False)


def log_cdf(z):
    """log Φ(z), by its series where Φ is no number."""
    z = np.asarray(z, float)
    far = z < -30
    near = np.log(np.maximum(normal_cdf(np.where(far, 0, z)), 1e-300))
    with np.errstate(divide="ignore", invalid="ignore"):
        tail = -0.5 * z * z - np.log(-z * np.sqrt(2 * np.pi)) + np.log1p(-1 / z**2 + 3 / z**4)
    return np.where(far, np.where(np.isinf(z), -np.inf, tail), near)


def cells():
    return (
        [grid_cell(name, sigma) for name in DIRECTIONS for sigma in SPREADS]
        + [grazing_cell(sigma, angle) for sigma in SPREADS for angle in ANGLES]
        + [leaving_cell(sigma, angle) for sigma in SPREADS for angle in ANGLES if angle >= 0]
        + [starts_cell(z) for z in (-40, -5, -1, 0, 1e-3, 1, 5, 40)]
    )
