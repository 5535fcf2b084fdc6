"""Rays through fine grids: voxels are crossed by the cubic of the path as long as f stays above 0 in them, and the path is
asked only where it might not."""

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_same_distribution

pytestmark = pytest.mark.stats
BOUNDS = ((-1.3, -1.3, -1.3), (1.3, 1.3, 1.3))


def fine_grid(f, nodes=105):
    x = np.linspace(-1.3, 1.3, nodes)
    values = f(*np.meshgrid(x, x, x, indexing="ij")).astype(np.float32)
    return gn.GridField(values, x[1] - x[0], [-1.3] * 3)


def sphere_on_a_grid():
    return fine_grid(lambda x, y, z: np.sqrt(x * x + y * y + z * z) - 1)


def rays(n, seed):
    rng = np.random.default_rng(seed)
    origins = np.column_stack([rng.uniform(-1.2, 1.2, (n, 2)), np.full(n, 3.0)])
    directions = np.column_stack([rng.uniform(-0.05, 0.05, (n, 2)), np.full(n, -1.0)])
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.mark.parametrize("kernel", [gn.SquaredExponential(0.4), gn.Matern(2.5, 0.4), gn.Matern(1.5, 0.4)])
def test_hits_are_those_of_the_sphere_itself(kernel, full_size, seed):
    """Against the analytic mean, which has no voxels: same law of (t, slope), and far fewer questions to the path than
    voxels."""
    n = 200_000 if full_size else 20_000
    sigma = fine_grid(lambda x, y, z: 0.12 + 0 * x)  # on the nodes of the mean, not constant for the planner's eyes
    origins, directions = rays(n, seed)
    on_grid = gn.GaussianProcess(sphere_on_a_grid(), sigma, kernel, bounds=BOUNDS)
    exact = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 0.12, kernel, bounds=BOUNDS)
    a = gn.first_hits(on_grid, origins, directions, 10.0, seed=seed)
    b = gn.first_hits(exact, *rays(n, seed + 7), 10.0, seed=seed + 1)
    check_same_distribution(a["t"], b["t"], "t")
    hit = [np.isfinite(h["t"]) for h in (a, b)]
    slopes = [np.linalg.norm(h["gradient"][m], axis=1) for h, m in zip((a, b), hit, strict=True)]
    check_same_distribution(*slopes, "|gradient|")
    c = a["counters"]
    assert c["line_pieces_clear"] > 5 * c["line_segments"]
    assert b["counters"]["line_pieces_clear"] == 0


@pytest.mark.parametrize("memory", ["none", "renewal+"])
def test_few_roots_are_missed(memory, full_size, seed):
    """The ray's own path, looked at anywhere in front of its hit, is above 0 but for 1e-3 of the rays (the promise)."""
    n = 50_000 if full_size else 5_000
    gp = gn.GaussianProcess(sphere_on_a_grid(), 0.12, gn.SquaredExponential(0.4), bounds=BOUNDS)
    origins, directions = rays(n, seed)
    start = None
    if memory == "renewal+":
        hits = gn.first_hits(gp, origins, directions, 10.0, seed=seed)
        hit = np.isfinite(hits["t"])
        out = hits["gradient"][hit] + np.random.default_rng(seed).normal(size=(hit.sum(), 3)) * 0.5
        up = np.einsum("ij,ij->i", out, hits["gradient"][hit]) > 0
        directions = (out / np.linalg.norm(out, axis=1, keepdims=True))[up]
        origins = hits["position"][hit][up]
        start = {key: hits["state"][key][hit][up] for key in ("value", "gradient")}
    t = np.arange(0.003, 5.0, 0.007)
    options = {"memory": memory, "start": start, "seed": seed + 3}
    assert gn.first_hits(gp, origins, directions, 10.0, **options)["counters"]["line_pieces_clear"] > n
    values = gn.line_values(gp, origins, directions, t, **options)
    below = np.nanmin(np.column_stack([values, np.ones(len(values))]), axis=1) < 0
    assert np.sum(below) <= max(3, 1e-3 * len(values)), np.mean(below)


def test_a_scaled_grid_is_the_grid_of_scaled_values(seed):
    """Bit by bit: a number times a grid keeps the grid's lines, bounds and bricks; and -1 turns it inside out."""
    rng = np.random.default_rng(seed)
    values = rng.normal(size=(20, 9, 12)).astype(np.float32)
    values[8:17, :, :] = 3  # a brick of one value
    for factor in (2.0, -0.5):
        a = factor * gn.GridField(values, 0.1, [0, 0, 0])
        b = gn.GridField(np.float32(factor) * values, 0.1, [0, 0, 0])
        points = rng.uniform(-0.2, 2.1, (2000, 3))
        np.testing.assert_array_equal(a(points), b(points))
        np.testing.assert_array_equal(a.gradient(points), b.gradient(points))
        hits = []
        for mean in (a, b):
            gp = gn.GaussianProcess(mean, 0.2, gn.SquaredExponential(0.3))
            directions = np.tile([1.0, 0.0, 0.0], (500, 1))
            hits.append(gn.first_hits(gp, np.tile([-1.0, 0.4, 0.5], (500, 1)), directions, 9.0, seed=seed))
        np.testing.assert_array_equal(hits[0]["t"], hits[1]["t"])
        np.testing.assert_array_equal(hits[0]["gradient"], hits[1]["gradient"])
