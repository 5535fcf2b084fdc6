"""Smooth unions along rays against explicit joint realisations that numpy draws and blends."""

import gpis_native as gn
import numpy as np
import pytest
from csg_leaves import SAME, A, B, C, Leaf, X, a, b, c, conditioned, draw, rays
from statistics_checks import check_proportion, check_same_distribution

pytestmark = pytest.mark.stats

# Leaves whose values are within the radius of each other nearly everywhere.
NEAR = [Leaf(gn.SphereField([2.0, 0.3, 0], 0.5), 0.1, 0.5), Leaf(gn.SphereField([2.1, -0.2, 0], 0.5), 0.2, 0.4)]
BALL = Leaf(gn.SphereField([2.6, -0.4, 0], 0.8), 0.0, 1.0)
ROUGH = [Leaf(gn.SphereField([1.6, 0.3, 0], 0.8), 0.2, gn.Matern(1.5, 0.5)), NEAR[1]]


def process(leaves):
    return [leaf.process for leaf in leaves]


TREES = {
    "two": (gn.smooth_union(a, b, blend=0.4), [A, B], False),
    "wide": (gn.smooth_union(*process(NEAR), blend=1.5), NEAR, False),
    "three": (gn.smooth_union(a, b, c, blend=0.3), [A, B, C], False),
    "less another": (gn.difference(gn.smooth_union(a, b, blend=0.4), c), [A, B, C], False),
    "of an intersection": (gn.smooth_union(gn.intersection(a, b), c, blend=0.5), [A, B, C], False),
    "from a body": (gn.difference(a, gn.smooth_union(b, c, blend=0.4)), [A, B, C], False),
    "with a certain ball": (gn.smooth_union(NEAR[0].process, BALL.process, blend=0.5), [NEAR[0], BALL], False),
    "rough": (gn.smooth_union(*process(ROUGH), blend=0.4), ROUGH, False),
    "shared": (gn.smooth_union(*process(SAME), blend=0.4, shared_noise=True), SAME, True),
}


@pytest.fixture
def n(full_size):
    return 40_000 if full_size else 5_000


def first_crossings(tree, leaves, shared, g, rng):
    """t, leaf, gradient of F and values of the leaves where F first falls to 0 on the grid; rays that start inside are
    left out. Weights of the leaves by differences of the composition."""
    f = np.stack([leaf.values(x) for leaf, x in zip(leaves, g, strict=True)], axis=-1)
    composed = tree.compose(f)
    outside = composed[:, 0] > 0
    f, composed = f[outside], composed[outside]
    below = composed <= 0
    row = np.flatnonzero(below.any(axis=1))
    i = np.argmax(below[row], axis=1)
    fraction = composed[row, i - 1] / (composed[row, i - 1] - composed[row, i])
    t = np.full(len(f), np.inf)
    t[row] = X[i - 1] + (X[1] - X[0]) * fraction
    there = f[row, i - 1] + fraction[:, None] * (f[row, i] - f[row, i - 1])
    step = 1e-6
    weights = np.stack([(tree.compose(there + step * e) - tree.compose(there - step * e)) for e in np.eye(len(leaves))], axis=-1)
    weights /= 2 * step
    part = np.full(len(f), -1)
    part[row] = np.argmax(np.abs(weights), axis=1)
    gradient = np.full((len(f), 3), np.nan)
    gradient[row, 0] = (composed[row, i] - composed[row, i - 1]) / (X[1] - X[0])
    across = [rng.normal(size=(len(row), 2)) for _ in leaves]
    gradient[row, 1:] = sum(
        weights[:, k, None] * (leaf.mean_gradient[i, 1:] + leaf.across * across[0 if shared else k])
        for k, leaf in enumerate(leaves)
    )
    return t, part, gradient, there


@pytest.mark.parametrize("name", TREES)
def test_first_hits_of_explicit_realisations(name, n, seed):
    """Two-sample tests of t, part, gradient and the values of the leaves that are to be remembered."""
    tree, leaves, shared = TREES[name]
    rng = np.random.default_rng(seed)
    t, part, gradient, there = first_crossings(tree, leaves, shared, draw(leaves, shared, n, rng), rng)
    m = len(t)
    hits = gn.first_hits(tree, *rays(m), 4, seed=seed)
    check_same_distribution(hits["t"], t, f"{name}: t")
    for k in range(len(leaves)):
        p = np.mean(part == k)
        check_proportion(np.sum(hits["part"] == k), m, p, np.sqrt(p * (1 - p) / m), f"{name}: part {k}")
    hit = np.isfinite(hits["t"])
    for axis in range(3):
        pair = hits["gradient"][hit, axis], gradient[np.isfinite(t), axis]
        check_same_distribution(*pair, f"{name}: gradient {axis}")
    value = hits["state"]["value"][hit]
    every = np.isfinite(value).all(axis=1)
    assert every.any() and np.abs(tree.compose(value[every])).max() < 1e-8
    # The nearer leaf of a crease lies off 0 by up to a quarter of the radius; elsewhere it is 0, but for the grid's lines.
    low, expected = np.nanmin(np.abs(value), axis=1), np.min(np.abs(there), axis=1)
    assert expected.max() > 0.02
    low, expected = (np.where(x < 4e-3, 0, x) for x in (low, expected))
    check_same_distribution(low, expected, f"{name}: value of the leaf that is nearest")
    assert np.all(hits["gradient"][hit, 0] <= 0)
    assert hits["counters"]["line_step_limit"] == 0
    assert hits["counters"]["line_entry_inside"] < 1e-3 * m


@pytest.mark.parametrize("name", ["union", "difference", "nested"])
def test_without_a_radius_it_is_the_union(name, n, seed):
    """Radius -> 0: the same law as the march by signs, which shares no code with this one but the lines."""
    pair = [gn.union(a, b), gn.smooth_union(a, b, blend=1e-9)]
    if name == "difference":
        pair = [gn.difference(c, x) for x in pair]
    if name == "nested":
        pair = [gn.union(gn.intersection(x, c), b) for x in pair]
    hard, smooth = (gn.first_hits(tree, *rays(3 * n), 4, seed=seed + i) for i, tree in enumerate(pair))
    check_same_distribution(hard["t"], smooth["t"], "t")
    for k in range(2):
        of = [h["part"] == k for h in (hard, smooth)]
        check_proportion(of[1].sum(), 3 * n, of[0].mean(), np.sqrt(of[0].mean() * (1 - of[0].mean()) / (3 * n)), f"part {k}")
        for axis in range(3):
            check_same_distribution(hard["gradient"][of[0], axis], smooth["gradient"][of[1], axis], f"part {k}: gradient {axis}")


def test_certain_leaves_meet_in_a_closed_form():
    """Two planes without bumps, 90° apart: t and ∇F on a ray through their crease."""
    flat = [gn.GaussianProcess(gn.PlaneField([0, 0, 0], axis), 0, gn.SquaredExponential(1)) for axis in np.eye(3)[:2]]
    radius, y = 0.5, np.linspace(-0.4, 0.7, 50)
    origins = np.column_stack([np.full(50, 3.0), y, np.zeros(50)])
    hits = gn.first_hits(gn.smooth_union(*flat, blend=radius), origins, np.tile([-1.0, 0, 0], (50, 1)), 9)
    # F = min - (r - |x - y|)²₊/4r = 0 for x, y in the crease: (x - y)² - 2r(x + y) + r² = 0.
    x = np.where(y > radius, 0, y + radius - 2 * np.sqrt(radius * np.maximum(y, 0)))
    inside = (y > 0.01) & (x > -1e-12)
    np.testing.assert_allclose(hits["t"][inside], 3 - x[inside], atol=1e-9)
    share = np.clip(0.5 - (x - y) / (2 * radius), 0, 1)[inside]
    np.testing.assert_allclose(hits["gradient"][inside, 0], share, atol=1e-7)
    np.testing.assert_allclose(hits["gradient"][inside, 1], 1 - share, atol=1e-7)


@pytest.mark.parametrize("memory", ["renewal", "renewal+", "none"])
def test_starts_on_a_crease(memory, n, seed):
    """Definitions B1-B3 where F = 0 though neither leaf is: values, or values and gradients, or F > 0 alone."""
    leaves = [Leaf(gn.ConstantField(0.15), 0.2, 0.8), Leaf(gn.ConstantField(0.2), 0.3, 0.6)]
    radius, first = 0.6, 0.05
    tree = gn.smooth_union(*process(leaves), blend=radius)
    second = first + radius - 2 * np.sqrt(radius * first)  # F = 0: (f₀ - f₁)² - 2r(f₀ + f₁) + r² = 0
    value = np.tile([first, second], (n, 1))
    assert abs(tree.compose(value[0])) < 1e-12
    slopes = np.array([0.5, -0.1])
    gradient = np.zeros((n, 2, 3))
    gradient[:, :, 0] = slopes
    gradient[:, :, 1] = [0.2, -0.3]
    hits = gn.first_hits(tree, *rays(n), 4, memory=memory, start={"value": value, "gradient": gradient}, seed=seed)
    rng = np.random.default_rng(seed)
    m = 6 * n
    if memory == "none":
        g = [leaf.noise(m, rng) for leaf in leaves]
    else:
        weights = np.array([0.5 + (second - first) / (2 * radius), 0.5 - (second - first) / (2 * radius)])
        sigma, length = np.array([0.2, 0.3]), np.array([0.8, 0.6])
        slope = np.tile(slopes, (m, 1))
        if memory == "renewal":
            # Rayleigh along the sum, free across it: slopes of the leaves are N(0, (σ/ℓ)²).
            s = sigma / length
            free = rng.normal(size=(m, 2)) * s
            total = np.sqrt(np.sum((weights * s) ** 2))
            wanted = total * np.sqrt(-2 * np.log(rng.uniform(size=m)))
            slope = free + np.outer(wanted - free @ weights, weights * s**2 / total**2)
        g = [
            conditioned(leaf, float(ell), m, rng, np.full(m, (v - mean) / s), slope[:, k] / s)
            for k, (leaf, ell, v, mean, s) in enumerate(zip(leaves, length, (first, second), (0.15, 0.2), sigma, strict=True))
        ]
        g[0][:, 0] += 1e-6  # the start counts as outside
    t, part, _, _ = first_crossings(tree, leaves, False, g, rng)
    if memory != "none":
        assert len(t) == m
    check_same_distribution(hits["t"], t, memory)
    for k in range(2):
        p, error = np.mean(part == k), 0.5 / np.sqrt(len(t))
        check_proportion(np.sum(hits["part"] == k), n, p, error, f"{memory}: part {k}")


def test_inside_sees_the_complement(n, seed):
    tree = TREES["three"][0]
    origins, directions = rays(n)
    origins[:, 0] = 1.6
    inside = gn.first_hits(tree, origins, directions, 2, inside=np.ones(n, dtype=bool), seed=seed)
    turned = gn.first_hits(gn.complement(tree), origins, directions, 2, seed=seed)
    assert np.isfinite(inside["t"]).mean() > 0.3
    np.testing.assert_array_equal(inside["t"], turned["t"])
    np.testing.assert_array_equal(inside["gradient"], -turned["gradient"])


def test_only_leaves_within_reach_of_the_surface_are_drawn(seed):
    """Far from the crease a smooth union costs what the leaf does: the other is skipped by its mean less the radius."""
    far = gn.GaussianProcess(gn.SphereField([3.5, 3, 0], 0.5), 0.1, gn.SquaredExponential(0.5), bounds=((0, -6, -6), (4, 6, 6)))
    n = 2000
    with_it = gn.first_hits(gn.smooth_union(a, far, blend=0.2), *rays(n), 4, seed=seed)
    state = with_it["state"]["value"][np.isfinite(with_it["t"])]
    assert np.isnan(state[:, 1]).all() and np.isfinite(state[:, 0]).all()
    # A radius that reaches it draws it.
    wide = gn.first_hits(gn.smooth_union(a, far, blend=4.0), *rays(n), 4, seed=seed)
    assert np.isfinite(wide["state"]["value"][np.isfinite(wide["t"]), 1]).all()


def test_names_of_trees():
    tree = gn.smooth_union(a, b, c, blend=0.2)
    assert repr(tree) == "<ProcessTree smooth_union(smooth_union(0, 1, blend=0.2), 2, blend=0.2)>"
    plan = tree.plan()
    assert "smooth_union" in plan["composition"] and "within the blend radii" in plan["composition"]
    for blend in (0, -1, np.nan, np.inf):
        with pytest.raises(ValueError, match="smooth_union: blend"):
            gn.smooth_union(a, b, blend=blend)


def unit(v):
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def continued(tree, memory, n, seed):
    """First hits of rays that leave first hits in directions about the gradient there."""
    found = gn.first_hits(tree, *rays(n), 4, memory=memory, seed=seed)
    hit = np.isfinite(found["t"])
    rng = np.random.default_rng(seed)
    directions = unit(unit(found["gradient"][hit]) + unit(rng.normal(size=(hit.sum(), 3))))
    start = {name: found["state"][name][hit] for name in ("value", "gradient")}
    return gn.first_hits(tree, found["position"][hit], directions, 4, memory=memory, start=start, seed=seed + 1)


ROUGH_BALL = Leaf(gn.SphereField([0, 0, 0], 0.7), 0.2, 0.5)
FLOOR = gn.GaussianProcess(gn.PlaneField([0, 0, 0], [0, 0, 1]), 0, gn.SquaredExponential(1))
LEAVING = {
    "two": ([a, b], {}),
    "shared": (process(SAME), {"shared_noise": True}),
    "large bumps": (process([Leaf(gn.SphereField([x, 0.1, 0], 0.7), 1.0, 3.0) for x in (1.4, 2.2)]), {}),
}


@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
@pytest.mark.parametrize("name", LEAVING)
def test_rays_leave_it_as_they_leave_the_union(name, memory, n, seed):
    """Radius -> 0 again, from hits on: none is met again at once, none counts as inside."""
    leaves, options = LEAVING[name]
    trees = gn.union(*leaves, **options), gn.smooth_union(*leaves, blend=1e-7, **options)
    hard, smooth = (continued(tree, memory, 2 * n, seed + 10 * i) for i, tree in enumerate(trees))
    check_same_distribution(hard["t"], smooth["t"], f"{name}, {memory}")
    assert np.mean(smooth["t"] < 1e-4) <= np.mean(hard["t"] < 1e-4) + 2e-3
    assert smooth["counters"]["line_entry_inside"] <= 2e-4 * n


@pytest.mark.parametrize("blend", [1e-7, 0.05])
def test_a_forgotten_leaf_was_not_in_the_way(blend, n, seed):
    """Memory none: what is known of a floor without bumps does not say that a ball above it, whose mean is below 0, is there."""
    origins, up = np.tile([0.6, 0, 0.0], (n, 1)), unit(np.tile([-0.3, 0, 1.0], (n, 1)))
    start = {"value": np.tile([np.nan, 0], (n, 1)), "gradient": np.tile([[np.nan] * 3, [0, 0, 1]], (n, 1, 1))}
    trees = gn.union(ROUGH_BALL.process, FLOOR), gn.smooth_union(ROUGH_BALL.process, FLOOR, blend=blend)
    hard, smooth = (gn.first_hits(t, origins, up, 4, memory="none", start=start, seed=seed + i) for i, t in enumerate(trees))
    assert smooth["counters"]["line_entry_inside"] == hard["counters"]["line_entry_inside"] == 0
    if blend < 1e-6:
        check_same_distribution(hard["t"], smooth["t"])


@pytest.mark.parametrize("depth", [0.5, 0.7, 0.9])
def test_rays_enter_deep_below_the_mean(depth, n, seed):
    """Definitions B2, B4: a ray that enters the bounds 4.5 deviations below the mean of a ground is outside there all the same."""
    bounds = ((-3, -3, -3), (3, 3, 3))
    ground = gn.GaussianProcess(gn.PlaneField([0, 0, 0], [0, 0, 1]), 0.2, gn.SquaredExponential(0.5), bounds=bounds)
    ball = gn.GaussianProcess(gn.SphereField([0, 0, 2], 0.3), 0.05, gn.SquaredExponential(0.5), bounds=bounds)
    origins, along = np.tile([-4, 0, -depth], (n, 1)), np.tile([1.0, 0, 0], (n, 1))
    trees = gn.union(ground, ball), gn.smooth_union(ground, ball, blend=0.2)
    hard, smooth = (gn.first_hits(t, origins, along, 9, seed=seed + i) for i, t in enumerate(trees))
    assert smooth["counters"]["line_entry_inside"] == 0
    check_same_distribution(hard["t"], smooth["t"])


def test_gradients_of_one_noise_fit_together(n, seed):
    """Two spheres of one noise: σ∇g = ∇f - ∇μ is the same at a hit whichever leaf tells it."""
    centers, radius = np.array([[1.4, 0, 0], [2.4, 0, 0]]), 0.7
    leaves = [gn.GaussianProcess(gn.SphereField(x, radius), 0.2, gn.SquaredExponential(0.5)) for x in centers]
    for tree in (gn.union(*leaves, shared_noise=True), gn.smooth_union(*leaves, blend=0.02, shared_noise=True)):
        hits = gn.first_hits(tree, *rays(n), 4, memory="renewal+", seed=seed)
        both = np.isfinite(hits["state"]["value"]).all(axis=1)
        assert both.mean() > 0.05
        noise = [hits["state"]["gradient"][both, k] - unit(hits["position"][both] - centers[k]) for k in range(2)]
        np.testing.assert_allclose(noise[0], noise[1], atol=1e-6)
