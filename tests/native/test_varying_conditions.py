"""Condition points where length scales vary, and where time flows: realisations against Gaussian process regression by numpy, and
rays of memory global, which see one realisation for their whole path."""

import gpis_native as gn
import numpy as np
import pytest
from regression import Regression, check_law
from statistics_checks import check_z
from tensor_grids import along_x, isotropic

pytestmark = pytest.mark.stats
BOX = ((-1, -1, -1), (1, 1, 1))
MEAN, SIGMA = gn.SphereField([0, 0, 0], 0.7), gn.ConstantField(0.2)
GROWING = along_x(lambda x: isotropic(0.3 * np.exp(0.4 * np.clip(x, -1, 1))), 2, 65)  # lengths of .2 to .45
KERNELS = {"squared exponential": gn.SquaredExponential(1.0), "matern 5/2": gn.Matern(2.5, 1.0)}


def conditions(seed, n=8):
    """Values, gradients or both."""
    rng = np.random.default_rng(seed)
    values, normals = 0.1 * rng.normal(size=n), rng.normal(size=(n, 3))
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    values[2], normals[4:7] = np.nan, np.nan
    points, slopes = rng.uniform(-0.8, 0.8, (n, 3)), rng.uniform(0.5, 1.5, n)
    return {"points": points, "values": values, "normals": normals, "slopes": slopes, "noise": np.zeros(n)}


def varying(kernel, **more):
    return gn.GaussianProcess(MEAN, SIGMA, KERNELS[kernel], anisotropy=GROWING, bounds=BOX, **more)


def check_held(at, c):
    n, known, normals = len(c["points"]), ~np.isnan(c["values"]), ~np.isnan(c["normals"][:, 0])
    np.testing.assert_allclose(at["value"][:, :n][:, known] - c["values"][known], 0, atol=1e-6)
    gradients = c["slopes"][normals, None] * c["normals"][normals]
    np.testing.assert_allclose(at["gradient"][:, :n][:, normals] - gradients, 0, atol=1e-6)


def check_flow(found, pairs):
    """Standard normals at each time, whose correlation between two times is exp(-dt²/2): by how much they move."""
    for time, z in found.items():
        check_z(np.mean(z), 0, 1 / np.sqrt(z.size), f"mean at {time}")
        check_z(np.mean(z**2), 1, np.sqrt(2 / z.size), f"variance at {time}")
    for a, b in pairs:
        moved = 2 * (1 - np.exp(-((a - b) ** 2) / 2))
        check_z(np.mean((found[a] - found[b]) ** 2), moved, moved * np.sqrt(2 / found[a].size), f"from {a} to {b}")


@pytest.mark.parametrize("kernel", KERNELS)
def test_realisations_of_varying_lengths_follow_the_posterior(kernel, full_size, seed):
    """Conditions are met; values beside them and far from them have the mean and the covariance of the regression."""
    n = (20_000 if full_size else 1200) // (1 if kernel == "squared exponential" else 12)
    c = conditions(seed)
    x = np.random.default_rng(seed + 1).uniform(-0.8, 0.8, (5, 3))
    x[0] = c["points"][0] + 0.05
    at = varying(kernel, conditions=c).realisation_at(np.concatenate([c["points"], x]), seed, n)
    check_held(at, c)
    mean, covariance = Regression(varying(kernel), c, MEAN, SIGMA).law(x)
    # What the plan states of a mixture of squared exponentials: 5e-4 of the prior's variance.
    slack = 0 if kernel == "squared exponential" else 5e-4 * 0.2**2
    check_law(at["value"][:, len(c["points"]) :], mean, covariance, slack)


def test_conditions_hold_while_lengths_vary_and_time_flows(full_size, seed):
    """At all times; what is free has the correlation exp(-t²/2) with itself at time 0. Such points take ten times as long."""
    n, c = 1000 if full_size else 80, conditions(seed)
    x = np.random.default_rng(seed + 1).uniform(-0.8, 0.8, (5, 3))
    mean, covariance = Regression(varying("squared exponential"), c, MEAN, SIGMA).law(x)
    whiten, found = np.linalg.inv(np.linalg.cholesky(covariance)), {}
    for time in (0.0, 0.3, 50.0):
        gp = varying("squared exponential", conditions=c, time_scale=2.0, time=2 * time)
        at = gp.realisation_at(np.concatenate([c["points"], x]), seed, n)
        check_held(at, c)
        found[time] = (at["value"][:, len(c["points"]) :] - mean) @ whiten.T
    check_flow(found, [(0.0, 0.3), (0.0, 50.0)])


# f = z + σg(x, y): the height of the hit is normal, and that of a later time the same normal as much as g is.
FLOOR = gn.PlaneField([0, 0, 0], [0, 0, 1], 1)
PEGS = {"points": np.array([[0.3, 0.2, 0.05], [-0.4, 0.1, -0.1], [0.1, -0.5, 0.0]]), "values": np.zeros(3)}
PEGS |= {"normals": np.full((3, 3), np.nan), "slopes": np.ones(3), "noise": np.zeros(3)}
FLAT = {
    "squared exponential": gn.SquaredExponential([0.5, 0.4, np.inf]),
    "matern 3/2": gn.Matern(1.5, [0.5, 0.4, np.inf]),
    "rational quadratic": gn.RationalQuadratic(1, [0.5, 0.4, np.inf]),
}


def heights(kernel, xy, seed, **more):
    """Of the hits of rays from above, all of one path each, memory global."""
    bounds = ((-2, -2, -2), (2, 2, 2))
    gp = gn.GaussianProcess(FLOOR, 0.2, FLAT[kernel], bounds=bounds, **more)
    down = np.tile([0, 0, -1.0], (len(xy), 1))
    hits = gn.first_hits(gp, np.column_stack([xy, np.full(len(xy), 1.9)]), down, 10, memory="global", seed=seed)
    assert np.isfinite(hits["t"]).all()
    return hits["position"][:, 2]


@pytest.mark.parametrize("held", [False, True], ids=["free", "held"])
@pytest.mark.parametrize("kernel", FLAT)
def test_global_rays_see_the_surface_flow(kernel, held, full_size, seed):
    """The heights at two times have the correlation exp(-dt²/2), about the mean and the deviation of the regression where points
    hold them; and the rays through those points meet them at all times."""
    n = 20_000 if full_size else 800
    xy = np.array([[0.35, 0.2], [-0.1, -0.2], [0.9, 0.8]])
    mean, deviation = np.zeros(3), np.full(3, 0.2)
    more = {"conditions": PEGS} if held else {}
    if held:
        prior = gn.GaussianProcess(FLOOR, 0.2, FLAT[kernel])
        law = Regression(prior, PEGS, FLOOR, gn.ConstantField(0.2)).law(np.column_stack([xy, np.zeros(3)]))
        mean, deviation = -law[0], np.sqrt(np.diag(law[1]))
    rows, found = np.repeat(np.arange(3), n), {}
    for time in (0.0, 0.4, 0.5, 3.0):
        z = heights(kernel, xy[rows], seed, time_scale=0.5, time=0.5 * time, **more)
        found[time] = (z - mean[rows]) / deviation[rows]
        if held:
            at = heights(kernel, np.tile(PEGS["points"][:, :2], (20, 1)), seed, time_scale=0.5, time=0.5 * time, **more)
            np.testing.assert_allclose(at, np.tile(PEGS["points"][:, 2], 20), atol=1e-6)
    check_flow(found, [(0.0, 0.4), (0.4, 0.5), (0.5, 3.0), (0.0, 3.0)])
