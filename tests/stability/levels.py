"""Constant means from -40 to 40 deviations, for every kernel and every sampler that serves it; rays from outside, and
rays that leave the surface.

Exact answers, σ = 1, u = |μ|, s = √λ₂: a path that is outside where the mean is -u is the top of a high excursion,
f = E/u + v t - u λ₂ t²/2 with E exponential and v ~ N(0, λ₂): P(u s T > x) = 2 Φ(-x/2); from the surface, with the
flux-weighted slope (a Rayleigh variable), T = 2v/(uλ₂): P(T u s/2 > x) = e^{-x²/2}. Both up to O(1/u²) for a kernel
with four derivatives. At a mean of +u, hits are Rice's: rate s/2π e^{-u²/2}, and from 5 deviations on next to no ray
hits. Matérn 3/2, Wong and sums with them bend on the way (O(1/√u)): there, and in the middle, samplers are compared
with each other.
"""

from math import pi, sqrt

import gpis_native as gn
import numpy as np
from line_samplers import JOINT, KERNELS, SAMPLERS
from statistics_checks import normal_cdf

from stability.verdicts import Cell, few_hits, first_hits, of_cdf, of_sample, within

LEVELS = [-40, -20, -10, -5, -2, 0, 2, 5, 10, 20, 40]
X = [1.0, 0, 0]
BENT = ("matern 3/2", "wong", "sum with a rough term", "sum of rough terms")
COST = {"realisation": 20, "nystrom": 5}


def samples(kernel, sampler, n):
    return max(150, n // (COST.get(sampler, 1) if not (sampler == "dense" and kernel in JOINT) else 15))


def reference_of(kernel, sampler):
    """Another sampler that serves the kernel, the fastest there is."""
    return next((s for s in SAMPLERS[kernel] if s not in (sampler, "realisation")), "realisation")


def length_of(level):
    return 1 if abs(level) > 5 else 6


def hits_of(kernel, sampler, level, start, n, seed):
    length = length_of(level)
    gp = gn.GaussianProcess(float(level), 1, KERNELS[kernel], bounds=((-1, -1, -1), (length, 1, 1)))
    options = {}
    if start == "surface":
        options = {"start": {"value": np.zeros(n), "gradient": np.tile(X, (n, 1))}, "memory": "renewal"}
    return first_hits(gp, n, [0, 0, 0], X, length, sampler=sampler, seed=seed, **options)


def cell(kernel, sampler, level, start):
    def run(n):
        n = samples(kernel, sampler, n)
        hits = hits_of(kernel, sampler, level, start, n, 5)
        u, slope = abs(level), sqrt(KERNELS[kernel].derivative_variance(X))
        if (level >= 5 and start == "outside") or (level >= 10 and kernel not in BENT):
            return few_hits(hits, length_of(level) * slope / (2 * pi) * np.exp(-u * u / 2), "Rice: no hit")
        if kernel == "plane wave" and start == "surface" and level == 0:
            # Dense rows carry noise of 1e-3 deviations.
            allowed = 1e-2 if sampler == "dense" else 1e-4
            return within(hits["t"], pi, allowed, "half a period exactly", [hits])
        if level <= -10 and kernel not in BENT and kernel != "plane wave":
            if start == "outside":
                cdf, against = lambda t: 1 - 2 * normal_cdf(-t * u * slope / 2), "top of a high excursion"
            else:
                cdf, against = lambda t: 1 - np.exp(-0.5 * (t * u * slope / 2) ** 2), "arc of a high excursion"
            return of_cdf(hits["t"], cdf, against, [hits], stated=4 / u**2)
        other = reference_of(kernel, sampler)
        reference = hits_of(kernel, other, level, start, samples(kernel, other, n), 7)
        return of_sample(hits["t"], reference["t"], other, [hits, reference], stated=0.003 if "dense" in (sampler, other) else 0)

    return Cell(f"μ/σ, rays from {'outside' if start == 'outside' else 'the surface'}", f"{kernel}, {sampler}", level, run)


def cells():
    return [
        cell(kernel, sampler, level, start)
        for start in ("outside", "surface")
        for kernel, samplers in SAMPLERS.items()
        for sampler in samplers
        for level in LEVELS
    ]
