"""The covariance of (g, ∇g): stationary, and after Paciorek and Schervish with a tensor field of squared length scales."""

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_z
from tensor_grids import GRID, ORIGIN, VALUES, VOXEL, matrices, points, trilinear

KERNELS = {
    "squared exponential": (gn.SquaredExponential(1.3), lambda q: np.exp(-((q / 1.3) ** 2) / 2), 1),
    "matern 3/2": (gn.Matern(1.5, 1), lambda q: (1 + np.sqrt(3) * q) * np.exp(-np.sqrt(3) * q), 3),
    "matern 5/2": (
        gn.Matern(2.5, 0.8),
        lambda q: (1 + np.sqrt(5) * q / 0.8 + 5 * (q / 0.8) ** 2 / 3) * np.exp(-np.sqrt(5) * q / 0.8),
        5 / 3,
    ),
    "rational quadratic": (gn.RationalQuadratic(0.7, 1), lambda q: (1 + q**2 / 1.4) ** -0.7, 1),
    "wong": (gn.Wong(1), lambda q: 1.5 * np.exp(-q / np.sqrt(3)) - 0.5 * np.exp(-np.sqrt(3) * q), 1),
    "sum": (
        0.6 * gn.SquaredExponential(1) + 0.4 * gn.Matern(2.5, 2),
        lambda q: 0.6 * np.exp(-(q**2) / 2) + 0.4 * (1 + np.sqrt(5) * q / 2 + 5 * q**2 / 12) * np.exp(-np.sqrt(5) * q / 2),
        0,
    ),
}
MOVED = GRID.transformed(np.diag([0.5, 2.0, 1.0, 1.0]))
SIGMA = gn.PlaneField([0, 0, 0], [1, 2, 3], 0.1).clamped(-0.2, 0.4) + 0.5


def process(name, anisotropy=GRID):
    return gn.GaussianProcess(0, SIGMA, KERNELS[name][0], anisotropy=anisotropy)


def paciorek_schervish(x, y, kappa):
    """Independent of the implementation: determinants and solves by numpy, pair by pair."""
    out = np.empty((len(x), len(y)))
    for i, p in enumerate(x):
        for j, q in enumerate(y):
            a, b = matrices(trilinear(p[None]))[0], matrices(trilinear(q[None]))[0]
            s = (a + b) / 2
            ratio = (np.linalg.det(a) * np.linalg.det(b)) ** 0.25 / np.sqrt(np.linalg.det(s))
            out[i, j] = ratio * kappa(np.sqrt((p - q) @ np.linalg.solve(s, p - q)))
    return out


@pytest.mark.parametrize("name", KERNELS)
def test_covariance_is_that_of_paciorek_and_schervish(name):
    """[PS06], the mixed determinant to the power 1/2 in the denominator (math.md §2)."""
    x, y = points(25, 5), points(20, 6)
    x[:5] = y[:5] + 1e-3
    expected = SIGMA(x)[:, None] * SIGMA(y) * paciorek_schervish(x, y, KERNELS[name][1])
    np.testing.assert_allclose(process(name).covariance(x, y), expected, rtol=1e-10, atol=1e-13)


@pytest.mark.parametrize("anisotropy", [None, GRID, MOVED], ids=["none", "grid", "moved grid"])
@pytest.mark.parametrize("name", KERNELS)
def test_derivatives_against_differences(name, anisotropy):
    """C10: fourth-order central differences of the covariance itself."""
    gp, h = process(name, anisotropy), 1e-3
    rng = np.random.default_rng(7)
    x = rng.uniform(-1, 0.6, (300, 3))
    y = x + rng.normal(0, 0.4, x.shape)
    # No difference straddles the face of a cell, where the interpolated A has a kink.
    stretch = {None: [1, 1, 1], GRID: [1, 1, 1], MOVED: [0.5, 2, 1]}[anisotropy]
    place = np.concatenate([x, y], axis=1) / np.tile(stretch, 2) - np.tile(ORIGIN, 2)
    inside = np.abs(np.modf(place / np.tile(VOXEL, 2) + 10)[0] - 0.5) < 0.47
    x, y = x[inside.all(axis=1)][:60], y[inside.all(axis=1)][:60]
    weights = {-2: 1 / 12, -1: -2 / 3, 1: 2 / 3, 2: -1 / 12}

    def value(x, y):
        return np.diag(gp.joint_covariance(x, y)[..., 0, 0])

    got = np.einsum("iijk->ijk", gp.joint_covariance(x, y))
    off = []
    for i, e in enumerate(np.eye(3) * h):
        by_x = sum(w * value(x + s * e, y) for s, w in weights.items()) / h
        by_y = sum(w * value(x, y + s * e) for s, w in weights.items()) / h
        off += [got[:, 1 + i, 0] - by_x, got[:, 0, 1 + i] - by_y]
        for j, f in enumerate(np.eye(3) * h):
            mixed = sum(w * v * value(x + s * e, y + t * f) for s, w in weights.items() for t, v in weights.items()) / h**2
            off.append(got[:, 1 + i, 1 + j] - mixed)
    assert np.abs(off).max() < 1e-6 * np.abs(got).max()


@pytest.mark.parametrize("name", KERNELS)
def test_values_and_gradients_together_are_positive_semidefinite(name):
    x = points(60, 8)
    x[30:40] = x[:10] + 1e-4
    blocks = process(name).joint_covariance(x, x)
    matrix = blocks.transpose(0, 2, 1, 3).reshape(4 * len(x), 4 * len(x))
    np.testing.assert_allclose(matrix, matrix.T, atol=1e-9 * np.abs(matrix).max())
    scale = 1 / np.sqrt(np.diag(matrix))
    assert np.linalg.eigvalsh(scale[:, None] * matrix * scale).min() > -1e-10


@pytest.mark.parametrize("name", ["squared exponential", "matern 3/2", "matern 5/2", "wong"])
def test_covariance_of_the_gradient_at_a_point(name):
    """Definitions E3: G = λ₂A⁻¹ + ⅛ tr(A⁻¹∂_iA A⁻¹∂_jA); values and gradients at a point are independent."""
    kernel, _, lambda2 = KERNELS[name]
    length = kernel.derivative_variance([1, 0, 0])  # λ₂/ℓ²
    x = points(40, 9)
    a, da = np.linalg.inv(matrices(GRID(x))), matrices(GRID.gradient(x))
    product = np.einsum("nab,nibc->niac", a, da)
    g = length * a + np.einsum("niab,njba->nij", product, product) / 8
    block = np.einsum("iijk->ijk", process(name).joint_covariance(x, x))
    np.testing.assert_allclose(block[:, 1:, 1:], g, rtol=1e-9, atol=1e-9 * np.abs(g).max())
    np.testing.assert_allclose(block[:, 0], [[1, 0, 0, 0]] * len(x), atol=1e-12)
    np.testing.assert_allclose(length, lambda2 / {"squared exponential": 1.3**2, "matern 5/2": 0.64}.get(name, 1))


def test_constant_tensors_are_the_stationary_kernel():
    rotation = [0.9, 0.3, -0.2, 0.1]
    w, *v = np.array(rotation) / np.linalg.norm(rotation)
    x, y, z = v
    axes = np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )
    a = axes @ np.diag(np.square([0.5, 1.5, 0.25])) @ axes.T
    values = np.broadcast_to([a[0, 0], a[1, 1], a[2, 2], a[0, 1], a[0, 2], a[1, 2]], (3, 3, 3, 6))
    field = gn.TensorGridField(values, 1, [-1, -1, -1])
    at = points(50, 3)
    with_field = gn.GaussianProcess(0, 1, gn.Matern(2.5, 1), anisotropy=field).joint_covariance(at, at)
    without = gn.GaussianProcess(0, 1, gn.Matern(2.5, [0.5, 1.5, 0.25], rotation=rotation)).joint_covariance(at, at)
    np.testing.assert_allclose(with_field, without, atol=2e-5 * np.abs(without).max())  # the grid keeps floats


@pytest.mark.stats
def test_samples_have_this_covariance(seed, full_size):
    gp, x = process("squared exponential"), points(12, 4)
    n = 400_000 if full_size else 40_000
    f = gp.sample(x, n, seed)
    k = gp.covariance(x, x)
    check_z(f.T @ f / n, k, np.sqrt((np.outer(np.diag(k), np.diag(k)) + k**2) / n))


@pytest.mark.parametrize(
    ("kernel", "sentence"),
    [
        (gn.SquaredExponential([1, 2, 1]), "whose own length_scale is one number"),
        (gn.PlaneWave([1, 0, 0]), "takes a kernel of one distance"),
        (gn.LocallyPeriodic(1, 0.5, [0, 0, 1], 1), "takes a kernel of one distance"),
        (gn.SquaredExponential(1) * gn.Matern(1.5, 1), "takes a kernel of one distance"),
    ],
)
def test_kernels_that_take_no_anisotropy_get_a_sentence(kernel, sentence):
    with pytest.raises(ValueError, match=sentence):
        gn.GaussianProcess(0, 1, kernel, anisotropy=GRID)


def test_other_arguments_get_a_sentence():
    with pytest.raises(ValueError, match="anisotropy must be a TensorField, it is a ndarray"):
        gn.GaussianProcess(0, 1, gn.SquaredExponential(1), anisotropy=VALUES)
    with pytest.raises(ValueError, match="has no gradient"):
        gn.GaussianProcess(0, 1, gn.Matern(0.5, 1)).joint_covariance(points(1), points(1))
