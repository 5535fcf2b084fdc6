"""Condition points from a length scale apart to the same place, that agree or contradict each other.

Exact answers: the posterior deviation at and beside the points by regression in 2,400 digits (tables.py, with mpmath;
kept in tables.json). Rows that the others determine to 1e-10 of the variance are left out, which never understates a
deviation: it lies between that of exact values and that of values with a noise of 1e-4 deviations. The data are
values of κ(x - c), a function of norm 1 in the kernel's space: whatever rows are left out, the posterior mean m keeps
|m(x) - κ(x - c)| <= deviation(x). Points that contradict each other must be refused where nothing but the contradiction
tells them apart.
"""

import json
from functools import cache
from pathlib import Path

import gpis_native as gn
import numpy as np

from stability import exact_paths
from stability.verdicts import Cell, first_hits, of_sample, within

SPACINGS = [1.0, 0.3, 0.1, 0.03, 0.01, 1e-3, 1e-4, 1e-6, 0.0]
KERNELS = {
    "squared exponential": gn.SquaredExponential(1),
    "matern 3/2": gn.Matern(1.5, 1),
    "matern 5/2": gn.Matern(2.5, 1),
    "rational quadratic": gn.RationalQuadratic(0.7, 1),
}
COUNTS = [2, 12]
BOUNDS = ((-20, -3, -3), (20, 3, 3))


@cache
def tables():
    return json.loads((Path(__file__).parent / "tables.json").read_text())


def points_of(spacing, count):
    return np.array([[spacing * i, 0.0, 0.0] for i in range(count)])


def data(kernel, x):
    """κ(x - c), c off the points."""
    x = np.asarray(x)
    return KERNELS[kernel](np.stack([x, 0 * x, 0 * x], axis=1), [[0.62, 0.5, 0.0]])[:, 0]


def process(kernel, points, values, **more):
    return gn.GaussianProcess(0.0, 1, KERNELS[kernel], bounds=BOUNDS, conditions={"points": points, "values": values} | more)


def gram_condition(kernel, points):
    return float(np.linalg.cond(KERNELS[kernel](points, points)))


def posterior_cell(kernel, count, spacing):
    def run(_):
        entry = tables()["posterior"][f"{kernel}, {count}, {spacing:g}"]
        points = points_of(spacing, count)
        gp = process(kernel, points, data(kernel, points[:, 0]))
        x = np.array(entry["x"])
        mean, variance = gp.posterior(np.stack([x, 0 * x, 0 * x], axis=1))
        deviation = np.sqrt(np.maximum(variance, 0))
        low, high = np.array(entry["deviation"]), np.array(entry["deviation_of_noisy"])
        outside = np.maximum(low - deviation, deviation - high)
        off = np.abs(mean - data(kernel, x)) - deviation
        out = within(np.maximum(outside, 0), 0, 1e-4, "2,400 digits: deviation, σ")
        out = out.joined(within(np.maximum(off, 0), 0, 1e-5, "the deviation bounds the mean's error, σ"))
        out.condition = gram_condition(kernel, points)
        return out

    return Cell("conditions, spacing/ℓ: posterior", f"{kernel}, {count} points", f"{spacing:g}", run, refusal=False)


def contradiction_cell(kernel, count, spacing):
    """One value is a deviation off. Two points: where they leave each other 1e-6 of the variance or less, contradiction."""

    def run(_):
        points = points_of(spacing, count)
        values = data(kernel, points[:, 0])
        values[count // 2] += 1
        gp = process(kernel, points, values)
        mean, variance = gp.posterior(points)
        if (variance < -1e-9).any():
            return within(variance.min(), 0, 1e-9, "no negative variance")
        return within(mean, values, 1e-3, "the values themselves, σ")

    return Cell(
        "conditions, spacing/ℓ: one value 1 σ off",
        f"{kernel}, {count} points",
        f"{spacing:g}",
        run,
        refusal=True if spacing <= 1e-4 else None,
    )


def hits_cell(kernel, count, spacing, normals):
    """Rays along conditions, of each sampler that serves them: what is hit lies where the data say, all of
    them or (the nearer of two laws) all but what the others determine to 1e-10 of the variance."""

    def run(n):
        n = max(200, n // 2)
        points = points_of(spacing, count) - [spacing * (count - 1) / 2, 0, 0]
        values = 0.5 + 0.2 * np.sin(0.9 * points[:, 0] + 0.4)
        more, gradients = {}, None
        if normals:
            slope = 0.2 * 0.9 * np.cos(0.9 * points[:, 0] + 0.4)
            more = {"normals": np.tile([1.0, 0, 0], (count, 1)) * np.sign(slope)[:, None], "slopes": np.abs(slope)}
            gradients = np.stack([slope, 0 * slope, 0 * slope], axis=1)
        gp = process(kernel, points, values, **more)
        line = [points[0, 0] - 0.7, 0.05, 0], [1, 0, 0], 8
        references = [
            exact_paths.first_hits(kernel, points, values, gradients, *line, 4000, noise)
            for noise in (exact_paths.NOISE, exact_paths.LEFT_OUT)
        ]

        def of(sampler, seed):
            hits = first_hits(gp, n, *line, sampler=sampler, seed=seed)
            against = f"regression in numpy, paths on a lattice; {sampler}"
            both = (of_sample(hits["t"], law, against, [hits], stated=0.005) for law in references)
            return min(both, key=lambda one: one.error)

        out = of("dense", 7)
        if kernel == "squared exponential":
            out = out.joined(of("nystrom", 5))
        out.condition = gram_condition(kernel, points)
        return out

    name = f"{kernel}, {count} {'values and normals' if normals else 'values'}"
    return Cell("conditions, spacing/ℓ: first hits", name, f"{spacing:g}", run, refusal=None if normals else False)


def cells():
    return (
        [posterior_cell(k, c, s) for k in KERNELS for c in (*COUNTS, 30, 200) for s in SPACINGS if c < 30 or s == 0.01]
        + [contradiction_cell(k, c, s) for k in KERNELS for c in COUNTS for s in SPACINGS]
        + [
            hits_cell(k, 4, s, normals)
            for k in ("squared exponential", "matern 5/2")
            for normals in (False, True)
            for s in SPACINGS
        ]
        + [hits_cell(k, 200, 0.01, False) for k in ("squared exponential", "matern 5/2")]
    )
