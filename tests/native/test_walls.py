"""Where bounds end inside of a body it has a wall: those of a subtracted operand, and of one that is solid there for certain.
The same body with a certain box in place of the bounds is the oracle; its leaves are drawn in another order."""

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_proportion, check_same_distribution, check_z

pytestmark = pytest.mark.stats

END = 0.2  # of the hole, in x
HOLE = ((-1.5, -1.2, -1.2), (END, 1.2, 1.2))
WIDE = ((-2.5, -2, -2), (2.5, 2, 2))
BOX = ((-1, -1, -1), (1, 1, 1))
KERNEL = gn.SquaredExponential(0.4)
BALL = gn.SphereField([0, 0, 0], 0.9)
BODIES = {
    "half space": gn.GaussianProcess(gn.PlaneField([0, 0, 0], [-1, 0, 0]), 0.1, KERNEL),
    "half space in bounds": gn.GaussianProcess(gn.PlaneField([0, 0, 0], [-1, 0, 0]), 0.1, KERNEL, bounds=BOX),
    "ball": gn.GaussianProcess(BALL, 0.1, KERNEL),
    "rough ball": gn.GaussianProcess(BALL, 0.3, gn.Matern(1.5, 0.4)),
    "certain ball": gn.GaussianProcess(BALL, 0, KERNEL),
    "cloud": gn.GaussianProcess(-0.1, 0.2, KERNEL, bounds=BOX),
}
SUBTRACTED = {
    "cloud": lambda bounds: gn.GaussianProcess(-0.1, 0.2, KERNEL, bounds=bounds),
    "certain ball": lambda bounds: gn.GaussianProcess(gn.SphereField([-0.3, 0, 0], 0.8), 0, KERNEL, bounds=bounds),
}
MEMORIES = ("none", "renewal", "renewal+", "global-2", "global")


def box(bounds):
    low, high = np.asarray(bounds)
    return gn.GaussianProcess(gn.BoxField((low + high) / 2, high - low), 0, KERNEL)


def written_out(subtracted, bounds=HOLE):
    return gn.intersection(SUBTRACTED[subtracted](WIDE), box(bounds))


ORDERS = {
    "difference": gn.difference,
    "intersection": lambda a, c: gn.intersection(gn.complement(c), a),
    "complement": lambda a, c: gn.complement(gn.union(c, gn.complement(a))),
}
FIRST = {"difference": True, "intersection": False, "complement": False}  # whether the body is operand 0


@pytest.fixture
def n(full_size):
    return 40_000 if full_size else 4_000


def along_x(n):
    return np.tile([-3.0, 0, 0], (n, 1)), np.tile([1.0, 0, 0], (n, 1))


def all_ways(n, seed):
    rng = np.random.default_rng(seed)
    origins = rng.normal(size=(n, 3))
    origins *= 4 / np.linalg.norm(origins, axis=1, keepdims=True)
    directions = rng.uniform(-1, 1, (n, 3)) - origins
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


def on_end(hits):
    return np.abs(hits["position"][:, 0] - END) < 2e-7


def check_same_hits(first, second, what):
    # A wall is 1e-7 of its size within the bounds.
    check_same_distribution(np.round(first["t"], 5), np.round(second["t"], 5), f"{what}: t")
    n, p = len(first["t"]), np.isfinite(first["t"]).mean()
    check_proportion(np.isfinite(second["t"]).sum(), len(second["t"]), p, np.sqrt(p * (1 - p) / n), f"{what}: hits")
    for axis in range(3):
        # A wall's gradient is a unit vector but for rounding.
        pair = [np.round(h["gradient"][np.isfinite(h["t"]), axis], 7) for h in (first, second)]
        check_same_distribution(*pair, f"{what}: gradient {axis}")


@pytest.mark.parametrize("order", ORDERS)
@pytest.mark.parametrize("subtracted", SUBTRACTED)
@pytest.mark.parametrize("body", BODIES)
def test_first_hits_are_those_of_a_box(body, subtracted, order, n, seed):
    """Along the hole's axis onto its end, and from all around: (t, gradient), the share of hits on the end, and whose they
    are."""
    tree = ORDERS[order](BODIES[body], SUBTRACTED[subtracted](HOLE))
    oracle = gn.difference(BODIES[body], written_out(subtracted))
    for k, rays in enumerate((along_x(n), all_ways(n, seed))):
        hits = gn.first_hits(tree, *rays, 12, seed=seed + k)
        expected = gn.first_hits(oracle, *rays, 12, seed=seed + 10 + k)
        check_same_hits(expected, hits, f"{body} less {subtracted}, {order}, rays {k}")
        p = on_end(expected).mean()
        check_proportion(on_end(hits).sum(), n, p, np.sqrt(p * (1 - p) / n), f"{body} less {subtracted}, {order}: end")
        assert np.sum(hits["part"][on_end(hits)] != FIRST[order]) <= 2  # the body's own surface may be there by chance
        faces = hits["gradient"][on_end(hits) & (hits["part"] == FIRST[order])]
        assert np.allclose(faces, [-1, 0, 0], atol=1e-9)
        assert hits["counters"]["line_slope_floor"] == 0
        if k == 0 and body != "cloud":
            assert p > 0.2  # there is an end to see
        if k == 0 and "ball" in body and "rough" not in body:
            assert np.isfinite(hits["t"]).all()  # what passes through the hole meets its end


@pytest.mark.parametrize("memory", MEMORIES)
@pytest.mark.parametrize("order", ["difference", "intersection"])
def test_second_hits_are_those_of_a_box(order, memory, n, seed):
    """From the end of the hole back out of it, with what the ray remembers."""
    body, subtracted = "ball", "cloud"
    trees = [
        ORDERS[order](BODIES[body], SUBTRACTED[subtracted](HOLE)),
        ORDERS[order](BODIES[body], written_out(subtracted)),
    ]
    second = []
    for k, tree in enumerate(trees):
        hits = gn.first_hits(tree, *along_x(n), 12, seed=seed + k, memory=memory)
        up = np.random.default_rng(seed + k).normal(size=(n, 3))
        up[:, 0] = -np.abs(up[:, 0])
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        if memory == "global-2":  # it may only be handed on whole
            end = np.flatnonzero(on_end(hits))
            missed = ~on_end(hits)
            hits["state"]["value"][missed], hits["state"]["gradient"][missed] = np.nan, np.nan
            again = gn.first_hits(tree, hits["position"], up, 12, seed=seed + 10 + k, memory=memory, start=hits["state"])
            second.append({name: again[name][end] for name in ("t", "gradient", "part")})
            continue
        end = on_end(hits)
        state = {name: hits["state"][name][end] for name in ("value", "gradient")}
        if memory == "global":
            state["realisation"] = {name: rows[end] for name, rows in hits["state"]["realisation"].items()}
        second.append(gn.first_hits(tree, hits["position"][end], up[end], 12, seed=seed + 10 + k, memory=memory, start=state))
        assert second[-1]["counters"]["line_entry_inside"] == 0
    assert 0.02 < np.isfinite(second[0]["t"]).mean() < 0.98
    assert second[0]["t"].min() > 1e-6
    check_same_hits(*second, f"{order}, {memory}: second hits")


def test_a_certain_body_is_cut_by_its_bounds(n, seed):
    """Alone and in trees: exactly what it has in common with a box, which it was let through before."""
    cut = ((-0.4, -0.3, -0.5), (0.6, 0.9, 0.3))
    far = gn.GaussianProcess(gn.SphereField([30, 0, 0], 1), 0.1, KERNEL)
    alone = gn.GaussianProcess(BALL, 0, KERNEL, bounds=cut)
    oracle = gn.intersection(BODIES["certain ball"], box(cut))
    rays = all_ways(n, seed)
    expected = gn.first_hits(oracle, *rays, 12, seed=seed)
    for tree in (alone, gn.union(far, alone), gn.difference(alone, far), gn.intersection(alone, gn.complement(far))):
        hits = gn.first_hits(tree, *rays, 12, seed=seed)
        # A ray that grazes an edge may be let by: the wall is 1e-7 of its size within the bounds.
        found, of_box = np.isfinite(hits["t"]), np.isfinite(expected["t"])
        assert (found != of_box).sum() <= 2 and hits["counters"]["line_entry_inside"] == 0
        both = found & of_box
        assert both.sum() > 0.3 * n
        assert np.quantile(np.abs(hits["t"][both] - expected["t"][both]), 0.999) < 1e-5
    assert gn.first_hits(alone, *rays, 12)["state"]["value"].shape == (n,)


def test_a_body_whose_deviation_is_0_at_the_cut(n, seed):
    """On a grid, and elsewhere it is not: a random body is entered outside, there it cannot be."""
    at = np.linspace(-1.5, 1.5, 31)
    values = np.full((31, 31, 31), 0.1)
    values[at < 0] = 0
    sigma = gn.GridField(values, (0.1,) * 3, (-1.5,) * 3)
    body = gn.GaussianProcess(BALL, sigma, KERNEL, bounds=((-0.4, -1.2, -1.2), (1.2, 1.2, 1.2)))
    rays = np.tile([-3.0, 0.1, 0.1], (n, 1)), np.tile([1.0, 0, 0], (n, 1))
    far = gn.GaussianProcess(gn.SphereField([30, 0, 0], 1), 0.1, KERNEL)
    for tree in (body, gn.union(far, body), gn.difference(body, far)):
        hits = gn.first_hits(tree, *rays, 12, seed=seed)
        assert np.allclose(hits["position"][:, 0], -0.4, atol=1e-6)


def test_the_end_of_a_hole_in_everything(n, seed):
    """A complement has no other operand that could be solid: it is itself."""
    room = gn.complement(gn.GaussianProcess(-0.5, 0.05, KERNEL, bounds=BOX))
    origins, directions = np.zeros((n, 3)), all_ways(n, seed)[1]
    hits = gn.first_hits(room, origins, directions, 12, seed=seed)
    # Inside the hole, which is 10 deviations deep, a ray meets the nearest face.
    assert np.allclose(np.abs(hits["position"]).max(axis=1), 1, atol=1e-6)


@pytest.mark.parametrize("how", ["smooth", "shared noise", "nested"])
def test_walls_in_other_trees(how, n, seed):
    def tree(c):
        if how == "smooth":
            return gn.complement(gn.smooth_union(gn.complement(BODIES["ball"]), c, blend=0.15))
        if how == "shared noise":
            parts = c if isinstance(c, list) else [c]
            return gn.intersection(BODIES["ball"], *[gn.complement(p) for p in parts], shared_noise=True)
        return gn.union(gn.difference(BODIES["ball"], gn.difference(c, BODIES["certain ball"])), gn.difference(BODIES["cloud"], c))

    c = SUBTRACTED["cloud"](HOLE)
    oracle = tree(gn.intersection(SUBTRACTED["cloud"](WIDE), box(HOLE), shared_noise=how == "shared noise"))
    for k, rays in enumerate((along_x(n), all_ways(n, seed))):
        hits = gn.first_hits(tree(c), *rays, 12, seed=seed + k)
        expected = gn.first_hits(oracle, *rays, 12, seed=seed + 10 + k)
        check_same_hits(expected, hits, f"{how}, rays {k}")


MATERIALS = {
    "dark": {"type": "lambert", "color": (0.1, 0.1, 0.1)},
    "white": {"type": "lambert", "color": (1, 1, 1)},
    "mirror": {"type": "mirror", "color": (0.7, 0.7, 0.7)},
    "glass": {"type": "dielectric", "color": (1, 1, 1), "ior": 1.5},
}


def render(tree, materials, seed, *, white=True, samples=64, memory="renewal+"):
    """The hole's end in front: its average and that average's standard error."""
    camera = np.array([[0, 0, -1, -6.0], [-1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 0, 1]])
    sky = np.ones((8, 8, 3)) * (1 if white else np.linspace(0, 1, 8)[:, None, None])
    scene = gn.Scene(
        {
            "version": 1,
            "settings": {"max_bounces": 1024},
            "camera": {"type": "orthographic", "matrix": camera, "width": 2.5},
            "world": {"image": sky},
            "materials": MATERIALS,
            "objects": [{"name": "Body", "type": "gpis", "process": tree, "materials": materials, "memory": memory}],
        }
    )
    result = gn.render(scene, 8, 8, samples=samples, seed=seed)
    pixels, variance = (result.passes[k][..., 0].astype(float) for k in ("combined", "variance"))
    return pixels.mean(), np.sqrt(variance.sum()) / variance.size


@pytest.mark.parametrize("memory", ["none", "renewal+", "global"])
@pytest.mark.parametrize("material", ["dark and white", "mirror", "glass"])
def test_pictures_are_those_of_a_box(material, memory, full_size, seed):
    """Whose material the end has, and the light that comes from it."""
    own, of_hole = ("dark", "white") if material == "dark and white" else (material, material)
    samples = 1024 if full_size else 128
    tree = gn.difference(BODIES["ball"], SUBTRACTED["cloud"](HOLE))
    oracle = gn.difference(BODIES["ball"], written_out("cloud"))
    a, a_error = render(tree, [own, of_hole], seed, samples=samples, white=False, memory=memory)
    b, b_error = render(oracle, [own, of_hole, of_hole], seed + 1, samples=samples, white=False, memory=memory)
    check_z(a, b, np.hypot(a_error, b_error), f"{material}, {memory}")


@pytest.mark.parametrize("order", ORDERS)
def test_white_furnace(order, seed):
    """Glass too, which is refracted at the walls from within."""
    tree = ORDERS[order](BODIES["ball"], SUBTRACTED["cloud"](HOLE))
    for material in ("white", "glass"):
        mean, _ = render(tree, [material, material], seed)
        assert mean == pytest.approx(1, abs=1e-6 if material == "glass" else 2e-2)


DEEP = -0.6  # six deviations: solid for certain


def deep(bounds):
    return gn.GaussianProcess(DEEP, 0.1, KERNEL, bounds=bounds)


@pytest.mark.parametrize("order", ORDERS)
def test_no_film_where_bounds_end_together(order):
    """Where the other's bounds end on those of the hole there is nothing to see, on the whole of a face or a part of it; where
    it goes on there is the hole's end."""
    n = 200

    def hits(body, hole, origin, direction):
        tree = ORDERS[order](body, hole)
        return gn.first_hits(tree, np.tile(np.array(origin, float), (n, 1)), np.tile(np.array(direction, float), (n, 1)), 12)

    flush = deep(((-1, -1, -1), (END, 1, 1)))
    assert not np.isfinite(hits(deep(BOX), flush, (-0.5, 3, 0.2), (0, -1, 0))["t"]).any()
    end = hits(deep(BOX), flush, (-3, 0.1, 0.2), (1, 0, 0))
    assert np.allclose(end["position"][:, 0], END, atol=1e-6)
    # The body is two boxes, of which one ends where the hole does and one goes on.
    body = gn.union(deep(((-1, -1, -1), (END, 0, 1))), deep(((-1, 0, -1), (1, 1, 1))))
    hole = deep(((-1.5, -0.5, -0.5), (END, 0.5, 0.5)))
    assert not np.isfinite(hits(body, hole, (-3, -0.2, 0.1), (1, 0, 0))["t"]).any()
    assert np.allclose(hits(body, hole, (-3, 0.2, 0.1), (1, 0, 0))["position"][:, 0], END, atol=1e-6)


@pytest.mark.parametrize("wide", [2.0, 50.0, 1e3, 1e6])
def test_the_end_is_found_in_wide_bounds(wide):
    """A ball of 1 on a face of any size."""
    origins, directions = along_x(500)
    hole = gn.GaussianProcess(-0.1, 0.2, KERNEL, bounds=((-1.5, -wide, -0.7 * wide), (END, 0.3 * wide + 1.5, 2 * wide)))
    hits = gn.first_hits(gn.difference(BODIES["ball"], hole), origins, directions, 12)
    assert np.isfinite(hits["t"]).all() and 0.2 < on_end(hits).mean() < 0.6


def test_a_certain_face_on_its_bounds_is_seen(n, seed):
    """Whatever rounding says, and still by a cut."""
    ball, sides = gn.GaussianProcess(BALL, 0.1, KERNEL), ((-0.5, -0.3, -0.3), (0.3, 0.3, 0.3))
    low, high = np.asarray(sides)
    tight = gn.GaussianProcess(gn.BoxField((low + high) / 2, high - low), 0, KERNEL, bounds=sides)
    rays = all_ways(n, seed)
    alone, free = (gn.first_hits(gp, *rays, 12) for gp in (tight, box(sides)))
    assert np.array_equal(np.isfinite(alone["t"]), np.isfinite(free["t"])) and "wall" not in tight.plan()
    assert "cut by certain operands" in gn.difference(ball, tight).plan()["composition"]
    cut, whole = (gn.first_hits(gn.intersection(ball, c), *rays, 12, seed=seed) for c in (tight, box(sides)))
    check_same_hits(whole, cut, "within a box")


def test_only_where_bounds_end_inside():
    """Not where the operand is absent at its bounds, or nothing else is there, or others are solid for certain anyway."""
    ball = gn.GaussianProcess(gn.SphereField([0, 0, 0], 0.8), 0.05, gn.SquaredExponential(0.2), bounds=((-1.2,) * 3, (1.2,) * 3))

    def subtracted(mean, side):
        return gn.GaussianProcess(mean, 0.05, gn.SquaredExponential(0.2), bounds=((-side,) * 3, (side,) * 3))

    small = gn.SphereField([0, 0, 0], 0.2)
    for other, expected in ((subtracted(-0.1, 0.5), True), (subtracted(small, 0.5), False), (subtracted(-0.1, 1.3), False)):
        assert ("leaf[1].wall" in gn.difference(ball, other).plan()) == expected
    around = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1.3), 0.05, gn.SquaredExponential(0.2))
    hidden = gn.union(gn.difference(ball, subtracted(-0.1, 0.5)), around)
    assert "leaf[1].wall" not in hidden.plan()
    same_bounds = gn.intersection(BODIES["cloud"], gn.GaussianProcess(gn.PlaneField([0, 0, 0], [0, 0, 1]), 0, KERNEL, bounds=BOX))
    assert "wall" not in "".join(same_bounds.plan())
    certain = gn.GaussianProcess(BALL, 0, KERNEL, bounds=((-1, -1, -1), (1, 1, 0)))
    assert "they cut it" in certain.plan()["wall"]
    for body in (gn.GaussianProcess(BALL, 0, KERNEL, bounds=BOX), gn.GaussianProcess(BALL, 0.1, KERNEL, bounds=HOLE)):
        assert "wall" not in "".join(body.plan())
