"""Trees of processes against explicit joint realisations that numpy draws and composes, and their algebra."""

from math import erfc, pi, sqrt

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_proportion, check_same_distribution, check_z
from tensor_grids import along_x, isotropic

pytestmark = pytest.mark.stats
BOUNDS = ((0, -3, -3), (4, 3, 3))  # rays run along the x axis from 0 to 4
X = np.linspace(0, 4, 321)


@pytest.fixture
def n(full_size):
    return 60_000 if full_size else 10_000


def rays(n):
    return np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0], (n, 1))


def normals(covariance, n, rng):
    values, vectors = np.linalg.eigh(covariance)
    return rng.normal(size=(n, len(covariance))) @ (vectors * np.sqrt(np.maximum(values, 0))).T


class Leaf:
    """A process with a mean that numpy knows, and realisations of it on the x axis."""

    def __init__(self, mean, sigma, kernel, bounds=BOUNDS, anisotropy=None):
        self.kernel = gn.SquaredExponential(kernel) if isinstance(kernel, float) else kernel
        self.sigma = sigma
        # Slopes across the line are independent of the line for one radial correlation (math.md §4).
        self.radial = anisotropy is None and not isinstance(self.kernel, gn.PlaneWave)
        self.across = sigma * np.sqrt(self.kernel.derivative_variance([0, 1, 0]))
        self.process = gn.GaussianProcess(mean, sigma, self.kernel, bounds=bounds, anisotropy=anisotropy)
        points = np.column_stack([X, np.zeros((len(X), 2))])
        self.covariance = self.process.covariance(points, points) / sigma**2 if sigma > 0 else np.eye(len(X))
        self.mean = self.process.mean(points)
        self.mean_gradient = mean.gradient(points)

    def noise(self, n, rng):
        return normals(self.covariance, n, rng)

    def values(self, g):
        return self.mean + self.sigma * g


def sphere(x, y, radius, sigma, length_scale):
    return Leaf(gn.SphereField([x, y, 0], radius), sigma, length_scale)


A = sphere(1.6, 0.3, 0.8, 0.2, 0.5)
B = sphere(2.4, -0.2, 0.9, 0.15, 0.35)
C = sphere(1.9, 0.1, 0.6, 0.25, 0.4)
SAME = [sphere(1.6, 0.3, 0.8, 0.2, 0.5), sphere(2.3, 0, 0.7, 0.3, 0.5)]
WAVE = Leaf(gn.PlaneField([1, 0, 0], [1, 0, 0], 0.1), 0.4, 0.5)
a, b, c = A.process, B.process, C.process
MARKOV = Leaf(gn.SphereField([1.6, 0.3, 0], 0.8), 0.2, gn.Matern(1.5, 0.5))
SPECTRAL = Leaf(gn.SphereField([1.9, 0, 0], 0.6), 0.2, gn.RationalQuadratic(1.0, 0.4))
VARYING = Leaf(
    gn.SphereField([1.8, 0.2, 0], 0.9),
    0.25,
    gn.SquaredExponential(1),
    anisotropy=along_x(lambda x: isotropic(0.3 * np.exp(x / 6)), 6),
)
RIPPLE = Leaf(gn.PlaneField([1.5, 0, 0], [1, 0, 0], 0.2), 0.4, gn.PlaneWave([5.0, 2.0, 1.0]))
# Faces that a ray meets within one step: which one is first follows from all of them.
FACES = [Leaf(gn.PlaneField([2, 0, 0], [-1, 0, 0], 1), s, length) for s, length in ((0.15, 1.0), (0.2, 1.1), (0.1, 0.9))]


def ramp(x, slope, low, high):
    """A mean along the x axis: slope from x on (or up to it), between two levels."""
    return gn.PlaneField([x, 0, 0], [np.sign(slope), 0, 0], abs(slope)).clamped(low, high)


# One that is drawn, clear for certain and there again; the other has become uncertain by then.
AGAIN = Leaf(ramp(0.3, 6, 0, 1.2) + ramp(1.3, -1, -1.6, 0) + gn.ConstantField(0.1), 0.15, 1.0)
LATER = Leaf(ramp(1.95, 4, -0.8, 0) + gn.ConstantField(-0.1), 0.2, 1.0)
BOX = Leaf(gn.BoxField([1.7, 0, 0], [1.2, 2, 2]), 0.0, 1.0)

TREES = {
    "union": (gn.union(a, b), [A, B], False),
    "intersection": (gn.intersection(a, b), [A, B], False),
    "difference": (gn.difference(a, c), [A, C], False),
    "three": (gn.union(a, b, c), [A, B, C], False),
    "nested": (gn.difference(gn.union(a, b), c), [A, B, C], False),
    "complements": (gn.intersection(b, gn.complement(gn.intersection(a, gn.complement(c)))), [B, A, C], False),
    "cut by a certain box": (gn.intersection(BOX.process, b), [BOX, B], False),
    "waves": (gn.intersection(gn.union(a, WAVE.process), gn.complement(c)), [A, WAVE, C], False),
    "Markov less spectral": (gn.difference(MARKOV.process, SPECTRAL.process), [MARKOV, SPECTRAL], False),
    "deep, one process twice": (
        gn.union(gn.difference(a, gn.intersection(b, c)), gn.intersection(WAVE.process, gn.complement(a))),
        [A, B, C, WAVE, A],
        False,
    ),
    "varying lengths less a plane wave": (gn.difference(VARYING.process, RIPPLE.process), [VARYING, RIPPLE], False),
    "faces in one place": (gn.union(*[x.process for x in FACES]), FACES, False),
    "faces in one place, nested": (
        gn.intersection(FACES[0].process, gn.union(FACES[1].process, FACES[2].process)),
        FACES,
        False,
    ),
    "left behind": (gn.intersection(LATER.process, AGAIN.process), [LATER, AGAIN], False),
    "shared union": (gn.union(*[s.process for s in SAME], shared_noise=True), SAME, True),
    "shared difference": (gn.difference(*[s.process for s in SAME], shared_noise=True), SAME, True),
    "shared inside": (
        gn.difference(gn.intersection(SAME[0].process, WAVE.process, shared_noise=True), c),
        [SAME[0], WAVE, C],
        (0, 0, 1),
    ),
}


def draw(leaves, shared, n, rng):
    """g of each leaf (n, points)."""
    groups = shared if isinstance(shared, tuple) else [0] * len(leaves) if shared else range(len(leaves))
    drawn = {}
    return [drawn[k] if k in drawn else drawn.setdefault(k, leaf.noise(n, rng)) for k, leaf in zip(groups, leaves, strict=True)]


def first_crossings(tree, leaves, g, rng):
    """t, leaf and gradient where F first falls to 0 on the grid; rays that start inside are left out."""
    f = np.stack([leaf.values(x) for leaf, x in zip(leaves, g, strict=True)], axis=-1)
    composed = tree.compose(f)
    outside = composed[:, 0] > 0
    f, composed = f[outside], composed[outside]
    below = composed <= 0
    hit = below.any(axis=1)
    i = np.argmax(below[hit], axis=1)
    row = np.flatnonzero(hit)
    step = X[1] - X[0]
    # Every leaf is a line between two points: F falls to 0 where the first of them does at which F is 0.
    before, after = f[row, i - 1], f[row, i]
    fraction = np.full(before.shape, np.inf)
    for k in range(len(leaves)):
        crosses = before[:, k] * after[:, k] <= 0
        weight = before[crosses, k] / (before[crosses, k] - after[crosses, k])
        there = before[crosses] + weight[:, None] * (after[crosses] - before[crosses])
        there[:, k] = 0
        fraction[crosses, k] = np.where(tree.compose(there) <= 1e-12, weight, np.inf)
    t = np.full(len(f), np.inf)
    t[row] = X[i - 1] + step * fraction.min(axis=1)
    part = np.full(len(f), -1)
    part[row] = np.argmin(fraction, axis=1)
    gradient = np.full((len(f), 3), np.nan)
    for k, leaf in enumerate(leaves):
        mine = row[part[row] == k]
        j = i[part[row] == k]
        values = f[mine][:, :, k]
        r = np.arange(len(mine))
        slope = (values[r, j] - values[r, j - 1]) / step
        # F falls along the ray.
        across = leaf.across * rng.normal(size=(len(mine), 2))
        full = np.column_stack([slope, leaf.mean_gradient[j, 1:] + across])
        gradient[mine] = full * -np.sign(slope)[:, None]
    return t, part, gradient


@pytest.mark.parametrize("name", TREES)
def test_first_hits_of_explicit_realisations(name, n, seed):
    """Two-sample tests of t, part and gradient against dense joint realisations composed by numpy."""
    tree, leaves, shared = TREES[name]
    rng = np.random.default_rng(seed)
    t, part, gradient = first_crossings(tree, leaves, draw(leaves, shared, n, rng), rng)
    m = len(t)
    hits = gn.first_hits(tree, *rays(m), 4, seed=seed)
    check_same_distribution(hits["t"], t, f"{name}: t")
    for k in range(len(leaves)):
        p = np.mean(part == k)
        check_proportion(np.sum(hits["part"] == k), m, p, np.sqrt(p * (1 - p) / m), f"{name}: part {k}")
        if np.sum(part == k) < 200:
            continue
        check_same_distribution(hits["t"][hits["part"] == k], t[part == k], f"{name}: t of part {k}")
        if leaves[k].sigma > 0:
            for axis in range(3 if leaves[k].radial else 1):
                pair = hits["gradient"][hits["part"] == k, axis], gradient[part == k, axis]
                check_same_distribution(*pair, f"{name}: gradient {axis} of part {k}")
    hit = np.isfinite(hits["t"])
    assert np.all(hits["gradient"][hit, 0] <= 0)  # every hit is arrived at from outside
    assert np.array_equal(hit, hits["part"] >= 0)
    assert hits["counters"]["line_step_limit"] == 0
    assert hits["counters"]["line_entry_inside"] < 1e-3 * m


def conditioned(leaf, length_scale, n, rng, value, slope):
    """g on the axis given value and, unless None, slope (n,) at x = 0; squared exponential."""
    d = X / length_scale
    k = np.exp(-(d**2) / 2)
    covariance = leaf.covariance - np.outer(k, k) * (1 + np.outer(d, d) * (slope is not None))
    g = normals(covariance, n, rng) + np.multiply.outer(value, k)
    if slope is not None:
        g += np.multiply.outer(slope * length_scale, d * k)
    return g


@pytest.mark.parametrize("memory", ["renewal", "renewal+", "none"])
def test_starts_inside_other_leaves(memory, n, seed):
    """A ray that leaves the face of a subtracted leaf, inside of what is left over (definitions B1-B3)."""
    body = Leaf(gn.ConstantField(0.1), 0.5, 0.8)
    hole = Leaf(gn.ConstantField(0.2), 0.4, 0.6)
    other = Leaf(gn.ConstantField(0.3), 0.3, 0.5)  # was not sampled
    tree = gn.union(gn.difference(body.process, hole.process), other.process)
    value = np.tile([-0.3, 0.0, np.nan], (n, 1))
    gradient = np.full((n, 3, 3), np.nan)
    gradient[:, 0] = [0.4, 0.1, 0.2]
    gradient[:, 1] = [-0.7, 0.3, -0.2]  # F = -f grows along the ray
    hits = gn.first_hits(tree, *rays(n), 4, memory=memory, start={"value": value, "gradient": gradient}, seed=seed)
    rng = np.random.default_rng(seed)
    g = [leaf.noise(8 * n if memory == "none" else 3 * n, rng) for leaf in (body, hole, other)]
    m = len(g[0])
    if memory != "none":
        ones = np.ones(m)
        slope = None if memory == "renewal" else ones * 0.4 / 0.5
        g[0] = conditioned(body, 0.8, m, rng, ones * (-0.3 - 0.1) / 0.5, slope)
        # Flux-weighted: a Rayleigh slope, downwards.
        rayleigh = np.sqrt(-2 * np.log(rng.uniform(size=m))) / 0.6
        slope = -rayleigh if memory == "renewal" else ones * -0.7 / 0.4
        g[1] = conditioned(hole, 0.6, m, rng, ones * -0.2 / 0.4, slope)
        g[1][:, 0] -= 1e-9  # rounding of a value of 0
    t, part, _ = first_crossings(tree, [body, hole, other], g, rng)
    assert len(t) > n
    check_same_distribution(hits["t"], t, memory)
    for k in range(3):
        p, error = np.mean(part == k), 0.5 / np.sqrt(len(t))
        check_proportion(np.sum(hits["part"] == k), n, p, error, f"{memory}: part {k}")


@pytest.mark.parametrize("memory", ["renewal", "renewal+", "none"])
@pytest.mark.parametrize("inside_out", [False, True])
def test_a_tree_of_one_leaf_starts_as_the_process_does(inside_out, memory, n, seed):
    """Where mean and deviation vary: union with nothing, and the complement seen from inside."""
    origins, directions = rays(n)
    mean = gn.PlaneField([0.5, 0, 0], [0.6, 0.64, 0.48], 0.4)
    sigma = (gn.PlaneField([0, 0, 0], [0.8, -0.6, 0], 0.1) + 0.4).clamped(0.1, 1)
    gp = gn.GaussianProcess(mean, sigma, gn.SquaredExponential([0.5, 0.8, 0.4]), bounds=BOUNDS)
    rng = np.random.default_rng(seed)
    gradient = np.array([0.4, -0.5, 0.6]) + 0.3 * rng.normal(size=(n, 3))
    gradient[:, 0] = np.abs(gradient[:, 0])
    sign = -1 if inside_out else 1
    alone = gn.first_hits(
        gp,
        origins,
        directions,
        4,
        memory=memory,
        start={"value": np.zeros(n), "gradient": sign * gradient},
        inside=np.full(n, inside_out),
        seed=seed,
    )
    empty = gn.GaussianProcess(10.0, 0.1, gn.SquaredExponential(0.3))
    tree = gn.union(gn.complement(gp) if inside_out else gp, empty)
    state = {"value": np.tile([0, np.nan], (n, 1)), "gradient": np.full((n, 2, 3), np.nan)}
    state["gradient"][:, 0] = sign * gradient
    leaf = gn.first_hits(tree, origins, directions, 4, memory=memory, start=state, seed=seed + 1)
    check_same_distribution(alone["t"], leaf["t"], "t")
    for axis in range(3):
        found = [h["gradient"][np.isfinite(h["t"]), axis] * s for h, s in ((alone, sign), (leaf, 1))]
        check_same_distribution(*found, f"gradient {axis}")
        before = [gradient[np.isfinite(h["t"]), axis] for h in (alone, leaf)]
        check_same_distribution(found[0] * before[0], found[1] * before[1], f"memory of gradient {axis}")


def test_rays_inside(n, seed):
    """Definitions B7: rays inside see -F: those of a tree the complement's, those of a process its own march."""
    tree = TREES["nested"][0]
    origins, directions = rays(n)
    origins[:, 0] = 1.2
    everywhere = np.ones(n, dtype=bool)
    inside = gn.first_hits(tree, origins, directions, 2, inside=everywhere, seed=seed)
    turned = gn.first_hits(gn.complement(tree), origins, directions, 2, seed=seed)
    assert np.isfinite(inside["t"]).mean() > 0.5
    np.testing.assert_array_equal(inside["t"], turned["t"])
    np.testing.assert_array_equal(inside["gradient"], -turned["gradient"])
    assert np.nanmin(inside["gradient"][:, 0]) >= 0
    alone = gn.first_hits(a, origins, directions, 2, inside=everywhere, seed=seed)
    leaf = gn.first_hits(gn.complement(a), origins, directions, 2, seed=seed)
    check_same_distribution(alone["t"], leaf["t"], "a process")
    for axis in range(3):
        pair = [h["gradient"][np.isfinite(h["t"]), axis] * s for h, s in ((alone, 1), (leaf, -1))]
        check_same_distribution(*pair, f"gradient {axis}")


def test_a_leaf_that_is_certain_at_the_start(n, seed):
    """One noise, the deviation of one leaf 0 at the start: its sign is known there, the other is drawn outside."""
    sigma = gn.PlaneField([1, 0, 0], [1, 0, 0], 0.5).clamped(0, 0.4)
    sure = gn.GaussianProcess(0.2, sigma, gn.SquaredExponential(0.5), bounds=BOUNDS)
    other = gn.GaussianProcess(0.1, 0.4, gn.SquaredExponential(0.5), bounds=BOUNDS)
    tree = gn.union(sure, other, shared_noise=True)
    f = gn.line_values(tree, *rays(n), np.array([1e-9, 2]), seed=seed)[:, 0, 1]
    expected = np.random.default_rng(seed).normal(0.1, 0.4, 5 * n)
    check_same_distribution(f, expected[expected > 0], "the other leaf")
    assert gn.first_hits(tree, *rays(n), 2, seed=seed)["counters"]["line_entry_inside"] == 0


@pytest.mark.parametrize("subtracted", [False, True])
def test_a_ray_that_leaves_a_face_at_the_end_of_a_voxel(subtracted, seed):
    """The face is a plane of nodes, the start beside it by rounding: a ray that rises finds no root where its voxel ends."""
    n, rng = 2000, np.random.default_rng(seed)
    bounds = ((-1, -2, -2), (3, 2, 2))
    values = np.tile(np.linspace(-2, 2, 9)[:, None, None], (1, 9, 9))
    sign = -1 if subtracted else 1
    face = gn.GaussianProcess(gn.GridField(sign * values, 0.5, [-1, -2, -2]), 0, gn.SquaredExponential(0.5), bounds=bounds)
    rest = gn.GaussianProcess(-1.5 if subtracted else 1.5, 0.3, gn.SquaredExponential(0.5), bounds=bounds)
    tree = gn.difference(rest, face) if subtracted else gn.union(face, rest)
    leaf = int(subtracted)
    origins = np.column_stack([1 - rng.integers(0, 8, n) * 2.0**-53, rng.uniform(-1, 1, (n, 2))])
    along, angle = 10 ** -rng.uniform(3, 5, n), rng.uniform(0, 2 * pi, n)
    directions = np.column_stack([along, np.cos(angle), np.sin(angle)])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    start = {"value": np.full((n, 2), np.nan), "gradient": np.full((n, 2, 3), np.nan)}
    start["value"][:, leaf], start["gradient"][:, leaf] = 0, [sign, 0, 0]
    hits = gn.first_hits(tree, origins, directions, 1, start=start, seed=seed)
    assert np.sum(hits["t"] < 1e-6) == 0


def test_rays_that_start_inside_wait_until_they_are_out(n, seed):
    """A remembered value below 0 says inside: no hit before F has been above 0, and then the next."""
    m, leaf = 2 * n, Leaf(gn.ConstantField(0.1), 0.5, 0.5)
    tree = gn.union(leaf.process, gn.GaussianProcess(10.0, 0.1, gn.SquaredExponential(0.3)))
    start = {"value": np.tile([-0.3, np.nan], (m, 1)), "gradient": np.zeros((m, 2, 3))}
    hits = gn.first_hits(tree, *rays(m), 4, memory="renewal", start=start, seed=seed)
    assert hits["counters"]["line_entry_inside"] == m
    below = leaf.values(conditioned(leaf, 0.5, m, np.random.default_rng(seed), np.full(m, -0.4 / 0.5), None)) < 0
    again = below & ~np.logical_and.accumulate(below, axis=1)
    t = np.where(again.any(axis=1), X[np.argmax(again, axis=1)] - 0.5 * X[1], np.inf)
    check_same_distribution(hits["t"], t, "t")
    assert np.all(hits["gradient"][np.isfinite(hits["t"]), 0] <= 0)


def test_start_of_a_fresh_ray_is_joint(n, seed):
    """Formula C7: a camera inside constant media; the signs and values at the start given F > 0."""
    leaves = [Leaf(gn.ConstantField(mu), 1.0, 1.0) for mu in (-0.5, 0.4, -0.2)]
    a, b, c = (leaf.process for leaf in leaves)
    tree = gn.union(gn.intersection(a, b), gn.complement(c))
    f = gn.line_values(tree, *rays(n), np.array([1e-9, 4.0]), seed=seed)[:, 0]
    rng = np.random.default_rng(seed)
    expected = rng.normal(size=(20 * n, 3)) + [-0.5, 0.4, -0.2]
    expected = expected[tree.compose(expected) > 0]
    drawn = np.isfinite(f)
    assert drawn[:, 2].all() and drawn[:, :2].any(axis=1).all()
    assert np.all(f[:, 2] < 0)
    for k in range(3):
        everywhere = drawn[:, k]
        if everywhere.all():
            check_same_distribution(f[:, k], expected[:, k], f"leaf {k}")
    # Leaf 1 is drawn where leaf 0 alone does not decide: never conditioned on more than F > 0.
    both = drawn[:, 0] & drawn[:, 1]
    assert np.all((f[both, 0] > 0) | (f[both, 1] > 0))
    check_same_distribution(f[f[:, 0] > 0, 0], expected[expected[:, 0] > 0, 0], "leaf 0 above")
    p = np.mean(expected[:, 0] > 0)
    check_proportion(np.sum(f[:, 0] > 0), n, p, np.sqrt(p * (1 - p) / len(expected)))


def test_union_of_independent_constants(n, seed):
    """Oracle 1 and 6: survivals of independent objects multiply; P(inside) = 1 - Π(1 - P)."""
    gp = gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1.0), bounds=((0, -1, -1), (12, 1, 1)))
    m = 10 * n
    origins, directions = rays(m)
    t = gn.first_hits(gn.union(gp, gp, gp), origins, directions, 9, seed=seed)["t"]
    survival = np.array([0.84229, 0.69407, 0.45573, 0.12893])
    check_proportion([np.sum(t > x) for x in (0.5, 1, 2, 5)], m, survival**3, 3 * 4e-4 * survival**2)
    values = np.column_stack([gp.sample(np.zeros((1, 3)), m, seed + k)[:, 0] for k in range(3)])
    inside = gn.union(gp, gp, gp).compose(values) < 0
    check_proportion(inside.sum(), m, 1 - 0.5**3)


@pytest.mark.parametrize("shared", [False, True])
def test_marginals_of_the_composition(shared, n, seed):
    """Oracle 18, Clark 1961: mean and second moment of the greater and the lesser of two Gaussians, correlated where noise
    is shared."""
    mu, sigma, m = np.array([0.3, -0.2]), np.array([0.5, 0.8]), 10 * n
    leaves = [gn.GaussianProcess(u, s, gn.SquaredExponential(1)) for u, s in zip(mu, sigma, strict=True)]
    f = np.column_stack([leaf.sample(np.zeros((1, 3)), m, seed + (0 if shared else k)) for k, leaf in enumerate(leaves)])
    nu = np.sqrt(np.sum(sigma**2) - 2 * shared * sigma[0] * sigma[1])
    alpha = (mu[0] - mu[1]) / nu
    low, high = 0.5 * erfc(-alpha / sqrt(2)), 0.5 * erfc(alpha / sqrt(2))
    phi = np.exp(-(alpha**2) / 2) / sqrt(2 * pi)
    mean = mu[0] * low + mu[1] * high + nu * phi
    second = (mu[0] ** 2 + sigma[0] ** 2) * low + (mu[1] ** 2 + sigma[1] ** 2) * high + (mu[0] + mu[1]) * nu * phi
    greater = gn.intersection(*leaves, shared_noise=shared).compose(f)
    lesser = gn.union(*leaves, shared_noise=shared).compose(f)
    check_z(greater.mean(), mean, greater.std() / sqrt(m))
    check_z((greater**2).mean(), second, (greater**2).std() / sqrt(m))
    check_z(lesser.mean(), mu.sum() - mean, lesser.std() / sqrt(m))
    check_z((lesser**2).mean(), np.sum(mu**2 + sigma**2) - second, (lesser**2).std() / sqrt(m))


def same(x, y):
    for key in ("t", "part", "gradient"):
        np.testing.assert_array_equal(x[key], y[key])


def test_algebra(n, seed):
    origins, directions = rays(n)
    empty = gn.GaussianProcess(10.0, 0.1, gn.SquaredExponential(0.3))

    def hits(tree, offset=0):
        return gn.first_hits(tree, origins, directions, 4, seed=seed + offset)

    # With an empty object: the same random numbers, bit by bit; and the process itself in distribution.
    alone = hits(gn.union(a, empty))
    assert np.all(alone["part"][np.isfinite(alone["t"])] == 0)
    same(alone, hits(gn.difference(a, empty)))
    same(alone, hits(gn.union(gn.intersection(a, gn.complement(empty)), empty)))
    single = hits(a)
    np.testing.assert_allclose(np.sort(alone["t"])[:: n // 10], np.sort(single["t"])[:: n // 10], atol=0.1)
    check_same_distribution(alone["t"], single["t"], "the process itself")
    assert not np.isfinite(hits(gn.intersection(a, empty))["t"]).any()
    # A difference with itself under shared noise touches 0 and never changes sign.
    nothing = hits(gn.difference(a, a, shared_noise=True))
    assert not np.isfinite(nothing["t"]).any() and nothing["counters"]["line_normals"] > n
    # Independent noise leaves something of it.
    assert np.isfinite(hits(gn.difference(a, a))["t"]).mean() > 0.1
    # Idempotence under shared noise, order, De Morgan.
    same(alone, hits(gn.union(a, a, shared_noise=True)))
    check_same_distribution(alone["t"], hits(gn.intersection(a, a, shared_noise=True), 3)["t"], "idempotence")
    check_same_distribution(hits(gn.union(a, b))["t"], hits(gn.union(b, a), 1)["t"], "order")
    check_same_distribution(hits(gn.intersection(a, b))["t"], hits(gn.intersection(b, a), 1)["t"], "order")
    demorgan = gn.complement(gn.union(gn.complement(b), gn.complement(a)))
    check_same_distribution(hits(gn.intersection(a, b))["t"], hits(demorgan, 2)["t"], "De Morgan")
    same(hits(gn.difference(a, b)), hits(gn.intersection(a, gn.complement(b))))


def test_what_decides_nothing_is_not_drawn(seed):
    """Counters: two spheres that are far apart cost the one that is there; a certain box hides what it cuts off."""
    m = 2000
    origins, directions = rays(m)
    far = gn.GaussianProcess(gn.SphereField([1.6, 50, 0], 0.8), 0.2, gn.SquaredExponential(0.5))
    empty = gn.GaussianProcess(10.0, 0.1, gn.SquaredExponential(0.5))
    alone = gn.first_hits(gn.union(a, empty), origins, directions, 4, seed=seed)["counters"]
    pair = gn.first_hits(gn.union(a, far), origins, directions, 4, seed=seed)["counters"]
    near = gn.first_hits(gn.union(a, b), origins, directions, 4, seed=seed)["counters"]
    assert alone["line_normals"] == pair["line_normals"] < near["line_normals"]
    assert alone["line_evaluations"] == pair["line_evaluations"] > 0
    # Rays past the box: the process inside of it is never drawn, though its own rays would.
    box = gn.GaussianProcess(gn.BoxField([2, 5, 0], [1, 1, 1]), 0, gn.SquaredExponential(1))
    hidden = gn.first_hits(gn.intersection(box, a), origins, directions, 4, seed=seed)["counters"]
    assert hidden["line_skipped"] == m and hidden["line_normals"] == 0
    # Inside of what is subtracted for certain.
    hole = gn.GaussianProcess(gn.SphereField([2, 0, 0], 2.5), 0.0, gn.SquaredExponential(1))
    gone = gn.first_hits(gn.difference(a, hole), origins, directions, 4, seed=seed)["counters"]
    assert gone["line_skipped"] == m and gone["line_normals"] == 0


GLOBAL = ["nested", "complements", "Markov less spectral", "shared inside"]


@pytest.mark.parametrize("name", GLOBAL)
def test_global_is_one_realisation_of_every_leaf(name, full_size, seed):
    """Memory global: hits, and those of the rays reflected there, are roots of the composition of gp.realisation_at of the
    leaves under the seeds in the state, with F > 0 in between; the leaf that is hit gives the gradient."""
    tree, leaves, shared = TREES[name]
    groups = shared or range(len(leaves))
    n, rng = 300 if full_size else 30, np.random.default_rng(seed)
    origins, directions = rays(n)
    origins[:, 1:] += rng.uniform(-0.3, 0.3, (n, 2))
    hits = gn.first_hits(tree, origins, directions, 4, memory="global", seed=seed)
    compared = 0
    for bounce in range(2):
        rows = np.flatnonzero(np.isfinite(hits["t"]))
        realisation = hits["state"]["realisation"]
        for i in rows:
            # A path that entered a leaf inside has moved it: not the realisation of the seed alone.
            if np.isfinite(realisation["shift"][i]).any():
                continue
            part, t = hits["part"][i], np.append(np.linspace(0.02, 0.98, 25), 1) * hits["t"][i]
            points = origins[i] + t[:, None] * directions[i]
            seeds = [int(realisation["seed"][i, list(groups).index(k)]) for k in groups]
            at = [leaf.process.realisation_at(points, s) for leaf, s in zip(leaves, seeds, strict=True)]
            f = tree.compose(np.stack([x["value"][0] for x in at], axis=-1))
            assert abs(f[-1]) < 1e-6 and f[:-1].min() > -1e-3
            np.testing.assert_allclose(np.abs(hits["gradient"][i]), np.abs(at[part]["gradient"][0, -1]), atol=1e-4)
            assert hits["gradient"][i] @ directions[i] <= 0
            compared += 1
        state = {k: hits["state"][k][rows] for k in ("value", "gradient")}
        state["realisation"] = {k: v[rows] for k, v in realisation.items()}
        origins, gradient, d = hits["position"][rows], hits["gradient"][rows], directions[rows]
        normal = gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
        directions = d - 2 * np.sum(d * normal, axis=1, keepdims=True) * normal
        if bounce == 0:
            hits = gn.first_hits(tree, origins, directions, 4, memory="global", start=state, seed=seed + 1)
            np.testing.assert_array_equal(hits["state"]["realisation"]["seed"], state["realisation"]["seed"])
    assert compared > 0.4 * n


@pytest.mark.parametrize("name", GLOBAL)
def test_first_hits_of_global_are_those_of_lines(name, n, seed):
    """A fresh path sees a fresh realisation: the law of the first hit is that of the samplers of lines."""
    tree, leaves, _ = TREES[name]
    m = n // 10
    hits = gn.first_hits(tree, *rays(m), 4, memory="global", seed=seed)
    lines = gn.first_hits(tree, *rays(n), 4, seed=seed + 1)
    check_same_distribution(hits["t"], lines["t"], f"{name}: t")
    for k in range(len(leaves)):
        p = np.mean(lines["part"] == k)
        check_proportion(np.sum(hits["part"] == k), m, p, np.sqrt(p * (1 - p) / n), f"{name}: part {k}")
    for axis in range(3):
        pair = [h["gradient"][np.isfinite(h["t"]), axis] for h in (hits, lines)]
        check_same_distribution(*pair, f"{name}: gradient {axis}")


MOVED = np.array([[0.8, -0.9, 0.2, 0.4], [0.5, 0.7, -0.3, -0.2], [0.1, 0.3, 1.2, 0.1], [0, 0, 0, 1]])


@pytest.mark.parametrize(
    "kernel",
    [
        gn.SquaredExponential([0.5, 0.3, 0.9]),
        gn.Matern(1.5, 0.5),
        gn.RationalQuadratic(1, [0.4, np.inf, 0.6]),
        gn.LocallyPeriodic(0.8, 0.5, [0, 0, 1], 1.0),
        0.3 * gn.SquaredExponential(0.4) + gn.Wong(0.3),
    ],
)
def test_a_moved_process_is_the_process_elsewhere(kernel, seed):
    """Definitions B12: f at x is that at M⁻¹x, with its covariance, slopes and first hits."""
    box = ((-2, -2, -2), (2, 2, 2))
    gp = gn.GaussianProcess(
        gn.SphereField([0.2, 0, 0], 0.8),
        (0.1 + 0.05 * gn.PlaneField([0, 0, 0], [0, 1, 0])).clamped(0.02, 0.3),
        kernel,
        bounds=box,
    )
    moved = gp.transformed(MOVED)
    rng = np.random.default_rng(seed)
    points = rng.normal(size=(6, 3))
    there = points @ MOVED[:3, :3].T + MOVED[:3, 3]
    np.testing.assert_allclose(moved.mean(there), gp.mean(points), atol=1e-12)
    np.testing.assert_allclose(moved.covariance(there, there), gp.covariance(points, points), atol=1e-12)
    inverse = np.linalg.inv(MOVED[:3, :3])
    joint = gp.joint_covariance(points, points)[..., 1:, 1:]
    np.testing.assert_allclose(
        moved.joint_covariance(there, there)[..., 1:, 1:], np.einsum("ai,pqab,bj->pqij", inverse, joint, inverse), atol=1e-9
    )
    # Rays of the same parameter meet it at the same parameter, in distribution.
    n = 3000
    origins, directions = np.tile([-3.0, 0.1, 0.2], (n, 1)), np.tile([1.0, 0, 0], (n, 1))
    along = directions @ MOVED[:3, :3].T
    speed = np.linalg.norm(along[0])
    here = gn.first_hits(gp, origins, directions, 6, seed=seed)
    hits = gn.first_hits(moved, origins @ MOVED[:3, :3].T + MOVED[:3, 3], along / speed, 6 * speed, seed=seed + 1)
    check_same_distribution(hits["t"] / speed, here["t"], "t")
    for axis in range(3):
        hit, met = np.isfinite(here["t"]), np.isfinite(hits["t"])
        gradient = here["gradient"][hit] @ inverse
        check_same_distribution(hits["gradient"][met, axis], gradient[:, axis], f"gradient {axis}")


def test_operands_with_transforms_of_their_own(seed):
    """A tree that is moved as a whole is the tree of its moved leaves; moved there and back it shares its noise again."""
    s, t = (leaf.process for leaf in SAME)
    back = s.transformed(MOVED).transformed(np.linalg.inv(MOVED))
    shared = gn.union(back, t, shared_noise=True)
    assert not np.isfinite(gn.first_hits(gn.difference(s, s, shared_noise=True), *rays(500), 4)["t"]).any()
    whole = gn.union(s, t, shared_noise=True).transformed(MOVED)
    assert repr(whole) == repr(shared)
    points = np.random.default_rng(seed).normal(size=(5, 3))
    there = points @ MOVED[:3, :3].T + MOVED[:3, 3]
    for leaf, original in zip(whole.leaves, (s, t), strict=True):
        np.testing.assert_allclose(leaf.covariance(there, there), original.covariance(points, points), atol=1e-12)
    with pytest.raises(ValueError, match="must not flatten space"):
        s.transformed(np.diag([1, 0, 1, 1]))
    turned = np.eye(4)
    turned[:2, :2] = [[0, -1], [1, 0]]
    stretched = gn.GaussianProcess(0, 1, gn.SquaredExponential([1, 2, 3]))
    with pytest.raises(ValueError, match="takes operands of one kernel"):
        gn.union(stretched, stretched.transformed(turned), shared_noise=True)


def test_two_spheres_of_the_paper(n, seed):
    """Issue 5's scene: a rough sphere and an almost certain one; parts by explicit realisations elsewhere."""
    large = gn.GaussianProcess(gn.SphereField([-0.4, 0.8, 0], 0.8), 0.1, gn.SquaredExponential(0.5))
    small = gn.GaussianProcess(gn.SphereField([0.4, 0.8, 0], 0.5), 0.001, gn.SquaredExponential(0.5))
    origins = np.tile([3.0, 0.8, 0.0], (n, 1))
    hits = gn.first_hits(gn.union(large, small), origins, np.tile([-1.0, 0, 0], (n, 1)), 10, seed=seed)
    # The small sphere ends at x = .9; the large one reaches there with probability below 1e-6 at 4 deviations.
    assert np.mean(hits["part"] == 1) > 0.99
    check_z(hits["t"][hits["part"] == 1].mean(), 2.1, 0.001 / np.sqrt(n) + 1e-6)
    middle = np.tile([-0.2, 3.0, 0.0], (n, 1))
    t = gn.first_hits(gn.union(large, small), middle, np.tile([0, -1.0, 0], (n, 1)), 10, seed=seed)
    assert np.mean(t["part"] == 0) > 0.99


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: gn.union(), "union takes at least one operand"),
        (lambda: gn.union(a, 3), "union: operand 1 must be a GaussianProcess or a CSG tree of them, it is a int"),
        (lambda: gn.union(a, gn.GaussianProcess(0, 1, gn.Matern(0.5, 1.0))).plan(), "Operand 1: the kernel .* no gradient"),
        (lambda: gn.difference(a, None), "difference: b must be a GaussianProcess"),
        (lambda: gn.union(a, b, shared_noise=True), "takes operands of one kernel; these have SquaredExponential"),
        (
            lambda: gn.first_hits(gn.union(a, b), *rays(1), 4, start={"value": [0], "gradient": [[1, 0, 0]]}),
            r"start must hold value \(N, 2\) and gradient \(N, 2, 3\)",
        ),
        (lambda: gn.union(a, b).compose(np.zeros((4, 3))), "the last axis over the leaves"),
        (
            lambda: gn.union(a, gn.GaussianProcess(0, 0, gn.SquaredExponential(1))).plan(),
            "Operand 1: mean and sigma are both 0",
        ),
    ],
)
def test_bad_input_gets_a_sentence(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()


def test_plan_and_leaves():
    tree = gn.difference(gn.union(a, b), c)
    assert repr(tree) == "<ProcessTree intersection(union(0, 1), complement(2))>"
    assert tree.leaves == [a, b, c]
    plan = tree.plan()
    assert "independent" in plan["composition"] and "leaf[2].sampler" in plan
