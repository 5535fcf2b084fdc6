"""Trees of processes: closed forms, algebra, what is not drawn, moved operands, bad input."""

from math import erfc, pi, sqrt

import gpis_native as gn
import numpy as np
import pytest
from csg_leaves import SAME, a, b, c, rays
from statistics_checks import check_proportion, check_same_distribution, check_z

pytestmark = pytest.mark.stats


@pytest.fixture
def n(full_size):
    return 60_000 if full_size else 10_000


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

    # With an empty object: the same random numbers, bit by bit. A union of independent leaves marches each for itself, the
    # other trees all of them together.
    single = hits(a)
    same(hits(gn.union(a, empty)), single)
    same(hits(gn.union(empty, a)), single | {"part": np.where(single["part"] < 0, -1, 1)})
    alone = hits(gn.difference(a, empty))
    assert np.all(alone["part"][np.isfinite(alone["t"])] == 0)
    same(alone, hits(gn.union(gn.intersection(a, gn.complement(empty)), empty)))
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
    """A rough sphere and an almost certain one; parts by explicit realisations elsewhere."""
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


def test_short_dips_of_a_leaf_are_not_missed(full_size, seed):
    """A leaf 2.5 deviations outside dips below 0 for less than a step of the march as a rule. Marched together with one that
    is as good as certain it is hit as often as alone, where another march looks for its roots."""
    n, length = (1_000_000 if full_size else 250_000), 11.0
    bounds = ((-1, -1, -1), (12, 1, 1))
    outside, inside = (gn.GaussianProcess(mean, 1, gn.SquaredExponential(1), bounds=bounds) for mean in (2.5, -5.0))
    along = np.zeros((n, 3)), np.tile([1.0, 0, 0], (n, 1))
    alone = np.isfinite(gn.first_hits(outside, *along, length, seed=seed)["t"]).mean()
    hits = gn.first_hits(gn.intersection(outside, inside), *along, length, seed=seed + 1)
    check_proportion(np.sum(np.isfinite(hits["t"])), n, alone, sqrt(alone * (1 - alone) / n), "hits")
    assert hits["counters"]["line_evaluations"] > 8 * n and np.all(hits["part"][np.isfinite(hits["t"])] == 0)
