"""A process that its own bounds cut is the same alone and in a tree of which the rest is far away, or everywhere
(definitions B4, C7): bounds are entered outside, however deep below 0 the mean is there."""

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_proportion, check_same_distribution, check_z, normal_cdf

pytestmark = pytest.mark.stats

BOX = ((-1, -1, -1), (1, 1, 1))
SIGMA = 0.2
DEPTH = np.array([0, 0.6, 0.8])
MEANS = {  # as they are cut by BOX
    "plane": gn.PlaneField([0, 0, 0], DEPTH),
    "constant 0": gn.ConstantField(0),
    "constant -3 sigma": gn.ConstantField(-3 * SIGMA),
    "constant -20 sigma": gn.ConstantField(-20 * SIGMA),
    "sphere": gn.SphereField([0, 0, 1], 1.3),
}
KERNEL = gn.SquaredExponential(0.4)


def body(name, bounds=BOX):
    return gn.GaussianProcess(MEANS[name], SIGMA, KERNEL, bounds=bounds)


def ball(center, radius, sigma):
    return gn.GaussianProcess(gn.SphereField(center, radius), sigma, gn.SquaredExponential(1))


FAR, CERTAIN_FAR = ball((30, 0, 0), 1, 0.1), ball((30, 0, 0), 1, 0)
EVERYTHING, CERTAIN_EVERYTHING = ball((0, 0, 0), 60, 0.1), ball((0, 0, 0), 60, 0)
TREES = {
    "less far": lambda a: gn.difference(a, FAR),
    "less certain far": lambda a: gn.difference(a, CERTAIN_FAR),
    "and far": lambda a: gn.union(a, FAR),
    "smooth and far": lambda a: gn.smooth_union(a, FAR, blend=0.1),
    "in everything": lambda a: gn.intersection(a, EVERYTHING),
    "in certain everything": lambda a: gn.intersection(a, CERTAIN_EVERYTHING),
    "all of it": lambda a: gn.intersection(gn.union(gn.difference(a, FAR), FAR), EVERYTHING),
}


@pytest.fixture
def n(full_size):
    return 40_000 if full_size else 4_000


def rays(n, seed, camera_inside):
    """Through the box: from 4 away, or from within it."""
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(n, 3))
    origins *= 4 / np.linalg.norm(origins, axis=1, keepdims=True)
    if camera_inside:
        origins = rng.uniform(-0.9, 0.9, (n, 3))
    directions = rng.normal(size=(n, 3)) if camera_inside else rng.uniform(-1, 1, (n, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def check_same_hits(first, second, what):
    check_same_distribution(first["t"], second["t"], f"{what}: t")
    n, p = len(first["t"]), np.isfinite(first["t"]).mean()
    check_proportion(np.isfinite(second["t"]).sum(), n, p, np.sqrt(p * (1 - p) / n), f"{what}: hits")
    for axis in range(3):
        pair = [h["gradient"][np.isfinite(h["t"]), axis] for h in (first, second)]
        check_same_distribution(*pair, f"{what}: gradient {axis}")
    assert np.all(second["part"][np.isfinite(second["t"])] == 0)
    assert second["counters"]["line_entry_inside"] == 0


# A constant mean is everywhere: it takes bounds.
CASES = [(name, BOX) for name in MEANS] + [("plane", None), ("sphere", None)]


@pytest.mark.parametrize("tree", TREES)
@pytest.mark.parametrize(("name", "bounds"), CASES)
def test_hits_are_those_alone(name, tree, bounds, n, seed):
    """From outside, from within the bounds, and from the hits on: (t, gradient) in two-sample tests."""
    alone, whole = body(name, bounds), TREES[tree](body(name, bounds))
    for camera_inside in (False, True):
        first = gn.first_hits(alone, *rays(n, seed, camera_inside), 9, seed=seed)
        second = gn.first_hits(whole, *rays(n, seed + 1, camera_inside), 9, seed=seed + 1)
        check_same_hits(first, second, f"{name} {tree}, {camera_inside=}")
        if name == "constant -20 sigma":
            assert np.isfinite(second["t"]).mean() > 0.95  # its face, not the open
    hit = np.isfinite(first["t"])
    origins, normals = first["position"][hit], first["gradient"][hit]
    up = normals / np.linalg.norm(normals, axis=1, keepdims=True)
    up += 0.7 * np.random.default_rng(seed).uniform(-1, 1, up.shape) / np.sqrt(3)
    up /= np.linalg.norm(up, axis=1, keepdims=True)
    value, gradient = np.full((len(up), len(whole.leaves)), np.nan), np.full((len(up), len(whole.leaves), 3), np.nan)
    value[:, 0], gradient[:, 0] = 0, normals
    first = gn.first_hits(alone, origins, up, 9, seed=seed, start={"value": value[:, 0], "gradient": normals})
    second = gn.first_hits(whole, origins, up, 9, seed=seed + 1, start={"value": value, "gradient": gradient})
    check_same_hits(first, second, f"{name} {tree}, from its hits on")


def test_the_less_deep_of_two_leaves_is_outside(n, seed):
    """C7 far in the tails: of max(a, b) > 0 at the bounds, a and b 20 and 20.05 deviations below, either is what is outside;
    what is much deeper is left undrawn."""
    a, b = (gn.GaussianProcess(-SIGMA * depth, SIGMA, KERNEL, bounds=BOX) for depth in (20.0, 20.05))
    deep = gn.GaussianProcess(-60 * SIGMA, SIGMA, KERNEL, bounds=BOX)
    tree = gn.intersection(a, b, deep)
    origins, along = np.tile([-2.0, 0, 0], (n, 1)), np.tile([1.0, 0, 0], (n, 1))
    hits = gn.first_hits(tree, origins, along, 1.0 + 1e-9, seed=seed)
    f = gn.line_values(tree, origins, along, np.array([1.0 + 1e-9, 4.0]), seed=seed)[:, 0]
    assert hits["counters"]["line_entry_inside"] == 0 and not np.isfinite(f[:, 2]).any()
    # P(a > 0) : P(b > 0) = 1 : exp(-(20.05² - 20²) / 2) (20 / 20.05), both together e^-200 of it.
    odds = np.exp(-(20.05**2 - 20**2) / 2) * 20 / 20.05
    above = f[:, :2] > 0
    assert np.all(above.sum(axis=1) == 1)
    check_proportion(above[:, 1].sum(), n, odds / (1 + odds))


SHEARED = np.array([[-0.9, 0.3, 0, 0], [0.2, 0.8, 0.1, 0], [0, -0.2, 1.1, 0], [0, 0, 0, 1.0]])
MATERIALS = {
    "lambert": {"type": "lambert", "color": (1, 1, 1)},
    "mirror": {"type": "mirror", "color": (1, 1, 1)},
    "glass": {"type": "dielectric", "color": (1, 1, 1), "ior": 1.5},
}


FLOOR = {
    "vertices": np.array([(-3, -3, -1.6), (3, -3, -1.6), (3, 3, -1.6), (-3, 3, -1.6)]),
    "triangles": np.array([(0, 1, 2), (0, 2, 3)]),
}


def render(tree, material, matrix, seed, *, samples=128, white=False, floor=False, memory="renewal+"):
    """A body from z = 6, under an uneven sky or a white one, over a floor."""
    eye = np.eye(4)
    eye[2, 3] = 6
    leaves = len(tree.leaves) if hasattr(tree, "leaves") else 1
    body = {"name": "Cut", "type": "gpis", "process": tree, "materials": ["m"] * leaves, "memory": memory, "matrix": matrix}
    sheet = {"name": "Floor", "type": "mesh", "mesh": "Floor", "materials": ["grey"]}
    description = {
        "version": 1,
        "settings": {} if white else {"max_bounces": 8},
        "camera": {"type": "orthographic", "matrix": eye, "width": 2.0 if floor else 3.0},
        "world": {"color": (1, 1, 1)} if white else {"image": np.linspace(0, 1, 8)[:, None, None] * np.ones((8, 4, 3))},
        "materials": {"m": MATERIALS[material], "grey": {"type": "lambert", "color": (0.9, 0.9, 0.9)}},
        "meshes": {"Floor": FLOOR} if floor else {},
        "objects": [body, sheet] if floor else [body],
    }
    result = gn.render(gn.Scene(description), 8, 8, samples=samples, seed=seed)
    assert result.stats["line_entry_inside"] == result.stats["nan_samples"] == 0
    pixels, variance = (result.passes[p][..., 0].astype(float) for p in ("combined", "variance"))
    return pixels, pixels.mean(), np.sqrt(variance.sum()) / variance.size, result.stats


@pytest.mark.parametrize("material", MATERIALS)
@pytest.mark.parametrize("name", ["plane", "constant -20 sigma"])
def test_light_is_that_alone(name, material, seed):
    """Sheared: mean radiance as alone; nothing is lost in a white world."""
    _, alone, error, _ = render(body(name), material, SHEARED, seed)
    for i, tree in enumerate(("less far", "in everything")):
        pixels, mean, own, _ = render(TREES[tree](body(name)), material, SHEARED, seed + 1 + i)
        check_z(mean, alone, np.hypot(own, error), f"{name}, {material}, {tree}")
    if name == "plane":  # others are deep on every side: paths are long
        pixels, *_ = render(TREES["less far"](body(name)), material, SHEARED, seed, samples=64, white=True)
        assert np.allclose(pixels, 1, atol=1e-6)


@pytest.mark.parametrize("tree", ["less far", "and far", "smooth and far"])
def test_a_ray_in_glass_leaves_the_bounds_of_its_operand(tree, seed):
    """Definitions B4: where the bounds of the glass end, the ray is in it no more, however far others of a union reach."""
    found = [
        render(t, "glass", np.eye(4), seed + i, samples=512, floor=True)
        for i, t in enumerate([body("constant -3 sigma"), TREES[tree](body("constant -3 sigma"))])
    ]
    (_, alone, error, stats), (_, mean, own, tree_stats) = found
    check_z(mean, alone, np.hypot(own, error), tree)
    check_z(tree_stats["bounds_exits"], stats["bounds_exits"], 4 * np.sqrt(2 * stats["bounds_exits"]), "exits")  # several a path
    assert stats["bounds_exits"] > 10_000


SMOOTH = {"union": gn.union, "smooth union": lambda *parts: gn.smooth_union(*parts, blend=0.05)}
SOLID = gn.GaussianProcess(-3 * SIGMA, SIGMA, KERNEL, bounds=((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)))
# Uncertain where the bounds of SOLID end, and beyond them.
ACROSS = gn.GaussianProcess(gn.SphereField((0.5, 0, 0), 0.3), 0.1, gn.SquaredExponential(0.2))


@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
@pytest.mark.parametrize("kind", SMOOTH)
def test_glass_that_is_cut_inside_another_leaves_where_nothing_holds_it(kind, memory, seed):
    """Definitions B4, in a union of which one operand's bounds end where the other is undecided: the order of the operands
    is nothing, whichever of them was drawn before; a ray leaves without a surface, and enters what comes next from outside."""
    orders = [(SOLID, ACROSS), (ACROSS, SOLID)]
    found = [render(SMOOTH[kind](*o), "glass", SHEARED, seed + i, samples=1024, memory=memory) for i, o in enumerate(orders)]
    (_, mean, error, stats), (_, other, own, other_stats) = found
    check_z(mean, other, np.hypot(own, error), kind)
    for name in ("bounds_exits", "path_vertices", "inside_rays"):
        check_z(stats[name], other_stats[name], 4 * np.sqrt(stats[name] + other_stats[name]), name)
    assert stats["bounds_exits"] > 1_000
    assert max(s["line_slope_floor"] for s in (stats, other_stats)) < 1e-4 * stats["path_vertices"]


@pytest.mark.parametrize("kind", SMOOTH)
def test_rays_in_glass_meet_no_surface_on_the_bounds_of_an_operand(kind, n, seed):
    """The first hits of rays from inside: none lies on the face, and none has a slope that leads in."""
    origins = np.random.default_rng(seed).uniform(-0.4, 0.4, (n, 3)) * [0, 1, 1] - [0.49, 0, 0]
    along, value = np.tile([1.0, 0, 0], (n, 1)), np.full((n, 2), np.nan)
    found = []
    for i, order in enumerate([(SOLID, ACROSS), (ACROSS, SOLID)]):
        start = {"value": value.copy(), "gradient": np.full((n, 2, 3), np.nan)}
        start["value"][:, i], start["gradient"][:, i] = -2 * SIGMA, (-0.1, 0, 0)
        hits = gn.first_hits(SMOOTH[kind](*order), origins, along, 9, seed=seed + i, inside=np.ones(n, bool), start=start)
        hit = np.isfinite(hits["t"])
        assert hit.mean() > 0.05 and not np.any(np.abs(hits["position"][hit, 0] - 0.5) < 1e-9)
        assert np.all(hits["gradient"][hit, 0] > 0)
        found.append(hits["t"])
    check_same_distribution(*found, kind)


@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
def test_glass_in_two_pieces_is_glass_in_one(memory, seed):
    """A solid box as the union of two that lap over: a ray goes from one into the other without an end between."""

    def box(low, high):
        return gn.GaussianProcess(-6 * SIGMA, SIGMA, KERNEL, bounds=((low, -0.6, -0.6), (high, 0.6, 0.6)))

    whole, pieces = box(-1, 1), [gn.union(box(-1, 0.2), box(-0.1, 1)), gn.union(box(-0.1, 1), box(-1, 0.2))]
    found = [render(t, "glass", SHEARED, seed + i, samples=1024, floor=True, memory=memory) for i, t in enumerate([whole, *pieces])]
    _, mean, error, stats = found[0]
    for _, other, own, other_stats in found[1:]:
        check_z(other, mean, np.hypot(own, error), memory)
        for name in ("bounds_exits", "path_vertices"):
            check_z(other_stats[name], stats[name], 4 * np.sqrt(2 * stats[name]), name)


def test_a_leaf_is_drawn_with_what_it_matters_with(n, seed):
    """C7 within a union: of max(a, b) where a's bounds begin later than b's, b is drawn with a, not before: P(b > 0) given
    max(a, b) > 0, whatever the order. The other part of the union is being marched all the way."""
    level = -0.5 * SIGMA
    a = gn.GaussianProcess(level, SIGMA, KERNEL, bounds=((0, -1, -1), (1, 1, 1)))
    b = gn.GaussianProcess(level, SIGMA, KERNEL, bounds=BOX)
    around = gn.GaussianProcess(3 * SIGMA, SIGMA, KERNEL, bounds=((-2, -2, -2), (2, 2, 2)))
    origins, along = np.tile([-3.0, 0, 0], (n, 1)), np.tile([1.0, 0, 0], (n, 1))
    p = normal_cdf(-0.5)
    for i, order in enumerate([(a, b), (b, a)]):
        tree = gn.union(around, gn.intersection(*order))
        first = gn.line_values(tree, origins, along, np.array([3.0 + 1e-9, 5.0]), seed=seed + i)[:, 0, 1]
        first = first[np.isfinite(first)]
        assert len(first) > 0.9 * n
        check_proportion((first > 0).sum(), len(first), p / (1 - (1 - p) ** 2), 0, f"order {i}")
