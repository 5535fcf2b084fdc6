"""Trees of processes against explicit joint realisations that numpy draws and composes."""

from math import pi

import gpis_native as gn
import numpy as np
import pytest
from csg_leaves import BOUNDS, TREES, Leaf, X, a, conditioned, draw, rays
from statistics_checks import check_proportion, check_same_distribution

pytestmark = pytest.mark.stats


@pytest.fixture
def n(full_size):
    return 60_000 if full_size else 10_000


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
    assert compared > 0.08 * n  # most are moved where all leaves are entered inside


def test_a_fresh_realisation_is_drawn_by_what_it_takes(seed):
    """Definitions C7 under global too: of two solids that a ray enters by their bounds, half a deviation and three inside, the
    first is the one that is drawn outside, in either order. The first operand used to stay as it had been realised (outside
    for .31 of the paths), and the other was forced out instead: the light was 30 % off in one order."""
    bounds, n = ((-1,) * 3, (1,) * 3), 2000
    shallow, deep = (gn.GaussianProcess(mean, 0.2, gn.SquaredExponential(0.4), bounds=bounds) for mean in (-0.1, -0.6))
    origins = np.column_stack([np.random.default_rng(seed).uniform(-0.9, 0.9, (n, 2)), np.full(n, 6.0)])
    towards = np.tile([0, 0, -1.0], (n, 1))
    for tree, outside in ((gn.intersection(shallow, deep), 0), (gn.intersection(deep, shallow), 1)):
        lines, hits = (gn.first_hits(tree, origins, towards, 12, memory=m, seed=seed + outside) for m in ("none", "global"))
        check_same_distribution(hits["t"], lines["t"], f"outside {outside}")
        p = np.mean(lines["part"] == outside)
        check_proportion(np.sum(hits["part"] == outside), n, p, np.sqrt(p * (1 - p) / n), "who is met")


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
