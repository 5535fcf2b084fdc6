"""PaintedFields: the arithmetic of every brush against plain numpy, what stays true under any strokes, and its files."""

import gpis_native as gn
import numpy as np
import pytest
from brush_reference import Reference, full

ORIGIN, VOXEL = np.array((-1.3, -1.2, -1.1)), 0.08
SHAPE = (33, 31, 28)  # no whole number of leaves
SIGMA, LENGTH = 0.05, 0.2

BRUSHES = [
    ("mean", "inflate", {"value": 0.2}),
    ("mean", "deflate", {"value": 0.1}),
    ("mean", "smooth", {}),
    ("mean", "flatten", {}),
    ("mean", "grab", {"drag": 0.3}),
    ("deviation", "set", {"value": 0.3}),
    ("deviation", "add", {"value": 2.5}),
    ("deviation", "smooth", {}),
    ("length_scale", "set", {"value": 0.6}),
    ("length_scale", "add", {"value": 0.5}),
    ("length_scale", "smooth", {}),
    ("anisotropy", "comb", {"ratios": (5, 1, 0.4), "drag": 1.0}),
    ("anisotropy", "smooth", {}),
    ("albedo", "set", {"value": (0.9, 0.2, 0.1)}),
    ("albedo", "smooth", {}),
]


def bumpy_sphere(shape=SHAPE, origin=ORIGIN, voxel=VOXEL):
    x, y, z = np.meshgrid(*(origin[i] + voxel * np.arange(shape[i]) for i in range(3)), indexing="ij")
    return (np.sqrt(x * x + y * y + z * z) - 0.8 + 0.05 * np.sin(9 * x) * np.cos(7 * y + z)).astype(np.float32)


@pytest.fixture
def path(tmp_path):
    gn.write_vdb(tmp_path / "sphere.vdb", {"mean": bumpy_sphere(), "origin": ORIGIN, "voxel_size": VOXEL})
    return tmp_path / "sphere.vdb"


@pytest.fixture
def painted(path):
    return gn.PaintedFields(path, sigma=SIGMA, length_scale=LENGTH)


def dabs(rng, count, drag=0.0):
    """On and about the surface, some over the ends of the grid."""
    centers = rng.normal(size=(count, 3))
    centers *= (0.8 + rng.uniform(-0.2, 0.4, (count, 1))) / np.linalg.norm(centers, axis=1, keepdims=True)
    directions = drag * rng.normal(size=(count, 3)) if drag else None
    return centers, {"radius": rng.uniform(0.1, 0.6, count), "strength": rng.uniform(0.1, 1, count), "directions": directions}


def grids(fields, path):
    """What a file holds, on the nodes of the mean: painted grids may be constants."""
    fields.write(path)
    return gn.read_vdb(path)


def compare(fields, reference, path):
    """Grids to the rounding of single precision, of the largest value that was summed."""
    got = grids(fields, path)
    for name, expected in (
        ("mean", reference.mean),
        ("sigma", reference.deviation),
        ("anisotropy", reference.tensor),
        ("albedo", reference.albedo),
    ):
        if name in got:
            np.testing.assert_allclose(got[name], expected, rtol=2e-5, atol=2e-6 * np.abs(expected).max(), err_msg=name)
        elif name != "mean":
            assert np.ptp(expected.reshape(-1, expected.shape[-1] if expected.ndim > 3 else 1), axis=0).max() == 0


@pytest.mark.parametrize(("channel", "operation", "brush"), BRUSHES, ids=[f"{c}-{o}" for c, o, _ in BRUSHES])
@pytest.mark.parametrize("symmetry", [(False, False, False), (True, False, True)], ids=["plain", "symmetric"])
def test_a_brush_is_its_formula(painted, tmp_path, channel, operation, brush, symmetry):
    brush = dict(brush)
    rng = np.random.default_rng(5)
    reference = Reference(bumpy_sphere(), ORIGIN, VOXEL, SIGMA, LENGTH)
    if operation == "smooth" and channel != "mean":  # something to smooth
        rough = {"deviation": ("set", 0.4), "length_scale": ("set", 0.5), "albedo": ("set", (0.1, 0.5, 1))}
        how, value = rough.get(channel, ("comb", None))
        centers, dab = dabs(rng, 3, drag=1.0)
        before = {"value": value, "falloff": "sphere", "ratios": (3, 1, 1), **dab}
        for fields in (painted, reference):
            fields.apply(channel, how, centers, **before)
    centers, dab = dabs(rng, 6, brush.pop("drag", 0.0))
    for fields in (painted, reference):
        fields.apply(channel, operation, centers, **dab, **brush, symmetry=symmetry)
    compare(painted, reference, tmp_path / "painted.vdb")


@pytest.mark.parametrize(("channel", "operation"), [brush[:2] for brush in BRUSHES if brush[1] in {"smooth", "flatten", "comb"}])
def test_beyond_the_ends_of_the_grid_stands_the_nearest_node(painted, tmp_path, channel, operation):
    """On all corners of a box that is no whole number of leaves: brushes that look at neighbours find none there."""
    reference = Reference(bumpy_sphere(), ORIGIN, VOXEL, SIGMA, LENGTH)
    ends = np.stack([ORIGIN, ORIGIN + VOXEL * (np.array(SHAPE) - 1)])
    corners = ends[[*np.ndindex(2, 2, 2)], np.arange(3)]
    around = corners + np.random.default_rng(3).uniform(-0.1, 0.1, (8, 3))
    rough = {"deviation": ("set", 0.4), "length_scale": ("set", 0.5), "albedo": ("set", (0.1, 0.5, 1))}
    directions = np.tile((1.0, 2.0, -1.5), (8, 1))
    for fields in (painted, reference):
        if operation == "smooth" and channel != "mean":
            how, value = rough.get(channel, ("comb", None))
            fields.apply(channel, how, corners, radius=0.3, strength=0.8, value=value, ratios=(3, 1, 1), directions=directions)
        ratios = {"ratios": (4, 1, 1)} if operation == "comb" else {}
        fields.apply(channel, operation, around, radius=0.35, strength=0.9, directions=directions, **ratios)
    compare(painted, reference, tmp_path / "painted.vdb")


@pytest.mark.parametrize(
    "falloff",
    ["smooth", "smoother", "sphere", "root", "sharp", "sharper", "inverse_square", "linear", "constant", "custom"],
)
def test_falloffs(painted, tmp_path, falloff):
    brush = {"falloff": falloff} if falloff != "custom" else {"curve": [0.2, 1.0, 0.4, 0.0]}
    reference = Reference(bumpy_sphere(), ORIGIN, VOXEL, SIGMA, LENGTH)
    for fields in (painted, reference):
        fields.apply("deviation", "set", [(0.7, 0.1, 0.2)], radius=0.5, strength=0.8, value=0.4, **brush)
    compare(painted, reference, tmp_path / "painted.vdb")


def random_strokes(rng, count):
    for _ in range(count):
        channel, operation, brush = BRUSHES[rng.integers(len(BRUSHES))]
        brush = dict(brush)
        centers, dab = dabs(rng, int(rng.integers(1, 4)), brush.pop("drag", 0.0))
        if operation == "comb":
            brush["ratios"] = tuple(10 ** rng.uniform(-1, 1, 3))
        falloff = ["smooth", "constant", "root"][rng.integers(3)]
        yield channel, operation, centers, {**dab, **brush, "falloff": falloff, "symmetry": tuple(rng.random(3) < 0.5)}


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_positive_under_any_strokes(painted, tmp_path, seed):
    """σ > 0, A positive definite with a condition within that of the ratios, colours in 0..1; all finite."""
    for channel, operation, centers, brush in random_strokes(np.random.default_rng(seed), 60):
        counts = painted.apply(channel, operation, centers, **brush)
        assert counts["rejected"] == 0
    got = grids(painted, tmp_path / "painted.vdb")
    assert got["sigma"].min() > 0 and np.isfinite(got["sigma"]).all() and np.isfinite(got["mean"]).all()
    eigenvalues = np.linalg.eigvalsh(full(got["anisotropy"].astype(float)))
    assert eigenvalues.min() > 0
    assert (eigenvalues[..., 2] / eigenvalues[..., 0]).max() < 1.01 * 100**2  # lengths 10 ** ±1
    assert got["albedo"].min() >= 0 and got["albedo"].max() <= 1
    gn.VdbTensorField(tmp_path / "painted.vdb")  # checks every node itself
    gn.VdbColorField(tmp_path / "painted.vdb")


def test_extreme_values_are_kept_in_bounds_and_counted(painted, tmp_path):
    centers = [(0.8, 0, 0)] * 50
    for channel, value in (("deviation", 1e-3), ("length_scale", 1e3)):
        counts = painted.apply(channel, "add", centers, radius=0.4, value=value, falloff="constant")
        assert counts["clamped"] > 0
    got = grids(painted, tmp_path / "painted.vdb")
    assert got["sigma"].min() == np.float32(1e-12)
    eigenvalues = np.linalg.eigvalsh(full(got["anisotropy"].astype(float)))
    assert eigenvalues.min() > 0 and np.sqrt(eigenvalues.max()) == pytest.approx(1e9, rel=1e-6)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_symmetric_strokes_make_symmetric_grids(tmp_path, axis):
    shape, origin = (32, 32, 32), np.full(3, -1.24)
    x = origin[0] + VOXEL * np.arange(32)
    sphere = (np.sqrt(sum(v * v for v in np.meshgrid(x, x, x, indexing="ij"))) - 0.8).astype(np.float32)
    gn.write_vdb(tmp_path / "sphere.vdb", {"mean": sphere, "origin": origin, "voxel_size": VOXEL})
    painted = gn.PaintedFields(tmp_path / "sphere.vdb", sigma=SIGMA, length_scale=LENGTH)
    rng = np.random.default_rng(7)
    for channel, operation, centers, brush in random_strokes(rng, 25):
        brush["symmetry"] = tuple(np.arange(3) == axis) if rng.random() < 0.7 else (True, True, True)
        painted.apply(channel, operation, centers, **brush)
    got = grids(painted, tmp_path / "painted.vdb")
    assert got["mean"].shape == shape
    for name in ("mean", "sigma", "albedo"):
        np.testing.assert_allclose(got[name], np.flip(got[name], axis), rtol=1e-4, atol=1e-5, err_msg=name)
    sign = np.where(np.arange(3) == axis, -1.0, 1.0)
    a = full(got["anisotropy"].astype(float))
    np.testing.assert_allclose(a, np.flip(a, axis) * np.outer(sign, sign), rtol=1e-3, atol=1e-4 * a.max())


def test_grids_do_not_depend_on_threads(path, tmp_path):
    written = []
    for threads in (1, 3):
        painted = gn.PaintedFields(path, sigma=SIGMA, length_scale=LENGTH)
        for channel, operation, centers, brush in random_strokes(np.random.default_rng(4), 30):
            painted.apply(channel, operation, centers, **brush, threads=threads)
        written.append(grids(painted, tmp_path / f"{threads}.vdb"))
    for name, values in written[0].items():
        assert np.array_equal(values, written[1][name]), name


def test_only_touched_leaves(path):
    """Memory grows by the leaves that were written, and by a copy of each; painting there again needs no more."""
    painted = gn.PaintedFields(path, sigma=SIGMA, length_scale=LENGTH)
    painted.apply("deviation", "set", [(0.8, 0, 0)], radius=0.05, strength=0, value=0.3)  # makes the grid
    before = painted.memory()
    counts = painted.apply("deviation", "set", [(0.8, 0, 0)], radius=0.3, value=0.3)
    assert 0 < counts["leaves"] <= 27
    grown = painted.memory() - before
    leaf = 512 * 4
    # Two trees each have nodes above their leaves: 16³ pointers of 8 bytes and masks, and 32³.
    assert grown < counts["leaves"] * 2 * 1.2 * leaf + 2 * 10 * 32**3
    more = painted.apply("deviation", "add", [(0.8, 0, 0)], radius=0.3, value=1.1)
    assert more["leaves"] == counts["leaves"] and painted.memory() - before == grown


def test_what_was_there_comes_back(path, tmp_path):
    """Reset of a channel, restart of all, also out of the file that was written."""
    painted = gn.PaintedFields(path, sigma=SIGMA, length_scale=LENGTH)
    strokes = list(random_strokes(np.random.default_rng(9), 30))
    for channel, operation, centers, brush in strokes:
        painted.apply(channel, operation, centers, **brush)
    painted.extend([(-2, -1, -1), (1, 1, 2)])
    painted.write(tmp_path / "painted.vdb", b"strokes\0 and more")
    assert gn.read_strokes(tmp_path / "painted.vdb") == b"strokes\0 and more"

    again = gn.PaintedFields(tmp_path / "painted.vdb", sigma=9, length_scale=9, sigma_grid="sigma", anisotropy=True, albedo=True)
    before = grids(again, tmp_path / "again.vdb")
    again.reset("albedo")
    after = grids(again, tmp_path / "reset.vdb")
    assert np.all(after["albedo"] == 1)
    for name in ("mean", "sigma", "anisotropy"):
        assert np.array_equal(before[name], after[name])
    size = np.linalg.det(full(after["anisotropy"].astype(float)))
    again.reset("anisotropy")  # the shape alone
    tensor = full(grids(again, tmp_path / "reset.vdb")["anisotropy"].astype(float))
    np.testing.assert_allclose(np.linalg.det(tensor), size, rtol=1e-4)
    np.testing.assert_allclose(tensor[..., 0, 0], tensor[..., 1, 1], rtol=1e-5)
    again.reset("length_scale")
    np.testing.assert_allclose(full(grids(again, tmp_path / "reset.vdb")["anisotropy"])[..., 0, 0], LENGTH**2, rtol=1e-5)
    again.restart()
    got = grids(again, tmp_path / "restart.vdb")
    assert np.array_equal(got["mean"], bumpy_sphere()) and np.all(got["sigma"] == np.float32(SIGMA))
    np.testing.assert_allclose(got["origin"], ORIGIN)
    # And the same strokes make the same grids, to the bit.
    for channel, operation, centers, brush in strokes:
        again.apply(channel, operation, centers, **brush)
    again.extend([(-2, -1, -1), (1, 1, 2)])
    got = grids(again, tmp_path / "replayed.vdb")
    for name in ("mean", "sigma", "anisotropy", "albedo"):
        assert np.array_equal(got[name], before[name]), name


def test_extending_goes_on_with_the_mean(painted):
    low, high = painted.bounds()
    points = np.random.default_rng(2).uniform(low, high, (200, 3))
    before = painted.values("mean", points)
    painted.apply("deviation", "set", [(1.26, 0, 0)], radius=0.3, value=0.2)
    painted.extend([(-1.5, -1.5, -1.5), (1.8, 1.2, 1.1)])
    new_low, new_high = painted.bounds()
    assert np.all(np.array(new_low) <= -1.5) and new_high[0] >= 1.8
    np.testing.assert_allclose(painted.values("mean", points), before, atol=1e-6)
    # A distance stays one to first order, and what is outside stays outside.
    line = np.column_stack([np.linspace(1.2, 1.8, 30), np.zeros(30), np.zeros(30)])
    assert np.all(np.diff(painted.values("mean", line)) > 0)
    corner = painted.values("mean", [new_high])[0]
    assert corner > 0
    # The deviation goes on with its nearest value.
    assert painted.values("deviation", [(1.7, 0, 0)])[0] == pytest.approx(
        painted.values("deviation", [(1.26, 0, 0)])[0], rel=1e-5
    )


def test_mirror_and_copy(path, painted):
    painted.apply("anisotropy", "comb", [(0.8, 0.1, 0.2)], radius=0.4, directions=[(0.3, 1, 0.2)], ratios=(4, 1, 1))
    painted.apply("mean", "inflate", [(0.8, 0.1, 0.2)], radius=0.3, value=0.2)
    points = np.random.default_rng(3).uniform((0.4, -0.5, -0.5), (1.0, 0.5, 0.5), (100, 3))
    image = points * (-1, 1, 1)
    for channel in ("mean", "anisotropy"):
        painted.mirror(channel, 0, True)
    # Nodes are images of no nodes here: trilinear twice.
    np.testing.assert_allclose(painted.values("mean", image), painted.values("mean", points), atol=0.02)
    a, b = (full(painted.values("anisotropy", x)) for x in (points, image))
    sign = np.array((-1.0, 1.0, 1.0))
    assert np.abs(b - a * np.outer(sign, sign)).max() < 0.1 * np.abs(a).max()

    other = gn.PaintedFields(path, sigma=SIGMA, length_scale=2 * LENGTH)
    other.copy(painted, "anisotropy")  # its shape, and not its size
    np.testing.assert_allclose(other.values("length_scale", points), 2 * LENGTH, rtol=0.05)
    other.copy(painted, "length_scale")
    other.copy(painted, "mean")
    for channel in ("mean", "anisotropy"):
        np.testing.assert_allclose(other.values(channel, points), painted.values(channel, points), rtol=1e-4, atol=1e-5)
    other.apply("mean", "deflate", points, radius=0.1, value=1.0)
    other.reset("mean")
    np.testing.assert_allclose(other.values("mean", points), painted.values("mean", points), atol=1e-6)


def test_resample(painted):
    painted.apply("albedo", "set", [(0.8, 0, 0)], radius=0.5, value=(0, 0.5, 1))
    points = np.random.default_rng(6).uniform(-0.9, 0.9, (300, 3))
    before = {channel: painted.values(channel, points) for channel in ("mean", "albedo", "deviation")}
    painted.resample(0.05)
    assert painted.voxel_size() == pytest.approx((0.05,) * 3)
    for channel, values in before.items():
        np.testing.assert_allclose(painted.values(channel, points), values, atol=0.06, err_msg=channel)


def test_a_ray_finds_the_mean_surface(painted):
    rng = np.random.default_rng(8)
    field = gn.GridField(bumpy_sphere(), VOXEL, ORIGIN)
    for _ in range(20):
        direction = rng.normal(size=3)
        origin = -3 * direction / np.linalg.norm(direction) + rng.normal(size=3) * 0.1
        t, position, slope = painted.first_surface(origin, direction)
        np.testing.assert_allclose(position, origin + t * direction, atol=1e-12)
        assert abs(field([position])[0]) < 1e-6 and np.dot(slope, direction) < 0
        before = origin + np.linspace(0, t * (1 - 1e-6), 400)[:, None] * direction
        inside = np.all((before > ORIGIN) & (before < ORIGIN + VOXEL * (np.array(SHAPE) - 1)), axis=1)
        assert np.all(field(before[inside]) > 0)
    assert painted.first_surface((0, 0, 5), (1, 0, 0)) is None


def test_other_grids_are_carried_along(tmp_path):
    shape = (17, 17, 17)
    mean = bumpy_sphere(shape, np.full(3, -0.64), 0.08)
    extra = np.random.default_rng(1).random(shape).astype(np.float32)
    source = {"mean": mean, "density": extra, "var": extra + 1, "origin": (-0.64,) * 3, "voxel_size": 0.08}
    gn.write_vdb(tmp_path / "a.vdb", source)
    painted = gn.PaintedFields(tmp_path / "a.vdb", sigma_grid="var", sigma_meaning="variance", sigma_factor=2)
    painted.apply("deviation", "add", [(0, 0, 0)], radius=0.2, value=3)
    got = grids(painted, tmp_path / "b.vdb")
    assert np.array_equal(got["density"], extra) and np.array_equal(got["var"], extra + 1)
    far = np.linalg.norm(np.stack(np.meshgrid(*[np.arange(-8, 9) * 0.08] * 3, indexing="ij")), axis=0) > 0.2
    np.testing.assert_allclose(got["sigma"][far], 2 * np.sqrt(extra + 1)[far], rtol=1e-6)
    painted.reset("deviation")
    np.testing.assert_allclose(grids(painted, tmp_path / "c.vdb")["sigma"], 2 * np.sqrt(extra + 1), rtol=1e-6)


@pytest.mark.parametrize(
    ("call", "sentence"),
    [
        (lambda f: f.apply("mean", "comb", [(0, 0, 0)], radius=1), "operation does not go with channel: 'mean' takes"),
        (lambda f: f.apply("colour", "set", [(0, 0, 0)], radius=1), "channel is 'colour'; it takes 'mean', 'deviation'"),
        (lambda f: f.apply("deviation", "set", [(0, 0, 0)], radius=1, value=0), "value is 0; it takes a number from 1e-12"),
        (lambda f: f.apply("deviation", "set", [(0, 0, 0)], radius=1), "value is missing: 'set' takes what to paint"),
        (lambda f: f.apply("mean", "smooth", [(0, 0, 0)], radius=0), "radius of dab 0 is 0; it takes a positive number"),
        (lambda f: f.apply("mean", "smooth", [(0, 0, 0)], radius=1, strength=2), "strength of dab 0 is 2"),
        (lambda f: f.apply("mean", "smooth", [(0, 0, 0)], radius=[1, 2]), "radius takes a number, or one for each of the 1"),
        (
            lambda f: f.apply("anisotropy", "comb", [(0, 0, 0)], radius=1, directions=[(0, 0, 0)]),
            "directions of dab 0 is (0, 0, 0); it takes a direction",
        ),
        (
            lambda f: f.apply("anisotropy", "comb", [(0, 0, 0)], radius=1, directions=[(1, 0, 0)], ratios=(200, 1, 1)),
            "the longest is at most 100 times the shortest",
        ),
        (lambda f: f.apply("albedo", "set", [(0, 0, 0)], radius=1, value=(2, 0, 0)), "value (colour) is 2"),
        (lambda f: f.apply("mean", "smooth", [(0, 0, 0)], radius=1, falloff="soft"), "falloff is 'soft'; it takes 'smooth'"),
        (lambda f: f.apply("mean", "smooth", [(0, 0, 0)], radius=1, curve=[1]), "curve has 1 values; it takes at least two"),
        (lambda f: f.extend([(0, 0, 0), (1e6, 0, 0)]), "nodes, at most"),
        (lambda f: f.resample(1e-6), "voxel_size is 1e-06"),
        (lambda f: f.mirror("mean", 3), "axis is 3; it takes 0, 1 or 2"),
        (lambda f: f.write("nowhere/x.vdb"), 'There is no folder "nowhere"'),
    ],
)
def test_sentences(painted, call, sentence):
    with pytest.raises((ValueError, FileNotFoundError)) as caught:
        call(painted)
    assert sentence in str(caught.value)


def test_an_albedo_tints_the_material(tmp_path):
    """A constant albedo is the material's colour times it, to the last digit; a painted one is there in the albedo pass."""

    def render(color, **painted):
        process = gn.GaussianProcess(gn.SphereField((0, 0, 0), 0.8), 0.02, gn.SquaredExponential(0.3))
        entry = {"name": "o", "type": "gpis", "process": process, "matrix": np.eye(4), "materials": ["m"], **painted}
        matrix = np.eye(4)
        matrix[2, 3] = 4
        camera = {"type": "orthographic", "matrix": matrix, "width": 2.0}
        material = {"type": kind, "color": color, **({} if kind in ("lambert", "mirror") else {"roughness": 0.5})}
        scene = {"version": 1, "camera": camera, "world": {"color": (1, 1, 1)}, "materials": {"m": material}}
        return gn.render(gn.Scene(scene | {"objects": [entry]}), 12, 12, samples=16).passes

    for kind in ("lambert", "mirror", "conductor", "principled"):
        tinted = render((0.8, 0.5, 1.0), albedo=gn.ColorField(0.5, 1.0, 0.25))
        plain = render((0.4, 0.5, 0.25))
        for name in ("combined", "albedo"):
            np.testing.assert_allclose(tinted[name], plain[name], rtol=1e-6, atol=1e-7, err_msg=f"{kind} {name}")
    kind = "lambert"
    half = gn.BoxField((1, 0, 0), (2, 4, 4)).clamped(0, 0.01)  # 0 for x > 0
    passes = render((1, 1, 1), albedo=gn.ColorField(100.0 * half, 1, 1))
    middle = passes["albedo"][6]
    assert middle[4, 0] == pytest.approx(1) and middle[8, 0] == pytest.approx(0) and middle[8, 1] == pytest.approx(1)
    with pytest.raises(ValueError, match=r"objects\[0\].albedo must be a ColorField, it is a float"):
        render((1, 1, 1), albedo=0.5)
    with pytest.raises(ValueError, match="ColorField: red goes from -0.5 to"):
        gn.ColorField(gn.SphereField((0, 0, 0), 0.5), 1, 1)
