"""Rays of every kind against exact answers (design oracles, numbered as there): crossing rates, rays inside a body,
height fields, visible normals, long free flights; and what stops a search that takes too long."""

import signal
from math import erf, exp, pi, sqrt

import gpis_native as gn
import numpy as np
import pytest
from line_samplers import KERNELS, ROUGH_KERNELS, SERVED, factorises
from statistics_checks import SIGNIFICANCE, check_proportion, check_same_distribution, check_z

pytestmark = pytest.mark.stats


@pytest.fixture
def n(full_size):
    return 1_000_000 if full_size else 100_000


def normal_cdf(x):
    return 0.5 * (1 + erf(x / sqrt(2)))


def density(x):
    return exp(-x * x / 2) / sqrt(2 * pi)


def rays(n, origin, direction):
    direction = np.asarray(direction, float) / np.linalg.norm(direction)
    return np.tile(np.asarray(origin, float), (n, 1)), np.tile(direction, (n, 1))


def crossing_rays(name, sampler, full_size):
    """Enough that a slope's deviation off by a quarter is seen at m/s = -.5, which moves the rate by an eighth; by a tenth
    at full size. Of realisations a rate off by 30 %, and in every run of two kernels alone."""
    if sampler != "realisation":
        return (4_000_000 if full_size else 200_000) // (4 if factorises(name, sampler) else 1)
    if name in ("squared exponential", "rational quadratic"):
        return 100_000 if full_size else 20_000
    if not full_size:
        pytest.skip("realisations of this kernel are drawn at full size: few would say nothing")
    return 20_000


@pytest.mark.parametrize("ratio", [0.7, -0.5, -2.4])
@pytest.mark.parametrize(("name", "sampler"), SERVED)
def test_crossing_rate_over_a_sloping_mean_and_deviation(name, sampler, ratio, full_size, seed):
    """Oracle 2: down-rate (1/σ)φ(μ/σ)[sφ(m/s) - mΦ(-m/s)], m = d·∇μ - (μ/σ)d·∇σ, integrated over a stretch too short for
    two. By m/s (in its middle) slopes that rise against the mean, those that fall with it, and all but the mean's alone."""
    n, kernel = crossing_rays(name, sampler, full_size), KERNELS[name]
    root, jumps = sqrt(kernel.derivative_variance([1, 0, 0])), name in ROUGH_KERNELS
    length = 0.2 if sampler == "realisation" else 0.05 if jumps else 0.1  # over that of a slope
    h, mu0, s0, s1 = length / root, 0.1, 0.5, 0.7
    middle = s0 + s1 * h / 2
    mu1 = (ratio * middle * root + mu0 * s1 / middle) / (1 - h * s1 / (2 * middle))
    mean = gn.PlaneField([0, 0, 0], [1, 0, 0], mu1) + gn.ConstantField(mu0)
    sigma = (gn.PlaneField([0, 0, 0], [1, 0, 0], s1) + gn.ConstantField(s0)).clamped(0, 2)
    gp = gn.GaussianProcess(mean, sigma, kernel, bounds=((-1, -1, -1), (1, 1, 1)))
    hits = gn.first_hits(gp, *rays(n, [0, 0, 0], [1, 0, 0]), h, sampler=sampler, seed=seed)
    rate, steps = 0, 100
    for x in (np.arange(steps) + 0.5) * h / steps:
        mu, deviation = mu0 + mu1 * x, s0 + s1 * x
        m, s = mu1 - mu / deviation * s1, deviation * root
        rate += density(mu / deviation) / deviation * (s * density(m / s) - m * normal_cdf(-m / s)) / steps
    # Paths that fall again have crossed slowly. Of those there are φ/(φ - rΦ(-r)), and of those again the stretch squared,
    # or the stretch itself where g'' jumps about.
    slow = density(ratio) / (density(ratio) - ratio * normal_cdf(-ratio))
    twice = slow * (0.35 * length if jumps else 0.5 * length**2)
    p, share = rate * h / normal_cdf(mu0 / s0), np.isfinite(hits["t"]).mean()
    check_proportion(share * n, n, np.clip(share, p * (1 - twice), p))


@pytest.mark.parametrize("kernel", [gn.SquaredExponential(0.3), gn.Matern(1.5, 0.3)])
@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
def test_inside_is_outside_of_the_complement(kernel, memory, seed):
    """Definitions B7: a ray inside f is a ray outside -f, start, slope and remembered gradient included."""
    n, bounds = 3000, ((-1.5, -1.5, -1.5), (1.5, 1.5, 1.5))
    rng = np.random.default_rng(seed)
    origins, directions = rng.uniform(-0.3, 0.3, (n, 3)), rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    sphere = gn.SphereField([0, 0, 0], 1)
    body = gn.GaussianProcess(sphere, 0.1, kernel, bounds=bounds)
    complement = gn.GaussianProcess(-1 * sphere, 0.1, kernel, bounds=bounds)
    inside = np.ones(n, bool)
    a = gn.first_hits(body, origins, directions, 10, inside=inside, seed=seed)
    b = gn.first_hits(complement, origins, directions, 10, seed=seed)
    hit = np.isfinite(a["t"])
    assert hit.mean() > 0.99
    for step in range(2):
        np.testing.assert_array_equal(a["t"], b["t"])
        np.testing.assert_allclose(a["gradient"][hit], -b["gradient"][hit], atol=1e-12)
        assert np.all(np.sum(a["gradient"][hit] * directions[hit], axis=1) >= 0)
        if step == 1:
            break
        # Back into the body, by reflection at the surface that was met.
        normal = a["gradient"][hit] / np.linalg.norm(a["gradient"][hit], axis=1, keepdims=True)
        directions = directions[hit] - 2 * np.sum(directions[hit] * normal, axis=1, keepdims=True) * normal
        origins, inside = a["position"][hit], inside[hit]
        state = {key: value[hit] for key, value in a["state"].items()}
        other = {key: -value for key, value in state.items()}
        a = gn.first_hits(body, origins, directions, 10, memory=memory, start=state, inside=inside, seed=seed + 1)
        b = gn.first_hits(complement, origins, directions, 10, memory=memory, start=other, seed=seed + 1)
        hit = np.isfinite(a["t"])
        assert hit.mean() > 0.5


def test_inside_rays_leave_a_certain_ball(seed):
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 1e-9, gn.SquaredExponential(0.3))
    hits = gn.first_hits(gp, *rays(5, [0.5, 0, 0], [1, 0, 0]), 10, inside=np.array([1, 1, 0, 1, 1], bool), seed=seed)
    np.testing.assert_allclose(np.delete(hits["t"], 2), 0.5, atol=1e-7)
    with pytest.raises(ValueError, match="inside must be an array of truth values"):
        gn.first_hits(gp, *rays(2, [0, 0, 0], [1, 0, 0]), 10, inside=[True])
    with pytest.raises(ValueError, match="negative for rays inside"):
        start = {"value": [0.1], "gradient": [[1.0, 0, 0]]}
        gn.first_hits(gp, *rays(1, [0, 0, 0], [1, 0, 0]), 10, start=start, inside=np.array([True]))


@pytest.mark.parametrize("family", [gn.SquaredExponential, lambda *a: gn.Matern(1.5, *a), gn.Wong])
def test_along_the_constant_axis_of_a_height_field(family, n, seed):
    """An infinite length: f = μ + σg with one g for the ray, so the height of the hit is normal."""
    gp = gn.GaussianProcess(
        gn.PlaneField([0, 0, 0], [0, 0, 1], 0.5), 0.1, family([0.3, 0.2, np.inf]), bounds=((-2, -2, -2), (2, 2, 2))
    )
    hits = gn.first_hits(gp, *rays(n, [0.1, 0.2, 3], [0, 0, -1]), 10, seed=seed)
    assert np.isfinite(hits["t"]).all()
    check_same_distribution((hits["t"] - 3) * 5, np.random.default_rng(seed).normal(size=n))
    # ∇g has no part along the axis, and the deviation √λ₂/ℓ across it.
    np.testing.assert_allclose(hits["gradient"][:, 2], 0.5, atol=1e-12)
    lambda2 = family(1.0).derivative_variance([1, 0, 0])
    for axis, length in ((0, 0.3), (1, 0.2)):
        check_z((hits["gradient"][:, axis] ** 2).mean() / (0.01 * lambda2 / length**2), 1, sqrt(2 / n))
    # Up again from the hit the surface is never met: f only grows.
    up = gn.first_hits(gp, hits["position"], -rays(n, [0, 0, 0], [0, 0, -1])[1], 9, start=hits["state"], seed=seed)
    assert np.isinf(up["t"]).all()


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("family", [gn.SquaredExponential, lambda *a, **k: gn.RationalQuadratic(1, *a, **k)])
def test_gradients_along_a_turned_constant_axis(family, axis, n, seed):
    """∇f - ∇μ at the hit has the covariance σ²G: nothing on the line says anything of it, whichever axis is constant."""
    turn = np.array([0.9, 0.3, -0.2, 0.1]) / np.linalg.norm([0.9, 0.3, -0.2, 0.1])
    cross = np.cross(turn[1:], np.eye(3)[axis])
    d = np.eye(3)[axis] + 2 * (turn[0] * cross + np.cross(turn[1:], cross))
    kernel = family(np.insert([0.3, 0.15], axis, np.inf), rotation=turn)
    gp = gn.GaussianProcess(gn.PlaneField([0, 0, 0], -d, 1), 0.1, kernel, bounds=((-2, -2, -2), (2, 2, 2)))
    hits = gn.first_hits(gp, *rays(n, -1.5 * d, d), 10, seed=seed)
    assert np.isfinite(hits["t"]).all()
    g, law = hits["gradient"] + d, 0.01 * kernel.mixed([[0, 0, 0]], [[0, 0, 0]])[0, 0]
    size = np.sqrt(np.outer(np.diag(law), np.diag(law)) + law**2)
    check_z(g.T @ g / n, law, size / sqrt(n))


@pytest.mark.parametrize("lengths", [[0.3, np.inf, 0.2], [0.3, np.inf, np.inf]])
def test_a_mirror_of_a_grooved_surface(lengths):
    """Gradients in a plane or on a line have no density: a mirror must not be lit through one."""
    description = {
        "version": 1,
        "settings": {},
        "camera": {"type": "orthographic", "matrix": np.eye(4) + 3 * np.eye(4)[:, [0, 1, 3, 2]] * [0, 0, 0, 1], "width": 1},
        "world": {"color": [1, 1, 1]},
        "lights": [],
        "materials": {"mirror": {"type": "mirror", "color": [1, 1, 1]}},
        "meshes": {},
        "objects": [
            {
                "name": "grooves",
                "type": "gpis",
                "process": gn.GaussianProcess(
                    gn.PlaneField([0, 0, 0], [0, 0, 1], 1),
                    0.02,
                    gn.SquaredExponential(lengths),
                    bounds=((-1, -1, -1), (1, 1, 1)),
                ),
                "matrix": np.eye(4),
                "materials": ["mirror"],
            }
        ],
    }
    combined = gn.render(gn.Scene(description), 8, 8, samples=16).passes["combined"]
    np.testing.assert_allclose(combined, 1, atol=1e-6)


def visible_cosine(direction, slope, edges, rng, height_field, n=1_000_000):
    """Histogram of n·ω where gradients follow (-d·g)₊ N(g; ∇μ, s²I), across the plane alone for a height field."""
    gradient = np.array([0, 0, 1]) + slope * rng.normal(size=(n, 3)) * [1, 1, 0 if height_field else 1]
    towards = -gradient @ direction
    histogram, _ = np.histogram(towards / np.linalg.norm(gradient, axis=1), edges, weights=np.maximum(towards, 0))
    return histogram / histogram.sum()


FAMILIES = {
    "squared exponential": gn.SquaredExponential,
    "matern 5/2": lambda length: gn.Matern(2.5, length),
    "rational quadratic": lambda length: gn.RationalQuadratic(1, length),
}
# As far as the law is asked for of other kernels: their departures beyond are larger ones.
VISIBLE = [("squared exponential", 15), ("squared exponential", 45), ("squared exponential", 70)]
VISIBLE += [(family, degrees) for family in ("matern 5/2", "rational quadratic") for degrees in (15, 45)]


@pytest.mark.parametrize("kernel", ["height field", "isotropic"])
@pytest.mark.parametrize(("family", "degrees"), VISIBLE)
def test_visible_normals(kernel, family, degrees, n, seed, figure):
    """Oracle 12: total variation of n·ω below .01 (.02 for α = 1) up to 45°; grazing measured, its departures are real."""
    n //= 2 if family == "rational quadratic" else 1
    theta, edges = np.radians(degrees), np.linspace(0, 1, 21)
    direction = np.array([-np.sin(theta), 0, -np.cos(theta)])
    noise = FAMILIES[family]([0.1, 0.1, np.inf] if kernel == "height field" else 0.1)
    for alpha, bound in ((0.1, 0.01), (0.5, 0.01), (1, 0.02))[: 3 if family == "squared exponential" else 2]:
        slope = alpha / np.sqrt(2)
        sigma = slope / np.sqrt(noise.derivative_variance([1, 0, 0]))
        gp = gn.GaussianProcess(gn.PlaneField([0, 0, 0], [0, 0, 1], 1), sigma, noise)
        hits = gn.first_hits(gp, *rays(n, -3 * direction, direction), 10, seed=seed)
        hit = np.isfinite(hits["t"])
        assert hit.mean() > 0.9999
        seen = -hits["gradient"][hit] @ direction / np.linalg.norm(hits["gradient"][hit], axis=1)
        assert np.all(seen >= 0)
        got = np.histogram(seen, edges)[0] / hit.sum()
        expected = visible_cosine(direction, slope, edges, np.random.default_rng(seed), kernel == "height field")
        variation = 0.5 * np.abs(got - expected).sum()
        figure(f"Oracle 12: {kernel}, {family}, {degrees} degrees, alpha {alpha}: total variation of n·ω {variation:.4f}")
        assert variation < (bound if degrees <= 45 else 0.035)


@pytest.mark.parametrize("kernel", [gn.SquaredExponential(0.01), gn.Matern(2.5, 0.01), gn.RationalQuadratic(1, 0.04)], ids=repr)
def test_rare_hits_are_exponential(kernel, seed):
    """Oracle 16: μ = 3σ, free flights of rate ν/Φ(μ/σ), ν the one-sided Rice rate."""
    n = 4000
    gp = gn.GaussianProcess(3.0, 1.0, kernel)
    hits = gn.first_hits(gp, *rays(n, [0, 0, 0], [1, 0, 0]), 10, seed=seed)
    rate = sqrt(kernel.derivative_variance([1, 0, 0])) / (2 * pi) * exp(-4.5) / normal_cdf(3)
    t = np.array([1.0, 3.0, 6.0, 9.0])
    # Paths that dip below 0 often do so twice: .5% of the rate at this height.
    survival = np.exp(-rate * t)
    check_proportion([np.sum(hits["t"] > s) for s in t], n, survival, 0.01 * rate * t * survival)


@pytest.mark.parametrize("alpha", [0.1, 0.5, 1])
@pytest.mark.parametrize("degrees", [15, 45, 70])
@pytest.mark.parametrize("sampler", ["spectral", "nystrom", "dense", "realisation"])
@pytest.mark.parametrize("kernel", ["height field", "isotropic"])
def test_visible_normals_by_other_samplers(kernel, sampler, degrees, alpha, n, full_size, seed, figure):
    """Oracle 12: Kolmogorov's distance of n·ω to its law less what that law is off by."""
    if sampler == "realisation" and alpha != 0.5 and not full_size:
        pytest.skip("realisations of this slope are drawn at full size: few would say nothing")
    n //= {"realisation": 50 if full_size else 20, "nystrom": 5}.get(sampler, 1)
    edges, theta = np.linspace(0, 1, 2001), np.radians(degrees)
    direction = np.array([-np.sin(theta), 0, -np.cos(theta)])
    sigma = alpha * 0.1 / sqrt(2)
    flat = kernel == "height field"
    noise = gn.SquaredExponential([0.1, 0.1, np.inf] if flat else 0.1)
    high = max(0.15, 4.8 * sigma)
    bounds = ((-3.2 * high - 0.3, -0.3, -high), (3.2 * high + 0.3, 0.3, high))
    gp = gn.GaussianProcess(gn.PlaneField([0, 0, 0], [0, 0, 1], 1), sigma, noise, bounds=bounds)
    hits = gn.first_hits(gp, *rays(n, -3 * direction, direction), 10, sampler=sampler, seed=seed)
    gradient = hits["gradient"][np.isfinite(hits["t"])]
    assert len(gradient) > 0.999 * n
    seen = np.sort(-gradient @ direction / np.linalg.norm(gradient, axis=1))
    law = np.append(0, np.cumsum(visible_cosine(direction, sigma / 0.1, edges, np.random.default_rng(seed), flat)))
    steps, cdf = np.arange(len(seen) + 1) / len(seen), np.interp(seen, edges, law)
    distance = max(np.max(steps[1:] - cdf), np.max(cdf - steps[:-1]))
    figure(f"Oracle 12: {kernel}, {degrees}°, alpha {alpha}, {sampler}: the laws of n·ω differ by {distance:.4f}")
    off = (0.006 if alpha < 1 else 0.014) if degrees <= 45 else 0.025
    assert 2 * np.exp(-2 * len(seen) * max(distance - off, 0) ** 2) > SIGNIFICANCE, distance


DENTED = gn.SphereField([0, 0, 0], 1) + -0.01 * gn.BoxField([0, 0, 0], [1, 1, 1])
TORUS, BOX = gn.TorusField([0, 0, 0], [0.3, 0.2, 1], 0.5, 0.2), gn.BoxField([0, 0, 0], [1.6, 1.2, 0.4])


@pytest.mark.parametrize("mean", [TORUS, BOX, DENTED], ids=["torus", "box", "dented"])
@pytest.mark.parametrize("memory", ["renewal+", "global-1", "global"])
def test_rays_that_leave_for_good(mean, memory, seed):
    """Means without bounds of which a distance is all that is known: a ray is not evaluated where it has no digits left for a
    length scale. It was met at t = 2e15 there, with a gradient that is no number."""
    gp, n = gn.GaussianProcess(mean, 0.1, gn.Matern(1.5, 0.2)), 100
    origins = np.column_stack([np.random.default_rng(seed).uniform(-1.4, 1.4, (n, 2)), np.full(n, 6.0)])
    near, hits = (gn.first_hits(gp, origins, np.tile([0, 0, -1.0], (n, 1)), t, memory=memory, seed=seed) for t in (12, np.inf))
    hit = np.isfinite(hits["t"])
    assert 5 < hit.sum() < n and np.max(hits["t"][hit]) < 9 and np.isfinite(hits["gradient"][hit]).all()
    assert hits["counters"]["line_evaluations"] < 2 * near["counters"]["line_evaluations"]


def test_a_stretch_above_ends_where_steps_are_below_rounding():
    """A leaf of a tree is looked ahead from where its mean is the threshold but for rounding: such a stretch is empty (and a
    search that waited for steps to become long again never ended)."""
    kernel = gn.Matern(2.5, 1.0)
    sphere = gn.GaussianProcess(gn.SphereField([0, 0, 0], 0.6), 0.05, kernel)
    tree = gn.intersection(gn.GaussianProcess(TORUS, 0.1, kernel), sphere)
    xy = np.random.default_rng(0).uniform(-1.4, 1.4, (2, 50))
    hits = gn.first_hits(tree, np.column_stack([*xy, np.full(50, 6.0)]), np.tile([0, 0, -1.0], (50, 1)), 12, memory="none", seed=1)
    assert np.isfinite(hits["t"]).sum() > 2 and hits["counters"]["line_step_limit"] == 0


def test_ctrl_c_ends_a_long_search():
    """The calling thread listens while the rays are marched, and a ray notices in the middle of its line."""
    # All but constant: a constant mean that is so rarely met over so many length scales is refused.
    mean = gn.PlaneField([0, 0, 0], [0, 0, 1], 1e-9) + 1.0
    gp = gn.GaussianProcess(mean, 0.1, gn.SquaredExponential(1e-6), bounds=((-1, -1, -1), (1, 1, 1)))

    def interrupt(*_):
        raise KeyboardInterrupt

    before = signal.signal(signal.SIGALRM, interrupt)
    signal.setitimer(signal.ITIMER_REAL, 0.3)
    try:
        with pytest.raises(KeyboardInterrupt):
            gn.first_hits(gp, *rays(1_000_000, [-1, 0, 0], [1, 0, 0]), 2, tolerance=1e-300)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)


def test_the_plan_warns_of_lines_that_take_long():
    bounds = ((-1, -1, -1), (1, 1, 1))
    warning = gn.GaussianProcess(1.0, 0.1, gn.SquaredExponential(1e-6), bounds=bounds).plan()["warning"]
    assert "longer length_scale or smaller bounds" in warning
    assert "warning" not in gn.GaussianProcess(1.0, 0.1, gn.SquaredExponential(1e-3), bounds=bounds).plan()


def test_endless_lines_are_refused_where_they_would_lose_roots():
    """A constant mean on n length scales, of which a march takes 2^18: refused where more rays than roots may be missed
    end there and would have met the surface behind; by Rice's rate exp(-z²/2)/2π a length scale."""

    def planned(level, lengths):
        side = lengths / sqrt(3)
        return gn.GaussianProcess(level, 1, gn.SquaredExponential(1.0), bounds=((0, 0, 0), (side,) * 3)).plan()

    def lost(level, lengths):
        rate = np.exp(-(level**2) / 2) / (2 * np.pi)
        return np.exp(-rate * 2**18) * -np.expm1(-rate * (lengths - 2**18))

    outcomes = {}
    for lengths in (3e5, 5e5, 5e6):
        for level in (3.5, 4.1, 4.2, 5.0, 5.5, 6.1, 6.2, 6.3, 6.6):
            try:
                plan, refused = planned(level, lengths), False
            except ValueError as error:
                assert "rarely met and nowhere certain" in str(error)
                refused = True
            certain = not refused and level > float(plan["certainly_absent"].split("exceeds ")[1].split()[0])
            assert refused == (not certain and lost(level, lengths) > 1e-3), (level, lengths)
            outcomes[level, lengths] = refused
    # Of 5e5 length scales at 6.1 deviations one ray in 3,000 loses its root.
    assert outcomes[5.0, 5e5] and outcomes[5.5, 5e5] and not outcomes[6.1, 5e5] and not outcomes[3.5, 5e6]
