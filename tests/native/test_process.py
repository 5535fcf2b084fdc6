"""The process on a line against exact answers (design oracles, numbered as there) and against explicit realisations."""

import gpis_native as gn
import numpy as np
import pytest
from line_samplers import SAMPLERS as ALL_SAMPLERS
from line_samplers import worth
from statistics_checks import check_proportion, check_same_distribution, check_z

pytestmark = pytest.mark.stats
SAMPLERS = ["convolution", "dense"]
EVERY = ALL_SAMPLERS["squared exponential"]
LINE = ((-1, -1, -1), (12, 1, 1))  # bounds around the x axis, short enough for the dense sampler


@pytest.fixture
def n(full_size):
    return 2_000_000 if full_size else 200_000


def along_x(n, x=0.0):
    origins = np.zeros((n, 3))
    origins[:, 0] = x
    return origins, np.tile([1.0, 0.0, 0.0], (n, 1))


def standard(mean=0.0, sigma=1.0, bounds=LINE, length_scale=1.0):
    return gn.GaussianProcess(mean, sigma, gn.SquaredExponential(length_scale), bounds=bounds)


@pytest.mark.parametrize("sampler", EVERY)
@pytest.mark.parametrize(
    ("start", "memory", "survival"),
    [
        ("outside", "renewal+", [0.84229, 0.69407, 0.45573, 0.12893, 0.03639]),
        ("surface", "renewal", [0.96922, 0.88063, 0.61086, 0.17080, 0.04818]),
        ("slope 1", "renewal+", [0.99669, 0.88074, 0.58803, 0.16682, 0.04701]),
    ],
)
def test_survival_of_the_squared_exponential(sampler, start, memory, survival, n, seed):
    """Oracle 6: brute force over 1.4 million paths, standard error 4e-4."""
    n = worth("squared exponential", sampler, n)
    origins, directions = along_x(n)
    state = None
    if start != "outside":
        state = {"value": np.zeros(n), "gradient": np.tile([1.0, 0.3, -0.2], (n, 1))}
    hits = gn.first_hits(standard(), origins, directions, 9, memory=memory, start=state, sampler=sampler, seed=seed)
    times = [0.5, 1, 2, 5, 8]
    check_proportion([np.sum(hits["t"] > t) for t in times], n, survival, 4e-4, f"{sampler}, {start}")


@pytest.mark.parametrize("sampler", SAMPLERS)
@pytest.mark.parametrize("start", ["outside", "value and slope"])
def test_implied_correlation(sampler, start, n, seed):
    """Correlation of the values that a render's own line takes, at nodes, between them and across many cells.

    The mean of 5 deviations keeps every path outside; the tolerance makes the sampler draw there.
    """
    gp, (origins, directions) = standard(5.0), along_x(n)
    t = np.array([0.05, 0.3, 0.5, 0.77, 1.0, 1.9, 2.6, 4.0])
    state = None
    if start != "outside":
        state = {"value": np.full(n, 5.5), "gradient": np.tile([-0.4, 0.1, 0.2], (n, 1))}
    g = gn.line_values(gp, origins, directions, t, start=state, sampler=sampler, tolerance=1e-6, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > 0.999 * n
    lag = t[:, None] - t
    covariance = np.exp(-(lag**2) / 2)
    mean = np.zeros(len(t))
    if start != "outside":  # condition on value .5 and slope -.4 at 0
        k = np.exp(-(t**2) / 2)
        mean = k * (0.5 - 0.4 * t)
        covariance = covariance - np.outer(k, k) * (1 + np.outer(t, t))
    m = len(g)
    deviation = np.sqrt(np.diag(covariance))
    check_z(g.mean(axis=0), mean, deviation / np.sqrt(m), "mean")
    centred = g - mean
    # What each sampler states of its own: the dense one is a quintic between points, off by 1e-4 deviations.
    stated = {"convolution": 1e-7, "dense": 1e-4}[sampler] * np.add.outer(deviation, deviation)
    error = np.sqrt((np.outer(deviation, deviation) ** 2 + covariance**2) / m)
    difference = np.maximum(np.abs(centred.T @ centred / m - covariance) - stated, 0)
    check_z(difference, 0, error, "covariance")


@pytest.mark.parametrize("sampler", ["convolution", "dense", "spectral", "nystrom", "realisation"])
def test_conditioned_start_at_tiny_distances(sampler, seed):
    """Oracle 8: Var f = q⁴/2 close to a start with known value and slope, down to q = 1e-8, far below the rounding of what
    samplers add up."""
    n = worth("squared exponential", sampler, 100_000)
    origins, directions = along_x(n)
    state = {"value": np.zeros(n), "gradient": np.tile([1.0, 0, 0], (n, 1))}
    t = np.array([1e-8, 1e-6, 1e-4, 1e-3, 1e-2])
    v = gn.line_values(standard(), origins, directions, t, start=state, sampler=sampler, seed=seed)
    ratio = np.mean((v - t * np.exp(-(t**2) / 2)) ** 2, axis=0) / (t**4 / 2)
    check_z(ratio, 1, np.sqrt(2 / n))


@pytest.mark.parametrize("memory", ["renewal", "renewal+", "none"])
def test_samplers_agree_over_a_curved_mean(memory, n, seed):
    """Two samplers, the same law of (t, gradient) at the first and the second hit (test_samplers_agree.py has the others)."""
    kernel = gn.SquaredExponential([0.3, 0.15, 0.2], rotation=[0.9, 0.3, -0.2, 0.1])
    bounds = ((-1.5, -1.5, -1.5), (1.5, 1.5, 1.5))
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 0.12, kernel, bounds=bounds)
    rng = np.random.default_rng(seed)
    m = n // 4
    origins = np.column_stack([rng.uniform(-0.6, 0.6, (m, 2)), np.full(m, 3.0)])
    directions = np.array([0.2, -0.1, -1.0]) + rng.normal(0, 0.05, (m, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    results = {}
    for i, sampler in enumerate(SAMPLERS):
        first = gn.first_hits(gp, origins, directions, 10, sampler=sampler, seed=seed + 10 * i)
        hit = np.isfinite(first["t"])
        normal = first["gradient"][hit] / np.linalg.norm(first["gradient"][hit], axis=1, keepdims=True)
        d = directions[hit]
        out = d - 2 * np.sum(d * normal, axis=1, keepdims=True) * normal
        state = {"value": first["state"]["value"][hit], "gradient": first["state"]["gradient"][hit]}
        second = gn.first_hits(
            gp, first["position"][hit], out, 10, memory=memory, start=state, sampler=sampler, seed=seed + 10 * i + 5
        )
        results[sampler] = first, second
    for k, which in enumerate(["first", "second"]):
        a, b = results["convolution"][k], results["dense"][k]
        check_same_distribution(a["t"], b["t"], f"{which} t")
        for axis in range(3):
            pair = [h["gradient"][np.isfinite(h["t"]), axis] for h in (a, b)]
            check_same_distribution(*pair, f"{which} gradient {axis}")


@pytest.mark.parametrize("sampler", SAMPLERS)
def test_first_hit_of_explicit_realisations(sampler, full_size, seed):
    """A mean and a deviation that vary, drawn jointly by numpy on a grid of ℓ/40 to find changes of sign."""
    n = 40_000 if full_size else 10_000
    x = np.linspace(0, 3, 241)  # ℓ = .5
    centre, radius, sigma_slope = 2.6, 1.0, 0.15
    mean = np.abs(x - centre) - radius
    sigma = 0.2 + sigma_slope * x
    covariance = np.outer(sigma, sigma) * np.exp(-((x[:, None] - x) ** 2) / (2 * 0.25))
    values, vectors = np.linalg.eigh(covariance)
    factor = vectors * np.sqrt(np.maximum(values, 0))
    f = mean + np.random.default_rng(seed).normal(size=(2 * n, len(x))) @ factor.T
    f = f[f[:, 0] > 0][:n]  # a ray from outside
    below = f < 0
    first = np.argmax(below, axis=1)
    rows = np.arange(len(f))
    a, b = f[rows, np.maximum(first - 1, 0)], f[rows, first]
    step = x[1] - x[0]
    expected = np.where(below.any(axis=1), x[first] - step * b / np.where(a > b, b - a, -1), np.inf)
    # The deviation is a plane, unbounded over all space: say where it is used.
    gp = gn.GaussianProcess(
        gn.SphereField([centre, 0, 0], radius),
        (gn.PlaneField([0, 0, 0], [1, 0, 0], sigma_slope) + gn.ConstantField(0.2)).clamped(0, 0.66),
        gn.SquaredExponential(0.5),
        bounds=((0, -1, -1), (3, 1, 1)),
    )
    hits = gn.first_hits(gp, *along_x(len(f)), 3, sampler=sampler, seed=seed)
    check_same_distribution(hits["t"], expected)


@pytest.mark.parametrize("sigma", [0.0, 1e-12])
def test_certain_surface(sigma, seed):
    """Oracle 17: σ → 0 is the mean itself; nothing is drawn at σ = 0."""
    rng = np.random.default_rng(seed)
    origins = np.column_stack([rng.uniform(-1.2, 1.2, (5000, 2)), np.full(5000, 3.0)])
    directions = np.tile([0.0, 0.0, -1.0], (5000, 1))
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), sigma, gn.SquaredExponential(0.3))
    hits = gn.first_hits(gp, origins, directions, 10, seed=seed)
    b2 = np.sum(origins[:, :2] ** 2, axis=1)
    clear = np.abs(b2 - 1) > 1e-9
    expected = np.where(b2 < 1, 3 - np.sqrt(np.maximum(1 - b2, 0)), np.inf)
    assert np.array_equal(np.isfinite(hits["t"])[clear], (b2 < 1)[clear])
    hit = np.isfinite(hits["t"]) & clear
    # The root moves by σ over the slope, which vanishes for rays that graze.
    np.testing.assert_allclose(hits["t"][hit], expected[hit], atol=1e-9 + 100 * sigma / np.sqrt(1 - b2[hit]).min())
    if sigma == 0:
        np.testing.assert_allclose(hits["gradient"][hit], hits["position"][hit], atol=1e-9)
        normals = hits["counters"]["line_normals"]
        assert normals == 2 * np.isfinite(hits["t"]).sum()  # only the draw from the (certain) gradient law


def test_hits_on_grids_arrive_from_outside(seed):
    """Definitions E8: with trilinear mean and deviation and the cell's own gradient, ∂_d f <= 0 at every hit."""
    rng = np.random.default_rng(seed)
    axis = np.linspace(-1.5, 1.5, 17)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    mean = gn.GridField(np.sqrt(x**2 + y**2 + z**2) - 1 + rng.normal(0, 0.05, x.shape), axis[1] - axis[0], [-1.5] * 3)
    sigma = gn.GridField(rng.uniform(0.02, 0.25, x.shape), axis[1] - axis[0], [-1.5] * 3)
    gp = gn.GaussianProcess(mean, sigma, gn.SquaredExponential(0.3))
    m = 50_000
    directions = rng.normal(size=(m, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    origins = -3 * directions + rng.uniform(-0.8, 0.8, (m, 3))
    hits = gn.first_hits(gp, origins, directions, 10, seed=seed)
    hit = np.isfinite(hits["t"])
    assert hit.sum() > 0.3 * m
    assert np.all(np.sum(hits["gradient"][hit] * directions[hit], axis=1) <= 0)
    assert hits["counters"]["line_slope_floor"] == 0


def test_grid_mean_equals_the_field_it_holds(n, seed):
    """A plane is exact on a grid: the march through cells and the march in steps of ℓ/2 give one law."""
    axis = np.linspace(-1, 1, 21)
    x, y, z = np.meshgrid(axis, axis, axis, indexing="ij")
    grid = gn.GridField(0.6 * y + 0.8 * z, 0.1, [-1.0] * 3)
    direction = np.array([0.3, -0.2, -1.0]) / np.linalg.norm([0.3, -0.2, -1.0])
    origins, directions = np.tile([-0.3, 0.2, 0.95], (n, 1)), np.tile(direction, (n, 1))
    hits = [
        gn.first_hits(
            gn.GaussianProcess(mean, 0.15, gn.SquaredExponential(0.4), bounds=((-1, -1, -1), (1, 1, 1))),
            origins,
            directions,
            5,
            seed=seed + i,
        )
        for i, mean in enumerate([grid, gn.PlaneField([0, 0, 0], [0, 0.6, 0.8], 1)])
    ]
    # Clear stretches of voxels are crossed in one step on the grid, and only there.
    assert hits[0]["counters"]["line_cells_clear"] > 0 == hits[1]["counters"]["line_cells_clear"]
    check_same_distribution(hits[0]["t"], hits[1]["t"])
    for axis in range(3):
        check_same_distribution(*(h["gradient"][np.isfinite(h["t"]), axis] for h in hits))


def test_what_is_not_needed_is_not_done(seed):
    """Counters of the code that does the work: a constant deviation is never looked up, one factor serves all lines of the
    dense sampler (test_every_sampler.py has the rest)."""
    sphere, kernel = gn.SphereField([0, 0, 0], 1), gn.SquaredExponential(0.1)
    origins, directions = np.tile([0.0, 0, 3], (1000, 1)), np.tile([0.0, 0, -1], (1000, 1))
    gp = gn.GaussianProcess(sphere, 0.05, kernel, bounds=((-1.5, -1.5, -1.5), (1.5, 1.5, 1.5)))
    assert gn.first_hits(gp, origins, directions, 10, seed=seed)["counters"]["sigma_lookups"] == 0
    varying = gn.GaussianProcess(sphere, (gn.PlaneField([0, 0, 0], [0, 0, 1], 1e-3) + 0.05).clamped(0.01, 1), kernel)
    assert gn.first_hits(varying, origins, directions, 10, seed=seed)["counters"]["sigma_lookups"] > 0
    dense = gn.first_hits(gp, origins, directions, 10, sampler="dense", seed=seed)["counters"]
    assert dense["factorisations"] <= 1  # the first use in this process, for all its rays


def test_streams_depend_on_the_row_alone(seed):
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 0.2, gn.SquaredExponential(0.3))
    origins, directions = np.tile([0.1, 0.2, 3], (2000, 1)), np.tile([0.0, 0, -1], (2000, 1))
    whole = gn.first_hits(gp, origins, directions, 10, seed=seed, threads=1)
    part = gn.first_hits(gp, origins[700:], directions[700:], 10, seed=seed, first_index=700, threads=2)
    np.testing.assert_array_equal(whole["t"][700:], part["t"])
    np.testing.assert_array_equal(whole["gradient"][700:], part["gradient"])
    other = gn.first_hits(gp, origins, directions, 10, seed=seed + 1)
    assert np.mean(whole["t"] == other["t"]) < 0.01


@pytest.mark.parametrize(
    ("make", "sentence"),
    [
        (lambda: gn.SquaredExponential(0), "length_scale must be positive"),
        (lambda: gn.SquaredExponential([1, 2]), "three numbers"),
        (lambda: gn.GaussianProcess(0, -1, gn.SquaredExponential(1)), "sigma must not be negative"),
        (lambda: gn.GaussianProcess("x", 1, gn.SquaredExponential(1)), "mean must be a field or a number"),
        (
            lambda: gn.GaussianProcess(0, 1, gn.SquaredExponential(1), bounds=((0, 0, 0), (1, 0, 1))),
            "min must be below",
        ),
        (lambda: gn.first_hits(standard(), [[0, 0, 0]], [[2, 0, 0]], 1), "must have length 1"),
        (lambda: gn.first_hits(standard(), [[0, 0, np.nan]], [[1, 0, 0]], 1), "is not finite"),
        (lambda: gn.first_hits(standard(), [[0, 0, 0]], [[1, 0, 0]], 1, memory="all"), "'renewal+'"),
        (lambda: gn.first_hits(standard(), [[0, 0, 0]], [[1, 0, 0]], 1, start={"valeu": [0]}), "unknown key 'valeu'"),
        (lambda: gn.first_hits(standard(bounds=None), [[0, 0, 0]], [[1, 0, 0]], 1, sampler="dense"), "smaller bounds"),
        (lambda: gn.SquaredExponential("x"), "length_scale must be a number or three numbers, it is 'x'"),
        (lambda: gn.SquaredExponential(1, rotation="x"), "rotation must be a quaternion"),
        (lambda: gn.SquaredExponential(1).derivative_variance([1, np.nan, 0]), "direction must hold finite numbers"),
        (lambda: gn.first_hits(None, [[0, 0, 0]], [[1, 0, 0]], 1), "gp must be a GaussianProcess or a CSG tree of them"),
        (lambda: gn.line_values(None, [[0, 0, 0]], [[1, 0, 0]], [1]), "gp must be a GaussianProcess"),
        (lambda: gn.first_hits(standard(), [[0, 0, 0]], [[1, 0, 0]], 1, threads=10**6), "it is 1000000"),
        (lambda: gn.first_hits(standard(), [[0, 0, 0]], [[1, 0, 0]], 1, start={1: 2}), "unknown key '1'"),
        (lambda: gn.GaussianProcess(0, 0, gn.SquaredExponential(1)).plan(), "mean and sigma are both 0 everywhere"),
    ],
)
def test_bad_input_gets_a_sentence(make, sentence):
    with pytest.raises(ValueError, match=sentence):
        make()


def test_none_is_no_field():
    with pytest.raises(TypeError):
        gn.SphereField([0, 0, 0], 1) + None


def test_no_points_have_empty_samples():
    assert standard().sample(np.zeros((0, 3)), 3).shape == (3, 0)


@pytest.mark.parametrize("direction", [1, -1])
def test_where_mean_and_sigma_are_zero_there_is_no_surface(direction):
    """Only the faces at which the mean falls to 0 are met, with the gradient of the side the ray comes from."""
    z = np.linspace(-2, 2, 9)
    slab = np.where(np.abs(z) < 1, 0, np.abs(z) - 1) * np.ones((9, 9, 1))
    gp = gn.GaussianProcess(gn.GridField(slab, 0.5, [-2, -2, -2]), 0, gn.SquaredExponential(1))
    hits = gn.first_hits(gp, [[0.1, 0.2, 0.0], [0.1, 0.2, -1.9 * direction]], [[0, 0, direction]] * 2, 10)
    np.testing.assert_allclose(hits["t"], [np.inf, 0.9], atol=1e-9)
    np.testing.assert_allclose(hits["gradient"][1], [0, 0, -direction], atol=1e-6)


@pytest.mark.parametrize("memory", ["outside", "renewal+"])
def test_roots_are_not_missed(memory, full_size, seed):
    """Behind no hit's back: the path that a render took is nowhere inside before its hit, for all but 1e-3 of the rays."""
    n = 200_000 if full_size else 20_000
    rng = np.random.default_rng(seed)
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 0.05, gn.SquaredExponential(0.1))
    origins = np.column_stack([rng.uniform(-1.1, 1.1, (n, 2)), np.full(n, 2.0)])
    directions, state, t = np.tile([0.0, 0.0, -1.0], (n, 1)), None, np.arange(0.7, 3.3, 0.003)
    if memory != "outside":  # rays that graze the surface they left
        origins = origins / np.linalg.norm(origins, axis=1, keepdims=True)
        directions = np.cross(origins, rng.normal(size=(n, 3))) + 0.1 * np.abs(rng.normal(size=(n, 1))) * origins
        directions /= np.linalg.norm(directions, axis=1, keepdims=True)
        gradient = origins + 0.5 * rng.normal(size=(n, 3))
        gradient *= np.sign(np.sum(gradient * directions, axis=1, keepdims=True))
        state, t = {"value": np.zeros(n), "gradient": gradient}, np.arange(0.003, 1, 0.003)
    options = {"start": state, "seed": seed}
    hits = gn.first_hits(gp, origins, directions, t[-1], **options)
    values = gn.line_values(gp, origins, directions, t, **options)
    inside = np.nanmin(np.column_stack([values, np.ones(n)]), axis=1) < 0
    assert np.isfinite(hits["t"]).mean() > 0.2
    assert np.mean(inside) < 1e-3, f"{inside.sum()} of {n} rays passed through"


def test_a_length_scale_that_no_ray_gets_through_gets_a_sentence():
    """Every ray would be ended on its way to the surface, after a million steps."""
    sphere = gn.SphereField((0, 0, 0), 1)
    with pytest.raises(ValueError, match="The length scale 1e-30 is so small against the standard deviation 0.04"):
        gn.first_hits(gn.GaussianProcess(sphere, 0.04, gn.SquaredExponential(1e-30)), [(0, 0, 3)], [(0, 0, -1)], 10.0)
    # A thin skin of tiny bumps is another matter, and so is a medium: no way to its surfaces.
    skin = gn.GaussianProcess(sphere, 1e-7, gn.SquaredExponential(1e-6))
    medium = gn.GaussianProcess(gn.ConstantField(0.1), 1.0, gn.SquaredExponential(1e-9))
    for process in (skin, medium):
        hits = gn.first_hits(process, [(0, 0, 3)] * 20, [(0, 0, -1)] * 20, 10.0)
        assert np.isfinite(hits["t"]).all() and hits["counters"]["line_step_limit"] == 0


def test_the_plan_says_where_bounds_cut_the_surface():
    """Definitions B4: rays that come in through bounds start outside, however likely that is there."""

    def bounds_of(side, sigma=0.1):
        cube = ((-side,) * 3, (side,) * 3)
        return gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), sigma, gn.SquaredExponential(0.1), bounds=cube).plan()["bounds"]

    assert bounds_of(2) == bounds_of(1.1, 0) == "the surface is absent at them"
    assert bounds_of(1.4) == "the surface is all but absent at them: inside with probability 3.17e-05 at most"
    for side, probability in ((1.2, "0.0228"), (1.0, "0.5"), (0.9, "0.841")):
        text = bounds_of(side)
        assert text.startswith("cut the surface: at (") and f"inside with probability {probability}," in text
    assert gn.GaussianProcess(1.0, 0.1, gn.SquaredExponential(0.1)).plan()["bounds"].startswith("none")
