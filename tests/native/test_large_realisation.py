"""A realisation at the full size of 256³ nodes, with conditions, and what people make of it: a level set and a mesh."""

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_z
from tensor_grids import along_x, isotropic

pytestmark = pytest.mark.stats
NODES, LENGTH, SIGMA = 256, 0.05, 0.03
BOX = ((-1, -1, -1), (1, 1, 1))
STEP = 2 / (NODES - 1)
INDEX = np.array([[225, 127, 127], [215, 158, 130], [200, 60, 127]])  # of nodes, x > .5
VALUES = np.array([0.03, 0.0, np.nan])
NORMALS = np.array([[np.nan] * 3, [0.6, 0.0, 0.8], [0.0, -1.0, 0.0]])
SLOPES = np.array([1, 0.7, 1.2])


@pytest.fixture(scope="module")
def made():
    conditions = {"points": -1 + STEP * INDEX, "values": VALUES, "normals": NORMALS, "slopes": SLOPES}
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 0.7), SIGMA, gn.SquaredExponential(LENGTH), conditions=conditions)
    return gp, gp.realisation(BOX, NODES, 5)


def test_it_keeps_the_conditions(made):
    f = made[1]["realisation"]
    assert f.shape == (NODES,) * 3 and f.dtype == np.float32 and made[1]["voxel_size"] == pytest.approx(STEP)
    np.testing.assert_allclose(f[tuple(INDEX[:2].T)], VALUES[:2], atol=1e-6)
    for i in (1, 2):
        around = [[f[tuple(INDEX[i] + s * e)] for s in (-2, -1, 1, 2)] for e in np.eye(3, dtype=int)]
        slope = np.array(around) @ [1, -8, 8, -1] / (12 * STEP)  # of order h⁴
        np.testing.assert_allclose(slope, SLOPES[i] * NORMALS[i], atol=2e-3)


def test_its_covariance_is_that_of_the_kernel(made):
    """Means of g(x) g(x + r) over the half without conditions: of variance (1/V) ∫ ρ(u)² + ρ(u + r)ρ(u - r) du, which is
    π^{3/2} ℓ³ (1 + e^{-r²/ℓ²}) / V."""
    axis = -1 + STEP * np.arange(NODES)
    x, y, z = axis[:140, None, None], axis[:, None], axis
    g = (made[1]["realisation"][:140] - (np.sqrt(x * x + y * y + z * z) - 0.7)) / SIGMA
    volume = np.prod(g.shape) * STEP**3
    check_z(g.mean(), 0, np.sqrt((2 * np.pi) ** 1.5 * LENGTH**3 / volume))
    for lag in ((0, 0, 0), (3, 0, 0), (0, 6, 0), (0, 0, 9), (4, 4, 4), (20, 0, 0), (0, 0, 40)):
        there = g[lag[0] :, lag[1] :, lag[2] :]
        product = np.mean(there * g[: there.shape[0], : there.shape[1], : there.shape[2]], dtype=float)
        q2 = (STEP / LENGTH) ** 2 * np.dot(lag, lag)
        error = np.sqrt(np.pi**1.5 * LENGTH**3 * (1 + np.exp(-q2)) / (np.prod(there.shape) * STEP**3))
        check_z(product, np.exp(-q2 / 2), error, f"lag {lag}")


def check_linear(f):
    """Linear between nodes: off by h²/8 f'' along each axis at most, of deviation √3 σ/ℓ²."""
    off = STEP**2 / 8 * np.sqrt(3) * SIGMA / LENGTH**2
    assert np.abs(f).max() < 4.5 * np.sqrt(3) * off and np.abs(f).mean() < np.sqrt(3) * off


def test_it_is_a_mesh(made):
    gp, grid = made
    vertices, triangles = gn.level_set_mesh(grid["realisation"], grid["voxel_size"], grid["origin"])
    some = vertices[:: len(vertices) // 400]
    at = gp.realisation_at(some, 5)
    size = np.linalg.norm(at["gradient"][0], axis=1)
    check_linear(at["value"][0])
    assert np.mean(np.abs(at["value"][0]) / size < 0.05 * STEP) > 0.9
    a, b, c = (vertices[triangles[:, k]].astype(float) for k in range(3))
    volume, inside = np.sum(np.cross(a, b) * c) / 6, np.mean(grid["realisation"] < 0) * (NODES * STEP) ** 3
    assert volume == pytest.approx(inside, rel=2e-3)  # closed, faces outwards


def test_it_is_a_level_set(made, tmp_path):
    gp, grid = made
    gn.write_vdb(tmp_path / "realisation.vdb", grid)
    surface = gn.GaussianProcess(gn.VdbField(tmp_path / "realisation.vdb", "realisation"), 0, gn.SquaredExponential(LENGTH))
    origins = np.column_stack([np.random.default_rng(1).uniform(-0.4, 0.4, (200, 2)), np.full(200, 2.0)])
    hits = gn.first_hits(surface, origins, np.tile([0.0, 0, -1], (200, 1)), 10)
    assert np.isfinite(hits["t"]).all()
    check_linear(gp.realisation_at(hits["position"], 5)["value"])


def test_lengths_that_vary_on_a_grid_of_many_nodes(full_size, seed):
    """Lengths from .05 to .2: nodes are the values at points, and in a plane where the lengths are one the covariance is that of
    Paciorek and Schervish with another such plane (here ((l l')/s²)^{3/2} exp(-r²/2s²), s² the mean of their squares). By how much
    neighbours differ tells lengths best. Points behind those planes are held."""
    nodes, length = 256 if full_size else 64, lambda x: 0.05 * 4 ** np.clip(x + 0.5, 0, 1)
    field, step = along_x(lambda x: isotropic(length(x)), 2, 129), 2 / (nodes - 1)
    held = np.round(np.array([[0.96, 0.6, 0.3], [0.97, 0.2, 0.6], [0.94, 0.8, 0.7]]) * (nodes - 1)).astype(int)
    conditions = {"points": -1 + step * held, "values": [0.3, -0.2, np.nan], "slopes": np.array([1, 0.7, 1.2])}
    conditions["normals"] = np.array([[np.nan] * 3, [0, 0.6, 0.8], [0, -1, 0]])
    gp = gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1.0), anisotropy=field, conditions=conditions)
    grid = gp.realisation(((-1, -1, -1), (1, 1, 1)), nodes, seed)["realisation"]
    assert grid.shape == (nodes,) * 3
    index = np.random.default_rng(seed).integers(0, nodes, (60, 3))
    np.testing.assert_allclose(grid[tuple(index.T)], gp.realisation_at(-1 + step * index, seed)["value"][0], atol=1e-5)
    at = gp.realisation_at(-1 + step * held, seed)
    np.testing.assert_allclose(at["value"][0, :2], [0.3, -0.2], atol=1e-8)
    np.testing.assert_allclose(at["gradient"][0, 1:], conditions["slopes"][1:, None] * conditions["normals"][1:], atol=1e-6)
    np.testing.assert_allclose(grid[tuple(held[:2].T)], [0.3, -0.2], atol=1e-5)  # in single precision
    for i in (1, 2):
        for axis in (1, 2):
            around = [grid[tuple(held[i] + s * np.eye(3, dtype=int)[axis])] for s in (-2, -1, 1, 2)]
            slope = np.dot(around, [1, -8, 8, -1]) / (12 * step)
            # h⁴/30 of the fifth derivative, of deviation √945/l⁵, and single precision.
            off = 4 * (step / 0.2) ** 4 / 30 * np.sqrt(945) / 0.2 + 5e-6 / step
            assert abs(slope - conditions["slopes"][i] * conditions["normals"][i, axis]) < off, (i, axis)
    area = (2 - 0.1) ** 2
    for a, b, lag in [(-0.79, -0.79, 0), (-0.58, -0.55, 0.03), (-0.05, 0.03, 0.03), (0.04, 0.08, 0)]:
        i, j = (round((x + 1) / step) for x in (a, b))
        lag = round(lag / step)
        # As it is interpolated.
        a, b = (np.sqrt(field([[-1 + step * n, 0, 0]])[0, 0]) for n in (i, j))
        s2, r2 = (a * a + b * b) / 2, step**2 * ((i - j) ** 2 + lag**2)
        expected = (a * b / s2) ** 1.5 * np.exp(-r2 / (2 * s2))
        product = np.mean(grid[i, lag:, :] * grid[j, : nodes - lag, :], dtype=float)
        # Variance as above, of a plane; edges make it a little more.
        check_z(product, expected, np.sqrt(np.pi * s2 * (1 + expected**2) / area), f"{i} {j} {lag}")
    # Of all lengths one, and where they grow: squares of γ = 2ρ(u) - ρ(u + r) - ρ(u - r), at the longest length of the slab.
    for low, high in [(-1, -0.5), (-0.5, -0.2)]:
        planes = slice(int(np.ceil((low + 1) / step)), int((high + 1) / step))
        l2, r2 = field([[-1 + step * n, 0, 0] for n in range(planes.start, planes.stop)])[:, 0], step**2
        expected, longest = np.mean(2 - 2 * np.exp(-r2 / (2 * l2))), l2.max()
        square = 6 - 8 * np.exp(-r2 / (4 * longest)) + 2 * np.exp(-r2 / longest)
        error = np.sqrt(2 * np.pi**1.5 * longest**1.5 * square / ((high - low - 2 * step) * 4))
        for axis in (1, 2):
            moved = np.mean(np.diff(grid[planes], axis=axis) ** 2, dtype=float)
            check_z(moved, expected, error, f"neighbours from {low} to {high}")
