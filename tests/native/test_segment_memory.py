"""Memory global-n (definitions B11): a ray knows g on the last n segments of its path, so that it approaches one realisation
for the whole path (memory global) as n grows."""

import gpis_native as gn
import numpy as np
import pytest
from remembered import take
from statistics_checks import check_proportion, check_same_distribution

pytestmark = pytest.mark.stats

BOX = ([-3, -3, -3], [3, 3, 3])
ROUGH = gn.GaussianProcess(gn.SphereField((0, 0, 0), 1), 0.3, gn.SquaredExponential(0.4), bounds=BOX)
MATERN = gn.GaussianProcess(gn.SphereField((0, 0, 0), 1), 0.3, gn.Matern(2.5, 0.5), bounds=BOX)


def bounce(gp, memory, hits, directions, seed):
    """Rays that leave hits in the same given directions, mirrored where those point into the surface."""
    gradient = hits["gradient"]
    along = np.sum(directions * gradient, axis=1, keepdims=True) / np.sum(gradient**2, axis=1, keepdims=True)
    out = directions - 2 * np.minimum(along, 0) * gradient
    return gn.first_hits(gp, hits["position"], out, 10, memory=memory, start=hits["state"], seed=seed), out


def chain(gp, memory, n, seed):
    """t of the four segments of paths to and fro in a cave, between walls that later segments meet again."""
    turns = np.array([[0.0, 0, -1.0], [0.1, 0, 1.0], [0.0, 0.1, -1.0], [-0.1, 0.1, 1.0]])
    turns /= np.linalg.norm(turns, axis=1, keepdims=True)
    t = np.full((4, n), np.inf)
    directions = np.tile(turns[0], (n, 1))
    hits = gn.first_hits(gp, np.zeros((n, 3)), directions, 10, memory=memory, seed=seed)
    for k in range(4):
        t[k] = hits["t"]
        if k < 3:
            hits, directions = bounce(gp, memory, hits, np.tile(turns[k + 1], (n, 1)), seed + 1 + k)
    assert np.isfinite(t).all()
    return t


def test_the_way_back_is_free():
    """A ray that turns round knows its line, so nothing is there; under Renewal+ something may be."""
    n = 2000
    o, d = np.tile([0.5, 0.0, 3.0], (n, 1)), np.tile([0.0, 0, -1.0], (n, 1))
    for gp in (ROUGH, MATERN):
        back = {}
        for memory in ("renewal+", "global-1"):
            first = gn.first_hits(gp, o, d, 10, memory=memory, seed=3)
            hit = np.isfinite(first["t"])
            state = take(first["state"], hit)
            again = gn.first_hits(gp, first["position"][hit], -d[hit], 10, memory=memory, start=state, seed=4)
            back[memory] = np.isfinite(again["t"]).mean()
        assert back["global-1"] < 2e-3  # what the kept rows leave open: 1e-4 of the rays
        assert back["renewal+"] > 0.02


KERNELS = {  # and how much slower their lines are
    "squared exponential": (gn.SquaredExponential(0.4), 1),
    "anisotropic": (gn.SquaredExponential([0.8, 0.4, 0.5], rotation=(0.9, 0.1, 0.3, -0.3)), 1),
    "matern 5/2": (gn.Matern(2.5, 0.5), 1),
    "matern 3/2": (gn.Matern(1.5, 0.5), 3),
    "wong": (gn.Wong(0.5), 3),
    "rational quadratic": (gn.RationalQuadratic(0.7, 0.5), 1),
    "locally periodic": (gn.LocallyPeriodic(0.7, 1.2, [0.6, 0.8, 0], 1.2), 1),
    "plane wave": (gn.PlaneWave([1.0, 0.5, 0.3]), 1),
    "sum with a rough term": (0.6 * gn.SquaredExponential(0.5) + 0.4 * gn.Matern(1.5, 0.5), 4),
}


@pytest.mark.parametrize("name", KERNELS)
def test_many_segments_are_one_realisation(name, seed, full_size):
    """Every segment against memory global; Renewal+ differs, so the test can fail (but of a plane wave it remembers all)."""
    kernel, slower = KERNELS[name]
    n = (20_000 if full_size else 2500) // slower
    cave = gn.GaussianProcess(-1 * gn.SphereField((0, 0, 0), 1), 0.2, kernel, bounds=BOX)
    known = chain(cave, "global-8", n, seed)
    whole = chain(cave, "global", n if full_size else n // 3, seed + 50)

    def compare(a, b):
        for k in range(4):
            check_same_distribution(a[k], b[k], f"segment {k}")
        # The walls stand still: up and down again, and up again.
        check_same_distribution(a[2] - a[1], b[2] - b[1], "third less second")
        check_same_distribution(a[3] - a[1], b[3] - b[1], "fourth less second")

    compare(known, whole)
    if name == "plane wave":
        return
    with pytest.raises(AssertionError):
        compare(chain(cave, "renewal+", n, seed + 90), known)


def test_segments_are_forgotten_one_by_one(seed):
    n = 300
    for count in (1, 2):
        memory = f"global-{count}"
        hits = gn.first_hits(ROUGH, np.tile([0.5, 0, 3.0], (n, 1)), np.tile([0.0, 0, -1], (n, 1)), 10, memory=memory, seed=seed)
        for k in range(3):
            assert set(hits["state"]["segments"]["segment"]) == set(range(min(k + 1, count)))
            hit = np.isfinite(hits["t"])
            hits = {"position": hits["position"][hit], "gradient": hits["gradient"][hit], "state": take(hits["state"], hit)}
            hits, _ = bounce(ROUGH, memory, hits, np.tile([0.0, 0.6, 0.8], (hit.sum(), 1)), seed + k)
            if not np.isfinite(hits["t"]).any():
                break


def test_what_is_kept_is_what_was_drawn(seed):
    """The rows of a segment hold f on its line: 0 and the gradient at the hit."""
    n = 50
    hits = gn.first_hits(ROUGH, np.tile([0.2, 0, 3.0], (n, 1)), np.tile([0.0, 0, -1], (n, 1)), 10, memory="global-3", seed=seed)
    kept = hits["state"]["segments"]
    for i in np.flatnonzero(np.isfinite(hits["t"])):
        rows = np.flatnonzero(kept["row"] == i)
        at = kept["position"][rows]
        assert np.allclose(at[:, :2], [0.2, 0]) and at[:, 2].min() >= hits["position"][i, 2] - 1e-9
        value = ROUGH.mean(at) + 0.3 * kept["value"][rows]
        values = kept["functional"][rows][:, 0] == 1
        before = values & (at[:, 2] > hits["position"][i, 2] + 1e-9)
        assert np.all(value[before] > 0)
        at_hit = values & ~before
        assert np.allclose(value[at_hit], 0, atol=1e-9)


# Two leaves of one noise, and which of them a ray meets first changes within the bounds.
SHARED = [
    gn.GaussianProcess(gn.PlaneField([0, 0, 0], [1, 0, 0], 0.15) + 0.12, 0.3, gn.SquaredExponential(0.5), bounds=BOX),
    gn.GaussianProcess(gn.PlaneField([0, 0, 0], [-0.8, 0.6, 0], 0.3) + 0.75, 0.6, gn.SquaredExponential(0.5), bounds=BOX),
]


def explicit_hits(tree, origins, directions, seed, step=0.025):
    """First crossings of the composition of one realisation of g a ray, on its own points, cubic between them: t, leaf and
    gradient. Rays start where F > 0, or on the surface, which they leave."""
    n, t = len(origins), np.arange(0, 3.9, step)
    hits = {"t": np.full(n, np.inf), "part": np.full(n, -1), "gradient": np.full((n, 3), np.nan)}
    for i in range(n):
        x = origins[i] + t[:, None] * directions[i]
        at = SHARED[0].realisation_at(x, seed + i)
        g = (at["value"][0] - SHARED[0].mean(x)) / 0.3
        slopes = (at["gradient"][0] - [0.15, 0, 0]) / 0.3
        f = np.stack([SHARED[0].mean(x) + 0.3 * g, SHARED[1].mean(x) + 0.6 * g], axis=-1)
        below = (tree.compose(f) < 0) & np.all(np.abs(x) < 3, axis=1)
        below[0] = False
        if not below.any():
            continue
        k = np.argmax(below)
        falls = []
        for leaf, (sigma, mean) in enumerate(((0.3, [0.15, 0, 0]), (0.6, [-0.24, 0.18, 0]))):
            if f[k, leaf] >= 0:
                continue
            gradients = mean + sigma * slopes[k - 1 : k + 1]
            d0, d1 = step * gradients @ directions[i]
            a, b = f[k - 1, leaf], f[k, leaf]
            s = np.linspace(0, 1, 2001)
            cubic = a * (1 + 2 * s) * (1 - s) ** 2 + d0 * s * (1 - s) ** 2 + b * s**2 * (3 - 2 * s) - d1 * s**2 * (1 - s)
            at_root = s[len(s) - 1 - np.argmax(cubic[::-1] > 0)] if (cubic > 0).any() else 0
            falls.append((at_root, leaf, (1 - at_root) * gradients[0] + at_root * gradients[1]))
        s, leaf, gradient = min(falls, key=lambda root: root[0])
        hits["t"][i], hits["part"][i], hits["gradient"][i] = t[k - 1] + step * s, leaf, gradient
    return hits


def turned_back(gradient):
    """Directions back along the ray that came, but for 20 degrees, mirrored where they point into the surface."""
    back = np.tile(np.array([-0.8, 0.6, 0.36]) / np.sqrt(1 + 0.36**2), (len(gradient), 1))
    along = np.sum(back * gradient, axis=1, keepdims=True) / np.sum(gradient**2, axis=1, keepdims=True)
    return back - 2 * np.minimum(along, 0) * gradient


def check_same_hits(a, b, what):
    check_same_distribution(a["t"], b["t"], f"{what} t")
    for part in (0, 1):
        p = np.mean(b["part"] == part)
        error = np.sqrt(p * (1 - p) / len(b["part"]))
        check_proportion(np.sum(a["part"] == part), len(a["part"]), p, error, f"{what} part {part}")
        assert p > 0.05
    for axis in range(3):
        pair = [h["gradient"][np.isfinite(h["t"]), axis] for h in (a, b)]
        check_same_distribution(*pair, f"{what} gradient {axis}")


def test_leaves_of_one_noise_go_on_as_one_realisation(seed, full_size):
    """A hard union of shared noise: hits, and those of the rays that turn back there, against explicit realisations. A leaf
    that was not hit has to know the g of the one that was, its gradient too."""
    n = 10_000 if full_size else 2000
    tree = gn.union(*SHARED, shared_noise=True)
    origins, directions = np.zeros((n, 3)), np.tile([0.8, -0.6, 0.0], (n, 1))
    first = gn.first_hits(tree, origins, directions, 3.9, memory="global-1", seed=seed)
    seeds = np.arange(3 * n) + seed * 1_000_003
    g = np.concatenate([SHARED[0].realisation_at([[0.0, 0, 0]], s)["value"][0] for s in seeds])
    outside = seeds[(g > 0) & ((g - 0.12) / 0.3 * 0.6 + 0.75 > 0)][:n]
    m = len(outside)

    def realised(origins, directions):
        parts = [explicit_hits(tree, origins[i : i + 1], directions[i : i + 1], outside[i]) for i in range(len(origins))]
        return {key: np.concatenate([p[key] for p in parts]) for key in parts[0]}

    expected = realised(origins[:m], directions[:m])
    check_same_hits(first, expected, "first")
    hit, met = np.isfinite(first["t"]), np.isfinite(expected["t"])
    ray, state = (first["position"][hit], turned_back(first["gradient"][hit]), 3.9), take(first["state"], hit)
    second, forgetful = (
        gn.first_hits(tree, *ray, memory=memory, start=state, seed=seed + 1) for memory in ("global-1", "renewal+")
    )
    at, outside = expected["t"][met, None] * directions[:m][met], outside[met]
    expected = realised(at, turned_back(expected["gradient"][met]))
    check_same_hits(second, expected, "second")
    # None meets what it stands on: a slope that is not 0 takes it away.
    assert np.mean(expected["t"] < 0.01) < 2e-3 and np.mean(second["t"] < 0.01) < 5e-3
    with pytest.raises(AssertionError):  # another law, which the test sees
        check_same_distribution(forgetful["t"], expected["t"])


def test_a_mirror_and_a_tree_keep_the_furnace(seed):
    eye = np.eye(4)
    eye[2, 3] = 4
    other = gn.GaussianProcess(gn.SphereField((0.4, 0, 0.6), 0.5), 0.1, gn.SquaredExponential(0.3), bounds=BOX)
    for process, material in ((ROUGH, "mirror"), (MATERN, "lambert"), (gn.difference(ROUGH, other), "lambert")):
        leaves = 2 if process is not ROUGH and process is not MATERN else 1
        scene = {
            "version": 1,
            "camera": {"type": "perspective", "matrix": eye, "fov_x": 0.6},
            "world": {"color": (1, 1, 1)},
            "materials": {"m": {"type": material, "color": (1, 1, 1)}},
            "objects": [{"name": "A", "type": "gpis", "process": process, "materials": ["m"] * leaves, "memory": "global-2"}],
        }
        result = gn.render(gn.Scene(scene), 6, 6, samples=16, seed=seed)
        assert np.allclose(result.passes["combined"], 1, atol=1e-6)
        for name in ("nan_samples", "line_step_limit", "states_inside", "path_length_limit"):
            assert result.stats[name] == 0


def test_other_counts_and_samplers_are_refused():
    rays = np.array([[0, 0, 3.0]]), np.array([[0, 0, -1.0]])
    for memory in ("global-0", "global-65", "global-x", "global-", "global-2 "):
        with pytest.raises(ValueError, match="'global-1' to 'global-64'"):
            gn.first_hits(ROUGH, *rays, 5, memory=memory)
    with pytest.raises(ValueError, match="global-n"):
        gn.first_hits(ROUGH, *rays, 5, memory="global-2", sampler="convolution")
    with pytest.raises(ValueError, match=r"start\['segments'\] must be"):
        start = {"value": np.zeros(1), "gradient": np.array([[0, 0, 1.0]]), "segments": {"row": [0]}}
        gn.first_hits(ROUGH, *rays, 5, memory="global-2", start=start)
