"""Length scales from 1e-4 to 1e4 of the scene against deviations from 1e-4 to 100 length scales: the unit sphere, rays
at its middle, squared exponential.

Exact answers: while the deviation is a tenth of the length scale or less, f falls along such a ray up to the centre
(but for slopes 10 deviations out), so P(no hit before t) = Φ(μ(t)/σ) / Φ(μ(0)/σ). Of long length scales, the path
itself is drawn by its exact series g(q) = e^{-q²/2} Σ z_n qⁿ/√n!, z iid normal, which knows no lattice, no factor and
no step. The rest against the spectral sampler, which shares no path with the convolution.
"""

import gpis_native as gn
import numpy as np
from statistics_checks import normal_cdf

from stability.verdicts import Cell, first_hits, of_cdf, of_sample

LENGTHS = [1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1e3, 1e4]
RATIOS = [1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0]
T_MAX = 4.0


def mean(t):
    return np.abs(2.0 - t) - 1


def series_paths(n, q, seed, terms=90):
    """(n, len(q)) values of the squared exponential process, |q| <= 5."""
    z = np.random.default_rng(seed).normal(size=(n, terms))
    factors = np.empty((terms, len(q)))
    factors[0] = np.exp(-0.5 * q * q)
    for k in range(1, terms):
        factors[k] = factors[k - 1] * q / np.sqrt(k)
    return z @ factors


def series_first_hits(n, length, sigma, seed):
    """First sign changes on a grid of 1/400 of the line, of paths that are outside at the start; linear between."""
    t = np.linspace(0, T_MAX, 1601)
    kept = []
    have = 0
    for batch in range(200):
        f = mean(t) + sigma * series_paths(4000, (t - 2) / length, [seed, batch])
        f = f[f[:, 0] > 0]
        below = f <= 0
        first = np.argmax(below, axis=1)
        hit = below[np.arange(len(f)), first]
        a, b = f[np.arange(len(f)), first - 1], f[np.arange(len(f)), first]
        with np.errstate(invalid="ignore", divide="ignore"):
            kept.append(np.where(hit, t[first - 1] + (t[1] - t[0]) * a / (a - b), np.inf))
        have += len(f)
        if have >= n:
            break
    return np.concatenate(kept)[:n]


def cell(length, ratio):
    sigma = ratio * length
    gp_of = lambda: gn.GaussianProcess(  # noqa: E731
        gn.SphereField([0, 0, 0], 1), sigma, gn.SquaredExponential(length), bounds=((-3,) * 3, (3,) * 3)
    )

    def run(n):
        hits = first_hits(gp_of(), n, [0, 0, 2], [0, 0, -1], T_MAX, sampler="convolution", seed=5)
        if ratio <= 0.1:

            def cdf(t):
                return 1 - normal_cdf(mean(np.minimum(t, 2)) / sigma) / normal_cdf(1 / sigma)

            return of_cdf(hits["t"], cdf, "Φ(μ/σ) of a falling f", [hits])
        if length >= 1:
            return of_sample(hits["t"], series_first_hits(n, length, sigma, 6), "exact series of the path", [hits])
        spectral = first_hits(gp_of(), n, [0, 0, 2], [0, 0, -1], T_MAX, sampler="spectral", seed=7)
        return of_sample(hits["t"], spectral["t"], "spectral", [hits, spectral])

    return Cell("sphere: σ/ℓ against ℓ/R", f"{ratio:g}", f"{length:g}", run)


def cells():
    return [cell(length, ratio) for ratio in RATIOS for length in LENGTHS]
