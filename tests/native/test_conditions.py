"""Condition points: values and gradients of f that are known (the design's math.md §3) against Gaussian process regression
by numpy (regression.py)."""

import gpis_native as gn
import numpy as np
import pytest
from regression import Regression, check_law
from statistics_checks import check_same_distribution

pytestmark = pytest.mark.stats

LENGTH = 0.5
MEAN = gn.SphereField((0, 0, 0), 0.8)
SIGMA = 0.3 + gn.PlaneField((0, 0, 0), (1, 0, 0), 0.05).clamped(-0.1, 0.1)
KERNELS = {
    "se": gn.SquaredExponential(LENGTH),
    "anisotropic se": gn.SquaredExponential((0.3, 0.6, 0.5), rotation=(0.9, 0.1, 0.3, -0.2)),
    "matern 5/2": gn.Matern(2.5, LENGTH),
    "sum": 0.6 * gn.SquaredExponential(LENGTH) + 0.4 * gn.RationalQuadratic(2, 0.4),
}
BOUNDS = ((-3, -3, -3), (3, 3, 3))


def some_conditions(n=10, seed=5):
    """Values, normals or both at random points, some with noise."""
    rng = np.random.default_rng(seed)
    values, normals, noise = 0.2 * rng.normal(size=n), rng.normal(size=(n, 3)), np.zeros(n)
    normals /= np.linalg.norm(normals, axis=1, keepdims=True)
    values[3] = np.nan
    normals[5:8] = np.nan
    noise[1] = 0.1
    return {
        "points": rng.uniform(-1, 1, (n, 3)),
        "values": values,
        "normals": normals,
        "slopes": rng.uniform(0.5, 1.5, n),
        "noise": noise,
    }


def process(kernel="se", conditions=None, mean=MEAN, sigma=SIGMA):
    return gn.GaussianProcess(mean, sigma, KERNELS[kernel], conditions=conditions, bounds=BOUNDS)


@pytest.mark.parametrize("kernel", KERNELS)
def test_posterior_is_that_of_regression(kernel):
    c = some_conditions()
    x = np.random.default_rng(1).uniform(-1.5, 1.5, (200, 3))
    mean, variance = process(kernel, c).posterior(x)
    expected, covariance = Regression(process(kernel), c, MEAN, SIGMA).law(x)
    assert np.abs(mean - expected).max() < 1e-9
    assert np.abs(variance - np.diag(covariance)).max() < 1e-10
    assert np.abs(expected - MEAN(x)).max() > 0.1  # the conditions matter


def test_posterior_without_conditions_is_the_prior():
    x = np.random.default_rng(1).uniform(-1.5, 1.5, (20, 3))
    mean, variance = process().posterior(x)
    assert np.allclose(mean, MEAN(x)) and np.allclose(variance, SIGMA(x) ** 2)


@pytest.mark.parametrize("n", [1500])
def test_thousands_of_points_in_blocks(n, full_size):
    """Blocks against one system of all, within the truncation error that the plan states."""
    n = 6000 if full_size else n
    rng = np.random.default_rng(2)
    points = rng.normal(size=(n, 3))
    points *= (1 + 0.05 * rng.normal(size=(n, 1))) / np.linalg.norm(points, axis=1, keepdims=True)
    c = {"points": points, "values": 0.05 * np.sin(5 * points[:, 0]), "noise": np.full(n, 0.01)}
    kernel, mean, sigma = gn.SquaredExponential(0.12), gn.SphereField((0, 0, 0), 1), gn.ConstantField(0.1)
    gp = gn.GaussianProcess(mean, sigma, kernel, conditions=c)
    plan = gp.plan()["conditions"]
    truncation = float(plan.split("truncation error of ")[1].split()[0])
    assert int(plan.split(" values and slopes in ")[1].split()[0]) > 8 and truncation < 1e-2
    x = points[:300] * rng.uniform(0.9, 1.1, (300, 1))
    m, v = gp.posterior(x)
    full = dict(c, normals=np.full((n, 3), np.nan), slopes=np.ones(n))
    expected, covariance = Regression(gn.GaussianProcess(mean, sigma, kernel), full, mean, sigma).law(x)
    assert np.abs(m - expected).max() < 0.1 * max(3 * truncation, 1e-4)
    assert np.abs(np.sqrt(v) - np.sqrt(np.diag(covariance))).max() < 0.1 * max(3 * truncation, 1e-4)


def test_ten_thousand_points(seed):
    """Values at all and normals at some of 10,000 points: the blocks against one system of all conditions within 14 length
    scales of three places, and lines that a render draws there."""
    n, length, deviation = 10_000, 0.015, 0.02
    rng = np.random.default_rng(2)
    out = rng.normal(size=(n, 3))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    points = out * (1 + 0.01 * rng.normal(size=(n, 1)))
    normals = np.where(np.arange(n)[:, None] % 8 == 0, out, np.nan)
    c = {"points": points, "values": 0.02 * np.sin(5 * out[:, 0]), "noise": np.full(n, 0.005), "normals": normals}
    c["slopes"] = np.ones(n)
    kernel, mean, sigma = gn.SquaredExponential(length), gn.SphereField((0, 0, 0), 1), gn.ConstantField(deviation)
    gp, prior = (gn.GaussianProcess(mean, sigma, kernel, conditions=what) for what in (c, None))
    plan = gp.plan()["conditions"]
    assert plan.startswith("10000 points, 13750 values and slopes in ")
    truncation = float(plan.split("truncation error of ")[1].split()[0])
    assert truncation < 1e-2
    for place in (np.array([0.6, -0.64, 0.48]), np.array([0, 0, 1.0]), np.array([-0.8, -0.6, 0])):
        distance = np.linalg.norm(points - place, axis=1)
        near = {key: value[distance < 14 * length] for key, value in c.items()}
        x = points[distance < 5 * length] + rng.normal(0, 0.3 * length, (np.sum(distance < 5 * length), 3))
        expected, covariance = (around := Regression(prior, near, mean, sigma)).law(x)
        m, v = gp.posterior(x)
        assert len(x) > 7 and np.abs(expected - mean(x)).max() > 0.3 * deviation
        assert np.abs(m - expected).max() < 3 * truncation * deviation
        assert np.abs(np.sqrt(v) - np.sqrt(np.diag(covariance))).max() < 3 * truncation * deviation
    o, d, t = place + [0, 0, 0.06], np.array([0, 0, -1.0]), np.array([0.03, 0.05, 0.06])  # the last place, along the surface
    far = gn.GaussianProcess(gn.SphereField((0, 0, 0), 0.9), sigma, kernel, conditions=dict(c, values=c["values"] + 0.1))
    f = gn.line_values(far, np.tile(o, (200, 1)), np.tile(d, (200, 1)), t, tolerance=1e-9, seed=seed) - 0.1
    f = f[np.isfinite(f).all(axis=1)]
    assert len(f) > 190
    check_law(f, *around.law(o + t[:, None] * d), 3 * truncation * deviation)


@pytest.mark.parametrize("kernel", ["se", "matern 5/2"])
def test_samples_and_realisations_follow_the_posterior(kernel, seed, full_size):
    n = 20_000 if full_size else 3000
    c = some_conditions()
    gp = process(kernel, c)
    x = np.concatenate([c["points"], np.random.default_rng(3).uniform(-1, 1, (4, 3))])
    mean, covariance = Regression(process(kernel), c, MEAN, SIGMA).law(x)
    check_law(gp.sample(x, n, seed), mean, covariance, 1e-6, "sample")
    known = ~np.isnan(c["values"]) & (c["noise"] == 0)
    realisations = gp.realisation_at(x, seed, n if kernel == "se" else n // 10)
    assert np.abs(realisations["value"][:, : len(known)] - c["values"])[:, known].max() < 1e-7
    normals = ~np.isnan(c["normals"]).any(axis=1)
    gradients = realisations["gradient"][:, : len(known)][:, normals]
    assert np.abs(gradients - (c["slopes"][:, None] * c["normals"])[normals]).max() < 1e-5
    check_law(realisations["value"], mean, covariance, 1e-4, "realisation")


def test_a_grid_realisation_goes_through_its_points():
    points = np.array([[0, 0, 0.5], [0.25, -0.5, 0.0], [-0.5, 0.25, 0.25]])
    gp = process(conditions={"points": points, "values": np.array([0.1, -0.2, 0.0])})
    grid = gp.realisation(((-1, -1, -1), (1, 1, 1)), 33, 4)
    index = np.round((points - grid["origin"]) / grid["voxel_size"]).astype(int)
    assert np.allclose(grid["realisation"][tuple(index.T)], [0.1, -0.2, 0.0], atol=1e-5)


LINE = np.array([-1.2, 0.1, -0.3]), np.array([0.8, 0.0, 0.6])


@pytest.mark.parametrize("start", ["outside", "known"])
@pytest.mark.parametrize("kernel, sampler", [("se", "auto"), ("se", "dense"), ("matern 5/2", "auto"), ("se", "realisation")])
def test_lines_follow_the_posterior(kernel, sampler, start, seed, full_size):
    """Values on the lines that a render draws; a start with known value and gradient is one more condition."""
    n = 40_000 if full_size else 4000
    n //= 4 if sampler == "realisation" else 1
    far = gn.ConstantField(1.9)  # hardly any hits
    o, d = LINE
    beside = np.array([[0, 0.3, 0], [0.1, -0.3, 0.1], [-0.2, 0, 0.3], [0.3, 0.2, 0.2], [0, 0.4, -0.3]])
    c = {
        "points": o + np.array([0.3, 0.8, 1.3, 1.8, 2.4])[:, None] * d + beside,
        "values": 1.9 + np.array([0.2, -0.1, 0.3, np.nan, 0.1]),
        "normals": np.array([[np.nan] * 3, [0, 0.6, 0.8], [np.nan] * 3, [1.0, 0, 0], [np.nan] * 3]),
        "slopes": np.full(5, 0.4),
        "noise": np.array([0, 0, 0.05, 0, 0]),
    }
    t = np.array([0.03, 0.4, 0.9, 1.5, 2.2])
    known = dict(c)
    begin = None
    if start == "known":
        gradient = np.array([0.2, -0.3, 0.4])
        begin = {"value": np.full(n, 2.1), "gradient": np.tile(gradient, (n, 1))}
        size = np.linalg.norm(gradient)
        add = {"points": o, "values": 2.1, "normals": gradient / size, "slopes": size, "noise": 0.0}
        known = {key: np.concatenate([c[key], [add[key]]]) for key in c}
    gp = process(kernel, c, far)
    f = gn.line_values(gp, np.tile(o, (n, 1)), np.tile(d, (n, 1)), t, start=begin, sampler=sampler, tolerance=1e-9, seed=seed)
    f = f[np.isfinite(f).all(axis=1)]
    assert len(f) > 0.99 * n
    mean, covariance = Regression(process(kernel, None, far), known, far, SIGMA).law(o + t[:, None] * d)
    # The realisation takes the start by Matheron's rule too; Nyström leaves 1e-7 of variance, dense a cubic between.
    check_law(f, mean, covariance, 3e-4, f"{kernel} {sampler} {start}")


@pytest.mark.parametrize("memory", ["renewal", "renewal+"])
def test_hits_agree_with_those_of_realisations(memory, seed, full_size):
    """First and second hits near pinned points, joint sampler against realisations."""
    n = 20_000 if full_size else 2500
    c = {
        "points": np.array([[0.0, 0, 1.0], [0.3, 0.1, 0.7]]),
        "values": np.zeros(2),
        "normals": np.array([[0, 0, 1.0], [np.nan] * 3]),
    }
    gp = process(conditions=c)
    o = np.tile([0.25, 0.0, 3.0], (n, 1))
    d = np.tile([0.0, 0, -1.0], (n, 1))
    found = {}
    for sampler in ("auto", "realisation"):
        first = gn.first_hits(gp, o, d, 10, sampler=sampler, memory=memory, seed=seed)
        assert np.isfinite(first["t"]).mean() > 0.95
        hit = np.isfinite(first["t"])
        normal = first["gradient"][hit] / np.linalg.norm(first["gradient"][hit], axis=1, keepdims=True)
        out = normal + 0.6 * np.array([0.0, 1.0, 0.0])
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        state = {key: value[hit] for key, value in first["state"].items() if key != "realisation"}
        second = gn.first_hits(gp, first["position"][hit], out, 10, sampler=sampler, memory=memory, start=state, seed=seed + 1)
        found[sampler] = first, second
    for number in (0, 1):
        a, b = found["auto"][number], found["realisation"][number]
        check_same_distribution(a["t"], b["t"], f"t of hit {number}")
        for axis in range(3):
            on = [h["gradient"][np.isfinite(h["t"]), axis] for h in (a, b)]
            check_same_distribution(*on, f"gradient of hit {number}, axis {axis}")
    # Without the conditions it is another distribution, which the test would see.
    free = gn.first_hits(process(), o, d, 10, seed=seed)
    with pytest.raises(AssertionError):
        check_same_distribution(free["t"], found["auto"][0]["t"])


def test_a_pinned_surface_is_met_where_it_is_pinned(seed):
    """f = 0 and grows along the normal at the pin: no ray along it gets past."""
    c = {"points": np.array([[0, 0, 1.2]]), "values": np.zeros(1), "normals": np.array([[0.0, 0, 1]])}
    n = 2000
    hits = gn.first_hits(process(conditions=c), np.tile([0, 0, 3.0], (n, 1)), np.tile([0, 0, -1.0], (n, 1)), 10, seed=seed)
    assert np.all(hits["t"] < 1.8 + 1e-6)
    at_pin = np.abs(hits["t"] - 1.8) < 1e-6
    assert 0.5 < at_pin.mean() <= 1
    assert np.allclose(hits["gradient"][at_pin], [0, 0, 1], atol=2e-3)


def test_counters_say_which_rays_see_the_conditions():
    c = {"points": np.array([[0, 0, 0.8]]), "values": np.zeros(1)}
    gp = gn.GaussianProcess(MEAN, SIGMA, gn.SquaredExponential(0.3), conditions=c, bounds=BOUNDS)
    n = 200
    d = np.tile([0, 0, -1.0], (n, 1))
    far = gn.first_hits(gp, np.tile([2.9, 0, 3.0], (n, 1)), d, 10)["counters"]
    near = gn.first_hits(gp, np.tile([0.1, 0, 3.0], (n, 1)), d, 10)["counters"]
    beside = gn.first_hits(gp, np.tile([0.1, 0, -3.0], (n, 1)), -d, 1.8)["counters"]
    for counters in (far, beside):
        assert counters["condition_rows"] == counters["factorisations"] == 0
    assert near["condition_rows"] == near["factorisations"] == n
    assert beside["line_segments"] == n  # drawn, without them


def test_conditions_in_a_tree(seed):
    """A leaf with conditions, marched with another: against realisations, and against the leaf alone."""
    c = {"points": np.array([[0.0, 0, 1.0]]), "values": np.zeros(1), "normals": np.array([[0, 0.6, 0.8]])}
    pinned = process(conditions=c)
    other = gn.GaussianProcess(gn.SphereField((0.5, 0, 0), 0.6), 0.2, gn.SquaredExponential(0.3), bounds=BOUNDS)
    n = 2000
    o, d = np.tile([0.2, 0.0, 3.0], (n, 1)), np.tile([0.0, 0, -1.0], (n, 1))
    tree = gn.difference(pinned, other)
    a, b = (gn.first_hits(tree, o, d, 10, sampler=s, seed=seed) for s in ("auto", "realisation"))
    check_same_distribution(a["t"], b["t"], "t")
    check_same_distribution(a["part"].astype(float), b["part"].astype(float), "part")
    assert a["counters"]["condition_rows"] > 0
    with pytest.raises(ValueError, match="without conditions"):
        gn.union(pinned, process(), shared_noise=True)


def furnace(process, memory):
    eye = np.eye(4)
    eye[2, 3] = 4
    return gn.Scene(
        {
            "version": 1,
            "camera": {"type": "perspective", "matrix": eye, "fov_x": 0.6},
            "world": {"color": (1, 1, 1)},
            "materials": {"white": {"type": "lambert", "color": (1, 1, 1)}},
            "objects": [{"name": "Ball", "type": "gpis", "process": process, "materials": ["white"], "memory": memory}],
        }
    )


@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+", "global-2", "global"])
def test_furnace(memory, seed):
    c = {
        "points": np.array([[0.0, 0, 0.9], [0.4, 0.2, 0.6]]),
        "values": np.zeros(2),
        "normals": np.array([[0, 0, 1.0], [0.5, 0.5, 0.7]]),
    }
    result = gn.render(furnace(process(conditions=c, sigma=gn.ConstantField(0.15)), memory), 8, 8, samples=16, seed=seed)
    assert np.allclose(result.passes["combined"], 1, atol=1e-6)
    assert result.stats["condition_rows"] > 0 or memory == "global"
    for name in ("nan_samples", "line_step_limit", "states_inside", "path_length_limit"):
        assert result.stats[name] == 0


def test_contradictions_are_refused_by_name():
    points = np.array([[0, 0, 0.8], [0.5, 0.0, 0.2], [1e-6, 0, 0.8]])
    with pytest.raises(ValueError, match=r"conditions.points\[2\].*conditions.points\[0\].*contradict"):
        process(conditions={"points": points, "values": np.array([0.0, 0.1, 0.1])})
    agreeing = process(conditions={"points": points, "values": np.array([0.0, 0.1, 0.0])})
    assert np.allclose(agreeing.posterior(points)[0], [0, 0.1, 0], atol=1e-6)
    noisy = process(conditions={"points": points, "values": np.array([0.0, 0.1, 0.1]), "noise": np.full(3, 0.05)})
    assert abs(noisy.posterior(points[:1])[0][0] - 0.05) < 0.01


@pytest.mark.parametrize(
    "wrong, sentence",
    [
        ({"points": [[0, 0, 0]]}, "neither a value nor a normal"),
        ({"points": [[0, 0, np.nan]], "values": [0]}, "points"),
        ({"points": [[0, 0, 0]], "values": [np.inf]}, "infinite"),
        ({"points": [[0, 0, 0]], "values": [0, 1]}, r"array \(1,\)"),
        ({"points": [[0, 0, 0]], "normals": [[0, 0, 0]]}, "direction"),
        ({"points": [[0, 0, 0]], "normals": [[0, 0, 1]], "slopes": [-1]}, "positive"),
        ({"points": [[0, 0, 0]], "values": [0], "noise": [-1]}, "standard deviation"),
        ({"points": [[0, 0, 0]], "values": [0], "colour": [1]}, "unknown key 'colour'"),
        ({"values": [0]}, "must hold points"),
        ([1, 2], "a dict"),
    ],
)
def test_wrong_conditions_are_refused(wrong, sentence):
    with pytest.raises(ValueError, match=sentence):
        process(conditions=wrong)


def test_conditions_where_sigma_is_zero_are_refused():
    sigma = gn.PlaneField((0, 0, 0), (1, 0, 0)).clamped(0.0, 0.2)
    with pytest.raises(ValueError, match=r"points\[0\].*sigma is 0"):
        process(conditions={"points": [[-0.5, 0, 0]], "values": [0]}, sigma=sigma)


def test_samplers_that_see_the_start_alone_are_refused():
    gp = process(conditions={"points": [[0, 0, 0]], "values": [0]})
    with pytest.raises(ValueError, match="with conditions"):
        gn.first_hits(gp, [[0, 0, 3.0]], [[0, 0, -1.0]], 10, sampler="convolution")


def test_lines_across_many_blocks(seed, full_size):
    """A line that goes from block to block follows the posterior of all conditions together."""
    n = 20_000 if full_size else 3000
    rng = np.random.default_rng(8)
    x = np.linspace(-3, 9, 160)
    points = np.column_stack([x, 0.35 * np.cos(7 * x), 0.35 * np.sin(7 * x)])
    c = {"points": points, "values": 2.0 + 0.2 * rng.normal(size=160), "normals": np.full((160, 3), np.nan)}
    c |= {"slopes": np.ones(160), "noise": np.full(160, 0.15)}
    far, sigma = gn.ConstantField(2.0), gn.ConstantField(0.35)
    gp = gn.GaussianProcess(far, sigma, gn.SquaredExponential(0.5), conditions=c)
    assert int(gp.plan()["conditions"].split(" blocks")[0].split()[-1]) >= 2
    t = np.array([1.0, 2.9, 3.2, 4.4, 5.8, 6.0, 6.2, 7.5, 9.0])
    o, d = np.array([-3.0, 0.05, 0]), np.array([1.0, 0, 0])
    f = gn.line_values(gp, np.tile(o, (n, 1)), np.tile(d, (n, 1)), t, tolerance=1e-9, seed=seed)
    f = f[np.isfinite(f).all(axis=1)]
    assert len(f) > 0.99 * n
    law = Regression(gn.GaussianProcess(far, sigma, gn.SquaredExponential(0.5)), c, far, sigma).law(o + t[:, None] * d)
    check_law(f, *law, 3e-4)


@pytest.mark.parametrize("sampler", ["auto", "dense", "realisation"])
def test_a_start_outside_follows_the_truncated_posterior(sampler, seed, full_size):
    """Definitions B4 beside a condition: f at the start is the posterior's law given f > 0."""
    n = 20_000 if full_size else 3000
    c = {"points": np.array([[0.0, 0.3, 0]]), "values": np.array([-0.6])}
    gp = gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(0.5), conditions=c)
    start, direction = np.zeros((n, 3)), np.tile([0.0, 0, 1.0], (n, 1))
    mean, variance = (v[0] for v in gp.posterior(np.zeros((1, 3))))
    assert mean < -0.4  # most draws are not outside
    f = gn.line_values(gp, start, direction, [1e-9], sampler=sampler, seed=seed)[:, 0]
    draws = mean + np.sqrt(variance) * np.random.default_rng(seed).normal(size=100_000)
    assert (draws > 0).sum() > 10_000
    check_same_distribution(f, draws[draws > 0])
