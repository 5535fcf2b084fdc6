"""Fits as a whole: what is not drawn, algebra, trees, stated errors, threads, bad input."""

import gpis_native as gn
import numpy as np
import pytest
from fit_operands import BOX, SE, cdf, nodes_of, phi, sphere
from statistics_checks import check_z


def test_only_what_is_uncertain_is_drawn():
    apart = [sphere(-3, 0.5, 0.05), sphere(3, 0.5, 0.05)]
    bounds = ((-4, -1, -1), (4, 1, 1))
    fit = gn.compose_and_fit(apart, "union", bounds, 33, 50)
    plane = nodes_of(fit)[..., 0]
    drawn = fit["mean_error"] > 0
    assert 0 < fit["counters"]["voxels_drawn"] == drawn.sum() < 0.1 * drawn.size
    assert np.all(np.abs(plane[drawn]) < 0.5)  # around the plane between them, where either may be the least
    left = plane < -0.5
    np.testing.assert_allclose(fit["mean"][left], apart[0].mean(nodes_of(fit)[left]), rtol=1e-6)
    np.testing.assert_allclose(fit["sigma"], 0.05, rtol=0.5)
    everything = gn.compose_and_fit(apart, "union", bounds, 33, 50, certainty=np.inf)
    assert everything["counters"]["voxels_drawn"] == drawn.size
    # The same realisations: where both draw they agree.
    np.testing.assert_allclose(everything["mean"][drawn], fit["mean"][drawn], atol=1e-6)
    certain = [gn.GaussianProcess(gn.SphereField([x, 0, 0], 0.5), 0.0, SE(0.5)) for x in (-0.3, 0.3)]
    for blend in (0, 0.3):
        op = "smooth_union" if blend else "union"
        fit = gn.compose_and_fit(certain, op, BOX, 9, 10, blend=blend)
        assert fit["counters"]["voxels_drawn"] == 0 and not fit["sigma"].any()
        a, b = (c.mean(nodes_of(fit).reshape(-1, 3)).reshape(fit["mean"].shape) for c in certain)
        rounded = np.minimum(a, b) - (np.maximum(blend - np.abs(a - b), 0) ** 2 / (4 * blend) if blend else 0)
        np.testing.assert_allclose(fit["mean"], rounded, atol=1e-6)


def test_bounds_of_operands():
    """Outside of its bounds an operand is not there: a certain distance to them."""
    gp = gn.GaussianProcess(-1.0, 0.2, SE(0.5), bounds=((-0.5, -0.5, -0.5), (0.5, 0.5, 0.5)))
    fit = gn.compose_and_fit([gp], "union", BOX, 9, 10)
    x = nodes_of(fit)
    outside = np.abs(x).max(axis=-1) > 0.5
    distance = np.linalg.norm(np.maximum(np.abs(x) - 0.5, 0), axis=-1)
    np.testing.assert_allclose(fit["mean"][outside], distance[outside], atol=1e-6)
    assert not fit["sigma"][outside].any() and np.all(fit["mean"][~outside] == -1)


def same(x, y, sign=1):
    for key in ("mean", "sigma", "anisotropy", "mean_error", "sigma_error"):
        np.testing.assert_allclose(x[key], sign * y[key] if key == "mean" else y[key], rtol=2e-5, atol=2e-6, err_msg=key)


def test_a_certain_operand_with_a_rare_one_before_it(seed):
    """An atom with a thin tail is far from normal, and is said to be: skewness of -15, half the distribution off."""
    level, m, s = 0.1, 0.1 + 2.5 * 0.2, 0.2
    operands = [gn.GaussianProcess(level, 0.0, SE(1.0)), gn.GaussianProcess(m, s, SE(1.0))]
    x = np.linspace(-9, 9, 200_001)
    f, weight = np.minimum(level, m + s * x), phi(x) * (x[1] - x[0])
    mean = np.sum(f * weight)
    deviation, third = np.sqrt(np.sum((f - mean) ** 2 * weight)), np.sum((f - mean) ** 3 * weight)
    skewness, distance = third / deviation**3, 1 - float(cdf((level - mean) / deviation))
    assert skewness < -14 and 0.4 < distance < 0.5
    exact = gn.compose_and_fit(operands, "union", BOX, 2, 2, method="closed_form", certainty=np.inf)
    np.testing.assert_allclose(exact["sigma"], deviation, rtol=1e-5)
    np.testing.assert_allclose(exact["skewness"], skewness, rtol=1e-4)
    # Just below the atom, or on it.
    below = abs(float(cdf((level - m) / s)) - (1 - distance))
    np.testing.assert_allclose(exact["kolmogorov"], max(distance, below), atol=1e-3)
    # Realisations are counted in steps of a fifth of the deviation: an atom inside of one is seen at its end.
    drawn = gn.compose_and_fit(operands, "union", BOX, 2, 20_000, seed, certainty=np.inf)
    assert np.all(np.abs(drawn["kolmogorov"] - exact["kolmogorov"]) < 0.2 * phi(0) + 0.02)


@pytest.mark.parametrize("method", ["sample", "closed_form"])
def test_algebra(method, seed):
    a, b, c = sphere(-0.2, 0.5, 0.1), sphere(0.3, 0.4, 0.15), sphere(0.0, 0.3, 0.2)
    empty = gn.GaussianProcess(50.0, 0.1, SE(0.5))

    def fit(operands, op, **options):
        return gn.compose_and_fit(operands, op, BOX, 12, 100, seed, method=method, **options)

    alone = fit([a], "union")
    same(alone, fit([a, empty], "union"))
    same(alone, fit([a, empty], "difference"))
    same(alone, fit([a, a], "union", correlation=1.0))
    same(alone, fit([a, a], "intersection", correlation=1.0))
    same(alone, fit([gn.union(a, a, shared_noise=True)], "intersection"))
    # De Morgan, with the same realisations.
    same(fit([a, b], "intersection"), fit([gn.complement(a), gn.complement(b)], "union"), -1)
    same(fit([a, b], "difference"), fit([a, gn.complement(b)], "intersection"))
    # A difference with itself is |f|, of a folded normal distribution: nowhere inside.
    folded = fit([a, a], "difference", correlation=1.0)
    m = alone["mean"] / 0.1
    expected = 0.1 * (2 * phi(m) + m * (1 - 2 * cdf(-m)))
    assert np.all(folded["mean"] > 0)
    if method == "closed_form":
        np.testing.assert_allclose(folded["mean"], expected, atol=1e-6)
        same(fit([a, b], "union"), fit([b, a], "union"))
    else:
        check_z(folded["mean"], expected, np.maximum(folded["mean_error"], 1e-6))
    # A nested tree is one tree, and trees are operands.
    same(fit([gn.union(a, b), c], "difference"), fit([gn.difference(gn.union(a, b), c)], "union"))


@pytest.mark.stats
def test_nested_trees(seed):
    """More than two operands: the sampler against numpy, Clark's repeated use against the sampler within what he claims."""
    a, b, c = sphere(-0.2, 0.5, 0.1), sphere(0.3, 0.4, 0.15), sphere(0.0, 0.3, 0.1)
    tree = gn.difference(gn.union(a, b), c)
    n = 2000
    fit = gn.compose_and_fit([tree], "union", BOX, 9, n, seed)
    x = nodes_of(fit)
    rng = np.random.default_rng(seed)
    points = x.reshape(-1, 3)
    values = np.stack(
        [gp.mean(points)[:, None] + s * rng.normal(size=(len(points), n)) for gp, s in ((a, 0.1), (b, 0.15), (c, 0.1))], -1
    )
    f = tree.compose(values)
    shape = fit["mean"].shape
    error = np.sqrt(2) * f.std(axis=1).reshape(shape) / np.sqrt(n)
    check_z(fit["mean"], f.mean(axis=1).reshape(shape), error + 1e-7)
    check_z(fit["sigma"], f.std(axis=1).reshape(shape), 1.5 * error + 1e-7)
    clark = gn.compose_and_fit([tree], "union", BOX, 9, n, seed, method="closed_form")
    assert np.max(np.abs(clark["mean"] - fit["mean"]) / fit["sigma"]) < 0.1
    assert np.max(np.abs(clark["sigma"] / fit["sigma"] - 1)) < 0.15


def test_errors_are_those_of_joint_realisations(seed):
    """Neighbouring nodes see the same realisations: the error of the mean is as smooth as the process."""
    a, b = sphere(-0.01, 0.5, 0.3, SE(0.8)), sphere(0.01, 0.5, 0.3, SE(0.8))
    fit = gn.compose_and_fit([a, b], "union", BOX, 20, 100, seed)
    exact = gn.compose_and_fit([a, b], "union", BOX, 20, 100, method="closed_form")
    error = fit["mean"] - exact["mean"]
    assert np.corrcoef(error[1:].ravel(), error[:-1].ravel())[0, 1] > 0.95
    steps = np.diff(error, axis=0).std() / fit["mean_error"].mean()
    assert steps < 2 * fit["voxel_size"] / 0.8


def test_threads_seeds_and_cancelling(seed):
    operands = [sphere(-0.2, 0.5, 0.1), sphere(0.3, 0.4, 0.15)]
    query = (operands, "union", BOX, 24, 200)
    one, three, other = (gn.compose_and_fit(*query, s, threads=t) for s, t in ((seed, 1), (seed, 3), (seed + 1, 1)))
    assert np.array_equal(one["mean"], three["mean"]) and np.array_equal(one["anisotropy"], three["anisotropy"])
    assert not np.array_equal(one["mean"], other["mean"])
    fractions = []

    def progress(fraction):
        fractions.append(fraction)
        return len(fractions) < 2

    assert gn.compose_and_fit(operands, "union", BOX, 64, 5000, progress=progress) is None
    assert len(fractions) == 2 and 0 <= fractions[0] < 1

    def fails(_):
        raise RuntimeError("mine")

    with pytest.raises(RuntimeError, match="mine"):
        gn.compose_and_fit(operands, "union", BOX, 64, 5000, progress=fails)


def test_plan_tells_before(seed):
    operands = [sphere(-0.2, 0.5, 0.1), sphere(0.3, 0.4, 0.15)]
    plan = gn.compose_and_fit_plan(operands, "union", BOX, 24, 200)
    counters = gn.compose_and_fit(operands, "union", BOX, 24, 200)["counters"]
    assert plan["resolution"] == [24, 24, 24] and plan["voxels"] == counters["voxels"] == 24**3
    assert plan["voxels_drawn"] == counters["voxels_drawn"] > 0
    more = gn.compose_and_fit_plan(operands, "union", BOX, 24, 200_000)
    assert more["memory"] == plan["memory"] and more["seconds"] > plan["seconds"] > 0


def test_a_fit_is_a_process(tmp_path, seed):
    """What is written is read again, and makes a process with these fields."""
    fit = gn.compose_and_fit([sphere(-0.2, 0.5, 0.1), sphere(0.3, 0.4, 0.15)], "union", BOX, 16, 100, seed)
    path = tmp_path / "fit.vdb"
    gn.write_vdb(path, fit)
    again = gn.read_vdb(path)
    for key in ("mean", "sigma", "anisotropy", "mean_error", "sigma_error", "skewness", "kolmogorov"):
        np.testing.assert_array_equal(again[key], fit[key])
    np.testing.assert_allclose(again["origin"], fit["origin"], atol=1e-9)
    assert again["voxel_size"] == pytest.approx(fit["voxel_size"])
    gp = gn.GaussianProcess(gn.VdbField(path, "mean"), gn.VdbField(path, "sigma"), SE(1.0), anisotropy=gn.VdbTensorField(path))
    hits = gn.first_hits(gp, [[-0.2, 0, 3]], [[0, 0, -1]], 10)
    assert abs(hits["t"][0] - 2.5) < 0.6


WAVES = gn.LocallyPeriodic(1.2, 0.9, [0.6, 0.0, 0.8], 0.1)


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        ({"op": "xor"}, "op is 'xor'; it takes 'union', 'intersection'"),
        ({"operands": []}, "operands is empty"),
        ({"operands": [sphere(0, 1, 0.1), 3]}, r"operands\[1\] must be a GaussianProcess or a CSG tree"),
        ({"operands": [gn.GaussianProcess(0, 1, gn.Matern(0.5, 1.0))]}, "Operand 0: the kernel .* has no gradient"),
        ({"bounds": ((0, 0, 0), (1, 0, 1))}, "every side must be finite and of positive length"),
        ({"realisations": 1}, "realisations is 1; it takes 2 to 1e8"),
        ({"method": "guess"}, "method is 'guess'; it takes 'sample' or 'closed_form'"),
        ({"blend": 0.1}, "blend is 0.1: it is the radius of op 'smooth_union' alone"),
        ({"correlation": 1.5}, "correlation is 1.5; it takes -1 to 1"),
        ({"correlation": 0.5, "operands": [sphere(0, 1, 0.1), sphere(0, 1, 0.1, SE(0.2))]}, "takes operands of one kernel"),
        ({"correlation": -0.5, "operands": [sphere(0, 1, 0.1)] * 3}, "cannot all be opposed"),
        ({"certainty": 1.0}, "certainty is 1; it takes 3 or more"),
        (
            {"operands": [gn.GaussianProcess(0, 1, WAVES * WAVES * WAVES), gn.GaussianProcess(0, 1, SE(1.0))]},
            "A realisation takes kernels of at most 4096 terms",
        ),
        ({"operands": [sphere(k, 1, 0.1) for k in range(70)]}, "up to 64 operands and operations"),
    ],
)
def test_bad_input_gets_a_sentence(change, sentence):
    query = {
        "operands": [sphere(-0.2, 0.5, 0.1), sphere(0.3, 0.4, 0.15)],
        "op": "union",
        "bounds": BOX,
        "resolution": 8,
        "realisations": 10,
    }
    with pytest.raises(ValueError, match=sentence):
        gn.compose_and_fit(**(query | change))


def test_operands_with_conditions_are_refused():
    known = {"points": [[0, 0, 0.2]], "values": [0.1]}
    with pytest.raises(ValueError, match="Operand 1 has conditions; a fit takes operands without"):
        pinned = gn.GaussianProcess(0.1, 0.2, gn.SquaredExponential(0.5), conditions=known)
        gn.compose_and_fit([sphere(0, 1, 0.1), pinned], "union", ((-1, -1, -1), (1, 1, 1)), 5, 10)
