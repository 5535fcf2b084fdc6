"""The path of a ray is one function, over every sampler that serves a kernel: its root is where the hit is, none is passed by,
a ray that was far from the surface in between has not forgotten what it was before, a start that is known is left by the
law of slopes as of values, and what the memory does not keep is forgotten."""

from math import erfc, exp, pi, sqrt

import gpis_native as gn
import numpy as np
import pytest
from line_samplers import KERNELS, SAMPLERS, SERVED, factorises, worth
from statistics_checks import Z_LIMIT, check_proportion, check_z

pytestmark = pytest.mark.stats
X = np.array([1.0, 0, 0])
RADIAL = ("squared exponential", "matern 3/2", "matern 5/2", "wong", "rational quadratic")
# Bridges draw what they are asked for: behind a hit they no longer know at what its root was refined. The joint law of place and
# slope there is that of the closed form: test_markov.py.
ROUGH = ("matern 3/2", "matern 5/2", "wong", "sum with a rough term", "sum of rough terms")
BRIDGES = [(k, s) for k, s in SERVED if s == "markov" or (s == "dense" and k in ROUGH)]


def along_x(n):
    return np.zeros((n, 3)), np.tile(X, (n, 1))


def process(kernel, mean, length=8):
    return gn.GaussianProcess(mean, 1, KERNELS[kernel], bounds=((-1, -1, -1), (length, 1, 1)))


@pytest.mark.parametrize(("kernel", "sampler"), [p for p in SERVED if p not in BRIDGES])
def test_the_root_is_that_of_the_path(kernel, sampler, seed):
    """f is 0 at the hit and has the slope there that the hit says, without a secant's error; f > 0 in front of it."""
    gp, n = process(kernel, 0.3), 60
    hits = gn.first_hits(gp, *along_x(n), 7, sampler=sampler, seed=seed)
    rows = np.flatnonzero(np.isfinite(hits["t"]) & (hits["t"] > 0.01))[:10]
    for i in rows:
        t, slope = hits["t"][i], hits["gradient"][i, 0]
        # Realisations of the roughest kernels bend within 1e-6, and are sums of parts of order 1.
        at = t - np.array([0.9 * t, 0.5 * t, 1e-3, 1e-6, 1e-9])
        f = gn.line_values(gp, *along_x(1), at, sampler=sampler, seed=seed, first_index=int(i))[0]
        assert np.all(f[:4] > 0) and abs(f[4]) < 5e-9 * max(1, -slope), (i, f)
        assert f[3] == pytest.approx(-1e-6 * slope, rel=0.02, abs=1e-9)
    assert len(rows) == 10


@pytest.mark.parametrize(("kernel", "sampler"), SERVED)
def test_no_root_is_passed_by(kernel, sampler, full_size, seed):
    """Paths looked at 100 times where the ray has not hit: inside anywhere for 1e-3 of the rays at most, the default."""
    n, t = worth(kernel, sampler, 200_000 if full_size else 10_000), np.linspace(0.02, 2, 100)
    gp = process(kernel, 0.3)
    hits = gn.first_hits(gp, *along_x(n), 2, sampler=sampler, seed=seed)
    f = gn.line_values(gp, *along_x(n), t, sampler=sampler, seed=seed)
    before = t < hits["t"][:, None] - 1e-6
    assert np.isfinite(f[before]).all() and before.mean() > 0.2
    missed = np.sum(np.any(before & (f < 0), axis=1))
    assert missed <= 1e-3 * n + Z_LIMIT * np.sqrt(1e-3 * n), f"{missed} of {n}"


def ramp(x, slope, low, high):
    return gn.PlaneField([x, 0, 0], [np.sign(slope), 0, 0], abs(slope)).clamped(low, high)


# A realisation is a function of its own: test_realisation_covariance.cpp.
@pytest.mark.parametrize(("kernel", "sampler"), [p for p in SERVED if p[1] != "realisation"])
def test_nothing_is_forgotten_where_nothing_is_drawn(kernel, sampler, full_size, seed):
    """Between two stretches near the surface (5 deviations off, so that no path is inside) the mean is at 45, where nothing is
    drawn: the values on both sides have the covariance of the kernel all the same (definitions B4)."""
    n = worth(kernel, sampler, 400_000 if full_size else 30_000 if factorises(kernel, sampler) else 10_000)
    gap = gn.ConstantField(5.0) + ramp(0.6, 100, 0, 40) + ramp(1.5, -100, -40, 0)
    t, gp = np.array([0.3, 0.55, 1.2, 1.95, 2.3]), process(kernel, gap, 2.6)
    f = gn.line_values(gp, *along_x(n), t, sampler=sampler, tolerance=1e-6, seed=seed)
    assert np.isnan(f[:, 2]).all()
    g = f[np.isfinite(f[:, [0, 1, 3, 4]]).all(axis=1)][:, [0, 1, 3, 4]] - 5
    assert len(g) > 0.99 * n
    x = t[[0, 1, 3, 4], None] * X
    k = KERNELS[kernel](x, x)
    assert k[1, 2] > 0.15
    check_z(g.mean(axis=0), 0, 1 / np.sqrt(len(g)), "mean")
    stated = 1e-3  # what the worst of the plans states (test_implied_covariance.cpp measures it without noise)
    check_z(np.maximum(np.abs(g.T @ g / len(g) - k) - stated, 0), 0, np.sqrt((1 + k**2) / len(g)), "covariance")


@pytest.mark.parametrize("sampler", SAMPLERS["squared exponential"])
def test_slopes_close_to_a_known_start(sampler, full_size, seed):
    """Oracle 8: Var f' = 1 - (1 - q² + q⁴)e^{-q²} = 2q² - ..., by differences, whose variance long arithmetic gives."""
    n = worth("squared exponential", sampler, 400_000 if full_size else 60_000)
    q = np.array([1e-3, 1e-2, 0.1])
    t = np.sort(np.concatenate([0.9 * q, 1.1 * q]))
    u = t.astype(np.longdouble)
    k = np.exp(-((u[:, None] - u) ** 2) / 2) - np.exp(-(u[:, None] ** 2 + u**2) / 2) * (1 + np.outer(u, u))
    difference = np.kron(np.eye(3), [-1, 1]) / np.repeat(0.2 * q, 2)
    expected = np.diag((difference @ k @ difference.T).astype(float))
    np.testing.assert_allclose(expected, 1 - (1 - q**2 + q**4) * np.exp(-(q**2)), rtol=0.01)
    start = {"value": np.full(n, 5.0), "gradient": np.zeros((n, 3))}
    gp = process("squared exponential", 5.0)
    slopes = (gn.line_values(gp, *along_x(n), t, start=start, sampler=sampler, tolerance=1e-6, seed=seed) - 5) @ difference.T
    slopes = slopes[np.isfinite(slopes).all(axis=1)]
    assert len(slopes) > 0.99 * n
    check_z(np.mean(slopes**2, axis=0) / expected, 1, np.sqrt(2 / len(slopes)), "variance of slopes")
    check_z(slopes.mean(axis=0) / np.sqrt(expected), 0, 1 / np.sqrt(len(slopes)), "mean of slopes")


@pytest.mark.parametrize(("kernel", "sampler"), SERVED)
def test_none_forgets_all_but_that_it_is_outside(kernel, sampler, full_size, seed):
    """Definitions B2: from a start with a value and a gradient f is N(μ, 1) truncated at 0 all the same, and its slope free."""
    n, mu, t = worth(kernel, sampler, 400_000 if full_size else 40_000), 0.4, 1e-3
    start = {"value": np.zeros(n), "gradient": np.tile([2.5, 1.0, -1.0], (n, 1))}
    options = {"memory": "none", "start": start, "sampler": sampler, "seed": seed}
    f = gn.line_values(process(kernel, mu), *along_x(n), [1e-9, t], **options)
    f = f[np.isfinite(f).all(axis=1)]
    # Rays whose f is below a slope times t may be gone by t.
    assert len(f) > 0.998 * n - 5 and f.min() > 0
    for level in (0.3, 1.0, 2.0):
        check_proportion(np.sum(f[:, 0] > level), n, erfc((level - mu) / sqrt(2)) / erfc(-mu / sqrt(2)), 2e-3, f"above {level}")
    rho = KERNELS[kernel](t * X[None], np.zeros((1, 3)))[0, 0]
    slope = (f[:, 1] - mu - rho * (f[:, 0] - mu)) / t / sqrt((1 - rho) * (1 + rho) / t**2)
    m = len(slope)
    check_z(slope.mean(), 0, 1 / sqrt(m) + 2e-3, "slope")  # the rays that are gone had steep ones
    check_z((slope**2).mean(), 1, sqrt(2 / m) + 1e-2, "variance of the slope")
    check_z((slope * f[:, 0]).mean(), 0, (slope * f[:, 0]).std() / sqrt(m) + 2e-3, "slope with the value")


@pytest.mark.parametrize(("kernel", "sampler"), [p for p in SERVED if p[0] in RADIAL])
def test_renewal_forgets_the_gradient(kernel, sampler, full_size, seed):
    """Across the ray gradients are N(0, λ₂) at the next hit, whatever they were at the start (Renewal+: oracle 9)."""
    n, k = worth(kernel, sampler, 400_000 if full_size else 20_000), KERNELS[kernel]
    start = {"value": np.zeros(n), "gradient": np.tile([0.7, 1.5, -2.0], (n, 1))}
    options = {"memory": "renewal", "start": start, "sampler": sampler, "seed": seed}
    hits = gn.first_hits(process(kernel, 0), *along_x(n), 6, **options)
    for part in (hits["t"] < 1, (hits["t"] >= 1) & np.isfinite(hits["t"])):
        across = hits["gradient"][part, 1:] / sqrt(k.derivative_variance(X))
        assert len(across) > 10
        check_z(across.mean(axis=0), 0, 1 / sqrt(len(across)))
        check_z((across**2).mean(axis=0), 1, sqrt(2 / len(across)))


FACES = [gn.GaussianProcess(gn.PlaneField([2, 0, 0], [-1, 0, 0], s), 0, gn.SquaredExponential(1)) for s in (1.0, 1.7)]


@pytest.mark.parametrize(
    ("tree", "meets"),
    [
        (gn.intersection(*FACES), True),
        (gn.difference(*FACES), False),  # what is left has no inside: F touches 0
        (gn.intersection(gn.complement(FACES[1]), FACES[0]), False),
        (gn.difference(gn.union(FACES[0], FACES[1]), gn.complement(FACES[1])), True),
    ],
)
def test_faces_in_one_place(tree, meets):
    """Certain faces that a ray meets together: dividing the step cannot tell them apart, and ends (`line_split_limit`)."""
    origins, directions = along_x(50)
    origins[:, 1] = np.linspace(-1, 1, 50)
    hits = gn.first_hits(tree, origins, directions, 4)
    assert hits["counters"]["line_split_limit"] == 50
    np.testing.assert_allclose(hits["t"], 2 if meets else np.inf, atol=1e-9)
    assert not meets or np.all(hits["gradient"][:, 0] < 0)


def smith_cosine(theta, alpha):
    """Quantiles of n·ω over the normals of a Beckmann height field that are visible from angle theta, and 1 + Λ, from slopes on
    a grid: Heitz 2014, D_v ∝ (n·ω) D(n) / n_z, whose integral over slopes is cos θ (1 + Λ)."""
    x = np.linspace(-5, 5, 801) * alpha / np.sqrt(2)
    sx, sy = np.meshgrid(x, x, indexing="ij")
    weight = np.exp(-(sx**2 + sy**2) / alpha**2) * np.maximum(np.cos(theta) - sx * np.sin(theta), 0)
    cosine = (np.cos(theta) - sx * np.sin(theta)) / np.sqrt(1 + sx**2 + sy**2)
    order = np.argsort(cosine, axis=None)
    cdf = np.cumsum(weight.ravel()[order])
    total = weight.sum() * (x[1] - x[0]) ** 2 / (np.pi * alpha**2)
    return np.interp(np.linspace(0, 1, 21), cdf / cdf[-1], cosine.ravel()[order]), total / np.cos(theta)


@pytest.mark.parametrize(("kernel", "alpha"), [("height field", 0.1), ("height field", 0.5), ("isotropic", 0.1)])
@pytest.mark.parametrize("degrees", [15, 45, 70])
def test_visible_normals_in_bins_of_one_size(kernel, degrees, alpha, full_size, seed, figure):
    """Oracle 12 where bins of n·ω that are the same for all α see nothing: at α = .1 nearly all normals lie in one. Twenty bins of
    5 % each, of Smith's law for Beckmann's normals, with Λ in closed form; kernels of both kinds agree with it at .1."""
    theta, n = np.radians(degrees), 400_000 if full_size else 120_000
    edges, projected = smith_cosine(theta, alpha)
    a = 1 / (np.tan(theta) * alpha)
    assert projected == pytest.approx(1 + exp(-a * a) / (2 * a * sqrt(pi)) - erfc(a) / 2, rel=1e-4)
    direction = np.array([-np.sin(theta), 0, -np.cos(theta)])
    lengths = [0.1, 0.1, np.inf] if kernel == "height field" else 0.1
    gp = gn.GaussianProcess(gn.PlaneField([0, 0, 0], [0, 0, 1], 1), alpha * 0.1 / sqrt(2), gn.SquaredExponential(lengths))
    hits = gn.first_hits(gp, np.tile(-3 * direction, (n, 1)), np.tile(direction, (n, 1)), 10, seed=seed)
    hit = np.isfinite(hits["t"])
    assert hit.mean() > 0.9999
    seen = -hits["gradient"][hit] @ direction / np.linalg.norm(hits["gradient"][hit], axis=1)
    edges[0], edges[-1] = -1, 1.001
    variation = 0.5 * np.abs(np.histogram(seen, edges)[0] / hit.sum() - 0.05).sum()
    figure(f"Oracle 12: {kernel}, {degrees} degrees, alpha {alpha}: total variation of n·ω in bins of 5 % {variation:.4f}")
    assert variation < (0.01 if degrees <= 45 or alpha < 0.5 else 0.02)
