"""A process that certain planes, boxes and spheres cut is asked for itself where they let it be seen. Its light is that of the march of
all operands together, which the same tree still takes where the certain means are multiplied by 1."""

from itertools import product

import gpis_native as gn
import numpy as np
import pytest
from scene_parts import TRIANGLE, WHITE_SUNS
from statistics_checks import check_same_distribution, check_z, normal_cdf

BOX = ((-1, -1, -1), (1, 1, 1))
TIGHT, WIDE = ((-1, -1, -0.7), (1, 0.8, 1)), ((-3,) * 3, (3,) * 3)
FILLING = gn.GaussianProcess(gn.ConstantField(0.1), 0.2, gn.SquaredExponential(0.4), bounds=BOX)  # a table serves it
BALL = gn.GaussianProcess(gn.SphereField([0.1, 0.2, 0], 0.7), 0.15, gn.SquaredExponential(0.3), bounds=BOX)
VARIES = (0.2 + 0.1 * gn.PlaneField([0, 0, 0], [0, 1, 0])).clamped(0.1, 0.3)
ROUGH = gn.GaussianProcess(0.2, VARIES, gn.Matern(1.5, [0.4, 0.6, 0.3]), bounds=((-1, -1, -1), (1, 0.6, 1)))
PLANE = gn.PlaneField([0.1, 0, 0.2], [1, 0.3, 0.8], slope=1.7)
SPHERE = gn.SphereField([0.5, 0.1, 0.6], 0.8)
CUBOID = gn.BoxField([0, 0.3, 0.1], [1.5, 1.2, 1.1])
SHEARED = np.array([[-0.9, 0.3, 0, 0], [0.2, 0.8, 0.1, 0], [0, -0.2, 1.1, 0], [0, 0, 0, 1.0]])
TURNED = np.array([[0.6, -0.8, 0, 0.1], [0.9, 0.5, 0.2, 0], [0, 0.1, 1.1, -0.1], [0, 0, 0, 1]])


def certain(mean, bounds=None):
    return gn.GaussianProcess(mean, 0.0, gn.SquaredExponential(1), bounds=bounds)


# By what makes an operand of a certain mean; both orders of operands.
TREES = {
    "wedge": lambda c: gn.intersection(FILLING, c(PLANE)),
    "turned plane": lambda c: gn.intersection(c(PLANE).transformed(TURNED), BALL),
    "within a sphere": lambda c: gn.intersection(c(SPHERE), FILLING),
    "within a moved sphere": lambda c: gn.intersection(BALL, c(SPHERE).transformed(TURNED)),
    "less a sphere": lambda c: gn.difference(FILLING, c(SPHERE)),
    "less a moved sphere": lambda c: gn.difference(ROUGH, c(SPHERE).transformed(TURNED)),
    "within a box": lambda c: gn.intersection(c(CUBOID), ROUGH),
    "less a turned box": lambda c: gn.difference(FILLING, c(CUBOID).transformed(TURNED).transformed(SHEARED)),
    "less two": lambda c: gn.difference(gn.intersection(gn.complement(c(PLANE)), FILLING), c(SPHERE)),
    "within three": lambda c: gn.intersection(c(SPHERE), gn.intersection(c(CUBOID), gn.intersection(c(PLANE), BALL))),
}
MATRICES = {
    "in place": np.eye(4),
    "sheared": SHEARED,
    "moved": np.array([[0.36, 0.48, -0.8, 0.2], [-0.8, 0.6, 0, -0.1], [0.48, 0.64, 0.6, 0.3], [0, 0, 0, 1.0]]),
}
SUN = WHITE_SUNS[0] | {
    "matrix": np.array([[0.6, 0, 0.8, 0], [0, 1, 0, 0], [-0.8, 0, 0.6, 0], [0, 0, 0, 1.0]]),
    "angle": 0.4,
    "power": 2.0,
}
# Of the random operand and of certain ones, so that the albedo says which was hit.
OF_RANDOM, OF_CERTAIN = (0.8, 0.5, 0.3), (0.5, 0.8, 0.3)


def pair(name, bounds=None):
    """The tree, and the same marched together: its certain means are fields that no cut knows."""
    return [TREES[name](lambda mean, factor=factor: certain(factor(mean), bounds)) for factor in (lambda m: m, lambda m: 1.0 * m)]


def scene(tree, *, material="lambert", memory="renewal+", matrix=None, white=False, mesh=False, **more):
    eye = np.eye(4)
    eye[2, 3] = 6
    sure = [f"leaf[{k}].sampler" for k in range(len(tree.leaves))]
    sure = [tree.plan()[key].startswith("none") for key in sure]
    colours = {"Random": (1, 1, 1) if white else OF_RANDOM, "Certain": (1, 1, 1) if white else OF_CERTAIN}
    body = {"name": "Body", "type": "gpis", "process": tree, "memory": memory, "matrix": np.eye(4) if matrix is None else matrix}
    body["materials"] = ["Certain" if s else "Random" for s in sure]
    sheet = {"name": "Sheet", "type": "mesh", "mesh": "Sheet", "materials": ["Random"], "matrix": np.diag([1.0, 1, 0.1, 1])}
    return {
        "version": 1,
        "camera": {"type": "orthographic", "matrix": eye, "width": 3.0},
        "world": {"color": (1, 1, 1)} if white else {"image": np.linspace(0, 1, 8)[:, None, None] * np.ones((8, 4, 3))},
        "lights": [] if white else [SUN],
        "materials": {name: {"type": material, "color": colour} for name, colour in colours.items()},
        "meshes": {"Sheet": TRIANGLE} if mesh else {},
        "objects": [body, sheet] if mesh else [body],
    } | more


def same_floor(a, b, what):
    """Wrong slopes come from rays that are marched together, at faces of bounds that are no surface; a cut adds none."""
    count = [c["line_slope_floor"] for c in (a, b)]
    check_z(max(count[0] - count[1], 0), 0, np.sqrt(sum(count) + 1), f"{what}: slopes by rounding")


def compare(a, b, what, table_error):
    """Light by channels, vertices, and which operand was met first. `table_error`: of a hit's probability."""
    for channel in range(2):
        means, errors = [], []
        for r in (a, b):
            means.append(r.passes["combined"][..., channel].astype(float).mean())
            errors.append(np.sqrt(r.passes["variance"][..., channel].astype(float).sum()) / r.passes["variance"][..., 0].size)
        check_z(means[0], means[1], np.hypot(np.hypot(*errors), 0.3 * table_error), f"{what}: light of channel {channel}")
    paths = a.stats["camera_paths"]
    n = [r.stats["path_vertices"] / paths for r in (a, b)]
    # As a geometric number has it: of rays that meet the surface again with one probability.
    check_z(n[0], n[1], np.sqrt(n[1] * (1 + n[1]) * 2 / paths + (3 * table_error * n[1]) ** 2), f"{what}: vertices")
    mix = np.array([OF_RANDOM[:2], OF_CERTAIN[:2]]).T
    share = [np.linalg.solve(mix, r.passes["albedo"][..., :2].astype(float).mean(axis=(0, 1))) for r in (a, b)]
    p = (share[0] + share[1]) / 2
    check_z(share[0], share[1], np.sqrt(np.maximum(p, 1 / paths) * 2 / paths + table_error**2), f"{what}: which operand")


@pytest.mark.stats
@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
@pytest.mark.parametrize("name", TREES)
def test_light_is_that_of_the_march_together(name, memory, seed, full_size):
    """A different place, bounds of the certain operands and material for each; all of them at full size."""
    every = list(product(MATRICES, (None, TIGHT, WIDE), ("lambert", "mirror")))
    i = list(TREES).index(name) * 3 + ["none", "renewal", "renewal+"].index(memory)
    chosen = every if full_size else [every[(5 * i + k * 7) % len(every)] for k in range(2)]
    for place, bounds, material in chosen:
        trees = pair(name, bounds)
        results = [
            gn.render(
                gn.Scene(scene(t, material=material, memory=memory, matrix=MATRICES[place])),
                10, 10, samples=512 if full_size else 256, seed=seed + k,
            )
            for k, t in enumerate(trees)
        ]  # fmt: skip
        cut, together = (r.stats for r in results)
        what = f"{name}, {memory}, {place}, {bounds}, {material}"
        assert cut["nan_samples"] == cut["states_inside"] == 0, what
        # A certain operand that is subtracted in bounds of its own is no convex body.
        if "cut by" in trees[0].plan()["composition"]:
            assert cut["line_evaluations"] < together["line_evaluations"], what
        else:
            assert bounds == TIGHT and name.startswith("less"), what
        same_floor(cut, together, what)
        compare(*results, what, 7e-4 if cut["line_tabulated"] else 0)


def rays(n, seed):
    """From a sphere around the box, most of them through it."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(n, 3))
    origins *= 4 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-0.8, 0.8, (n, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def turned(bounds):
    """The bounds of what TURNED makes of a box."""
    corners = np.array(list(product(*np.transpose(bounds)))) @ TURNED[:3, :3].T + TURNED[:3, 3]
    return corners.min(axis=0), corners.max(axis=0)


def same_hits(a, b, parts, what, remembered):
    """`remembered`: the leaf whose state on the faces of others is asked for too."""
    check_same_distribution(a["t"], b["t"], f"{what}: t")
    for k in range(parts):
        x, y = a["part"] == k, b["part"] == k
        n, p = len(x), (x.mean() + y.mean()) / 2
        check_z(x.mean(), y.mean(), np.sqrt(2 * p * (1 - p) / n + 1e-12), f"{what}: part {k}")
        if min(x.sum(), y.sum()) < 200:
            continue
        pairs = [(f"gradient {axis}", a["gradient"][x, axis], b["gradient"][y, axis]) for axis in range(3)]
        pairs.append(("t", a["t"][x], b["t"][y]))
        if remembered is not None:
            pairs.append(("value", a["state"]["value"][x, remembered], b["state"]["value"][y, remembered]))
            pairs += [
                (f"slope {axis}", a["state"]["gradient"][x, remembered, axis], b["state"]["gradient"][y, remembered, axis])
                for axis in range(3)
            ]
        for quantity, s, t in pairs:  # of a face all gradients are one, but for rounding
            check_same_distribution(np.round(s, 9), np.round(t, 9), f"{what}: {quantity} at part {k}")


@pytest.mark.stats
@pytest.mark.parametrize("name", TREES)
def test_first_hits_are_those_of_the_march_together(name, seed, full_size):
    """Where, on which operand, with which gradient and states; and those of rays that leave the same points into the open."""
    n = 200_000 if full_size else 20_000
    for bounds in (None, TIGHT):
        trees = pair(name, bounds)
        random = next(k for k in range(len(trees[0].leaves)) if not trees[0].plan()[f"leaf[{k}].sampler"].startswith("none"))
        first = [gn.first_hits(t, *rays(n, seed), 12, seed=seed + k, memory="renewal+") for k, t in enumerate(trees)]
        parts = len(trees[0].leaves)
        same_hits(*first, parts, f"{name}, {bounds}", random)
        for k in set(range(parts)) - {random}:  # hits of a face lie on it, as a march finds it
            on = first[0]["position"][first[0]["part"] == k]
            off = np.abs(trees[0].leaves[k].mean(on))
            walled = f"leaf[{k}].wall" in trees[0].plan()
            if walled:  # or on the bounds that cut it
                off = np.minimum(off, np.abs(on[:, None] - (turned(TIGHT) if "turned" in name else TIGHT)).min(axis=(1, 2)))
            np.testing.assert_allclose(off, 0, atol=5e-7 if walled else 2e-11)
        # A certain operand that is subtracted in bounds of its own is no convex body.
        if "cut by" in trees[0].plan()["composition"]:
            assert first[0]["counters"]["line_evaluations"] < first[1]["counters"]["line_evaluations"]
        else:
            assert bounds and name.startswith("less")
        same_floor(*(f["counters"] for f in first), f"{name}, {bounds}")
        hit = np.isfinite(first[1]["t"])
        states = {key: first[1]["state"][key][hit] for key in ("value", "gradient")}
        normal, origins = first[1]["gradient"][hit], first[1]["position"][hit]
        directions = np.random.default_rng(seed + 7).normal(size=normal.shape)
        directions += 0.5 * normal / np.linalg.norm(normal, axis=1, keepdims=True)
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        directions *= np.sign(np.sum(directions * normal, axis=1))[:, None]
        for memory in ("none", "renewal", "renewal+"):
            second = [
                gn.first_hits(t, origins, directions, 12, seed=seed + 3 + k, memory=memory, start=states)
                for k, t in enumerate(trees)
            ]
            same_hits(*second, parts, f"{name}, {bounds}, {memory}, second", None)
            same_floor(*(s["counters"] for s in second), f"{name}, {bounds}, {memory}, second")


@pytest.mark.parametrize("material", ["lambert", "mirror"])
@pytest.mark.parametrize("name", TREES)
def test_white_furnace(name, material, seed):
    """Nothing is lost: every path ends in the white world."""
    for memory, matrix in zip(("none", "renewal", "renewal+"), MATRICES.values(), strict=True):
        description = scene(pair(name)[0], material=material, memory=memory, matrix=matrix, white=True)
        result = gn.render(gn.Scene(description), 8, 8, samples=64, seed=seed)
        assert np.allclose(result.passes["combined"], 1, atol=1e-6)
        assert all(result.stats[k] == 0 for k in ("path_length_limit", "line_step_limit", "nan_samples", "states_inside"))
        assert result.stats["path_vertices"] > 8 * 8


def test_what_a_face_lets_be_seen(seed):
    """Behind the plane a constant mean is inside with P(f <= 0) = Φ(-μ/σ), and f there is the lower part of a normal."""
    n = 20_000
    tree = gn.intersection(FILLING, certain(gn.PlaneField([0.1, 0, 0], [1, 0.3, 0.2])))
    hits = gn.first_hits(tree, np.tile([3.0, 0, 0], (n, 1)), np.tile([-1.0, 0, 0], (n, 1)), 8, seed=seed, memory="renewal+")
    on = hits["part"] == 1
    p = normal_cdf(-0.5)
    check_z(on.mean(), p, np.sqrt(p * (1 - p) / n))
    np.testing.assert_allclose(hits["t"][on], 2.9, atol=1e-12)
    lower = 0.1 + 0.2 * np.random.default_rng(seed).normal(size=10 * n)
    check_same_distribution(hits["state"]["value"][on, 0], lower[lower <= 0], "f behind the plane")
    assert hits["counters"]["mean_lookups"] == 0  # of the plane: nothing was marched together


def facts(tree, **more):
    description = scene(tree, **more)
    plan = gn.Scene(description).plan()
    stats = gn.render(gn.Scene(description), 8, 8, samples=16, seed=3).stats
    return plan["objects[0].composition of 'Body'"], plan.get("objects[0].cut of 'Body'"), stats


def test_the_plan_says_what_is_cut():
    """And the counters agree: of what is cut alone nothing certain is looked up, what a table serves is not marched."""
    wedge, together = pair("wedge")
    row, table, stats = facts(wedge)
    assert "cut by certain operands (1), operand 0 by a table (cut); together on rays" in row
    assert table.startswith("operand 0 by first_passage: ")
    assert stats["line_tabulated"] > 0 == stats["line_evaluations"] == stats["mean_lookups"]
    row, table, stats = facts(gn.intersection(BALL, certain(PLANE)))
    assert "marched alone" in row and table is None
    assert stats["line_evaluations"] > 0 == stats["line_tabulated"]
    # A ray that ends on something else would remember what was drawn around it of the process, up to 1.3 % of the light.
    row, table, stats = facts(wedge, mesh=True)
    assert row.endswith("leaves marched together (a cut takes an object of its own, and 'Sheet' reaches into its bounds)")
    assert table is None and stats["mean_lookups"] > 0 == stats["line_tabulated"]
    row, table, stats = facts(together)
    assert row.endswith("leaves marched together (a cut takes planes, boxes and spheres)") and table is None
    assert stats["mean_lookups"] > 0 == stats["line_tabulated"]
    # A subtracted ball lets some rays see the filling twice: these are marched together.
    assert facts(pair("less a sphere")[0])[2]["mean_lookups"] > 0


@pytest.mark.parametrize(
    ("tree", "more", "sentence"),
    [
        (gn.union(FILLING, certain(PLANE)), {}, "every leaf marched for itself, the first hit wins"),
        (
            gn.intersection(FILLING, gn.union(certain(PLANE), certain(SPHERE))),
            {},
            "a cut takes one random process, intersected with",
        ),
        (gn.difference(certain(SPHERE), BALL), {}, "a cut takes one random process, intersected with"),
        (gn.intersection(gn.intersection(FILLING, BALL), certain(PLANE)), {}, "a cut takes one random process, intersected with"),
        (gn.intersection(FILLING, certain(gn.TorusField([0, 0, 0], [0, 0, 1], 0.5, 0.2))), {}, "a cut takes planes, boxes and"),
        (pair("wedge")[0], {"memory": "global"}, "a cut takes paths that are drawn anew for every ray"),
        (pair("wedge")[0], {"memory": "global-2"}, "a cut takes paths that are drawn anew for every ray"),
        (pair("wedge")[0], {"material": "dielectric"}, "a cut takes bodies that no ray travels in"),
    ],
)
def test_what_is_marched_together(tree, more, sentence):
    assert sentence in facts(tree, **more)[0]
