"""The first moments of a ray: far tails of its first value, and its variance close to a known start.

Exact answers: P(f > x | f > 0) = Φ(-u-x)/Φ(-u) at a mean of -u deviations (tables in 60 digits, tables.py). Given
value and slope at the start, g(q) has the mean κ(q)g₀ - κ'(q)/λ₂ g₀' and the variance 1 - κ² - κ'²/λ₂, which is of
order q⁴ (q³ for Matérn 3/2): in 60 digits as well. Mean and deviation are compared relative to themselves where the
sampler can tell them from nothing, and else in deviations of the process: that it adds no more than it states.
"""

import gpis_native as gn
import numpy as np
from line_samplers import JOINT, KERNELS, SAMPLERS
from statistics_checks import Z_LIMIT

from stability.conditions import tables
from stability.verdicts import Cell, of_cdf, rays, within

DISTANCES = [1e-8, 1e-7, 1e-6, 1e-5, 1e-4, 1e-3, 1e-2]
LEVELS = [-40, -30, -20, -10, -5, -2, 0, 2, 10, 20]
X = [1.0, 0, 0]


def tail_cell(sampler, level):
    def run(n):
        gp = gn.GaussianProcess(float(level), 1, gn.SquaredExponential(1), bounds=((-1,) * 3, (2,) * 3))
        f = gn.line_values(gp, *rays(n, [0, 0, 0], X), [1e-9], sampler=sampler, seed=5, threads=1, tolerance=1e-300)[:, 0]
        missing = np.isnan(f)
        if missing.mean() > 0.001:
            return within(missing.mean(), 0, 0.001, "lines that were not drawn", most=1.0)
        entry = tables()["tail"][str(level)]
        x, above = np.array(entry["x"]), np.array(entry["above"])

        def cdf(v):
            # Between the table's points the logarithm of the tail is all but linear.
            return 1 - np.exp(np.interp(v, x, np.log(above), right=-np.inf))

        return of_cdf(f[~missing], cdf, "60 digits: Φ(-u-x)/Φ(-u)", stated=5e-4)

    return Cell("first value of a ray at μ/σ", sampler, level, run)


def costly(kernel, sampler):
    return sampler in ("nystrom", "realisation") or (sampler == "dense" and kernel in JOINT)


def rough(kernel):
    return kernel in ("matern 3/2", "wong", "sum with a rough term", "sum of rough terms")


def absolute(kernel, sampler, deviation):
    """What a sampler leaves open, in deviations: sums of parts of order 1 round, with weights of a hundred where nodes are
    close (nystrom); a realisation holds floats; dense lines of rough kernels are polynomials between rows: close to one
    they lose the deviation, but add nothing."""
    if sampler == "dense" and rough(kernel):
        return min(1e-4, deviation)
    return {"realisation": 3e-7, "spectral": 1e-15, "nystrom": 3e-13}.get(sampler, 0.0)


def compared(name, value, exact, chance, left):
    """Relative to what it is, if what a sampler leaves open lets it be told from nothing by half."""
    allowed = chance + left
    if allowed < 0.5 * exact:
        out = within(value / exact, 1, allowed / exact, f"60 digits: {name}, ratio", most=1.0)
    else:
        out = within(value, exact, allowed, f"60 digits: {name}, σ", most=1.0)
    out.stated = left
    return out


def variance_cell(kernel, sampler, q):
    """The path goes on behind q, as a ray does; what met the surface before q is missing."""

    def run(n):
        n = max(400, n // 10) if costly(kernel, sampler) else n
        gp = gn.GaussianProcess(0.0, 1, KERNELS[kernel], bounds=((-1,) * 3, (4,) * 3))
        state = {"value": np.zeros(n), "gradient": np.tile(X, (n, 1))}
        options = {"start": state, "memory": "renewal+", "sampler": sampler, "seed": 5, "threads": 1}
        f = gn.line_values(gp, *rays(n, [0, 0, 0], X), [q, 1.0], **options)[:, 0]
        entry = tables()["start"][f"{kernel}, {q:g}"]
        if np.isnan(f).mean() > 0.01:
            return within(np.isnan(f).mean(), 0, 0.01, "lines that met the surface within t", most=1.0)
        mean, deviation = entry["mean"], entry["deviation"]
        rms = np.sqrt(np.nanmean((f - mean) ** 2))
        left = absolute(kernel, sampler, deviation)
        # Of the standard deviation: half of the variance's.
        chance = (Z_LIMIT * np.sqrt(0.5 / n) + 0.01) * deviation
        out = compared("deviation", rms, deviation, chance, left)
        chance = (Z_LIMIT / np.sqrt(n) + 0.03) * deviation
        return out.joined(compared("mean", np.nanmean(f), mean, chance, left))

    return Cell("mean and deviation at t/ℓ after a known start", f"{kernel}, {sampler}", f"{q:g}", run)


def cells():
    return [tail_cell(s, level) for s in SAMPLERS["squared exponential"] for level in LEVELS] + [
        variance_cell(k, s, q) for k in KERNELS if k != "plane wave" for s in SAMPLERS[k] for q in DISTANCES
    ]
