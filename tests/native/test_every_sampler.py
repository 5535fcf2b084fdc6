"""What has an exact answer, over every sampler that serves a kernel (design oracles, numbered as there), and what each sampler
does not do (counters). Oracles 2 and 12 are in test_rays.py, 10 in test_realisation.py; the survivals of 5 and 6 and what few
samplers have (7, 8, 17) in test_process.py, test_markov.py and test_realisation_path.py."""

from math import erfc, pi, sqrt

import gpis_native as gn
import numpy as np
import pytest
from line_samplers import KERNELS, LONG, ROUGH_KERNELS, SERVED, factorises, worth
from statistics_checks import (
    SIGNIFICANCE,
    Z_LIMIT,
    check_proportion,
    check_same_distribution,
    check_z,
    count_comparisons,
    normal_cdf,
)

pytestmark = pytest.mark.stats
every = pytest.mark.parametrize(("kernel", "sampler"), SERVED)
X = np.array([1.0, 0, 0])


# Few realisations say nothing of a law: of these as many are drawn as it takes, of the others at full size alone.
REALISED = {"squared exponential": 5, "rational quadratic": 10}


@pytest.fixture
def n(request, full_size):
    """How many rays of the kernel and by the sampler of a test."""
    parameters = request.node.callspec.params
    kernel, sampler = parameters.get("kernel", "plane wave"), parameters["sampler"]
    if sampler != "realisation":
        return worth(kernel, sampler, 400_000 if full_size else 20_000)
    if kernel in REALISED:
        return (100_000 if full_size else 20_000) // REALISED[kernel]
    if not full_size:
        pytest.skip("realisations of this kernel are drawn at full size: few would say nothing")
    return 2000 if kernel.startswith("sum") else 4000


def along_x(n):
    return np.zeros((n, 3)), np.tile(X, (n, 1))


def line(length):
    return ((-1, -1, -1), (length, 1, 1))


@every
def test_crossings_that_a_fixed_grid_sees(kernel, sampler, n, seed):
    """Oracle 3: of two values h apart one is above and one below its mean with probability arccos ρ(h)/π. A mean of 5
    deviations keeps the paths outside; the tolerance makes the sampler draw there."""
    k, h = KERNELS[kernel], 0.3
    gp = gn.GaussianProcess(5.0, 1, k, bounds=line(8))
    t = 0.1 + h * np.arange(20)
    g = gn.line_values(gp, *along_x(n), t, tolerance=1e-6, sampler=sampler, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > 0.99 * n
    for step in (1, 4):
        seen = (np.sign(g[:, step:]) != np.sign(g[:, :-step])).mean(axis=1)  # of a path; paths are independent
        expected = np.arccos(k([[step * h, 0, 0]], [[0, 0, 0]])[0, 0] / k.variance) / pi
        check_z(seen.mean(), expected, seen.std() / sqrt(len(g)), f"lag {step}")


@pytest.mark.parametrize(("kernel", "sampler"), [p for p in SERVED if p[0] not in ("rational quadratic", "plane wave")])
def test_mean_excursion(kernel, sampler, n, seed):
    """Oracle 4: π/√λ₂ above zero, from a start on the surface with the flux-weighted slope (Renewal)."""
    gp = gn.GaussianProcess(0.0, 1, KERNELS[kernel], bounds=line(30))
    state = {"value": np.zeros(n), "gradient": np.tile(X, (n, 1))}
    t = gn.first_hits(gp, *along_x(n), 29, memory="renewal", start=state, sampler=sampler, seed=seed)["t"]
    assert np.isfinite(t).mean() > 0.998
    t = np.minimum(t, 29)
    # Longer ones than the line are rare, and not much longer.
    beyond = 5 * np.mean(t == 29)
    assert abs(t.mean() - pi / sqrt(KERNELS[kernel].derivative_variance(X))) < Z_LIMIT * t.std() / sqrt(n) + beyond


@every
def test_reciprocity_of_free_flight(kernel, sampler, n, seed):
    """Oracle 4: P(T <= t from a random outside point) = (crossing rate / P(f > 0)) ∫₀ᵗ S(s) ds, S of an excursion."""
    t, mean = 4.0, 0.3
    gp = gn.GaussianProcess(mean, 1, KERNELS[kernel], bounds=line(8))
    state = {"value": np.zeros(n), "gradient": np.tile(X, (n, 1))}
    free = gn.first_hits(gp, *along_x(n), t, sampler=sampler, seed=seed)["t"]
    excursion = gn.first_hits(gp, *along_x(n), t, memory="renewal", start=state, sampler=sampler, seed=seed + 1)["t"]
    slope = sqrt(KERNELS[kernel].derivative_variance(X))
    rate = slope / (2 * pi) * np.exp(-(mean**2) / 2) / (0.5 * erfc(-mean / sqrt(2)))
    lasted = np.minimum(excursion, t)
    p = np.isfinite(free).mean()
    check_z(p, rate * lasted.mean(), sqrt(p * (1 - p) / n + rate**2 * lasted.var() / n))


RADIAL = ("squared exponential", "matern 3/2", "matern 5/2", "wong", "rational quadratic")


@pytest.mark.parametrize(("kernel", "sampler"), [p for p in SERVED if p[0] in RADIAL])
def test_transverse_gradient_correlation(kernel, sampler, n, seed):
    """Oracle 9: a remembered transverse gradient decays as c(q) = -κ'(q)/(qλ₂); SE e^{-q²/2}, Matérn 3/2 e^{-√3q}."""
    n, start, k = 4 * n, np.array([0.7, 1.5, -2.0]), KERNELS[kernel]
    gp = gn.GaussianProcess(0, 1, k, bounds=line(12))
    state = {"value": np.zeros(n), "gradient": np.tile(start, (n, 1))}
    hits = gn.first_hits(gp, *along_x(n), 9, start=state, sampler=sampler, seed=seed)
    hit = np.isfinite(hits["t"])
    m, t, lambda2 = hit.sum(), hits["t"][hit], k.derivative_variance(X)
    known = {"squared exponential": lambda q: np.exp(-q * q / 2), "matern 3/2": lambda q: np.exp(-sqrt(3) * q)}
    gradient = k.gradient(t[:, None] * X, np.zeros((1, 3)))[:, 0, 0]
    c = known[kernel](t) if kernel in known else -gradient / (t * lambda2)
    for axis in (1, 2):
        scaled = (hits["gradient"][hit, axis] - c * start[axis]) / np.sqrt(lambda2 * (1 - c**2))
        check_z(scaled.mean(), 0, 1 / sqrt(m))
        check_z((scaled**2).mean(), 1, sqrt(2 / m))
        check_z((scaled * c).mean(), 0, sqrt((c**2).mean() / m))


SLOPES_ALIKE = (*RADIAL, "sum with a rough term", "sum of rough terms")


@pytest.mark.parametrize(("kernel", "sampler"), [p for p in SERVED if p[0] in SLOPES_ALIKE])
def test_normals_and_slopes_over_all_crossings(kernel, sampler, n, seed):
    """Oracle 11: normals have density (-n·d)₊/π, so that -n·d has 2u, and slopes are Rayleigh. Over a stretch from random
    outside points that is too short for the first crossings to differ from all of them; where g'' jumps about no stretch is:
    there at the ends of excursions that begin with Rayleigh slopes (Renewal), by symmetry under reversal."""
    k = KERNELS[kernel]
    n, s = 4 * n, sqrt(k.derivative_variance(X))
    if kernel in ROUGH_KERNELS:
        n //= 4
        state = {"value": np.zeros(n), "gradient": np.tile(X, (n, 1))}
        gp = gn.GaussianProcess(0, 1, k, bounds=line(61))
        hits = gn.first_hits(gp, *along_x(n), 60, memory="renewal", start=state, sampler=sampler, seed=seed)
        assert np.isfinite(hits["t"]).mean() > 0.9998
    else:
        hits = gn.first_hits(gn.GaussianProcess(0, 1, k, bounds=line(8)), *along_x(n), 0.2 / s, sampler=sampler, seed=seed)
        check_proportion(np.isfinite(hits["t"]).sum(), n, 0.2 / pi, 0.02 * 0.2 / pi, "oracle 2")
    g = hits["gradient"][np.isfinite(hits["t"])]
    rng = np.random.default_rng(seed)
    check_same_distribution(-g[:, 0] / np.linalg.norm(g, axis=1), np.sqrt(rng.uniform(size=100_000)), "n·d")
    check_same_distribution(-g[:, 0] / s, rng.rayleigh(size=100_000), "slope")


@every
def test_infinite_length_scale_is_one_normal(kernel, sampler, n, seed):
    """Oracle 14: f = μ + σξ with one ξ; a sphere is missed with probability Φ((b - R)/σ)."""
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 0.2, LONG[kernel](1e4), bounds=((-3,) * 3, (3,) * 3))
    for b in (0.9, 1.1):
        origins, directions = np.tile([b, 0.0, 2.8], (n, 1)), np.tile([0.0, 0, -1.0], (n, 1))
        hits = gn.first_hits(gp, origins, directions, 6, sampler=sampler, seed=seed)
        # Starts are outside but for 1e-23.
        check_proportion(np.sum(np.isinf(hits["t"])), n, 0.5 * erfc((1 - b) / 0.2 / sqrt(2)), what=f"b = {b}")


@pytest.mark.parametrize(
    ("kernel", "sampler"), [p for p in SERVED if p[0] in ("squared exponential", "matern 5/2", "rational quadratic")]
)
def test_rare_hits_are_exponential(kernel, sampler, n, seed):
    """Oracle 16: μ = 3σ, free flights of rate ν/Φ(μ/σ), ν the one-sided Rice rate; lines much longer than the memory are in
    test_rays.py. Paths that dip below 0 often do so twice: .5% of the rate at this height, more where g'' jumps about."""
    n, k = 4 * n, KERNELS[kernel]
    gp = gn.GaussianProcess(3.0, 1, k, bounds=line(12))
    t = gn.first_hits(gp, *along_x(n), 11, sampler=sampler, seed=seed)["t"]
    rate = sqrt(k.derivative_variance(X)) / (2 * pi) * np.exp(-4.5) / (0.5 * erfc(-3 / sqrt(2)))
    at = np.array([3.0, 7.0, 11.0])
    survival = np.exp(-rate * at)
    check_proportion([np.sum(t > x) for x in at], n, survival, 0.02 * rate * at * survival)


@pytest.mark.parametrize("slope", [1.5, 0.0, -1.5])
@every
def test_renewal_leaves_the_surface_with_the_flux_weighted_slope(kernel, sampler, slope, n, seed):
    """Definitions B3: density ∝ v₊ N(v; m, s²) over a mean of slope m"""
    s = sqrt(KERNELS[kernel].derivative_variance(X))
    gp = gn.GaussianProcess(gn.PlaneField([0, 0, 0], X, slope), 1, KERNELS[kernel], bounds=line(8))
    state = {"value": np.zeros(n), "gradient": np.tile(X, (n, 1))}
    t = 1e-4
    v = gn.line_values(gp, *along_x(n), [t], start=state, memory="renewal", sampler=sampler, seed=seed)[:, 0] / t
    v = np.sort(v[np.isfinite(v)])
    assert len(v) > 0.99 * n
    x = np.linspace(0, slope + 9 * s, 20_001)
    mass = x * np.exp(-((x - slope) ** 2) / (2 * s * s))
    cdf = np.interp(v, x, np.append(0, np.cumsum(0.5 * (mass[1:] + mass[:-1]))) / np.sum(0.5 * (mass[1:] + mass[:-1])))
    steps = np.arange(len(v) + 1) / len(v)
    distance = max(np.max(steps[1:] - cdf), np.max(cdf - steps[:-1]))
    # Rays that meet the surface again within 1e-4 are missing, and rough paths bend on the way.
    assert 2 * np.exp(-2 * len(v) * max(distance - 0.01, 0) ** 2) > SIGNIFICANCE, distance


@pytest.mark.parametrize(("sampler", "h"), [("convolution", 1e-3), ("spectral", 1e-4), ("nystrom", 1e-4), ("dense", 1e-4)])
def test_paths_are_smooth(sampler, h, seed):
    """No jump and no kink where cells, blocks of nodes and halves of tables meet: second differences stay g''h², whose
    deviation is √3. The window of the convolution lets nodes in at 1e-7."""
    n = 12
    gp = gn.GaussianProcess(5.0, 1, gn.SquaredExponential(1), bounds=line(8))
    t = 2.0 + np.arange(0, 4, h)
    g = gn.line_values(gp, *along_x(n), t, tolerance=1e-6, sampler=sampler, seed=seed)
    assert np.nanmax(np.abs(np.diff(g, 2, axis=1))) < 12 * h * h


@pytest.mark.parametrize(("kernel", "sampler"), [p for p in SERVED if not (p[1] == "dense" and factorises(*p))])
def test_small_scales(kernel, sampler, n, seed):
    """Second differences over a 25th of a length scale, whose variance is a few thousandths: bridges and tables inside of
    cells, which the correlation itself hardly feels. Joint dense lines are cubics there."""
    k, h = KERNELS[kernel], 0.04
    gp = gn.GaussianProcess(5.0, 1, k, bounds=line(8))
    t = 0.02 + h * np.arange(24)
    g = gn.line_values(gp, *along_x(n), t, tolerance=1e-6, sampler=sampler, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    x = t[:3, None] * X
    weights = np.array([1, -2, 1])
    expected = weights @ k(x, x) @ weights
    # Dense lines of Matérn 5/2 halve given values and slopes alone, to 1e-5 of the variance.
    stated = 0.2 if (kernel, sampler) == ("matern 5/2", "dense") else 0.01
    difference = np.abs(np.mean(np.diff(g, 2, axis=1) ** 2, axis=0) / expected - 1)
    check_z(np.maximum(difference - stated, 0), 0, sqrt(2 / len(g)))


@every
def test_occupancy(kernel, sampler, n, seed):
    """Oracle 1, and what a fresh ray is: f > 0 by Φ(μ/σ) alone, so that its value at the start is a normal truncated at 0."""
    mu = 0.4
    gp = gn.GaussianProcess(mu, 1, KERNELS[kernel], bounds=line(8))
    f = gn.line_values(gp, *along_x(n), [1e-9], sampler=sampler, seed=seed)[:, 0]
    assert np.isfinite(f).mean() > 0.999
    for level in (0.3, 1.0, 2.0):
        above = erfc((level - mu) / sqrt(2)) / erfc(-mu / sqrt(2))
        check_proportion(np.sum(f > level), n, above, what=f"above {level}")
    assert np.nanmin(f) > 0


@pytest.mark.parametrize("sampler", ["spectral", "nystrom", "dense", "realisation"])
def test_plane_wave(sampler, n, seed):
    """Oracle 15: T = 1 - wt/π from outside, excursions of π/w exactly."""
    wave = np.array([2.0, 0.5, 1.0])
    gp = gn.GaussianProcess(0, 1, gn.PlaneWave(wave), bounds=((-9, -9, -9), (9, 9, 9)))
    direction = np.array([0.48, -0.64, 0.6])
    w = abs(wave @ direction)

    def hits(n, direction=direction, **start):
        return gn.first_hits(gp, np.zeros((n, 3)), np.tile(direction, (n, 1)), 7, sampler=sampler, seed=seed, **start)["t"]

    t, fractions = hits(n), np.array([0.1, 0.25, 0.5, 0.75, 0.9])
    check_proportion([np.sum(t > x * pi / w) for x in fractions], n, 1 - fractions, what="from outside")
    # Dense rows carry noise of 1e-3 deviations.
    off = 1e-2 if sampler == "dense" else 1e-4
    assert t.max() <= pi / w * (1 + off)
    for memory in ("renewal", "renewal+"):
        state = {"value": np.zeros(50), "gradient": np.tile(np.sign(wave @ direction) * wave, (50, 1))}
        np.testing.assert_allclose(hits(50, start=state, memory=memory), pi / w, rtol=off)
    # Across the wave g is constant: no ray ever hits.
    across = np.cross(wave, direction)
    assert np.isinf(hits(50, across / np.linalg.norm(across))).all()


@every
def test_far_rays_draw_nothing_and_stationary_kernels_factorise_nothing(kernel, sampler, seed):
    """Issue "the process, exact", must show 5. Rays 20 deviations away from a sphere inside the bounds, and at it: the same
    counters."""
    k, sigma, n = KERNELS[kernel], 0.05, 40
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), sigma, k, bounds=((-2.5,) * 3, (2.5,) * 3))
    origins, directions = np.tile([0.0, 0, 2.4], (n, 1)), np.tile([0.0, 0, -1], (n, 1))

    def counters(x):
        return gn.first_hits(gp, origins + [x, 0, 0], directions, 10, sampler=sampler, seed=seed)["counters"]

    drawn = ("line_normals", "truncated_normals", "line_evaluations", "mean_lookups", "factorisations")
    far = counters(1 + 20 * sigma)
    assert far["line_skipped"] == n and far["line_segments"] == 0
    assert all(far[name] == 0 for name in drawn)
    counters(0.0)  # tables that all rays share are made by the first of them
    near = counters(0.0)
    assert near["line_skipped"] == 0 and near["line_segments"] == n
    assert near["line_normals"] >= 2 * n and near["line_evaluations"] > n and near["mean_lookups"] > n
    assert near["factorisations"] == (n if factorises(kernel, sampler) else 0)


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
def test_a_render_of_a_stationary_kernel_factorises_nothing_per_ray(kernel, memory, seed):
    """The same for what `auto` picks, camera rays and those that go back; under global-n that counter moves."""
    k, n = KERNELS[kernel], 40
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 0.05, k, bounds=((-1.5,) * 3, (1.5,) * 3))
    origins, directions = np.tile([0.3, 0, 1.4], (n, 1)), np.tile([0.0, 0, -1], (n, 1))

    def twice(memory):
        first = gn.first_hits(gp, origins, directions, 10, memory=memory, seed=seed)
        assert np.isfinite(first["t"]).all()
        again = gn.first_hits(gp, first["position"], -directions, 10, memory=memory, start=first["state"], seed=seed)
        return [hits["counters"] for hits in (first, again)]

    twice(memory)  # tables that all rays share
    for counters in twice(memory):
        assert counters["factorisations"] == 0 and counters["line_normals"] > 0
    assert twice("global-1")[1]["factorisations"] > 0


@pytest.mark.parametrize("mean", [-1.0, -8.0, -25.0])
@every
def test_entry_from_outside_the_bounds(kernel, sampler, mean, n, seed):
    """Definitions B4: a ray that comes from outside enters with f > 0 however unlikely that is, by the normal law of deviation 1
    about the mean truncated at 0: P(f > x) = Φ(μ - x)/Φ(μ). It falls from there."""
    gp = gn.GaussianProcess(mean, 1, KERNELS[kernel], bounds=((0, -1, -1), (4, 1, 1)))
    rays = np.tile([-3.0, 0.1, 0.2], (n, 1)), np.tile(X, (n, 1))
    f = np.sort(gn.line_values(gp, *rays, [3 + 1e-9], sampler=sampler, seed=seed)[:, 0])
    f = f[np.isfinite(f)]
    assert len(f) > 0.999 * n and f[0] > 0
    cdf = 1 - normal_cdf(mean - f) / normal_cdf(mean)
    steps = np.arange(len(f) + 1) / len(f)
    count_comparisons(1)
    distance = max(np.max(steps[1:] - cdf), np.max(cdf - steps[:-1]))
    assert 2 * np.exp(-2 * len(f) * distance**2) > SIGNIFICANCE, distance
    hits = gn.first_hits(gp, *rays, 7, sampler=sampler, seed=seed)
    hit = np.isfinite(hits["t"])
    assert np.min(hits["t"]) > 3 and np.all(hits["gradient"][hit, 0] <= 0)
    if mean == -25:
        assert np.all(hit)
