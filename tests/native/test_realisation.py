"""Realisations: their covariance and how Gaussian they are, grids against points, surface area and normals (design
oracles, numbered as there)."""

import os
import subprocess
import sys

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_same_distribution, check_z
from tensor_grids import along_x, isotropic

pytestmark = pytest.mark.stats
TURN = [0.9, 0.3, -0.2, 0.1]
BOX = ((-1, -1, -1), (1, 1, 1))
KERNELS = {
    "se": gn.SquaredExponential([0.7, 0.4, 1.1], rotation=TURN),
    "height field": gn.SquaredExponential([0.7, 0.5, np.inf], rotation=TURN),
    "matern 3/2": gn.Matern(1.5, [0.7, 0.4, 1.1], rotation=TURN),
    "matern 5/2": gn.Matern(2.5, 0.6),
    "rq .5": gn.RationalQuadratic(0.5, 0.6),
    "rq 2": gn.RationalQuadratic(2, [0.7, 0.5, np.inf]),
    "wong": gn.Wong([0.6, 0.9, 0.6]),
    "plane wave": gn.PlaneWave([1.0, 2.0, 0.5]),
    "locally periodic": gn.LocallyPeriodic(1.2, 0.9, [0.6, 0.0, 0.8], 1.0),
    "wave of rq": gn.RationalQuadratic(1, 0.8) * gn.PlaneWave([0.0, 2.0, 1.0]),
    "sum": 0.6 * gn.SquaredExponential(0.8) + 0.4 * gn.Matern(1.5, 0.5),
    "product": gn.Matern(1.5, [0.7, 0.4, 1.1], rotation=TURN) * gn.SquaredExponential([1.5, 0.9, 0.6]),
    "products": 0.7 * (gn.RationalQuadratic(1, 0.8) * gn.Matern(2.5, 1.1) * gn.PlaneWave([1.0, 2.0, 0.5]))
    * (gn.Matern(2.5, 2.0) * gn.PlaneWave([0.0, -1.0, 1.5]) + 0.4 * gn.RationalQuadratic(3, 1.0)),
}
ROUGH = ("matern 3/2", "wong", "sum", "product")


def process(kernel, mean=0.0, sigma=1.0):
    return gn.GaussianProcess(mean, sigma, kernel)


def joint_covariance(k, points, h=1e-4):
    """Of (g, ∇g) at all points, differences of the kernel's own values: (4N, 4N), error of order h²."""
    n = len(points)
    # Stencils: g at the point; (g(+h) - g(-h)) / 2h along each axis.
    at, weight = [], np.zeros((4 * n, 7 * n))
    for i, p in enumerate(points):
        at += [p] + [p + s * h * np.eye(3)[a] for a in range(3) for s in (1, -1)]
        weight[4 * i, 7 * i] = 1
        for a in range(3):
            weight[4 * i + 1 + a, 7 * i + 1 + 2 * a] = 0.5 / h
            weight[4 * i + 1 + a, 7 * i + 2 + 2 * a] = -0.5 / h
    at = np.array(at)
    return weight @ k(at, at) @ weight.T


@pytest.mark.parametrize("name", KERNELS)
def test_implied_covariance_of_values_and_gradients(name, full_size, seed):
    """Over many seeds, at points less than a lattice step to several length scales apart."""
    kernel = KERNELS[name]
    points = np.array([[0.1, 0.2, -0.3], [0.15, 0.24, -0.2], [0.6, -0.1, 0.4], [-7.3, 2.1, 5.2]])
    n = 100_000 if full_size else 10_000
    if name == "locally periodic":  # 23 lattices
        n //= 10
    at = process(kernel).realisation_at(points, seed=seed * 1_000_003, n=n)
    values = np.concatenate([at["value"][..., None], at["gradient"]], axis=-1).reshape(n, -1)
    expected = joint_covariance(kernel, points)
    deviation = np.sqrt(np.diag(expected))
    flat = deviation < 1e-3  # derivatives along an infinite length scale: differences of rounding
    assert np.all(np.abs(values[:, flat]) < 1e-3)
    values, expected, deviation = values[:, ~flat], expected[np.ix_(~flat, ~flat)], deviation[~flat]
    check_z(values.mean(axis=0), 0, deviation / np.sqrt(n), "mean")
    error = np.sqrt((np.outer(deviation, deviation) ** 2 + expected**2) / n)
    # Differences are off by h² times a fourth derivative; Matérn 3/2 and Wong, whose third derivative jumps, by h.
    stated = (1e-3 if name in ROUGH else 1e-5) * np.outer(deviation, deviation)
    check_z(np.maximum(np.abs(values.T @ values / n - expected) - stated, 0), 0, error, "covariance")


@pytest.mark.parametrize(
    ("name", "value", "slope"), [("se", 0, 0), ("matern 3/2", 0.72, 4.1), ("rq .5", 0.72, 4.1), ("wong", 0.8, 4.3)]
)
def test_excess_kurtosis_is_as_stated(name, value, slope, full_size, seed):
    """Lattices are exactly Gaussian. N = 1024 spectral features have .72/N in values and 4.1/N in slopes at most. Without
    their weights the slopes of Matérn 3/2, whose spectrum has no fourth moment, have one of order 1."""
    kernel = KERNELS[name]
    n = 100_000 if full_size else 20_000
    points = np.array([[0.1, 0.2, -0.3]])
    at = process(kernel).realisation_at(points, seed=seed, n=n)
    for what, x, bound in [("value", at["value"][:, 0], value), ("slope", at["gradient"][:, 0, 0], slope)]:
        x = x / np.sqrt(np.mean(x**2))
        check_z(np.mean(x**4) - 3, bound / 1024, np.sqrt(24 / n), f"{name}, {what}")


@pytest.mark.parametrize("name", KERNELS)
def test_grid_is_the_same_realisation_as_points(name, seed):
    """The grid walks rows and multiplies matrices, points are summed one by one: the same function, to single precision;
    gradients are the values' own."""
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 0.8), 0.3, KERNELS[name])
    grid = gp.realisation(((-1, -0.5, -1), (1, 0.9, 0.7)), 21, seed)
    assert grid["realisation"].shape == (21, 15, 18) and grid["voxel_size"] == 0.1
    index = np.random.default_rng(seed).integers(0, grid["realisation"].shape, (200, 3))
    points = np.array(grid["origin"]) + index * grid["voxel_size"]
    at = gp.realisation_at(points, seed)
    assert np.allclose(grid["realisation"][tuple(index.T)], at["value"][0], atol=1e-5)
    # Between the nodes, where no node of a lattice comes into reach within h. Waves of rough kernels have tails: in some seeds
    # one is ten thousand times as short as a length scale.
    points, h = points + np.random.default_rng(seed).uniform(0.01, 0.04, points.shape), 1e-7
    gradient = gp.realisation_at(points, seed)["gradient"]
    for axis in range(3):
        step = h * np.eye(3)[axis]
        difference = (gp.realisation_at(points + step, seed)["value"] - gp.realisation_at(points - step, seed)["value"]) / (2 * h)
        assert np.mean(np.abs(difference - gradient[..., axis]) > 1e-3) < 0.02


def test_threads_and_seeds(seed):
    gp = process(KERNELS["sum"])
    first, again, other = (gp.realisation(BOX, 24, s, threads=t)["realisation"] for s, t in [(seed, 1), (seed, 3), (seed + 1, 2)])
    assert np.array_equal(first, again)
    assert abs(np.corrcoef(first.ravel(), other.ravel())[0, 1]) < 0.5
    # Streams of one lattice under neighbouring seeds share nothing.
    at = process(KERNELS["plane wave"]).realisation_at([[0.0, 0, 0]], seed, 20_000)
    v, s = at["value"][:, 0], at["gradient"][:, 0, 0]
    check_z(np.mean(v[1:] * v[:-1]), 0, 1 / np.sqrt(len(v)))
    check_z(np.mean(v[1:] * s[:-1]) / s.std(), 0, 1 / np.sqrt(len(v)))


def area_of(vertices, triangles):
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    return 0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1)


@pytest.mark.parametrize("name", ["se", "matern 5/2", "rq"])
@pytest.mark.parametrize("mean", [0.0, 0.8])
def test_surface_area_per_volume(name, mean, full_size, seed):
    """Oracle 10: (2/π)(s/σ) e^{-μ²/2σ²}, s = σ√λ₂/ℓ, from meshes of independent realisations."""
    kernel, lambda2 = {
        "se": (gn.SquaredExponential(0.125), 1),
        "matern 5/2": (gn.Matern(2.5, 0.125), 5 / 3),
        "rq": (gn.RationalQuadratic(2, 0.125), 1),
    }[name]
    gp = process(kernel, mean)
    areas = []
    for k in range(96 if full_size else 24):
        grid = gp.realisation(((0, 0, 0), (1, 1, 1)), 65, seed + k)  # ℓ/8
        areas.append(area_of(*gn.level_set_mesh(grid["realisation"], grid["voxel_size"], grid["origin"])).sum())
    expected = 2 / np.pi * np.sqrt(lambda2) / 0.125 * np.exp(-(mean**2) / 2)
    error = np.std(areas, ddof=1) / np.sqrt(len(areas))
    # Flat triangles cut corners: of order h²/ℓ² of the area.
    assert abs(np.mean(areas) - expected) < 5 * error + 0.015 * expected, (np.mean(areas), expected, error)
    assert error < 0.05 * expected


def test_normals_over_all_crossings(full_size, seed):
    """Oracle 11: at all down-crossings of a line, -n·d has density 2u and slopes are Rayleigh."""
    gp = process(gn.SquaredExponential(0.5))
    n = 4000 if full_size else 400
    t = np.linspace(0, 8, 321)
    points = np.column_stack([t, 0 * t, 0 * t])
    at = gp.realisation_at(points, seed, n)
    v, s = at["value"], at["gradient"][..., 0]
    rows, cells = np.nonzero((v[:, :-1] > 0) & (v[:, 1:] <= 0))
    # Halfway: gradients at the nearer end are off by h g'' = .05; take the crossing by interpolation of gradients.
    w = (v[rows, cells] / (v[rows, cells] - v[rows, cells + 1]))[:, None]
    gradient = (1 - w) * at["gradient"][rows, cells] + w * at["gradient"][rows, cells + 1]
    u = -gradient[:, 0] / np.linalg.norm(gradient, axis=1)
    # Crossings of one line are dependent: as many independent ones as lines times the lengths of memory.
    rng = np.random.default_rng(seed)
    pick = rng.choice(len(u), min(len(u), 3 * n), replace=False)
    check_same_distribution(u[pick], np.sqrt(rng.uniform(size=200_000)), "n·d")
    check_same_distribution(-gradient[pick, 0] * 0.5, rng.rayleigh(size=200_000), "slope")
    assert s.shape == v.shape


def test_mesh_is_closed_and_faces_outwards(seed):
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 0.6), 0.05, gn.SquaredExponential(0.2))
    grid = gp.realisation(BOX, 40, seed)
    vertices, triangles = gn.level_set_mesh(grid["realisation"], grid["voxel_size"], grid["origin"])
    edges = np.concatenate([triangles[:, [0, 1]], triangles[:, [1, 2]], triangles[:, [2, 0]]])
    count = len(vertices)
    forward, backward = edges[:, 0].astype(int) * count + edges[:, 1], edges[:, 1].astype(int) * count + edges[:, 0]
    assert len(np.unique(forward)) == len(forward) and np.array_equal(np.sort(forward), np.sort(backward))
    a, b, c = (vertices[triangles[:, k]] for k in range(3))
    volume = np.sum(np.cross(a, b) * c) / 6
    inside = np.mean(grid["realisation"] < 0) * np.prod(np.array(grid["realisation"].shape) * grid["voxel_size"])
    assert volume > 0 and abs(volume - inside) < 0.02
    # On the realisation itself, linear between nodes.
    assert np.abs(gp.realisation_at(vertices[::50], seed)["value"]).max() < 0.02


def test_level_set_file_is_the_surface(tmp_path, seed):
    """Written, read back as a certain surface: rays hit it where the realisation changes sign."""
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 0.6), 0.05, gn.SquaredExponential(0.2))
    grid = gp.realisation(BOX, 96, seed)
    path = tmp_path / "realisation.vdb"
    gn.write_vdb(path, grid)
    surface = gn.GaussianProcess(gn.VdbField(path, "realisation"), 0, gn.SquaredExponential(0.2))
    rng = np.random.default_rng(seed)
    origins = np.column_stack([rng.uniform(-0.25, 0.25, (200, 2)), np.full(200, 2.0)])
    hits = gn.first_hits(surface, origins, np.tile([0.0, 0, -1], (200, 1)), 10)
    assert np.isfinite(hits["t"]).all()
    at = gp.realisation_at(hits["position"], seed)
    assert np.abs(at["value"]).max() < 0.01
    assert np.allclose(at["gradient"][0], hits["gradient"], atol=0.25)


def test_refusals_and_cancel():
    waves = gn.LocallyPeriodic(1.2, 0.9, [0.6, 0.0, 0.8], 0.1)
    with pytest.raises(ValueError, match="at most 4096 terms"):
        process(waves * waves * waves).realisation(BOX, 8)
    gp = process(gn.SquaredExponential(1.0))
    for bounds, resolution, text in [
        (((0, 0, 0), (1, 0, 1)), 8, "positive length"),
        (((0, 0, 0), (1, np.inf, 1)), 8, "finite"),
        (BOX, 1, "2 to 512"),
        (BOX, 513, "2 to 512"),
    ]:
        with pytest.raises(ValueError, match=text):
            gp.realisation(bounds, resolution)
    calls = []
    assert gp.realisation(BOX, 64, progress=lambda f: calls.append(f) or len(calls) < 2) is None
    assert len(calls) == 2
    with pytest.raises(ZeroDivisionError):
        gp.realisation(BOX, 64, progress=lambda f: 1 / 0)
    # A kernel without gradient still has values.
    v = process(gn.Matern(0.5, 1.0)).realisation_at([[0.0, 0, 0], [1, 0, 0]], n=4000)["value"]
    check_z(np.mean(v[:, 0] * v[:, 1]), np.exp(-1), np.sqrt((1 + np.exp(-2)) / 4000))


@pytest.mark.skipif("GPIS_SANITIZE" in os.environ, reason="a module built with a sanitizer takes all of the address space")
def test_short_memory_is_said(tmp_path):
    """In a process of its own: where the grid's values have no room, a sentence; then a smaller one has."""
    script = tmp_path / "short.py"
    script.write_text(
        """
import resource
import gpis_native as gn
gp = gn.GaussianProcess(0, 1, gn.SquaredExponential(0.5))
box = ((-1, -1, -1), (1, 1, 1))
gp.realisation(box, 8)
now = int(open("/proc/self/statm").read().split()[0]) * resource.getpagesize()
_, most = resource.getrlimit(resource.RLIMIT_AS)
resource.setrlimit(resource.RLIMIT_AS, (now + (64 << 20), most))
try:
    gp.realisation(box, 512, threads=1)
except RuntimeError as error:
    print(error)
print(gp.realisation(box, 16, threads=1)["realisation"].shape)
"""
    )
    out = subprocess.run([sys.executable, script], capture_output=True, text=True, check=True).stdout
    assert "512 nodes along its longest side takes more memory than is to be had. Take a lower resolution." in out
    assert "(16, 16, 16)" in out


def varying_process(kernel=None, mean=0.0, sigma=1.0):
    """Length scales that grow, with axes that turn, on a grid."""
    axis = np.linspace(-1, 1, 9)
    x, y, _ = np.meshgrid(axis, axis, axis, indexing="ij")
    l2 = 0.25 * np.exp(0.5 * x)
    a = np.stack([l2, 0.6 * l2, 1.2 * l2, 0.2 * l2 * y, 0 * l2, 0.1 * l2], axis=-1)
    field = gn.TensorGridField(a, 0.25, [-1, -1, -1])
    return gn.GaussianProcess(mean, sigma, kernel or gn.SquaredExponential(1.0), anisotropy=field, bounds=BOX)


def test_varying_length_scales(full_size, seed):
    """C11 against C10: values and gradients have the covariance of Paciorek and Schervish; grid and points agree."""
    n = 40_000 if full_size else 2000
    gp = varying_process()
    points = np.array([[0.1, 0.2, -0.3], [0.3, 0.1, -0.2], [-0.6, 0.3, 0.4]])
    at = gp.realisation_at(points, seed, n)
    values = np.concatenate([at["value"][..., None], at["gradient"]], axis=-1).reshape(n, -1)
    expected = gp.joint_covariance(points, points).transpose(0, 2, 1, 3).reshape(12, 12)
    deviation = np.sqrt(np.diag(expected))
    error = np.sqrt((np.outer(deviation, deviation) ** 2 + expected**2) / n)
    check_z(values.T @ values / n, expected, error, "covariance")
    grid = gp.realisation(BOX, 8, seed)
    index = np.array([[1, 2, 3], [6, 5, 4]])
    nodes = np.array(grid["origin"]) + index * grid["voxel_size"]
    assert np.allclose(grid["realisation"][tuple(index.T)], gp.realisation_at(nodes, seed)["value"][0], atol=1e-5)


@pytest.mark.parametrize(
    "kernel",
    [
        gn.Matern(1.5, 1.0),
        gn.RationalQuadratic(1.0, 0.8),
        gn.Matern(0.5, 1.5),
        0.5 * gn.Matern(2.5, 1.2) + 0.5 * gn.SquaredExponential(0.7) + 0.3 * gn.Wong(1.0),
    ],
    ids=["matern 3/2", "rational quadratic", "matern 1/2", "sum"],
)
def test_mixtures_under_varying_length_scales(kernel, full_size, seed):
    """Other kernels as mixtures of squared exponentials: the covariance of Paciorek and Schervish between close, apart and far
    points, of slopes where there are any; what the plan states of its error."""
    n = 20_000 if full_size else 600
    gp, rough = varying_process(kernel), repr(kernel).startswith("Matern(0.5")
    points = np.array([[0.1, 0.2, -0.3], [0.13, 0.18, -0.27], [0.3, 0.1, -0.2], [-0.6, 0.3, 0.4]])
    at = gp.realisation_at(points, seed, n)
    values, expected = at["value"], gp.covariance(points, points)
    if not rough:
        values = np.concatenate([values[..., None], at["gradient"]], axis=-1).reshape(n, -1)
        expected = gp.joint_covariance(points, points).transpose(0, 2, 1, 3).reshape(16, 16)
    deviation = np.sqrt(np.diag(expected))
    scale = np.outer(deviation, deviation)
    stated = np.full_like(expected, 2e-3)
    stated[:: 1 if rough else 4, :: 1 if rough else 4] = 5.1e-4
    difference = np.abs(values.T @ values / n - expected) - stated * scale
    check_z(np.maximum(difference, 0), 0, np.sqrt((scale**2 + expected**2) / n), "covariance")
    grid = gp.realisation(BOX, 4, seed)
    index = np.array([[1, 2, 3], [2, 1, 0]])
    nodes = np.array(grid["origin"]) + index * grid["voxel_size"]
    assert np.allclose(grid["realisation"][tuple(index.T)], gp.realisation_at(nodes, seed)["value"][0], atol=1e-5)


LONG = along_x(lambda x: isotropic(np.exp(0.25 * x)), 20, 89)  # lengths of .6 to 148, a quarter apart


def test_lengths_outside_the_bounds_do_not_count(tmp_path, seed):
    """The longest length counts where it is asked for: grids, points and lines."""
    path = tmp_path / "long.vdb"
    x = np.linspace(-2, 20, 89)
    a = np.broadcast_to(np.array([isotropic(np.exp(0.25 * v)) for v in x])[:, None, None], (89, 2, 2, 6))
    gn.write_vdb(path, {"anisotropy": a, "mean": np.ones(a.shape[:3]), "voxel_size": [0.25, 10, 10], "origin": [-2, -5, -5]})
    moved = np.diag([-1.0, 1, 1, 1])
    refused = r"within the bounds is [\d.]+, [\d.]+ times the shortest of the whole field, 0.606531: .* ratio of up to 8\. "
    for field, turn in [(LONG, 1), (gn.VdbTensorField(path), 1), (LONG.transformed(moved), -1)]:
        gp = gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1.0), anisotropy=field)
        box = np.sort(turn * np.array([-2, 2.0]))
        grid = gp.realisation(((box[0], -1, -1), (box[1], 1, 1)), 9, seed)
        nodes = np.array(grid["origin"]) + np.array([[1, 2, 3], [6, 4, 1]]) * grid["voxel_size"]
        np.testing.assert_allclose(
            gp.realisation_at(nodes, seed)["value"][0], grid["realisation"][[1, 6], [2, 4], [3, 1]], atol=1e-5
        )
        box = np.sort(turn * np.array([-2, 12.0]))
        with pytest.raises(ValueError, match=refused):
            gp.realisation(((box[0], -1, -1), (box[1], 1, 1)), 9, seed)
        with pytest.raises(ValueError, match=refused):
            gp.realisation_at([[0, 0, 0], [turn * 12.0, 0, 0]], seed)
        # A condition is met by what is drawn at it, wherever it lies.
        far = {"points": [(turn * 12.0, 0, 0)], "values": [0.0]}
        held = gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1.0), anisotropy=field, conditions=far)
        with pytest.raises(ValueError, match=refused):
            held.realisation(((-1, -1, -1), (1, 1, 1)), 9, seed)
    for end in (2, 12):
        gp = gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1.0), anisotropy=LONG, bounds=((-2, -1, -1), (end, 1, 1)))
        ray = [(0.5, 0, 2)], [(0, 0, -1)], 4
        if end == 2:
            assert gn.first_hits(gp, *ray, sampler="realisation", seed=seed)["t"].shape == (1,)
        else:
            with pytest.raises(ValueError, match=refused):
                gn.first_hits(gp, *ray, sampler="realisation", seed=seed)


def test_mixtures_that_take_too_many_lengths_are_refused():
    with pytest.raises(ValueError, match="does not reach a rational quadratic kernel of alpha 0.05: take a larger alpha"):
        varying_process(gn.RationalQuadratic(0.05, 1.0)).realisation(BOX, 4)
