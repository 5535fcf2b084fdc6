"""Lines of Matérn and Wong kernels against closed forms (design oracles, numbered as there), and every kernel that two
samplers serve: one sampler against the other."""

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import SIGNIFICANCE, Z_LIMIT, check_proportion, check_z

pytestmark = pytest.mark.stats
LINE = ((-1, -1, -1), (12, 1, 1))  # bounds around the x axis, short enough for the dense sampler
KERNELS = {
    "squared exponential": gn.SquaredExponential,
    "matern 3/2": lambda *a, **k: gn.Matern(1.5, *a, **k),
    "matern 5/2": lambda *a, **k: gn.Matern(2.5, *a, **k),
    "wong": gn.Wong,
    "rational quadratic": lambda *a, **k: gn.RationalQuadratic(0.7, *a, **k),
}
FAST = {"squared exponential": "convolution", "matern 3/2": "markov", "matern 5/2": "markov", "wong": "markov"}
PAIRS = [(kernel, sampler) for kernel in KERNELS for sampler in (FAST.get(kernel, "spectral"), "dense")]
ROUGH = ["matern 3/2", "matern 5/2", "wong"]


@pytest.fixture
def n(full_size):
    return 1_000_000 if full_size else 100_000


def along_x(n):
    return np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0], (n, 1))


def on_surface(n, gradient=(1.0, 0.3, -0.2)):
    return {"value": np.zeros(n), "gradient": np.tile(np.asarray(gradient, float), (n, 1))}


def process(kernel, mean=0.0, sigma=1.0, bounds=LINE, length_scale=1.0):
    return gn.GaussianProcess(mean, sigma, KERNELS[kernel](length_scale), bounds=bounds)


@pytest.mark.parametrize("sampler", ["markov", "dense"])
@pytest.mark.parametrize(
    ("start", "memory", "survival"),
    [
        ("slope 1", "renewal+", [0.81637, 0.66014, 0.47057, 0.19405]),
        ("surface", "renewal", [0.81842, 0.68804, 0.50282, 0.20911]),
        ("outside", "renewal+", [0.85624, 0.73684, 0.54929, 0.23051]),
    ],
)
def test_survival_of_wong(sampler, start, memory, survival, n, full_size, seed, figure):
    """Oracle 5, closed form (McKean 1963, Wong 1966), exact to its last digit; at full size to 1e-3."""
    n = 4 * n if full_size else n
    origins, directions = along_x(2 * n)
    state = None if start == "outside" else on_surface(2 * n)
    hits = gn.first_hits(process("wong"), origins, directions, 6, memory=memory, start=state, sampler=sampler, seed=seed)
    times = [0.5, 1, 2, 5]
    survived = np.array([np.sum(hits["t"] > t) for t in times])
    check_proportion(survived, 2 * n, survival, 5e-6, f"{sampler}, {start}")
    off = np.abs(survived / (2 * n) - survival).max()
    figure(f"Oracle 5: Wong by {sampler}, {start}: survival off by {off:.1e} at most, {2 * n} rays")
    assert off < 1e-3 or not full_size


@pytest.mark.parametrize("sampler", ["markov", "dense"])
def test_slope_of_wong_at_its_first_return(sampler, n, seed):
    """Oracle 5: joint density of u = e^{2t/√3} - 1 and h, slope at the hit 2h/√(1+u), from slope v = 2b = 1."""
    from math import erf

    b, t_max = 0.5, 8.0
    hits = gn.first_hits(process("wong"), *along_x(n), t_max, start=on_surface(n), sampler=sampler, seed=seed)
    hit = np.isfinite(hits["t"])
    u_edges = np.geomspace(1e-7, np.expm1(2 * t_max / np.sqrt(3)), 2401)
    u = np.sqrt(u_edges[1:] * u_edges[:-1])[:, None]
    h = (np.arange(1500) + 0.5) / 1500 * 12 * (np.sqrt(u) + b)
    weight = (
        np.sqrt(3) * h / (np.pi * u**2) * np.exp(-2 * (b * b - b * h + h * h) / u) * np.vectorize(erf)(np.sqrt(6 * b * h / u))
    )
    weight *= np.diff(u_edges)[:, None] * (h[:, 1] - h[:, 0])[:, None]
    assert abs(weight.sum() - hit.mean()) < Z_LIMIT * 0.5 / np.sqrt(n) + 1e-4
    slope = (2 * h / np.sqrt(1 + u)).ravel()
    order = np.argsort(slope)
    expected = np.cumsum(weight.ravel()[order]) / weight.sum()
    got = np.sort(-hits["gradient"][hit, 0])
    cdf = np.interp(got, slope[order], expected)
    steps = np.arange(len(got) + 1) / len(got)
    distance = max(np.max(steps[1:] - cdf), np.max(cdf - steps[:-1]))
    assert 2 * np.exp(-2 * len(got) * max(distance - 5e-4, 0) ** 2) > SIGNIFICANCE, distance


@pytest.mark.parametrize(("kernel", "sampler"), PAIRS)
@pytest.mark.parametrize("start", ["outside", "value and slope"])
def test_implied_correlation(kernel, sampler, start, n, seed):
    """Correlation of the values that a render's own line takes; a mean of 5 deviations keeps every path outside."""
    gp, (origins, directions) = process(kernel, 5.0), along_x(n)
    t = np.array([0.01, 0.05, 0.3, 0.5, 0.77, 1.0, 1.9, 2.6, 4.0])
    points, k = t[:, None] * [1.0, 0, 0], KERNELS[kernel](1.0)
    covariance, mean, state = k(points, points), np.zeros(len(t)), None
    if start != "outside":  # value .5 and slope -.4 at 0: they are independent there
        state = {"value": np.full(n, 5.5), "gradient": np.tile([-0.4, 0.1, 0.2], (n, 1))}
        value, slope = k(points, np.zeros((1, 3)))[:, 0], -k.gradient(points, np.zeros((1, 3)))[:, 0, 0]
        lambda2 = k.derivative_variance([1, 0, 0])
        mean = 0.5 * value - 0.4 * slope / lambda2
        covariance = covariance - np.outer(value, value) - np.outer(slope, slope) / lambda2
    g = gn.line_values(gp, origins, directions, t, start=state, sampler=sampler, tolerance=1e-6, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > 0.999 * n
    m, deviation = len(g), np.sqrt(np.diag(covariance))
    check_z(g.mean(axis=0), mean, deviation / np.sqrt(m) + 1e-6, "mean")
    # What the plans state; relative for the exact ones, since close to a known start everything is small.
    stated = 2.1e-4 if sampler == "dense" else 1e-7 * np.add.outer(deviation, deviation)
    error = np.sqrt((np.outer(deviation, deviation) ** 2 + covariance**2) / m)
    difference = np.abs((g - mean).T @ (g - mean) / m - covariance) - stated
    check_z(np.maximum(difference, 0), 0, error, "covariance")


@pytest.mark.parametrize(("kernel", "sampler"), PAIRS)
def test_slopes_after_a_known_start(kernel, sampler, n, seed):
    """Means and covariance of central differences, at ends of cells and between, given value and slope at 0: what the start
    does to later slopes shows little in the values."""
    h, at = 0.005, np.array([0.25, 0.5, 1.0, 1.6, 2.25])
    t = np.sort(np.concatenate([at - h, at + h]))
    difference = np.kron(np.eye(len(at)), [-1, 1]) / (2 * h)
    points, k = t[:, None] * [1.0, 0, 0], KERNELS[kernel](1.0)
    value, slope = k(points, np.zeros((1, 3)))[:, 0], -k.gradient(points, np.zeros((1, 3)))[:, 0, 0]
    lambda2 = gp_slope(kernel)
    covariance = k(points, points) - np.outer(value, value) - np.outer(slope, slope) / lambda2
    state = {"value": np.full(n, 5.5), "gradient": np.tile([-0.4, 0.1, 0.2], (n, 1))}
    g = gn.line_values(process(kernel, 5.0), *along_x(n), t, start=state, sampler=sampler, tolerance=1e-6, seed=seed) - 5
    slopes = g[np.isfinite(g).all(axis=1)] @ difference.T
    m, expected = len(slopes), difference @ covariance @ difference.T
    assert m > 0.999 * n
    mean, variance = difference @ (0.5 * value - 0.4 * slope / lambda2), np.diag(expected)
    check_z(slopes.mean(axis=0), mean, np.sqrt(variance / m), "mean")
    error = np.sqrt((np.outer(variance, variance) + expected**2) / m)
    check_z((slopes - mean).T @ (slopes - mean) / m, expected, error, "covariance")


@pytest.mark.parametrize("kernel", ROUGH)
def test_conditioned_start_at_tiny_distances(kernel, seed):
    """Oracle 8 for Markov lines: Var f = c t³ or c t⁵ next to a known value and slope, down to 1e-8 of a length scale."""
    n = 20_000
    t = np.array([1e-8, 1e-6, 1e-4, 1e-2])
    v = gn.line_values(process(kernel), *along_x(n), t, start=on_surface(n), seed=seed)
    # Integrated Brownian motion (formulas C2, C4), and with the second derivative free for Matérn 5/2 (C3): 1 - 1/9.
    variance = {
        "matern 3/2": 4 / 3 * (np.sqrt(3) * t) ** 3,
        "matern 5/2": 8 / 9 * (np.sqrt(5) * t) ** 4 / 4,
        "wong": 8 / np.sqrt(3) / 3 * t**3,
    }[kernel]
    # A slope of 1 falls by at most 2t per length scale, relative to the standard deviation that is t^½ or less.
    check_z(np.nanmean((v[:, :3] - t[:3]) ** 2, axis=0) / variance[:3], 1.0, np.sqrt(2 / n) + 2e-3)


@pytest.mark.parametrize(("kernel", "sampler"), PAIRS)
def test_few_roots_are_missed(kernel, sampler, full_size, seed):
    """Rays said to have no hit, looked at 400 times: fewer than 1e-3 of all are inside somewhere."""
    n = 100_000 if full_size else 10_000
    t = np.linspace(0.0025, 1, 400)
    gp, (origins, directions) = process(kernel), along_x(n)
    hits = gn.first_hits(gp, origins, directions, 1, sampler=sampler, seed=seed)
    v = gn.line_values(gp, origins, directions, t, sampler=sampler, seed=seed)
    free = np.isinf(hits["t"])
    assert np.isfinite(v[free]).all()
    assert np.sum(v[free].min(axis=1) < 0) < 1e-3 * n


def gp_slope(kernel):
    return KERNELS[kernel](1.0).derivative_variance([1, 0, 0])


@pytest.mark.parametrize("kernel", KERNELS)
def test_automatic_choice(kernel):
    chosen = process(kernel).plan()["sampler"]
    assert chosen.startswith(FAST.get(kernel, "spectral")), chosen


@pytest.mark.parametrize("sampler", ["convolution", "markov"])
def test_a_sampler_refuses_what_it_does_not_serve(sampler):
    with pytest.raises(ValueError, match=f"(?i){sampler} sampler serves"):
        gn.first_hits(process("rational quadratic"), *along_x(1), 1, sampler=sampler)
    with pytest.raises(ValueError, match=r"serves one radial correlation, not .*SquaredExponential\(1\) \+"):
        kernel = gn.SquaredExponential(1) + gn.SquaredExponential(2)
        gn.first_hits(gn.GaussianProcess(0, 1, kernel, bounds=LINE), *along_x(1), 1, sampler=sampler)


@pytest.mark.parametrize("value", [None, 1.0, 0.3])
def test_first_passage_of_matern_12(value, n, seed):
    """Oracle 7: P(no sign change on [0, t]) = (2/π) arcsin e^{-t}, from g₀ erf(g₀e^{-t}/√(2(1 - e^{-2t}))). The closer g₀ is to
    0, the more of it is decided by bridges, within the first cell of a 64th too."""
    from math import asin, erf, exp, pi, sqrt

    gp = gn.GaussianProcess(0.0, 1.0, gn.Matern(0.5, 1.0))
    state = None if value is None else {"value": np.full(n, value), "gradient": np.zeros((n, 3))}
    hits = gn.first_hits(gp, *along_x(n), 5, memory="renewal", start=state, seed=seed)
    times = [0.01, 0.03, 0.25, 1, 3]
    if value is None:
        survival = [2 / pi * asin(exp(-t)) for t in times]
    else:
        survival = [erf(value * exp(-t) / sqrt(2 * (1 - exp(-2 * t)))) for t in times]
    check_proportion([np.sum(hits["t"] > t) for t in times], n, survival)
    assert np.isnan(hits["gradient"]).all()
    with pytest.raises(ValueError, match="no ray can leave a point of its surface"):
        gn.first_hits(gp, *along_x(1), 5, start=on_surface(1))
