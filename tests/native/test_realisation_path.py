"""First hits on explicit realisations of g: a fresh one for every ray, against exact answers and the samplers of lines, and
one for a whole path (memory global). Oracles of the design, numbered as there."""

import gpis_native as gn
import numpy as np
import pytest
import tensor_grids
from scene_parts import BLACK, WHITE_SUNS
from statistics_checks import Z_LIMIT, check_proportion, check_z

pytestmark = pytest.mark.stats
LINE = ((-1, -1, -1), (12, 1, 1))
SPHERE_BOX = ((-1.8, -1.8, -1.8), (1.8, 1.8, 1.8))


def along_x(n):
    return np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0], (n, 1))


SURVIVAL = {
    # Oracle 5: Wong's closed form, at .5, 1, 2, 5.
    ("wong", "outside", "renewal+"): [0.85624, 0.73684, 0.54929, 0.23051],
    ("wong", "surface", "renewal"): [0.81842, 0.68804, 0.50282, 0.20911],
    ("wong", "slope 1", "renewal+"): [0.81637, 0.66014, 0.47057, 0.19405],
    # Oracle 6: brute force, standard error 4e-4.
    ("se", "outside", "renewal+"): [0.84229, 0.69407, 0.45573, 0.12893],
    ("se", "surface", "renewal"): [0.96922, 0.88063, 0.61086, 0.17080],
    ("se", "slope 1", "renewal+"): [0.99669, 0.88074, 0.58803, 0.16682],
}


@pytest.mark.parametrize(("kernel", "start", "memory"), SURVIVAL)
def test_survival(kernel, start, memory, full_size, seed):
    n = 50_000 if full_size else 2000
    gp = gn.GaussianProcess(0.0, 1.0, gn.Wong(1.0) if kernel == "wong" else gn.SquaredExponential(1.0), bounds=LINE)
    state = None
    if start != "outside":
        state = {"value": np.zeros(n), "gradient": np.tile([1.0, 0.3, -0.2], (n, 1))}
    hits = gn.first_hits(gp, *along_x(n), 5.5, memory=memory, start=state, sampler="realisation", seed=seed)
    counts = [np.sum(hits["t"] > t) for t in (0.5, 1, 2, 5)]
    check_proportion(counts, n, SURVIVAL[kernel, start, memory], 4e-4, f"{kernel}, {start}")
    # A realisation knows its gradient: the state is that of the path, not a draw around it.
    assert hits["counters"]["line_step_limit"] == 0


@pytest.mark.parametrize("kernel", [gn.SquaredExponential(1.0), gn.Matern(2.5, 1.0), gn.RationalQuadratic(1, 1.0)])
@pytest.mark.parametrize("start", ["outside", "value and slope"])
def test_implied_correlation_on_a_line(kernel, start, full_size, seed):
    n = 100_000 if full_size else 10_000
    gp = gn.GaussianProcess(5.0, 1.0, kernel, bounds=LINE)
    t = np.array([0.05, 0.3, 0.77, 1.9, 4.0])
    state = None
    if start != "outside":
        state = {"value": np.full(n, 5.5), "gradient": np.tile([-0.4, 0.1, 0.2], (n, 1))}
    g = gn.line_values(gp, *along_x(n), t, start=state, sampler="realisation", tolerance=1e-6, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > 0.999 * n
    x = np.column_stack([t, 0 * t, 0 * t])
    covariance, mean = kernel(x, x), np.zeros(len(t))
    if start != "outside":
        h = 1e-4
        k = kernel(x, np.zeros((1, 3)))[:, 0]
        slope = (kernel(x, [[h, 0, 0]]) - kernel(x, [[-h, 0, 0]]))[:, 0] / (2 * h)
        g0 = kernel.derivative_variance([1, 0, 0])
        mean = 0.5 * k - 0.4 * slope / g0
        covariance = covariance - np.outer(k, k) - np.outer(slope, slope) / g0
    m, deviation = len(g), np.sqrt(np.diag(covariance))
    check_z(g.mean(axis=0), mean, deviation / np.sqrt(m), "mean")
    error = np.sqrt((np.outer(deviation, deviation) ** 2 + covariance**2) / m)
    check_z((g - mean).T @ (g - mean) / m, covariance, error, "covariance")


def bounce(gp, hits, directions, seed):
    """The next hits of mirrored rays, and the rays."""
    state = hits["state"]
    normal = state["gradient"] / np.linalg.norm(state["gradient"], axis=1, keepdims=True)
    out = directions - 2 * np.sum(directions * normal, axis=1, keepdims=True) * normal
    return gn.first_hits(gp, hits["position"], out, 10, memory="global", start=state, seed=seed), out


def select(hits, rows):
    state = {k: hits["state"][k][rows] for k in ("value", "gradient")}
    state["realisation"] = {k: v[rows] for k, v in hits["state"]["realisation"].items()}
    return {"t": hits["t"][rows], "position": hits["position"][rows], "state": state}


GLOBAL = [
    gn.SquaredExponential([0.6, 0.15, 0.3], rotation=[0.9, 0.3, -0.2, 0.1]),
    gn.Matern(1.5, 0.4),
    gn.Wong(0.4),
    gn.RationalQuadratic(0.7, 0.3),
    gn.LocallyPeriodic(0.6, 0.9, [0, 0.6, 0.8], 1.2),
    gn.PlaneWave([3.0, -4.0, 8.0]),
    0.6 * gn.SquaredExponential(0.4) + 0.4 * gn.Matern(2.5, 0.3),
    gn.RationalQuadratic(1, 0.4) * gn.PlaneWave([2.0, 1.0, -2.0]),
]


@pytest.mark.parametrize("kernel", GLOBAL, ids=repr)
def test_global_is_one_realisation(kernel, full_size, seed):
    """Hits of a path and their gradients are those of gp.realisation_at under the seed in the state; f > 0 between."""
    n = 1000 if full_size else 50
    gp = gn.GaussianProcess(-1 * gn.SphereField([0, 0, 0], 1), 0.3, kernel, bounds=SPHERE_BOX)
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    first = gn.first_hits(gp, np.zeros((n, 3)), directions, 10, memory="global", seed=seed)
    rows = np.isfinite(first["t"])
    assert rows.mean() > 0.95
    first, directions = select(first, rows), directions[rows]
    second, out = bounce(gp, first, directions, seed + 1)
    realisation = second["state"]["realisation"]
    assert np.array_equal(realisation["seed"], first["state"]["realisation"]["seed"])
    compared = 0
    for i in np.flatnonzero(np.isfinite(second["t"]) & np.isnan(realisation["shift"])):
        s = int(realisation["seed"][i])
        at = gp.realisation_at([first["position"][i], second["position"][i]], s)
        assert np.abs(at["value"]).max() < 1e-6
        assert np.allclose(at["gradient"][0], [first["state"]["gradient"][i], second["gradient"][i]], atol=1e-5)
        between = first["position"][i] + np.linspace(0.01, 0.99, 60)[:, None] * second["t"][i] * out[i]
        assert gp.realisation_at(between, s)["value"].min() > -1e-3
        compared += 1
    assert compared > 0.5 * n


def test_global_entry_is_outside_and_kept(seed):
    """Definitions B4: where the first ray finds the realisation inside it is moved out, once for the path."""
    n = 4000
    gp = gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1.0), bounds=LINE)
    hits = gn.first_hits(gp, *along_x(n), 5.5, memory="global", seed=seed)
    moved = np.isfinite(hits["state"]["realisation"]["shift"])
    check_proportion(moved.sum(), n, 0.5, what="inside at the start")
    check_proportion([np.sum(hits["t"] > t) for t in (0.5, 1, 2, 5)], n, SURVIVAL["se", "outside", "renewal+"], 4e-4)
    rows = np.isfinite(hits["t"])
    first = select(hits, rows)
    # Back along the ray: it came from outside, all the way to the face of the bounds.
    back = gn.first_hits(gp, first["position"], np.tile([-1.0, 0, 0], (rows.sum(), 1)), 10, memory="global", start=first["state"])
    kept = back["state"]["realisation"]
    assert np.array_equal(kept["shift"], first["state"]["realisation"]["shift"], equal_nan=True)
    assert np.all(back["t"] > first["t"] - 1e-6)


def test_global_at_infinite_length_scale(seed):
    """Oracle 14: one normal for the whole path. In a cavity every hit of a path is at the same radius, 1 + σξ."""
    n = 2000
    gp = gn.GaussianProcess(-1 * gn.SphereField([0, 0, 0], 1), 0.1, gn.SquaredExponential(1e7), bounds=SPHERE_BOX)
    rng = np.random.default_rng(seed)
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    hits = gn.first_hits(gp, np.tile([0.3, 0, 0], (n, 1)), directions, 10, memory="global", seed=seed)
    radius = np.linalg.norm(hits["position"], axis=1)
    check_z(np.mean((radius - 1) / 0.1), 0, 1 / np.sqrt(n))
    check_z(np.mean(((radius - 1) / 0.1) ** 2), 1, np.sqrt(2 / n))
    for k in range(3):
        hits, directions = bounce(gp, hits, directions, seed + k)
        assert np.allclose(np.linalg.norm(hits["position"], axis=1), radius, atol=1e-6)


def test_time_correlates_realisations(full_size, seed):
    """exp(-Δ²/2) over Δ time scales, times the kernel in space; amplitudes of features and nodes of lattices alike."""
    most = 40_000 if full_size else 1500
    points = np.array([[0.1, 0.2, 0.3], [0.5, 0.2, 0.1]])
    varying = tensor_grids.along_x(lambda x: tensor_grids.isotropic(np.exp(0.25 * x)), 5, 61)
    for kernel, anisotropy in (
        (gn.SquaredExponential(0.7), None), (gn.Matern(2.5, 0.7), None), (gn.SquaredExponential(0.7), varying)
    ):  # fmt: skip
        n = most // 8 if anisotropy else most
        values = []
        for time in (3.0, 3.2, 5.0):
            gp = gn.GaussianProcess(0.0, 1.0, kernel, anisotropy=anisotropy, time_scale=2.0, time=time)
            k = gp.covariance(points, points)
            values.append(gp.realisation_at(points, seed, n)["value"])
        for a, b, gap in [(0, 0, 0), (0, 1, 0.1), (0, 2, 1.0), (1, 2, 0.9)]:
            expected = k * np.exp(-(gap**2) / 2)
            check_z(values[a].T @ values[b] / n, expected, np.sqrt((1 + expected**2) / n), f"{gap}")
        # It flows: a tenth of a time scale moves g by about a tenth of its deviation.
        check_z(np.mean((values[0] - values[1]) ** 2), 2 * (1 - np.exp(-0.005)), 2 * 0.01 * np.sqrt(2 / n))
    grid = [gp.realisation(SPHERE_BOX, 12, seed)["realisation"] for _ in range(2)]
    assert np.array_equal(*grid)
    assert "flows" in gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1.0), time_scale=2.0).plan()["time"]
    with pytest.raises(ValueError, match="time needs a time_scale"):
        gn.GaussianProcess(0.0, 1.0, kernel, time=1.0)


def scene(memory, material, *, world, color=1.0, **more):
    eye = np.eye(4)
    eye[2, 3] = 4
    process = gn.GaussianProcess(gn.SphereField((0, 0, 0), 1), 0.1, gn.SquaredExponential(0.25), bounds=((-1.7,) * 3, (1.7,) * 3))
    ball = {"name": "Ball", "type": "gpis", "process": process, "materials": ["surface"], "memory": memory}
    return {
        "version": 1,
        "camera": {"type": "perspective", "matrix": eye, "fov_x": 0.55},
        "world": world,
        "materials": {"surface": {"type": material, "color": (color,) * 3}},
        "objects": [ball],
    } | more


@pytest.mark.parametrize("material", ["lambert", "mirror"])
def test_global_furnace(material, seed):
    """Oracle 13: every path ends in the white world with throughput 1; the same image with any number of threads."""
    s = gn.Scene(scene("global", material, world={"color": (1, 1, 1)}))
    assert "one realisation for the whole path" in str(s.plan())
    results = [gn.render(s, 8, 8, samples=16, seed=seed, threads=t) for t in (1, 2)]
    for r in results:
        assert np.allclose(r.passes["combined"], 1, atol=1e-6)
        for name in ("path_length_limit", "line_step_limit", "nan_samples", "states_inside", "realisation_moved"):
            assert r.stats[name] == 0, name
        assert r.stats["path_vertices"] > 8 * 8 * 8
    assert np.array_equal(results[0].passes["normal"], results[1].passes["normal"])


@pytest.mark.parametrize("material", ["lambert", "mirror"])
def test_global_enters_its_bounds_again(material, seed):
    """A body that mostly is solid where its bounds end, above a floor: paths come back to it where their realisation is
    inside, and it is moved out there. What such a ray hits, the next one leaves, in the same realisation: left in another one
    paths stuck to the place until they were cut off (39 moves cost 4,400 vertices of 6,900). A path may end up in a pocket
    without a way out, 1 of 20,000 did."""
    gp = gn.GaussianProcess(-0.2, 0.1, gn.SquaredExponential(0.4), bounds=((-1,) * 3, (1,) * 3))
    floor = {"vertices": [(-3, -3, -1.6), (3, -3, -1.6), (3, 3, -1.6), (-3, 3, -1.6)], "triangles": [(0, 1, 2), (0, 2, 3)]}
    described = scene("global", material, world={"color": (1, 1, 1)}, settings={"max_bounces": 300}, meshes={"F": floor})
    described["objects"][0]["process"] = gp
    described["camera"]["fov_x"] = 1.2
    described["materials"]["floor"] = {"type": "lambert", "color": (1, 1, 1)}
    described["objects"].append({"name": "Floor", "type": "mesh", "mesh": "F", "materials": ["floor"]})
    result = gn.render(gn.Scene(described), 8, 8, samples=64, seed=seed)
    assert result.stats["realisation_moved"] > 20
    assert result.stats["path_vertices"] < 4 * result.stats["camera_paths"]
    assert np.sum(1 - result.passes["combined"][..., 0]) * 64 < 2


def test_mirrors_know_their_gradient(seed):
    """Under global a mirror is a delta: no light is sampled from it, and it finds the same light by reflection."""
    white = {"world": BLACK, "lights": WHITE_SUNS}
    result = gn.render(gn.Scene(scene("global", "mirror", **white)), 8, 8, samples=16, seed=seed)
    assert result.stats["shadow_rays"] == 0 and np.allclose(result.passes["combined"], 1, atol=1e-6)
    result = gn.render(gn.Scene(scene("global", "lambert", **white)), 8, 8, samples=64, seed=seed)
    assert result.stats["shadow_rays"] > 0
    pixels, variance = (result.passes[p][..., 0].astype(float) for p in ("combined", "variance"))
    assert abs(pixels.mean() - 1) < Z_LIMIT * np.sqrt(variance.sum()) / pixels.size + 1e-6


def test_global_beside_renewal_plus(seed, full_size):
    """Albedo ½ under a gradient and half a sky. Renewal+ forgets what it passed, so the two need not agree: they do to .02 here."""
    light = {"world": {"image": np.linspace(0, 1, 32)[:, None, None] * np.ones((32, 8, 3))}, "lights": WHITE_SUNS[:1]}
    means = []
    for memory in ("global", "renewal+"):
        described = scene(memory, "lambert", color=0.5, **light)
        result = gn.render(gn.Scene(described), 12, 12, samples=256 if full_size else 64, seed=seed)
        image, variance = (result.passes[p][..., 0].astype(float) for p in ("combined", "variance"))
        means.append((image.mean(), np.sqrt(variance.sum()) / image.size))
    (a, da), (b, db) = means
    print(f"global {a:.4f} ± {da:.4f}, renewal+ {b:.4f} ± {db:.4f}")
    assert abs(a - b) < 0.02 + 4 * np.hypot(da, db)


def test_refusals():
    gp = gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1.0), bounds=LINE)
    rays = along_x(2)
    with pytest.raises(ValueError, match="'global' is one realisation"):
        gn.first_hits(gp, *rays, 5, memory="global", sampler="dense")
    with pytest.raises(ValueError, match="has no gradient"):
        gn.first_hits(gn.GaussianProcess(0.0, 1.0, gn.Matern(0.5, 1.0), bounds=LINE), *rays, 5, sampler="realisation")
    start = {"value": np.zeros(2), "gradient": np.ones((2, 3)), "realisation": {"seed": np.zeros(2, np.uint64)}}
    with pytest.raises(ValueError, match=r"start\['realisation'\]"):
        gn.first_hits(gp, *rays, 5, memory="global", start=start)


def test_rays_inside_see_the_same_realisation(seed):
    """Memory global: a ray that enters the body (a dielectric) leaves it where that very realisation does."""
    n = 60
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 0.1, gn.SquaredExponential(0.3), bounds=SPHERE_BOX)
    rng = np.random.default_rng(seed)
    origins = np.column_stack([rng.uniform(-0.5, 0.5, (n, 2)), np.full(n, 3.0)])
    down = np.tile([0.0, 0, -1], (n, 1))
    first = select(gn.first_hits(gp, origins, down, 10, memory="global", seed=seed), slice(None))
    leave = gn.first_hits(
        gp, first["position"], down, 10, memory="global", start=first["state"], inside=np.ones(n, bool), seed=seed
    )
    assert np.isfinite(leave["t"]).all()
    for i in range(n):
        at = gp.realisation_at(leave["position"][i : i + 1], int(first["state"]["realisation"]["seed"][i]))
        assert abs(at["value"][0, 0]) < 1e-6
        assert np.allclose(at["gradient"][0, 0], leave["gradient"][i], atol=1e-5) and leave["gradient"][i, 2] < 0
