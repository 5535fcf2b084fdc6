"""Volumes as means: the density of a fog, and what a stochastic Poisson surface reconstruction (SPSR) writes, mean and deviation.
Oracles of the design, numbered as there."""

from math import erfc, sqrt
from pathlib import Path

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_proportion, check_same_distribution, normal_cdf

pytestmark = pytest.mark.stats
DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "gpis-light-transport"
DOWN = np.array([0.0, 0, -1])


def rays(n, x, y, z):
    return np.tile([x, y, z], (n, 1)), np.tile(DOWN, (n, 1))


def test_a_fog_is_a_mean(tmp_path, full_size, seed):
    """Density grows from 0 to 1 between the radii 1 and .5: level - density is the mean of a surface at .75 that is as blurred
    as the fog. With one normal for all of space (oracle 14) hits and misses are known."""
    n, voxel, level, sigma = 200_000 if full_size else 20_000, 0.03, 0.5, 0.15
    axis = np.arange(80) * voxel - 1.185
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    density = np.clip(2 - 2 * np.sqrt(x * x + y * y + z * z), 0, 1)
    gn.write_vdb(tmp_path / "fog.vdb", {"density": density, "origin": (axis[0],) * 3, "voxel_size": voxel})
    fog = gn.VdbField(tmp_path / "fog.vdb", "density")
    mean = level + -1 * fog
    at = np.array([[0, 0, 0.75], [0, 0.3, 0], [0, 0, 0.9], [1.1, 0, 0]])
    np.testing.assert_allclose(mean(at), [0, -0.5, 0.3, 0.5], atol=2e-3)
    np.testing.assert_allclose(mean.gradient([[0, 0, 0.752]])[0], [0, 0, 2], atol=0.05)
    certain = gn.first_hits(gn.GaussianProcess(mean, 0, gn.SquaredExponential(1.0)), *rays(1, 0, 0, 3), 10)
    assert certain["t"][0] == pytest.approx(2.25, abs=1e-3)

    gp = gn.GaussianProcess(mean, sigma, gn.SquaredExponential(1e4), bounds=((-1.1,) * 3, (1.1,) * 3))
    t = gn.first_hits(gp, *rays(n, 0, 0, 1.05), 2, seed=seed)["t"]
    xi = np.random.default_rng(seed + 1).normal(size=4 * n)
    xi = xi[xi > -level / sigma]  # outside at the start
    expected = np.where(xi < level / sigma, 0.05 + 0.5 * (level + sigma * xi), np.inf)
    check_same_distribution(np.round(t, 3), np.round(expected, 3), "t")  # voxels of .03 bend the sphere by 1e-4
    t = gn.first_hits(gp, *rays(n, 0.9, 0, 1.05), 2, seed=seed)["t"]  # no denser than .2
    check_proportion(np.sum(np.isfinite(t)), n, 0.5 * erfc(0.3 / sigma / sqrt(2)), 1e-3, "beside")


@pytest.fixture(scope="module")
def bunny():
    """The published reconstruction as its authors use it: half its deviation, the plane that is missing cut off."""
    path = DATA / "bunny.vdb"
    if not path.exists():
        pytest.skip("the shared data files are not there")
    grids = gn.read_vdb(path)

    def value(name, points):
        """Trilinear, written here."""
        u = (points - grids["origin"]) / grids["voxel_size"]
        cell = u.astype(int)
        total = np.zeros(len(points))
        for corner in np.ndindex(2, 2, 2):
            total += np.prod(np.where(corner, u - cell, 1 - u + cell), axis=1) * grids[name][tuple((cell + corner).T)]
        return total

    def process(length):
        sigma = 0.5 * gn.VdbField(path, "variance")  # holds the deviation
        bounds = ((-1.05,) * 3, (0.95,) * 3)
        return gn.GaussianProcess(gn.VdbField(path, "mean"), sigma, gn.SquaredExponential(length), bounds=bounds)

    return value, process


@pytest.mark.parametrize(("x", "y"), [(-0.1, -0.3), (0.05, 0.1), (-0.35, -0.05)])
def test_a_reconstruction_is_a_mean(bunny, x, y, full_size, seed):
    """Oracle 14 with mean and deviation of the file: f > 0 as far as ξ > -μ/σ, so that the first hit is where -μ/σ first
    exceeds ξ."""
    value, process = bunny
    n = 100_000 if full_size else 10_000
    t = np.linspace(0, 1.9, 20_001)
    points = np.array([x, y, 0.94]) + t[:, None] * DOWN
    highest = np.maximum.accumulate(-value("mean", points) / (0.5 * value("variance", points)))
    assert normal_cdf(highest[-1]) > 0.3
    hits = gn.first_hits(process(1e4), *rays(n, x, y, 0.94), 1.9, seed=seed)["t"]
    at = t[[np.searchsorted(highest, v) for v in np.linspace(-2.5, min(2.5, highest[-1] - 1e-3), 9)]]
    start = normal_cdf(highest[0])
    expected = [(normal_cdf(highest[np.searchsorted(t, s)]) - start) / (1 - start) for s in at]
    check_proportion([np.sum(hits <= s) for s in at], n, expected, 2e-4, "hits")
    check_proportion(np.sum(np.isfinite(hits)), n, (normal_cdf(highest[-1]) - start) / (1 - start), what="any hit")


def test_hits_of_a_reconstruction_are_those_of_explicit_realisations(bunny, full_size, seed):
    """The published length scale: jointly drawn at 400 points of the line, changes of sign found between them."""
    _, process = bunny
    n, gp = 20_000 if full_size else 3000, process(0.5)
    t = np.linspace(0, 1.9, 401)
    f = gp.sample(np.array([-0.1, -0.3, 0.94]) + t[:, None] * DOWN, n, seed)
    f = f[f[:, 0] > 0]  # rays come from outside
    below = f < 0
    first, rows = np.argmax(below, axis=1), np.arange(len(f))
    a, b = f[rows, np.maximum(first - 1, 0)], f[rows, first]
    expected = np.where(below.any(axis=1), t[first] - t[1] * b / np.where(a > b, b - a, -1), np.inf)
    hits = gn.first_hits(gp, *rays(n, -0.1, -0.3, 0.94), 1.9, seed=seed)
    check_same_distribution(hits["t"], expected)
    assert len(f) > 0.9 * n and np.isfinite(expected).mean() > 0.5
