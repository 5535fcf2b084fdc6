"""Sums with rough terms, whose terms are paths of their own: what is known of the sum at the start is split among them."""

import gpis_native as gn
import numpy as np
import pytest
from line_samplers import KERNELS
from statistics_checks import check_z

pytestmark = pytest.mark.stats
SUMS = ["sum with a rough term", "sum of rough terms"]
X = np.array([1.0, 0.0, 0.0])


@pytest.fixture
def n(full_size):
    return 400_000 if full_size else 40_000


def along_x(n):
    return np.zeros((n, 3)), np.tile(X, (n, 1))


def line(reach):
    return ((-1, -1, -1), (reach, 1, 1))


def transverse(kernel, t):
    """cov(∂_w g(0), ∂_w g(t)) = -∂²k/∂w² across a line along x."""
    h = 1e-3
    k = [kernel(np.zeros((1, 3)), np.column_stack([t, np.full_like(t, w), 0 * t]))[0] for w in (-h, 0, h)]
    return (2 * k[1] - k[0] - k[2]) / h**2


@pytest.mark.parametrize("name", SUMS)
def test_the_sum_given_its_value(name, n, seed):
    """E[g(t) | g(0) = v] = vρ(t), variance 1 - ρ(t)²: each term starts with its own share of v, not with any other."""
    kernel, v, t = KERNELS[name], 2.5, np.array([0.1, 0.4, 1.0, 2.0])
    gp = gn.GaussianProcess(4.0, 1, kernel, bounds=line(5))  # 4 deviations off: hits are too rare to be seen
    state = {"value": np.full(n, 4.0 + v), "gradient": np.tile(X, (n, 1))}
    f = gn.line_values(gp, *along_x(n), t, memory="renewal", start=state, sampler="markov", seed=seed)
    rho = kernel(np.zeros((1, 3)), t[:, None] * X)[0]
    for g, r in zip(f.T - 4, rho, strict=True):
        g = g[np.isfinite(g)]
        check_z(g.mean(), v * r, g.std() / np.sqrt(len(g)))
        check_z(np.mean((g - v * r) ** 2), 1 - r * r, np.std((g - v * r) ** 2) / np.sqrt(len(g)))


@pytest.mark.parametrize("name", SUMS)
def test_gradients_across_the_line_given_the_first(name, n, seed):
    """γ(t) given γ(0) has the mean C(t)/C(0) γ(0) and the variance C(0) - C(t)²/C(0), near the start as far from it."""
    kernel, start = KERNELS[name], np.array([0.7, 1.5, -2.0])
    gp = gn.GaussianProcess(0, 1, kernel, bounds=line(12))
    state = {"value": np.zeros(n), "gradient": np.tile(start, (n, 1))}
    hits = gn.first_hits(gp, *along_x(n), 9, start=state, sampler="markov", seed=seed)
    hit = np.isfinite(hits["t"])
    t, gradient = hits["t"][hit], hits["gradient"][hit]
    c0, c = transverse(kernel, np.zeros(1))[0], transverse(kernel, t)
    for part in (t < np.median(t), t >= np.median(t)):
        for axis in (1, 2):
            z = (gradient[:, axis] - c / c0 * start[axis]) / np.sqrt(c0 - c * c / c0)
            z = z[part]
            check_z(z.mean(), 0, 1 / np.sqrt(len(z)))
            check_z(np.mean(z * z), 1, np.sqrt(2 / len(z)))
