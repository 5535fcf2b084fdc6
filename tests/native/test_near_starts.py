"""Close to a start where value and gradient are known: the little that is still open there, by every sampler. It decides how
soon a slow ray is back, and is far below what samplers state of their covariances."""

import gpis_native as gn
import numpy as np
import pytest
from line_samplers import KERNELS, SERVED
from statistics_checks import check_z
from tensor_grids import VARYING

pytestmark = pytest.mark.stats
LEVEL = 6.0  # far from the surface: all values are kept
T = np.array([0.005, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8])
D = np.array([0.6, 0.0, 0.8])
ROUGH = {"matern 5/2": gn.Matern(2.5, 1), "matern 3/2": gn.Matern(1.5, 1), "wong": gn.Wong(1)}
MIXED = {
    "rational quadratic, heavy": gn.RationalQuadratic(0.5, 1),
    "locally periodic": gn.LocallyPeriodic(3, 1.8, [0.6, 0.8, 0], 0.8),
    "product": gn.Matern(2.5, 1) * gn.SquaredExponential(3),
    "rough product": gn.Matern(1.5, 1) * gn.SquaredExponential(3),
}


@pytest.fixture
def n(full_size):
    return 200_000 if full_size else 40_000


def check_near_start(gp, sampler, n, seed, allowed=0.01, t=T):
    """Mean and variance of f given value and gradient at the origin, by the joint covariance of gradients and values."""
    start = {"value": np.full(n, LEVEL + 0.5), "gradient": np.tile([0.5, 0.2, -0.3], (n, 1))}
    f = gn.line_values(gp, np.zeros((n, 3)), np.tile(D, (n, 1)), t, start=start, sampler=sampler, tolerance=1e-9, seed=seed)
    assert np.isfinite(f).all(axis=1).mean() > 0.999
    f = f[np.isfinite(f).all(axis=1)] - LEVEL
    x, origin = t[:, None] * D, np.zeros((1, 3))
    given, across = gp.joint_covariance(origin, origin)[0, 0], gp.joint_covariance(x, origin)[:, 0, 0]
    weights = np.linalg.lstsq(given, across.T, rcond=1e-12)[0].T
    mean = weights @ [0.5, 0.5, 0.2, -0.3]
    variance = np.diag(gp.covariance(x, x)) - np.sum(weights * across, axis=1)
    off = np.mean((f - mean) ** 2, axis=0) / variance - 1
    check_z(np.sign(off) * np.maximum(np.abs(off) - allowed, 0), 0, np.sqrt(2 / len(f)), "variance")
    check_z(f.mean(axis=0), mean, np.sqrt(variance / len(f)), "mean")


# A plane wave leaves nothing open; realisations have a test of their own distances (test_process.py).
@pytest.mark.parametrize(("name", "sampler"), [p for p in SERVED if p[0] != "plane wave" and p[1] != "realisation"])
def test_stationary(name, sampler, n, seed):
    gp = gn.GaussianProcess(LEVEL, 1, KERNELS[name], bounds=((-2, -2, -2), (4, 4, 4)))
    check_near_start(gp, sampler, n, seed)


@pytest.mark.parametrize("conditions", [False, True])
@pytest.mark.parametrize("name", [*ROUGH, *MIXED])
def test_joint_lines(name, conditions, n, seed):
    """As `auto` takes them, also where a far condition says nothing but asks for a joint line."""
    far = {"points": [[0.3, 5.0, 0.1]], "values": [LEVEL]} if conditions else None
    gp = gn.GaussianProcess(LEVEL, 1, {**ROUGH, **MIXED}[name], bounds=((-2, -6, -2), (4, 6, 4)), conditions=far)
    check_near_start(gp, "auto", n, seed)


@pytest.mark.parametrize("name", ["squared exponential", *ROUGH])
@pytest.mark.parametrize("field", VARYING)
def test_varying_lengths(field, name, n, seed):
    kernel = ROUGH.get(name, gn.SquaredExponential(1))
    gp = gn.GaussianProcess(LEVEL, 1, kernel, anisotropy=VARYING[field], bounds=((-2, -2, -2), (4, 4, 4)))
    check_near_start(gp, "auto", n, seed)


@pytest.mark.parametrize("name", ["squared exponential", "matern 5/2"])
def test_points_that_are_closer_for_others(name, n, seed):
    """Bounds that hold the end of a grid of lengths, where A has a kink: all points of dense lines are closer than elsewhere."""
    kernel = ROUGH.get(name, gn.SquaredExponential(1))
    gp = gn.GaussianProcess(LEVEL, 1, kernel, anisotropy=VARYING["length e^{x/4}"], bounds=((-2, -6, -2), (30, 6, 30)))
    check_near_start(gp, "dense", n, seed, t=np.array([0.02, 0.03, 0.04, 0.05, 0.06, 0.1, 0.2]))


@pytest.mark.parametrize(("name", "sampler"), SERVED)
def test_a_line_knows_nothing_of_lines_before_it(name, sampler, seed):
    """Rays one by one, and together by one thread that uses its line over and over: the same hits to the last bit. They come
    into the bounds sooner or later, and start there from a truncated normal as often as not."""
    gp = gn.GaussianProcess(0.1, 0.5, KERNELS[name], bounds=((-1, -1, -1), (1, 1, 1)))
    n = 40
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = rng.uniform(-0.5, 0.5, (n, 3)) - rng.uniform(2, 5, (n, 1)) * directions
    options = {"sampler": sampler, "seed": seed, "threads": 1}
    together = gn.first_hits(gp, origins, directions, 8, **options)
    alone = [gn.first_hits(gp, origins[i : i + 1], directions[i : i + 1], 8, first_index=i, **options) for i in range(n)]
    for key in ("t", "gradient"):
        np.testing.assert_array_equal(together[key], np.concatenate([hits[key] for hits in alone]))
    assert np.isfinite(together["t"]).sum() > n / 4
