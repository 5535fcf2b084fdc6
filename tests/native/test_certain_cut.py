"""Random leaves cut by certain ones (σ = 0): each marched for itself where they let it be seen. The same law as the march of all
leaves together, which a plane, box or sphere times 1 still gets."""

from math import erfc, sqrt

import gpis_native as gn
import numpy as np
import pytest
from scene_parts import scene
from statistics_checks import check_proportion, check_same_distribution

pytestmark = pytest.mark.stats

BOX = ((-1, -1, -1), (1, 1, 1))
KERNEL = gn.SquaredExponential(0.4)
TURNED = np.array([[0.6, -0.8, 0, 0.1], [0.9, 0.5, 0.2, 0], [0, 0.1, 1.1, -0.1], [0, 0, 0, 1]])
FILLING = gn.GaussianProcess(gn.ConstantField(0.1), 0.2, KERNEL, bounds=BOX)
BALL = gn.GaussianProcess(gn.SphereField([0.2, 0, 0], 0.7), 0.2, KERNEL, bounds=BOX)
ROUGH = gn.GaussianProcess(0.2, 0.2, gn.Matern(1.5, [0.4, 0.6, 0.3]), bounds=((-1, -1, -1), (1, 0.5, 1)))


def plane(x=0.1, normal=(1, 0.3, 0.2)):
    return gn.PlaneField([x, 0, 0], normal)


def certain(mean, bounds=None, matrix=None):
    """The leaf, and the same as a field that no cut knows."""
    both = [gn.GaussianProcess(field, 0.0, gn.SquaredExponential(1), bounds=bounds) for field in (mean, 1.0 * mean)]
    return both if matrix is None else [leaf.transformed(matrix) for leaf in both]


def pair(make, *cuts):
    return [make(*leaves) for leaves in zip(*cuts, strict=True)]


def ball(radius=0.6, x=0.0):
    return gn.SphereField([x, 0.1, 0], radius)


CUTS = {
    "wedge": pair(lambda h: gn.intersection(FILLING, h), certain(plane(), BOX)),
    "plane of the other side": pair(lambda h: gn.difference(FILLING, h), certain(plane())),
    "box": pair(lambda h: gn.intersection(h, FILLING), certain(gn.BoxField([0, 0.3, 0], [1.5, 1.2, 0.9]))),
    "turned box": pair(lambda h: gn.intersection(h, FILLING), certain(gn.BoxField([0, 0, 0], [1.2, 1, 0.9]), None, TURNED)),
    "sphere": pair(lambda h: gn.intersection(BALL, h), certain(ball())),
    "less a sphere": pair(lambda h: gn.difference(FILLING, h), certain(ball(0.8, 0.6))),
    "slab": pair(
        lambda g, h: gn.intersection(FILLING, gn.intersection(g, h)), certain(plane(0.3)), certain(plane(-0.4, (-1, 0, 0.1)))
    ),
    "two leaves": pair(lambda h: gn.intersection(h, gn.union(FILLING, ROUGH)), certain(plane())),
}


def rays(n, seed, spread=0.7):
    """From a sphere around the box, most of them through it."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(n, 3))
    origins *= 3 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-spread, spread, (n, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@pytest.fixture
def n(full_size):
    return 100_000 if full_size else 20_000


def same(a, b, what):
    """Normals of a face are all one, but for rounding."""
    check_same_distribution(np.round(a, 9), np.round(b, 9), what)


def compare(a, b, leaves, what, values):
    """`values`: leaves whose remembered state is asked for too."""
    n = len(a["t"])
    check_same_distribution(a["t"], b["t"], f"{what}: t")
    for k in range(leaves):
        x, y = a["part"] == k, b["part"] == k
        p = (x.mean() + y.mean()) / 2
        check_proportion(x.sum(), n, y.mean(), np.sqrt(p * (1 - p) / n), f"{what}: part {k}")
        if min(x.sum(), y.sum()) < 200:
            continue
        check_same_distribution(a["t"][x], b["t"][y], f"{what}: t of part {k}")
        for axis in range(3):
            same(a["gradient"][x, axis], b["gradient"][y, axis], f"{what}: gradient {axis} of part {k}")
        for i in values:
            for s, t in [(a["state"]["value"], b["state"]["value"])] + [
                (a["state"]["gradient"][..., axis], b["state"]["gradient"][..., axis]) for axis in range(3)
            ]:
                s, t = s[x, i], t[y, i]
                same(s[np.isfinite(s)], t[np.isfinite(t)], f"{what}: state of {i} at part {k}")


@pytest.mark.parametrize("name", CUTS)
def test_the_law_is_that_of_the_march_together(name, n, seed):
    """(t, leaf, gradient, states) of rays from outside, and of rays that leave what these met."""
    cut, together = CUTS[name]
    assert "for itself" in cut.plan()["composition"] and "together (a certain cut takes" in together.plan()["composition"]
    # The certain leaf's own value is known without being remembered; a random one's where both saw it: on the cut, at its hit.
    sure = [cut.plan()[f"leaf[{k}].sampler"].startswith("none") for k in range(len(cut.leaves))]
    first = [gn.first_hits(tree, *rays(n, seed), 8, seed=seed + k, memory="renewal+") for k, tree in enumerate((cut, together))]
    on_cut = [np.isin(f["part"], np.flatnonzero(sure)) for f in first]
    assert on_cut[0].sum() > 200
    compare(*first, len(sure), name, [k for k, certainly in enumerate(sure) if not certainly] if name != "two leaves" else [])
    assert first[0]["counters"]["line_evaluations"] < first[1]["counters"]["line_evaluations"]
    assert first[0]["counters"]["line_slope_floor"] == 0
    # Both go on from the same points in the same directions, into the open half-space.
    hit = np.isfinite(first[1]["t"])
    state = {key: first[1]["state"][key][hit] for key in ("value", "gradient")}
    normal, origins = first[1]["gradient"][hit], first[1]["position"][hit]
    directions = np.random.default_rng(seed + 7).normal(size=normal.shape)
    directions += 0.5 * normal / np.linalg.norm(normal, axis=1, keepdims=True)
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    directions *= np.sign(np.sum(directions * normal, axis=1))[:, None]
    for memory in ("none", "renewal", "renewal+"):
        second = [
            gn.first_hits(tree, origins, directions, 8, seed=seed + 3 + k, memory=memory, start=state)
            for k, tree in enumerate((cut, together))
        ]
        compare(*second, len(sure), f"{name}, {memory}", [])
        assert second[0]["counters"]["line_evaluations"] < second[1]["counters"]["line_evaluations"]


def test_inside_behind_the_cut(n, seed):
    """P(f <= 0) = Φ(-μ/σ) where the plane lets a constant mean be seen, and f there is the lower part of a normal."""
    tree = CUTS["wedge"][0]
    origins, directions = np.tile([3.0, 0, 0], (n, 1)), np.tile([-1.0, 0, 0], (n, 1))
    hits = gn.first_hits(tree, origins, directions, 8, seed=seed, memory="renewal+")
    on = hits["part"] == 1
    check_proportion(on.sum(), n, 0.5 * erfc(0.5 / sqrt(2)))
    np.testing.assert_allclose(hits["t"][on], 2.9, atol=1e-12)
    value = hits["state"]["value"][on, 0]
    lower = 0.1 + 0.2 * np.random.default_rng(seed).normal(size=10 * n)
    check_same_distribution(value, lower[lower <= 0], "f behind the plane")


def test_a_certain_mean_is_not_looked_up(seed):
    """The march of a constant mean that a plane cuts asks neither; what it met before it was cut off is what it costs."""
    cut, together = (gn.first_hits(tree, *rays(2000, seed), 8, seed=seed)["counters"] for tree in CUTS["wedge"])
    assert cut["mean_lookups"] == 0 < together["mean_lookups"]
    # A ray that a subtracted ball lets see the filling twice is marched together, on one path.
    small = gn.difference(FILLING, certain(ball(0.3))[0])
    through = np.tile([-3.0, 0.1, 0], (500, 1)), np.tile([1.0, 0, 0], (500, 1))
    beside = np.tile([-3.0, 0.6, 0], (500, 1)), np.tile([1.0, 0, 0], (500, 1))
    assert gn.first_hits(small, *through, 8, seed=seed)["counters"]["mean_lookups"] > 0
    assert gn.first_hits(small, *beside, 8, seed=seed)["counters"]["mean_lookups"] == 0


@pytest.mark.parametrize(
    ("tree", "memory", "sentence"),
    [
        (gn.union(FILLING, certain(plane())[0]), "renewal", "marched for itself, the first hit wins"),
        (gn.intersection(FILLING, gn.union(*certain(plane()))), "renewal", "certain leaves do not cut one random leaf"),
        (gn.intersection(FILLING, certain(gn.TorusField([0, 0, 0], [0, 0, 1], 0.5, 0.2))[0]), "none", "takes planes, boxes and"),
        (CUTS["wedge"][0], "global", "paths that are drawn anew for every ray"),
        (CUTS["wedge"][0], "global-2", "paths that are drawn anew for every ray"),
        (CUTS["wedge"][0], "none", "every random leaf (0) marched for itself where the certain ones (1)"),
        (gn.intersection(FILLING, BALL), "renewal", "leaves marched together"),
    ],
)
def test_the_plan_says_what_is_cut(tree, memory, sentence):
    description = scene(tree)
    description["objects"][0]["memory"] = memory
    assert sentence in str(gn.Scene(description).plan())
