"""The joint samplers: lines of processes whose length scales vary, and of kernels that no other sampler serves."""

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_same_distribution, check_z
from tensor_grids import VARYING, along_x, isotropic

pytestmark = pytest.mark.stats

# Issue "the process, exact", must show 6.
FIELDS = VARYING
KERNELS = {
    "se": gn.SquaredExponential(1),
    "rq": gn.RationalQuadratic(1, 1),
    "matern 3/2": gn.Matern(1.5, 1),
    "matern 5/2": gn.Matern(2.5, 1),
    "wong": gn.Wong(1),
}
BOUNDS = ((-2, -2, -2), (8, 2, 2))
PLACE = np.array([0.3, -0.2, 0.1])


def process(field, kernel="se", mean=0.0, sigma=1.0):
    return gn.GaussianProcess(mean, sigma, KERNELS[kernel], anisotropy=FIELDS[field], bounds=BOUNDS)


def along(n, direction=(1.0, 0, 0), origin=(0.0, 0, 0)):
    return np.tile(origin, (n, 1)), np.tile(direction, (n, 1))


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("field", FIELDS)
def test_representation_error(field, kernel):
    """What the sampler that `auto` picks states, from the covariances of its own rows: no randomness in it."""
    plan = process(field, kernel).plan()
    assert plan["sampler"].startswith("nystrom" if kernel in ("se", "rq") else "dense")
    assert 0 < float(plan["correlation_error"]) < 1e-3


@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("field", FIELDS)
def test_implied_correlation(field, kernel, full_size, seed):
    """Values that a render's own line takes, against the covariance of Paciorek and Schervish (test_covariance.py)."""
    n = (40_000 if full_size else 4_000) // (1 if kernel == "se" else 4)
    direction = np.array([0.96, 0.28, 0])
    t = np.array([0.05, 0.4, 1.0, 1.7, 2.3, 2.6, 3.1, 4.5])
    g = gn.line_values(process(field, kernel, 5.0), *along(n, direction), t, tolerance=1e-6, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > 0.99 * n
    k = process(field, kernel).covariance(t[:, None] * direction, t[:, None] * direction)
    error = np.sqrt((np.outer(np.diag(k), np.diag(k)) + k**2) / len(g))
    check_z(np.maximum(np.abs(g.T @ g / len(g) - k) - 1e-3, 0), 0, error, "covariance")
    check_z(g.mean(axis=0), 0, 1 / np.sqrt(len(g)), "mean")


def grid(length_at, nodes=41):
    """Lengths that vary in three dimensions, over a cube from -1 to 1."""
    axis = np.linspace(-1, 1, nodes)
    length = length_at(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1))
    entries = np.concatenate([np.repeat((length**2)[..., None], 3, -1), np.zeros((*length.shape, 3))], -1)
    return gn.TensorGridField(entries, axis[1] - axis[0], [-1] * 3)


def dab(x, at=PLACE, radius=0.3, long=0.5, short=0.05):
    """Painted with a brush: smooth, from long to short."""
    q = np.clip(np.linalg.norm(x - at, axis=-1) / radius, 0, 1)
    return long * (short / long) ** ((1 - q * q) ** 2)


SHORT = {
    "crease": lambda: along_x(lambda x: isotropic(0.1 if abs(x - 2) < 0.05 else 1.0), 8, 101),
    "one node": lambda: grid(lambda x: np.where(np.linalg.norm(x - PLACE, axis=-1) < 0.04, 0.1, 0.5), 21),
    "dab": lambda: grid(dab),
}
WITH_SUM = KERNELS | {"sum": 0.5 * gn.SquaredExponential(1) + 0.5 * gn.Matern(2.5, 1)}


def short_lengths(field, kernel, mean):
    """A process whose lengths are short in one place, and a ray across it: (process, origin, direction, t of the place)."""
    if field == "crease":
        gp = gn.GaussianProcess(mean, 1.0, WITH_SUM[kernel], anisotropy=SHORT[field](), bounds=BOUNDS)
        return gp, np.zeros(3), np.array([0.96, 0.28, 0]), 2 / 0.96
    gp = gn.GaussianProcess(mean, 1.0, WITH_SUM[kernel], anisotropy=SHORT[field](), bounds=((-1,) * 3, (1,) * 3))
    direction = np.array([0.8, 0.36, 0.48])
    return gp, PLACE - 0.7 * direction, direction, 0.7


@pytest.mark.parametrize("kernel", WITH_SUM)
@pytest.mark.parametrize("field", SHORT)
def test_lengths_that_are_short_in_one_place(field, kernel, full_size, seed):
    """At one node, as a fit has them where operands meet, or where a brush was set down: points find the place, steps are
    divided at the kinks of the grid alone, and what lies before it is not forgotten behind it."""
    gp, origin, direction, place = short_lengths(field, kernel, 5.0)
    assert 0 < float(gp.plan()["correlation_error"]) < 1e-3
    n = (10_000 if full_size else 1_600) // (1 if kernel == "se" else 8)
    t = place + np.array([-0.6, -0.3, -0.15, -0.04, 0, 0.004, 0.03, 0.08, 0.2, 0.5])
    g = gn.line_values(gp, *along(n, direction, origin), t, tolerance=1e-6, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > 0.99 * n
    x = origin + t[:, None] * direction
    k = gp.covariance(x, x)
    error = np.sqrt((np.outer(np.diag(k), np.diag(k)) + k**2) / len(g))
    check_z(np.maximum(np.abs(g.T @ g / len(g) - k) - 1e-3, 0), 0, error, "covariance")
    steps = np.diff(np.eye(len(t)), axis=0)
    of_steps = np.diag(steps @ k @ steps.T)
    check_z((np.diff(g, axis=1) ** 2).mean(axis=0) / of_steps, 1, np.sqrt(2 / len(g)) + 1e-3 / of_steps, "increments")


@pytest.mark.parametrize("kernel", ["se", "matern 3/2", "matern 5/2", "wong"])
@pytest.mark.parametrize("field", SHORT)
def test_first_hits_across_short_lengths(field, kernel, full_size, seed):
    """Against paths drawn from the covariance at points that come as close as the lengths do."""
    gp, origin, direction, place = short_lengths(field, kernel, 0.6)
    near, n = (
        np.geomspace(1e-5, 0.5, 120 if kernel == "se" else 320),
        (20_000 if full_size else 2_000) // (1 if kernel == "se" else 2),
    )
    t = np.concatenate([place - near[::-1], [place], place + near])
    x = origin + t[:, None] * direction
    values, vectors = np.linalg.eigh(gp.covariance(x, x))
    paths = 0.6 + np.random.default_rng(seed).normal(size=(2 * n, len(t))) @ (vectors * np.sqrt(np.maximum(values, 0))).T
    paths = paths[paths[:, 0] > 0]
    below = paths < 0
    expected = np.where(below.any(axis=1), t[np.argmax(below, axis=1)] - t[0], np.inf)
    start = origin + t[0] * direction
    hits = gn.first_hits(gp, *along(n, direction, start), 1.0, seed=seed)
    check_same_distribution(hits["t"], expected, "t")
    assert hits["counters"]["line_split_limit"] == hits["counters"]["line_entry_inside"] == 0


@pytest.mark.parametrize("kernel", ["se", "rq"])
def test_steps_across_a_crease(kernel, seed):
    gp = gn.GaussianProcess(
        gn.PlaneField([0, 0, 0], [0, 0, 1]), 0.3, KERNELS[kernel], anisotropy=SHORT["crease"](), bounds=BOUNDS
    )
    counters = hits_twice(gp, 500, "auto", seed)[1]["counters"]
    assert counters["line_split_limit"] == 0
    assert counters["line_evaluations"] < 80 * counters["line_segments"] and counters["line_splits"] > 0


def test_one_length_a_thousandth_of_the_others():
    """Points creep towards it by half of the way, not by a thousandth: lines have hundreds of them, not a million."""
    field = along_x(lambda x: isotropic(1e-3 if abs(x - 2) < 0.05 else 1.0), 8, 101)
    for kernel in (gn.SquaredExponential(1), gn.Matern(2.5, 1)):
        gp = gn.GaussianProcess(5.0, 1.0, kernel, anisotropy=field, bounds=BOUNDS)
        counters = gn.first_hits(gp, *along(20, np.array([1.0, 0, 0]), (0.2, 0.1, 0)), 5, tolerance=1e-6)["counters"]
        assert 20 * 20 < counters["tensor_lookups"] < 1_000 * 20
        assert float(gp.plan()["correlation_error"]) < 1e-3
        # And a thousand times the others: what is surveyed of a line has an end.
        field_of_long = along_x(lambda x: isotropic(1e3 if x > 2 else 1.0), 8, 101)
        gp = gn.GaussianProcess(5.0, 1.0, kernel, anisotropy=field_of_long, bounds=BOUNDS)
        assert float(gp.plan()["correlation_error"]) < 1e-3


# Of many turns or many changes per length scale: rows that all but determine each other, and more of them than are kept.
@pytest.mark.parametrize(
    ("kernel", "sampler", "conditions"),
    [
        (gn.LocallyPeriodic(5, 0.6, [1, 0, 0], 0.5) * gn.Matern(2.5, 5), "auto", False),
        (gn.Matern(2.5, 10) * gn.PlaneWave([30, 0, 0]), "auto", False),
        (0.5 * gn.PlaneWave([30, 0, 0]) + 0.5 * gn.SquaredExponential(0.5), "nystrom", False),
        (0.5 * gn.PlaneWave([60, 0, 0]) + 0.5 * gn.SquaredExponential(0.5), "auto", True),
    ],
    ids=str,
)
def test_kernels_of_two_scales(kernel, sampler, conditions, full_size, seed):
    n, t = 2_000 if full_size else 150, np.array([0.05, 0.36, 0.67, 0.98, 1.3, 1.6, 1.9])
    far = {"points": [[-1.4, 0.9, 0.9]], "values": [5.1]} if conditions else None
    gp = gn.GaussianProcess(5.0, 1.0, kernel, bounds=((-1.5,) * 3, (1.5,) * 3), conditions=far)
    direction, origin = np.array([0.96, 0.28, 0]), np.array([-1.3, -0.3, 0.05])
    g = gn.line_values(gp, *along(n, direction, origin), t, tolerance=1e-6, sampler=sampler, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > 0.99 * n
    x, mean = origin + t[:, None] * direction, 0
    k = kernel(x, x)
    if conditions:
        at = np.array(far["points"])
        weights = kernel(x, at) / kernel(at, at)
        mean, k = 0.1 * weights[:, 0], k - weights @ kernel(at, x)
    check_z(g.mean(axis=0), mean, np.sqrt(np.diag(k) / len(g)), "mean")
    g = g - mean
    error = np.sqrt((np.outer(np.diag(k), np.diag(k)) + k**2) / len(g))
    check_z(np.maximum(np.abs(g.T @ g / len(g) - k) - 1e-3, 0), 0, error, "covariance")


def test_dense_lines_of_smooth_kernels(full_size, seed):
    """Points so close, over so many length scales, that rounding once grew to a thousand deviations."""
    n, kernel = 10_000 if full_size else 600, gn.LocallyPeriodic(0.3, 0.5, [0, 0.6, 0.8], 0.9)
    gp = gn.GaussianProcess(5.0, 1, kernel, bounds=((-1, -1, -1), (1, 1, 1)))
    direction, t = np.array([0.2, -0.3, -1.0]) / np.linalg.norm([0.2, -0.3, -1.0]), np.arange(0.02, 1.4, 0.15)
    g = gn.line_values(gp, *along(n, direction, -direction), t, tolerance=1e-6, sampler="dense", seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > 0.99 * n
    x = t[:, None] * direction
    k = kernel(x, x)
    check_z(g.T @ g / len(g), k, np.sqrt((1 + k**2) / len(g)) + 1e-4, "covariance")


def test_implied_correlation_given_value_and_slope(full_size, seed):
    """A start with known value and gradient: the conditional law of the design (math.md §3), by numpy."""
    n, t = 20_000 if full_size else 4_000, np.array([0.02, 0.3, 0.9, 2.0])
    direction = np.array([0.6, 0.8, 0])
    gradient = np.array([0.4, -0.5, 0.3])
    start = {"value": np.full(n, 5.5), "gradient": np.tile(gradient, (n, 1))}
    gp = process("rotating 3:1", mean=5.0)
    g = gn.line_values(gp, *along(n, direction), t, start=start, tolerance=1e-6, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    x, zero = t[:, None] * direction, np.zeros((1, 3))
    data = gp.joint_covariance(zero, zero)[0, 0]
    cross = gp.joint_covariance(x, zero)[:, 0, 0]
    weights = np.linalg.solve(data, cross.T).T
    mean = weights @ [0.5, *gradient]
    k = gp.covariance(x, x) - weights @ cross.T
    sd = np.sqrt(np.diag(k))
    check_z(g.mean(axis=0), mean, sd / np.sqrt(len(g)), "mean")
    c = g - mean
    check_z(c.T @ c / len(g) / np.outer(sd, sd), k / np.outer(sd, sd), np.sqrt(2 / len(g)), "covariance")


def hits_twice(gp, n, sampler, seed, memory="renewal+"):
    """First hits from above and, reflected, the second ones."""
    rng = np.random.default_rng(seed)
    origins = np.column_stack([rng.uniform(0, 5, n), rng.uniform(-1, 1, n), np.full(n, 1.9)])
    directions = np.array([0.3, 0.1, -1.0]) + rng.normal(0, 0.1, (n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    first = gn.first_hits(gp, origins, directions, 10, sampler=sampler, seed=seed)
    hit = np.isfinite(first["t"])
    d, g = directions[hit], first["gradient"][hit]
    assert np.all(np.sum(d * g, axis=1) <= 0)
    normal = g / np.linalg.norm(g, axis=1, keepdims=True)
    out = d - 2 * np.sum(d * normal, axis=1, keepdims=True) * normal
    state = {"value": first["state"]["value"][hit], "gradient": first["state"]["gradient"][hit]}
    at = first["position"][hit]
    second = gn.first_hits(gp, at, out, 10, memory=memory, start=state, sampler=sampler, seed=seed + 5)
    found = np.isfinite(second["t"])
    assert np.all(np.sum(out[found] * second["gradient"][found], axis=1) <= 0)
    assert first["counters"]["line_slope_floor"] == second["counters"]["line_slope_floor"] == 0
    return first, second


def check_same_hits(a, b):
    for which, x, y in zip(["first", "second"], a, b, strict=True):
        check_same_distribution(x["t"], y["t"], f"{which} t")
        for axis in range(3):
            pair = [h["gradient"][np.isfinite(h["t"]), axis] for h in (x, y)]
            check_same_distribution(*pair, f"{which} gradient {axis}")


@pytest.mark.parametrize("memory", ["renewal+", "renewal"])
@pytest.mark.parametrize("sampler", ["nystrom", "dense"])
def test_agrees_with_the_convolution_sampler(sampler, memory, full_size, seed):
    """A stationary process: by itself, and as a constant tensor field."""
    n = 20_000 if full_size else 3_000
    mean = gn.PlaneField([0, 0, 0], [0.1, 0, 1], 1)
    alone = gn.GaussianProcess(mean, 0.3, gn.SquaredExponential([0.8, 0.5, 0.5]), bounds=BOUNDS)
    field = along_x(lambda x: np.array([0.64, 0.25, 0.25, 0, 0, 0]), 8, 3)
    as_field = gn.GaussianProcess(mean, 0.3, KERNELS["se"], anisotropy=field, bounds=BOUNDS)
    check_same_hits(hits_twice(alone, n, "convolution", seed, memory), hits_twice(as_field, n, sampler, seed + 100, memory))


@pytest.mark.parametrize("field", FIELDS)
def test_first_hit_of_explicit_realisations(field, full_size, seed):
    """Jointly drawn at 300 points of the line, changes of sign found between them."""
    n, direction = 20_000 if full_size else 3_000, np.array([0.8, 0.6, 0])
    gp = process(field, mean=0.3)
    t = np.linspace(0, 3, 301)
    f = gp.sample(t[:, None] * direction, 2 * n, seed)
    f = f[f[:, 0] > 0][:n]
    below = f < 0
    first, rows = np.argmax(below, axis=1), np.arange(len(f))
    a, b = f[rows, np.maximum(first - 1, 0)], f[rows, first]
    expected = np.where(below.any(axis=1), t[first] - 0.01 * b / np.where(a > b, b - a, -1), np.inf)
    hits = gn.first_hits(gp, *along(len(f), direction), 3, seed=seed)
    check_same_distribution(hits["t"], expected)


def test_gradient_at_a_hit_given_the_start(full_size, seed):
    """A mean so steep that every path hits at t = 1.3: the law of the whole gradient there given value and gradient at
    the start, by numpy."""
    n, direction, steep = 20_000 if full_size else 4_000, np.array([0.6, 0.8, 0]), 1e4
    gp = process("rotating 3:1", mean=gn.PlaneField(1.3 * direction, direction, -steep))
    g0 = np.array([0.4, 0.5, -0.9, 0.7])  # of g
    gradient = g0[1:] - steep * direction
    start = {"value": np.full(n, 1.3 * steep + g0[0]), "gradient": np.tile(gradient, (n, 1))}
    hits = gn.first_hits(gp, *along(n, direction), 10, start=start, seed=seed)
    np.testing.assert_allclose(hits["t"], 1.3, atol=1e-3)
    g = hits["gradient"] + steep * direction
    x, zero = 1.3 * direction[None], np.zeros((1, 3))
    cross, here = gp.joint_covariance(x, zero)[0, 0], gp.joint_covariance(x, x)[0, 0]
    w = np.linalg.solve(gp.joint_covariance(zero, zero)[0, 0], cross.T).T
    mean, law = w @ g0, here - w @ cross.T
    whitened = np.linalg.solve(np.linalg.cholesky(law[1:, 1:]), (g - mean[1:]).T)
    check_z(whitened.mean(axis=1), 0, 1 / np.sqrt(n), "mean")
    check_z(whitened @ whitened.T / n, np.eye(3), np.sqrt((1 + np.eye(3)) / n), "covariance")


def test_kernels_that_no_other_sampler_serves(full_size, seed):
    """A product without normal form, on the line against its own covariance."""
    n, kernel = 4_000 if full_size else 800, gn.Matern(2.5, 1) * gn.SquaredExponential(2)
    gp = gn.GaussianProcess(5.0, 1, kernel, bounds=BOUNDS)
    assert gp.plan()["sampler"].startswith("dense")
    t = np.array([0.1, 0.5, 1.2, 2.5])
    g = gn.line_values(gp, *along(n), t, tolerance=1e-6, seed=seed) - 5
    g = g[np.isfinite(g).all(axis=1)]
    x = t[:, None] * [1.0, 0, 0]
    k = gp.covariance(x, x)
    check_z(g.T @ g / len(g), k, np.sqrt((1 + k**2) / len(g)))


def test_long_lines_forget_nothing_that_matters(seed):
    """600 length scales in one line: rows are dropped on the way, and neighbours stay as correlated as they are."""
    n = 40
    gp = gn.GaussianProcess(4.5, 1, gn.SquaredExponential(0.02), bounds=((0, -1, -1), (12, 1, 1)))
    t = np.arange(0.1, 11.9, 0.02)
    g = gn.line_values(gp, *along(n), t, tolerance=1e-4, sampler="nystrom", seed=seed) - 4.5
    g = g[np.isfinite(g).all(axis=1)]
    assert len(g) > n / 2
    products = np.mean(g[:, 1:] * g[:, :-1], axis=0)  # each lag of one length scale: e^{-1/2}
    blocks = products[: len(products) // 10 * 10].reshape(-1, 10).mean(axis=1)
    check_z(blocks.mean(), np.exp(-0.5), blocks.std() / np.sqrt(len(blocks)) * 2)


def test_counters(seed):
    """One factorisation for each line here, and none where the kernel is stationary and served otherwise."""
    mean = gn.SphereField([2, 0, 0], 1)
    origins, directions = along(500, (0.0, 0, -1), (2.0, 0.3, 1.9))
    far = origins + [0, 50, 0]
    gp = process("rotating 3:1", mean=mean, sigma=0.1)
    counters = gn.first_hits(gp, origins, directions, 10, seed=seed)["counters"]
    assert counters["factorisations"] == counters["line_segments"] == 500 and counters["line_normals"] > 500 * 4
    counters = gn.first_hits(gp, far, directions, 10, seed=seed)["counters"]
    assert counters["factorisations"] == counters["line_normals"] == 0 and counters["line_skipped"] == 500
    stationary = gn.GaussianProcess(mean, 0.1, KERNELS["se"], bounds=BOUNDS)
    assert gn.first_hits(stationary, origins, directions, 10, seed=seed)["counters"]["factorisations"] == 0


@pytest.mark.parametrize("kernel", [gn.PlaneWave([1, 0, 7]), gn.SquaredExponential([0.4, 0.2, np.inf])])
def test_lines_along_which_g_is_constant(kernel, seed):
    """The plan looks at lines along the axes; on one of them g has no length scale, and no second node."""
    gp = gn.GaussianProcess(1.0, 0.5, kernel, bounds=((-1, -1, -1), (1, 1, 1)))
    along_it = [0, 1.0, 0] if isinstance(kernel, gn.PlaneWave) else [0, 0, 1.0]
    hits = gn.first_hits(gp, *along(100, along_it), 1, sampler="nystrom", seed=seed)
    assert hits["counters"]["line_normals"] <= 2 * hits["counters"]["line_segments"] == 200
    assert np.isinf(hits["t"]).all()  # starts outside, and stays there


def test_unsuitable_kernels_get_a_sentence():
    rough = gn.GaussianProcess(0, 1, gn.Matern(1.5, 1), bounds=BOUNDS)
    with pytest.raises(ValueError, match="values at half a length scale do not determine it. Take the sampler 'dense'"):
        gn.first_hits(rough, *along(1), 1, sampler="nystrom")
    broken = gn.GaussianProcess(0, 1, gn.Matern(0.5, 1), anisotropy=FIELDS["rotating 3:1"], bounds=BOUNDS)
    with pytest.raises(ValueError, match="has no gradient"):
        gn.first_hits(broken, *along(1), 1)


@pytest.mark.parametrize("name", ["sum with a rough term", "varying lengths"])
def test_slopes_of_rough_lines_between_their_rows(name, full_size, seed):
    """Rows are far apart against a rough path: what lies between them is no polynomial, and differences over a hundredth of a
    length have the variance of the process wherever they are taken (cubics alone lack 5 to 6 % of it)."""
    kernel, anisotropy = {
        "sum with a rough term": (0.6 * gn.SquaredExponential(0.4) + 0.4 * gn.Matern(1.5, 0.3), None),
        "varying lengths": (gn.Matern(1.5, 1), along_x(lambda x: isotropic(0.3 * np.exp(0.3 * x)), 3)),
    }[name]
    # So far from 0 that hardly a ray ends in a hit, and near enough for all of it to be drawn.
    gp = gn.GaussianProcess(4.0, 1.0, kernel, anisotropy=anisotropy, bounds=((-1, -1, -1), (1, 1, 1)))
    n = 20_000 if full_size else 2000
    t = np.linspace(1.15, 2.8, 34) + 0.003 * np.arange(34)
    step = 0.003
    both = np.sort(np.concatenate([t, t + step, [4.0]]))
    f = gn.line_values(gp, np.tile([-2.0, 0.1, 0.2], (n, 1)), np.tile([1.0, 0, 0], (n, 1)), both, sampler="dense", seed=seed)
    f = f.reshape(n, -1)[:, :-1]
    f = f[np.isfinite(f).all(axis=1)]
    assert len(f) > 0.98 * n
    points = np.column_stack([both[:-1] - 2, np.full(len(both) - 1, 0.1), np.full(len(both) - 1, 0.2)])
    k = gp.covariance(points, points)
    first, second = np.searchsorted(both, t), np.searchsorted(both, t + step)
    variance = k[first, first] + k[second, second] - 2 * k[first, second]
    ratio = ((f[:, second] - f[:, first]) ** 2 / variance).mean(axis=1)
    check_z(ratio.mean(), 1, ratio.std() / np.sqrt(len(ratio)), name)
