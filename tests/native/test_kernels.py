"""Kernels against closed forms written here on their own, their derivatives by finite differences in long arithmetic,
and their normal forms."""

import math

import gpis_native as gn
import numpy as np
import pytest

INF = math.inf
SCALES, ROTATION = np.array([0.3, 0.7, 1.9]), np.array([0.9, 0.3, -0.2, 0.1])
AXIS, WAVE = np.array([0.48, 0.6, 0.64]), np.array([2.1, -1.3, 0.4])


def rotation_matrix(q):
    w, x, y, z = np.asarray(q) / np.linalg.norm(q)
    cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + 2 * w * cross + 2 * cross @ cross  # Rodrigues


def distance(r, scales, rotation=(1, 0, 0, 0)):
    """q = |diag(1/l) Rᵀ r| in long arithmetic."""
    turned = np.asarray(r, np.longdouble) @ rotation_matrix(rotation).astype(np.longdouble)
    return np.sqrt(np.sum((turned / np.broadcast_to(scales, 3)) ** 2, axis=-1))


RADIAL = {
    "squared exponential": lambda q: np.exp(-q * q / 2),
    "matern 1/2": lambda q: np.exp(-q),
    "matern 3/2": lambda q: (1 + np.sqrt(np.longdouble(3)) * q) * np.exp(-np.sqrt(np.longdouble(3)) * q),
    "matern 5/2": lambda q: (1 + np.sqrt(np.longdouble(5)) * q + 5 * q * q / 3) * np.exp(-np.sqrt(np.longdouble(5)) * q),
    "rational quadratic": lambda q: (1 + q * q / 1.4) ** np.longdouble(-0.7),
    "wong": lambda q: np.longdouble(1.5) * np.exp(-q / np.sqrt(np.longdouble(3))) - np.exp(-np.sqrt(np.longdouble(3)) * q) / 2,
}
MAKE = {
    "squared exponential": gn.SquaredExponential,
    "matern 1/2": lambda *a, **k: gn.Matern(0.5, *a, **k),
    "matern 3/2": lambda *a, **k: gn.Matern(1.5, *a, **k),
    "matern 5/2": lambda *a, **k: gn.Matern(2.5, *a, **k),
    "rational quadratic": lambda *a, **k: gn.RationalQuadratic(0.7, *a, **k),
    "wong": gn.Wong,
}


def periodic(r, period, scale):
    return np.exp(-2 * np.sin(np.pi * (r @ AXIS.astype(np.longdouble)) / np.longdouble(period)) ** 2 / scale**2)


def envelope(r):
    return RADIAL["squared exponential"](distance(r, SCALES, ROTATION))


def wave(r):
    return np.cos(r @ WAVE.astype(np.longdouble))


# name -> (kernel, covariance of r written here)
KERNELS = {
    name: (MAKE[name](SCALES, rotation=ROTATION), lambda r, name=name: RADIAL[name](distance(r, SCALES, ROTATION)))
    for name in RADIAL
}
SE = gn.SquaredExponential(SCALES, rotation=ROTATION)
LP = gn.LocallyPeriodic(SCALES, 0.4, 3 * AXIS, 0.8, rotation=ROTATION)
KERNELS |= {
    "height field": (gn.Matern(2.5, [0.3, 0.4, INF]), lambda r: RADIAL["matern 5/2"](distance(r, [0.3, 0.4, INF]))),
    "plane wave": (gn.PlaneWave(WAVE), wave),
    "locally periodic": (LP, lambda r: periodic(r, 0.4, 0.8) * envelope(r)),
    "sharply periodic": (
        gn.LocallyPeriodic(SCALES, 3.1, AXIS, 0.05, rotation=ROTATION),
        lambda r: periodic(r, 3.1, 0.05) * envelope(r),
    ),
    "sum": (
        0.5 * gn.Matern(1.5, 0.4) + SE * 0.25,
        lambda r: RADIAL["matern 3/2"](distance(r, 0.4)) / 2 + envelope(r) / 4,
    ),
    "product": (
        gn.SquaredExponential([0.5, INF, INF]) * SE,
        lambda r: RADIAL["squared exponential"](distance(r, [0.5, INF, INF])) * envelope(r),
    ),
    "product of products": (
        (gn.PlaneWave(WAVE) + 0.3 * SE) * (LP * gn.PlaneWave(2 * WAVE)),
        lambda r: (wave(r) + np.longdouble(0.3) * envelope(r)) * periodic(r, 0.4, 0.8) * envelope(r) * wave(2 * r),
    ),
    "wave times matern": (
        gn.PlaneWave(WAVE) * gn.Matern(2.5, 0.8),
        lambda r: wave(r) * RADIAL["matern 5/2"](distance(r, 0.8)),
    ),
    "no normal form": (
        gn.Matern(1.5, 0.8) * SE,
        lambda r: RADIAL["matern 3/2"](distance(r, 0.8)) * envelope(r),
    ),
}
ROUGH = ["matern 1/2"]
parametrize = pytest.mark.parametrize("name", KERNELS)
smooth = pytest.mark.parametrize("name", [k for k in KERNELS if k not in ROUGH])


def lags(seed=0):
    """Differences of all sizes: 1e-8 to 30 length scales, in all directions."""
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(120, 3))
    directions /= np.linalg.norm(directions, axis=1)[:, None]
    return directions * np.geomspace(1e-8, 20, 120)[:, None]


def origin():
    return np.zeros((1, 3))


@parametrize
def test_closed_form(name):
    kernel, expected = KERNELS[name]
    r = lags()
    np.testing.assert_allclose(kernel(r, origin())[:, 0], expected(r.astype(np.longdouble)).astype(float), atol=4e-14)
    assert kernel.variance == pytest.approx(float(expected(np.zeros((1, 3), np.longdouble))[0]), rel=1e-15)


# Fourth-order differences in long arithmetic: error ~ h⁴ κ⁗' + 1e-19/h.
STENCIL = [(-2, 1 / 12), (-1, -2 / 3), (1, 2 / 3), (2, -1 / 12)]


def difference(f, r, axis, h):
    step = np.zeros(3, np.longdouble)
    step[axis] = h
    return sum(np.longdouble(w) * f(r + k * step) for k, w in STENCIL) / h


@smooth
def test_derivatives_are_those_of_the_covariance(name):
    """Gradient and mixed second derivative, at lags from 1e-3 on (below, differences see the kink of Matérn 3/2)."""
    kernel, k = KERNELS[name]
    r = lags(1)
    r = r[np.linalg.norm(r, axis=1) > 1e-2].astype(np.longdouble)
    h = np.longdouble(1e-4)
    gradient = np.stack([difference(k, r, i, h) for i in range(3)], axis=-1)
    size = max(1.0, math.sqrt(max(kernel.derivative_variance(e) for e in np.eye(3))))
    np.testing.assert_allclose(kernel.gradient(r, origin())[:, 0], gradient.astype(float), atol=3e-9 * size**5)
    mixed = np.stack(
        [np.stack([-difference(lambda x, j=j: difference(k, x, j, h), r, i, h) for j in range(3)], axis=-1) for i in range(3)],
        axis=-2,
    )
    got = kernel.mixed(r, origin())[:, 0]
    np.testing.assert_allclose(got, mixed.astype(float), atol=3e-8 * size**6)
    np.testing.assert_allclose(got, np.swapaxes(got, 1, 2), atol=1e-12 * size**2)


@parametrize
def test_gram_matrices_are_positive(name):
    rng = np.random.default_rng(2)
    points = rng.uniform(-1, 1, size=(120, 3)) * SCALES * 3
    kernel = KERNELS[name][0]
    gram = kernel(points, points)
    np.testing.assert_array_equal(gram, gram.T)
    assert np.linalg.eigvalsh(gram)[0] > -1e-12 * len(points)
    if name in ROUGH:
        return
    # Values and gradients together, (g, ∇g) at every point: the blocks that joint samplers factorise.
    p = points[:30]
    slopes = kernel.gradient(p, p)  # cov(∇g(x), g(y)); cov(g(x), ∇g(y)) is minus it
    joint = np.block([
        [kernel(p, p), -slopes.transpose(0, 1, 2).reshape(30, 90)],
        [slopes.transpose(0, 2, 1).reshape(90, 30), kernel.mixed(p, p).transpose(0, 2, 1, 3).reshape(90, 90)],
    ])  # fmt: skip
    np.testing.assert_allclose(joint, joint.T, atol=1e-10 * np.abs(joint).max())
    assert np.linalg.eigvalsh(joint)[0] > -1e-13 * 120 * np.abs(joint).max()


@smooth
def test_derivatives_at_tiny_distances(name):
    """1e-8 length scales apart: no cancellation. ∇k = -G r to first order and the mixed derivative is G, both up to
    the |r| term of the kernels whose third derivative jumps (2.6 λ₂ |r|/l³ is its largest)."""
    kernel = KERNELS[name][0]
    g = kernel.mixed(origin(), origin())[0, 0]
    np.testing.assert_allclose(kernel.gradient(origin(), origin()), 0)
    for size in [1e-8, 1e-12, 1e-100]:
        r = size * np.array([[0.6, -0.64, 0.48]]) * 0.3
        slope = kernel.gradient(r, origin())[0, 0]
        relative = 100 * size + 1e-14
        np.testing.assert_allclose(slope, -g @ r[0], atol=relative * np.abs(g).max() * size)
        np.testing.assert_allclose(kernel.mixed(r, origin())[0, 0], g, atol=relative * np.abs(g).max())


@pytest.mark.parametrize(
    ("name", "cubic"),
    [("matern 3/2", 3**1.5), ("wong", 2 / math.sqrt(3)), ("matern 5/2", 0.0), ("squared exponential", 0.0)],
)
def test_the_kink_of_the_second_derivative(name, cubic):
    """-κ'' + λ₂ = 2·(3 c₃) q with κ = 1 - λ₂q²/2 + c₃q³: known to full precision at q = 1e-8 where λ₂ hides it."""
    kernel = MAKE[name](1.0)
    across = kernel.mixed([[0, 0, 1e-3]], origin())[0, 0]
    along, side = across[2, 2], across[0, 0]
    # κ'' - κ'/q = 3 c₃ q + O(q²)
    assert side - along == pytest.approx(cubic * 1e-3, rel=6e-3, abs=1e-5)


@smooth
def test_derivative_variance(name):
    kernel = KERNELS[name][0]
    g = kernel.mixed(origin(), origin())[0, 0]
    for d in np.random.default_rng(3).normal(size=(5, 3)):
        assert kernel.derivative_variance(d) == pytest.approx(d @ g @ d, rel=1e-13)


def test_derivative_variance_in_closed_form():
    """λ₂ dᵀA⁻¹d (definitions E3), the table of math.md §2, and 4π²/(p²ℓ_p²) along the axis of a periodic kernel."""
    turn = rotation_matrix(ROTATION)
    inverse_a = turn @ np.diag(SCALES**-2.0) @ turn.T
    d = np.array([0.2, -0.5, 0.9])
    for name, lambda2 in [
        ("squared exponential", 1), ("matern 3/2", 3), ("matern 5/2", 5 / 3), ("rational quadratic", 1), ("wong", 1)
    ]:  # fmt: skip
        assert KERNELS[name][0].derivative_variance(d) == pytest.approx(lambda2 * d @ inverse_a @ d, rel=1e-13)
    along = (2 * np.pi / (0.4 * 0.8) * (d @ AXIS)) ** 2
    assert LP.derivative_variance(d) == pytest.approx(d @ inverse_a @ d + along, rel=1e-13)
    assert gn.PlaneWave(WAVE).derivative_variance(d) == pytest.approx((WAVE @ d) ** 2, rel=1e-13)
    assert gn.Matern(0.5, 1).derivative_variance(d) == INF
    assert (0.5 * gn.Matern(1.5, 0.4) + 0.25 * SE).derivative_variance(d) == pytest.approx(
        1.5 * d @ d / 0.16 + 0.25 * d @ inverse_a @ d, rel=1e-13
    )


@pytest.mark.parametrize("make", MAKE.values(), ids=MAKE)
def test_infinite_lengths_and_rotations(make):
    field = make([0.3, 0.4, INF], rotation=ROTATION)
    turn = rotation_matrix(ROTATION)
    r, along = lags(4)[:90], turn[:, 2]
    np.testing.assert_allclose(field(r, origin()), field(r + 17 * along, origin()), atol=1e-13)
    if make is not MAKE["matern 1/2"]:
        np.testing.assert_allclose(field.gradient(r, origin()) @ along, 0, atol=1e-13)
        np.testing.assert_allclose(field.mixed(r, origin()) @ along, 0, atol=1e-12)
    assert field.derivative_variance(along) in (pytest.approx(0, abs=1e-14), INF)
    assert field.derivative_variance(along) >= 0
    # Turning points and axes together changes nothing; a quaternion and its negative turn alike.
    plain = make([0.3, 0.7, 1.9])
    np.testing.assert_allclose(plain(r, origin()), make(SCALES, rotation=ROTATION)(r @ turn.T, origin()), atol=1e-14)
    negative, doubled = make(SCALES, rotation=-ROTATION), make(SCALES, rotation=2 * ROTATION)
    np.testing.assert_allclose(negative(r, origin()), doubled(r, origin()), atol=1e-14)
    assert make([INF] * 3)([[1e9, 2, 3]], origin())[0, 0] == 1


@parametrize
def test_normal_form(name):
    """The independent terms that samplers draw add up to the covariance."""
    terms = KERNELS[name][0].terms()
    if name == "no normal form":
        assert terms is None
        return
    r = lags(5).astype(np.longdouble)
    total = 0
    for t in terms:
        q = np.sqrt(np.sum((r @ t["whitening"].T.astype(np.longdouble)) ** 2, axis=1))
        radial = RADIAL.get(t["family"], lambda q: np.ones_like(q))(q)
        total = total + t["weight"] * radial * np.cos(r @ t["wave_vector"].astype(np.longdouble))
    np.testing.assert_allclose(np.asarray(total, float), KERNELS[name][1](r).astype(float), atol=2e-12)


def test_normal_form_of_a_product_of_lengths_far_apart():
    (term,) = (gn.SquaredExponential([1e-6, INF, INF]) * gn.SquaredExponential([INF, 1e4, INF])).terms()
    np.testing.assert_allclose(np.sort(np.linalg.norm(term["whitening"], axis=1)), [0, 1e-4, 1e6], rtol=1e-5)


def test_normal_forms_too_long_are_not_made():
    sharp = gn.LocallyPeriodic(1, 1, [1, 0, 0], 0.01)
    assert 300 < len(sharp.terms()) < 1500
    assert (sharp * sharp).terms() is None
    blunt = gn.LocallyPeriodic(1, 1, [1, 0, 0], 1e6)
    assert len(blunt.terms()) <= 2


def test_algebra_reads_back():
    inf = INF  # as repr writes it
    assert eval(repr(gn.SquaredExponential([1, inf, 2]) * gn.Wong(1)), vars(gn) | {"inf": inf}).variance == 1
    for kernel, _ in KERNELS.values():
        again = eval(repr(kernel), vars(gn) | {"inf": inf})
        np.testing.assert_allclose(again(lags(), origin()), kernel(lags(), origin()), atol=1e-12)
    assert (0.5 * SE + SE).variance == 1.5
    assert isinstance(gn.Matern(1.5, 1), gn.Kernel)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: gn.SquaredExponential([1, -1, 1]), "length_scale must be positive .* it holds -1"),
        (lambda: gn.Matern(1.5, math.nan), "length_scale must be positive"),
        (lambda: gn.Wong(-INF), "length_scale must be positive"),
        (lambda: gn.Matern(2, 1), "nu is 2: a Matérn kernel takes 0.5, 1.5 or 2.5"),
        (lambda: gn.Matern("x", 1), "nu must be a number, it is 'x'"),
        (lambda: gn.RationalQuadratic(0, 1), "alpha is 0; it takes a positive number"),
        (lambda: gn.RationalQuadratic(INF, 1), "alpha is inf"),
        (lambda: gn.PlaneWave([0, 0, 0]), "wave_vector is .*direction of non-zero length"),
        (lambda: gn.PlaneWave([1, 2]), "wave_vector must hold three numbers"),
        (lambda: gn.PlaneWave([1, math.nan, 0]), "wave_vector must hold finite numbers"),
        (lambda: gn.LocallyPeriodic(1, -1, [1, 0, 0], 1), "period is -1; it takes a positive number"),
        (lambda: gn.LocallyPeriodic(1, 1, [0, 0, 0], 1), "axis is"),
        (lambda: gn.LocallyPeriodic(1, 1, [1, 0, 0], 0), "periodic_scale is 0; it takes 0.001 to 1e6"),
        (lambda: gn.Wong(1, rotation=[0, 0, 0, 0]), "rotation must be a quaternion that is not zero"),
        (lambda: -1 * gn.Wong(1), "The weight of a kernel is -1; it takes a positive number"),
        (lambda: 10 * (1e308 * gn.Wong(1)), "The variance of a kernel times its weight is inf; it takes a positive number"),
        (lambda: 1e308 * gn.Wong(1) + 1e308 * gn.Wong(1), "The variance of a sum of kernels is inf"),
        (lambda: (1e-200 * gn.Wong(1)) * (1e-200 * gn.Wong(1)), "The variance of a product of kernels is 0"),
        (lambda: gn.Wong(1) * math.nan, "The weight of a kernel is nan"),
        (lambda: gn.Matern(0.5, 1).gradient([[0, 0, 1]], [[0, 0, 0]]), "Matern.0.5, 1. has no gradient"),
        (lambda: (gn.Matern(0.5, 1) + SE).mixed([[0, 0, 1]], [[0, 0, 0]]), "has no gradient"),
        (lambda: SE([[0, 0]], [[0, 0, 0]]), "x must be an array of shape"),
        (lambda: gn.GaussianProcess(0, 1, None), "kernel must be a kernel, it is a NoneType"),
    ],
)
def test_wrong_arguments(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.parametrize("call", [lambda: SE + 1, lambda: SE * "x"])
def test_operands_that_are_no_kernels(call):
    with pytest.raises(TypeError):
        call()
