"""The spectral sampler as a render uses it: implied correlation against the kernel, and exact answers (design oracles,
numbered as there). The joint law of value and gradient is tested in test_spectral.cpp."""

import math

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_proportion, check_z

pytestmark = pytest.mark.stats
BOUNDS = ((-4, -4, -4), (4, 4, 4))
DIRECTION = np.array([0.48, -0.64, 0.6])
ORIGIN = np.array([-1.5, 2.0, -1.0])
LENGTHS, ROTATION = [0.6, 1.0, 1.7], [0.9, 0.3, -0.2, 0.1]

SE = gn.SquaredExponential(LENGTHS, rotation=ROTATION)
PERIODIC = gn.LocallyPeriodic(1.5, 0.9, [0, 0.6, 0.8], 0.8)  # its axis turned against the ray
WAVE = gn.PlaneWave([2.0, 0.5, 1.0])
KERNELS = {
    "squared exponential": SE,
    **{f"rational quadratic {a}": gn.RationalQuadratic(a, LENGTHS, rotation=ROTATION) for a in (0.3, 0.5, 1, 2)},
    "locally periodic": PERIODIC,
    "plane wave": WAVE,
    "sum": 0.4 * SE + 0.6 * gn.RationalQuadratic(1, 0.5),
    "sum with a wave": 0.3 * WAVE + 0.7 * PERIODIC,
    "product": WAVE * gn.RationalQuadratic(0.5, 0.8) * gn.PlaneWave([0, 1, 0]),
    "height field": gn.RationalQuadratic(1, [0.5, 0.7, math.inf]),
}
# What the sampler states of its own: 1e-5 of the correlation, 3e-5 with a rational quadratic, and 1e-4 of the slopes.
STATED = 4e-5
STATED_SLOPES = 1e-4
parametrize = pytest.mark.parametrize("name", KERNELS)


@pytest.fixture
def n(full_size):
    return 1_000_000 if full_size else 40_000


def rays(n):
    return np.tile(ORIGIN, (n, 1)), np.tile(DIRECTION, (n, 1))


def derivative_deviation(kernel):
    return math.sqrt(kernel.derivative_variance(DIRECTION))


@parametrize
@pytest.mark.parametrize("start", ["outside", "value and gradient"])
def test_implied_correlation(name, start, n, seed):
    """Values that a render's own line takes, over many cells. The mean of 5 deviations keeps every path outside; the
    tolerance makes the sampler draw there."""
    kernel = KERNELS[name]
    gp = gn.GaussianProcess(5.0, 1.0, kernel, bounds=BOUNDS)
    t = np.array([0.02, 0.1, 0.3, 0.7, 1.1, 1.9, 3.1])
    points = ORIGIN + t[:, None] * DIRECTION
    covariance, mean = kernel(points, points), np.zeros(len(t))
    state = None
    if start != "outside":
        # (g, ∇g) at the start; the gradient one that the process can have.
        at = ORIGIN[None]
        g = kernel.mixed(at, at)[0, 0]
        values, vectors = np.linalg.eigh(g)
        root = vectors * np.sqrt(np.where(values > 1e-12 * values[-1], values, 0))
        gradient = root @ np.array([0.5, -0.3, 0.4])
        across = np.concatenate([kernel(points, at), -kernel.gradient(points, at)[:, 0]], axis=1)
        inverse = np.zeros((4, 4))
        inverse[0, 0] = 1 / kernel.variance
        inverse[1:, 1:] = np.linalg.pinv(g, rcond=1e-10)
        mean = across @ inverse @ np.concatenate([[0.5], gradient])
        covariance = covariance - across @ inverse @ across.T
        state = {"value": np.full(n, 5.5), "gradient": np.tile(gradient, (n, 1))}
    g = gn.line_values(gp, *rays(n), t, start=state, tolerance=1e-6, sampler="spectral", seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > 0.999 * n
    m, deviation = len(g), np.sqrt(np.maximum(np.diag(covariance), 1e-16))
    check_z(g.mean(axis=0), mean, deviation / np.sqrt(m), "mean")
    centred = g - mean
    outer = np.outer(deviation, deviation)
    error = np.sqrt((outer**2 + covariance**2) / m)
    difference = np.abs(centred.T @ centred / m - covariance) - STATED * np.add.outer(deviation, deviation)
    check_z(np.maximum(difference, 0), 0, error, "covariance")


@parametrize
@pytest.mark.parametrize("level", [0.0, 1.0])
def test_rate_and_gradients_of_crossings(name, level, n, seed):
    """Oracle 2 within a short step from a random outside point, and the law of the gradient there: of density
    proportional to (-d·g)₊ N(g; 0, G), so that E[g gᵀ] = G + G d dᵀG/(dᵀGd) (definitions E2: all three components)."""
    kernel = KERNELS[name]
    variance, s = kernel.variance, derivative_deviation(kernel)
    gp = gn.GaussianProcess(level, 1.0, kernel, bounds=BOUNDS)
    t = 0.15 * math.sqrt(variance) / s
    hits = gn.first_hits(gp, *rays(n), t, sampler="spectral", seed=seed)
    hit = np.isfinite(hits["t"])
    outside = 0.5 * math.erfc(-level / math.sqrt(2 * variance))
    rate = s / (2 * math.pi * math.sqrt(variance)) * math.exp(-0.5 * level**2 / variance) / outside
    # Two crossings within the step: below 2e-3 of the rate for the squared exponential, .01 for the roughest here.
    check_proportion(hit.sum(), n, rate * t, 0.01 * rate * t, "rate")
    g = kernel.mixed([[0, 0, 0]], [[0, 0, 0]])[0, 0]
    along = g @ DIRECTION
    expected = g + np.outer(along, along) / s**2
    products = hits["gradient"][hit][:, :, None] * hits["gradient"][hit][:, None, :]
    scale = np.sqrt(np.outer(np.diag(expected), np.diag(expected)))
    # First crossings from outside are all but .01 of the crossings.
    difference = np.maximum(np.abs(products.mean(axis=0) - expected) - 0.02 * scale, 0)
    check_z(difference, 0, products.std(axis=0) / math.sqrt(hit.sum()) + 1e-9 * scale.max(), "gradient")
    assert (hits["gradient"][hit] @ DIRECTION < 0).all()


def test_counters():
    """No factorisation per ray; a line longer than the tables is counted, others are not."""
    n = 200
    along = np.zeros((n, 3)), np.tile([0.0, 0, 1], (n, 1))
    kernel = gn.RationalQuadratic(1, 0.5)
    bounded = gn.first_hits(gn.GaussianProcess(2, 1, kernel, bounds=BOUNDS), *along, 100)["counters"]
    assert bounded["line_normals"] > 50 * n
    assert bounded["factorisations"] == bounded["line_reach_limit"] == 0
    endless = gn.first_hits(gn.GaussianProcess(2, 1, kernel), *along, 1000)["counters"]
    assert endless["line_reach_limit"] == n
    # More of the line is uncertain than one table holds: it takes the next.
    longer = gn.GaussianProcess(2, 1, kernel, bounds=((-1, -1, -1), (1, 1, 30)))
    assert gn.first_hits(longer, *along, 100)["counters"]["line_normals"] > 1.5 * bounded["line_normals"]


def test_choice():
    def sampler(kernel):
        return gn.GaussianProcess(0, 1, kernel, bounds=BOUNDS).plan()["sampler"]

    assert "convolution" in sampler(SE)
    for name, kernel in KERNELS.items():
        if name != "squared exponential":
            assert "spectral" in sampler(kernel), name


@pytest.mark.parametrize(
    ("kernel", "message"),
    [
        (gn.Matern(1.5, 1), "spectral sampler does not serve Matern.1.5, 1.: a part of it is rough"),
        (gn.RationalQuadratic(1, 1) * SE, "it is no sum of independent terms"),
        (gn.RationalQuadratic(1e-5, 1), "take a larger alpha"),
        (gn.LocallyPeriodic(0.001, 1, [1, 0, 0], 0.01), "waves for this kernel"),
    ],
)
def test_refused(kernel, message):
    gp = gn.GaussianProcess(0, 1, kernel, bounds=BOUNDS)
    with pytest.raises(ValueError, match=message):
        gn.first_hits(gp, np.zeros((1, 3)), [[0.0, 0, 1]], 1, sampler="spectral")


def test_the_plan_warns_of_lines_that_repeat_themselves():
    """The tables end at 256 length scales, at 1024 where finite bounds ask for it: bounds that are longer, or none, are told;
    shorter ones are not."""
    kernel = gn.RationalQuadratic(1.0, 0.1)
    for side, reach in ((None, 256), (200.0, 1024), (60.0, None), (10.0, None)):
        bounds = None if side is None else ([0, 0, 0], [side, 1, 1])
        plan = gn.GaussianProcess(1.0, 0.5, kernel, bounds=bounds).plan()
        assert plan["sampler"].startswith("spectral")
        assert f"{reach} length scales" in plan["line_reach"] if reach else "line_reach" not in plan


def test_a_short_line_in_long_bounds_takes_a_short_table():
    """Counters: what long bounds add is not drawn by rays that meet little of them."""
    kernel, across = gn.RationalQuadratic(1, 1), (np.zeros((50, 3)), np.tile([0.0, 0, 1], (50, 1)))
    normals = [
        gn.first_hits(gn.GaussianProcess(2, 1, kernel, bounds=((-1, -1, -1), (side, 1, 20))), *across, 100)["counters"]
        for side in (1, 900)
    ]
    assert normals[0]["line_normals"] == normals[1]["line_normals"] > 0


def test_survival_on_a_long_line(full_size, seed):
    """600 length scales: a table for shorter lines repeats itself there, what got through once gets through again (survival
    .42). Against circulant realisations (period 1638, lost spectrum 1e-9) every tenth of a length scale, which see all but
    u²h²/24 = .4% of the crossings at u = 3 deviations."""
    n, length, step, level, alpha = 30_000 if full_size else 3000, 600, 0.1, 3.0, 5.0
    rng, size = np.random.default_rng(seed), 1 << 14
    lag = np.minimum(np.arange(size), size - np.arange(size)) * step
    spectrum = np.fft.fft((1 + lag**2 / (2 * alpha)) ** -alpha).real
    assert -spectrum[spectrum < 0].sum() < 1e-8 * spectrum.sum()
    root, free = np.sqrt(np.maximum(spectrum, 0) / size), []
    for _ in range(n):
        noise = np.fft.fft(root * (rng.normal(size=size) + 1j * rng.normal(size=size)))[: int(length / step) + 1]
        free += [g.min() > -level for g in (noise.real, noise.imag) if g[0] > -level]
    gp = gn.GaussianProcess(level, 1, gn.RationalQuadratic(alpha, 1), bounds=((0, -0.1, -0.1), (length, 0.1, 0.1)))
    along = np.zeros((n, 3)), np.tile([1.0, 0, 0], (n, 1))
    hits = gn.first_hits(gp, *along, length, sampler="spectral", seed=seed)
    assert hits["counters"]["line_reach_limit"] == 0
    p = np.mean(free)
    crossings = -math.log(p)
    expected = math.exp(-crossings * (1 + level**2 * step**2 / 24))
    check_proportion(np.isinf(hits["t"]).sum(), n, expected, math.sqrt(p * (1 - p) / len(free)), "survival")
