"""Smooth unions from the first hit on: a ray from the camera, a bounce into the cosine law about the gradient there, and where
that ray ends, against explicit realisations that numpy draws, blends and traces with no code of this project."""

import gpis_native as gn
import numpy as np
import pytest
from csg_leaves import Leaf, X, conditioned, draw, rays
from remembered import take
from statistics_checks import check_proportion, check_same_distribution, check_z

pytestmark = pytest.mark.stats

STEP = X[1] - X[0]
# Two balls above and below the ray, which meets the valley between them: every second bounce meets a slope of it.
CENTERS, RADIUS = np.array([[1.5, 1.5, 0.0], [1.6, -1.5, 0.0]]), 1.5


# Out of the way: the realisations have none, and second rays go where they like.
BOUNDS = ((-9, -9, -9), (9, 9, 9))


def balls(sigmas, lengths):
    means = [gn.SphereField(c, RADIUS) for c in CENTERS]
    return [Leaf(m, s, length, bounds=BOUNDS) for m, s, length in zip(means, sigmas, lengths, strict=True)]


SCENES = {
    "independent": (balls((0.3, 0.4), (0.35, 0.3)), (0.35, 0.3), False),
    "one noise": (balls((0.25, 0.4), (0.35, 0.35)), (0.35, 0.35), True),
}
BLEND = 0.4


def tree_of(scene):
    leaves, _, shared = SCENES[scene]
    return gn.smooth_union(*[leaf.process for leaf in leaves], blend=BLEND, shared_noise=shared)


@pytest.fixture
def n(full_size):
    return 30_000 if full_size else 4000


def unit(v):
    return v / np.linalg.norm(v, axis=-1, keepdims=True)


def blended(f):
    """F and the weights of the two leaves."""
    apart = f[..., 0] - f[..., 1]
    share = np.clip(0.5 - apart / (2 * BLEND), 0, 1)
    return np.minimum(f[..., 0], f[..., 1]) - np.maximum(BLEND - np.abs(apart), 0) ** 2 / (4 * BLEND), np.stack(
        [share, 1 - share], -1
    )


def crossing(f):
    """Row, point before and fraction of the step where F (n, points) first falls to 0, after the first point."""
    below = f[:, 1:] <= 0
    row = np.flatnonzero(below.any(axis=1))
    i = np.argmax(below[row], axis=1)
    before = np.maximum(f[row, i], 1e-12)
    return row, i, before / (before - f[row, i + 1])


def cosine(gradient, rng):
    return unit(unit(gradient) + unit(rng.normal(size=gradient.shape)))


def of_line_and_slope(length, g, i, fraction, across, directions, rng):
    """g on the second rays (rows, points) given all of g on the first ray and its slopes across that ray at the hit. Values half
    a length apart fix a squared exponential on a line to 3e-4 (math.md, 5.4)."""
    nodes = np.arange(0, len(X), int(0.5 * length / STEP))
    hit = X[i] + fraction * STEP
    k = lambda r2: np.exp(-r2 / (2 * length**2))  # noqa: E731
    known = k((X[nodes][:, None] - X[nodes]) ** 2) + 1e-8 * np.eye(len(nodes))
    data = np.column_stack([g[:, nodes], across])
    inverse = np.zeros((data.shape[1],) * 2)
    inverse[:-2, :-2] = np.linalg.inv(known)
    inverse[-2:, -2:] = np.eye(2) * length**2
    # The second ray at nodes as close, and from these to all its points.
    s = X[nodes]
    among = k((s[:, None] - s) ** 2)
    point = hit[:, None, None] * np.array([1.0, 0, 0]) + s[:, None] * directions[:, None, :]
    along = point[..., 0, None] - X[nodes]
    cross = np.empty((len(hit), len(s), data.shape[1]))
    cross[..., :-2] = k(along**2 + np.sum(point[..., 1:] ** 2, axis=-1)[..., None])
    cross[..., -2:] = (point[..., 1:] / length**2) * k(s**2)[:, None]
    weights = cross @ inverse
    rest = among - weights @ cross.transpose(0, 2, 1) + 1e-8 * np.eye(len(s))
    drawn = np.einsum("nij,nj->ni", np.linalg.cholesky(rest), rng.normal(size=(len(hit), len(s))))
    at_nodes = np.einsum("nij,nj->ni", weights, data) + drawn
    return at_nodes @ np.linalg.solve(among + 1e-8 * np.eye(len(s)), k((s[:, None] - X) ** 2))


def explicit(scene, everything, n, rng):
    """Of rays whose first point is outside: the share that hits; of those the slope of F along the second ray, and t where that
    hits, by realisations of which the second ray sees everything, or the values and gradients at the first hit alone."""
    leaves, lengths, shared = SCENES[scene]
    g = draw(leaves, shared, n, rng)
    f = np.stack([leaf.values(x) for leaf, x in zip(leaves, g, strict=True)], axis=-1)
    composed, _ = blended(f)
    outside = composed[:, 0] > 0
    g, f, composed = [x[outside] for x in g], f[outside], composed[outside]
    row, i, fraction = crossing(composed)
    position = (X[i] + fraction * STEP)[:, None] * np.array([1.0, 0, 0])
    across = [rng.normal(size=(len(row), 2)) / length for length in lengths]
    value, slope, gradient = [], [], []
    for k, leaf in enumerate(leaves):
        g_k, rise = g[k][row], np.gradient(g[k][row], STEP, axis=1)
        r = np.arange(len(row))
        value.append(g_k[r, i] + fraction * (g_k[r, i + 1] - g_k[r, i]))
        along = rise[r, i] + fraction * (rise[r, i + 1] - rise[r, i])
        slope.append(np.column_stack([along, across[0 if shared else k]]))
        gradient.append(unit(position - CENTERS[k]) + leaf.sigma * slope[k])
    at_hit = [
        np.linalg.norm(position - c, axis=1) - RADIUS + leaf.sigma * v for c, leaf, v in zip(CENTERS, leaves, value, strict=True)
    ]
    weights = blended(np.stack(at_hit, axis=-1))[1]
    normal = sum(weights[:, k, None] * gradient[k] for k in range(2))
    directions = cosine(normal, rng)
    points = position[:, None] + X[:, None] * directions[:, None]
    second, drawn = [], None
    for k, (leaf, length) in enumerate(zip(leaves, lengths, strict=True)):
        if drawn is None or not shared:
            if everything:
                drawn = of_line_and_slope(length, g[k][row], i, fraction, across[k], directions, rng)
            else:
                drawn = conditioned(leaf, length, len(row), rng, value[k], np.sum(slope[k] * directions, axis=1))
        second.append(np.linalg.norm(points - CENTERS[k], axis=-1) - RADIUS + leaf.sigma * drawn)
    hit, j, part = crossing(blended(np.stack(second, axis=-1))[0])
    t = np.full(len(row), np.inf)
    t[hit] = X[j] + part * STEP
    return len(row) / len(f), np.sum(normal * directions, axis=1), t


@pytest.mark.parametrize("memory", ["renewal+", "global-1", "global"])
@pytest.mark.parametrize("scene", SCENES)
def test_second_hits_of_explicit_realisations(scene, memory, n, seed):
    rng = np.random.default_rng(seed)
    n *= 3 if memory == "renewal+" else 1  # which is cheap, and depends on little more than the start
    share, slope, t = explicit(scene, memory != "renewal+", n, rng)
    assert 0.2 < np.isfinite(t).mean() < 0.8
    tree = tree_of(scene)
    found = gn.first_hits(tree, *rays(n), 4, memory=memory, seed=seed)
    hit = np.isfinite(found["t"])
    check_proportion(hit.sum(), n, share, np.sqrt(share * (1 - share) / n), "first hits")
    directions = cosine(found["gradient"][hit], rng)
    start = take(found["state"], hit)
    second = gn.first_hits(tree, found["position"][hit], directions, 4, memory=memory, start=start, seed=seed + 1)
    check_same_distribution(second["t"], t, f"{scene}, {memory}: t of the second hit")
    # By the slope at the start, which a ray that had forgotten it would not depend on.
    ours = np.sum(found["gradient"][hit] * directions, axis=1)
    check_same_distribution(ours, slope, f"{scene}, {memory}: slope")
    ends = np.quantile(slope, [0, 0.1, 0.5, 1]) + [-9, 0, 0, 9]
    for low, high in zip(ends[:-1], ends[1:], strict=True):
        pair = second["t"][(ours > low) & (ours <= high)], t[(slope > low) & (slope <= high)]
        check_same_distribution(*pair, f"{scene}, {memory}: t after slopes {low:.2f} to {high:.2f}")
    # Those that leave slowly are soon back: one in four of them, of all rays one in fourteen.
    slow, slower = ours < ends[1], slope < ends[1]
    for most in (0.1, 0.2):
        p = np.mean(t[slower] < most)
        error = np.sqrt(p * (1 - p) / slower.sum())
        check_proportion(np.sum(second["t"][slow] < most), slow.sum(), p, error, f"{scene}, {memory}: soon back")


@pytest.mark.parametrize("memory", ["renewal+", "global"])
@pytest.mark.parametrize("scene", SCENES)
def test_light_after_one_bounce(scene, memory, n, seed):
    """The renderer on the same ray, direct light of a white world alone: what misses, and what is free after the first hit."""
    share, _, t = explicit(scene, memory != "renewal+", 2 * n, np.random.default_rng(seed))
    expected = 1 - share * np.isfinite(t).mean()
    forward = np.eye(4)
    forward[:3, :3] = np.array([[0, 0, -1], [0, 1, 0], [1, 0, 0]])  # looks along x
    scene_description = {
        "version": 1,
        "settings": {"max_bounces": 0},
        "camera": {"type": "orthographic", "matrix": forward, "width": 1e-9},
        "world": {"color": (1, 1, 1)},
        "materials": {"white": {"type": "lambert", "color": (1, 1, 1)}},
        "objects": [{"name": "Balls", "type": "gpis", "process": tree_of(scene), "materials": ["white"], "memory": memory}],
    }
    side = 16
    samples = max(16, n // side**2 // 16 * 16)
    result = gn.render(gn.Scene(scene_description), side, side, samples=samples, seed=seed)
    mean = result.passes["combined"][..., 0].astype(float).mean()
    error = np.sqrt(expected * (1 - expected) * (1 / (side**2 * samples) + 1 / (2 * n)))
    assert error < 0.02
    check_z(mean, expected, error, f"{scene}, {memory}")
