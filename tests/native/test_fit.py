"""Sample, compose, fit: against Clark's formulas, against numpy's own composition of explicit realisations, and against
published data."""

from pathlib import Path

import gpis_native as gn
import numpy as np
import pytest
from fit_operands import BOX, SE, cdf, nodes_of, phi
from statistics_checks import check_z

SHARED = Path(__file__).parents[3] / "shared" / "data" / "gpis-light-transport"
ENTRIES = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))


def clark(m1, s1, m2, s2, r, cdf=cdf):
    """Mean and deviation of the least of two (Clark 1961, as math.md §10 has it for the greatest)."""
    nu = np.sqrt(s1**2 + s2**2 - 2 * r * s1 * s2)
    a = (m2 - m1) / nu
    mean = -m1 * cdf(a) - m2 * cdf(-a) + nu * phi(a)
    second = (m1**2 + s1**2) * cdf(a) + (m2**2 + s2**2) * cdf(-a) - (m1 + m2) * nu * phi(a)
    return -mean, np.sqrt(second - mean**2)


def matrices(entries):
    out = np.empty((*entries.shape[:-1], 3, 3))
    for k, (i, j) in enumerate(ENTRIES):
        out[..., i, j] = out[..., j, i] = entries[..., k]
    return out


class Pairs:
    """Means and deviations of two operands that differ from node to node along x, too far apart to know of each other."""

    def __init__(self, seed, r, n=40):
        rng = np.random.default_rng(seed)
        self.m = rng.normal(size=(2, n))
        self.s = np.exp(rng.normal(-0.3, 0.7, size=(2, n)))
        self.r = r
        self.bounds = ((0, 0, 0), (n - 1.0, 1, 1))
        sheets = SE([0.2, np.inf, np.inf])

        def field(values):
            return gn.GridField(np.broadcast_to(values[:, None, None], (n, 2, 2)), 1.0)

        self.operands = [gn.GaussianProcess(field(m), field(s), sheets) for m, s in zip(self.m, self.s, strict=True)]

    def fit(self, n, seed, blend=0.0, **options):
        options = {"correlation": self.r, "certainty": np.inf, "blend": blend} | options
        op = "smooth_union" if blend else "union"
        fit = gn.compose_and_fit(self.operands, op, self.bounds, self.m.shape[1], n, seed, **options)
        return {k: v if k in ("counters", "origin", "voxel_size") else v[:, 0, 0] for k, v in fit.items()}

    def clark(self):
        return clark(self.m[0], self.s[0], self.m[1], self.s[1], self.r)


CORRELATIONS = (-0.6, 0.0, 0.3, 0.8, 1.0)  # 40 pairs each: 200


def test_closed_form_is_clark(seed):
    for r in (*CORRELATIONS, -1.0, 0.999):
        pairs = Pairs(seed, r)
        fit = pairs.fit(2, 0, method="closed_form")
        mean, sigma = pairs.clark()
        np.testing.assert_allclose(fit["mean"], mean, atol=2e-6)
        np.testing.assert_allclose(fit["sigma"], sigma, atol=2e-5)  # the formula loses digits in numpy
        assert fit["counters"]["voxels_drawn"] == 0


def test_closed_form_of_nearly_one_variable():
    """ν → 0: where the formula is 0/0, the least mean wins; next to it nothing jumps."""
    for gap in (0, 1e-12, 1e-8, 1e-4):
        for spread in (0, 1e-13, 1e-9, 1e-5):
            a, b = (gn.GaussianProcess(0.3 + g, 0.2 + s, SE(4.0)) for g, s in ((0, 0), (gap, spread)))
            fit = gn.compose_and_fit([a, b], "union", BOX, 2, 2, method="closed_form", correlation=1.0)
            assert np.all(np.abs(fit["mean"] - 0.3) < 1e-5) and np.all(np.abs(fit["sigma"] - 0.2) < 1e-5)
            assert np.all(np.abs(fit["anisotropy"][..., :3] - 16) < 1e-2)


def by_quadrature(pairs, blend, h=0.02):
    """Moments 1 to 3 of the smooth least (mean, deviation, skewness) by sums over the plane of the two normals."""
    x = np.arange(-8, 8 + h / 2, h)
    weight = np.multiply.outer(phi(x), phi(x)) * h * h
    out = []
    for (m1, m2), (s1, s2) in zip(pairs.m.T, pairs.s.T, strict=True):
        a = (m1 + s1 * x)[:, None]
        b = m2 + s2 * (pairs.r * x[:, None] + np.sqrt(1 - pairs.r**2) * x)
        f = np.minimum(a, b) - np.maximum(blend - np.abs(a - b), 0) ** 2 / (4 * blend)
        mean = np.sum(weight * f)
        second, third = (np.sum(weight * (f - mean) ** k) for k in (2, 3))
        out.append((mean, np.sqrt(second), third / second**1.5))
    return np.array(out).T


@pytest.mark.parametrize("blend", [0.05, 0.6, 5.0])
def test_closed_form_of_a_smooth_union(blend, seed):
    """Against sums over the plane; with a certain operand, of one noise, and as the radius goes to 0."""
    for r in (-1.0, -0.6, 0.0, 0.8, 0.999, 1.0):
        pairs = Pairs(seed, r, 6)
        fit = pairs.fit(2, 0, blend, method="closed_form")
        assert fit["counters"]["voxels_drawn"] == 0
        for name, expected, error in zip(("mean", "sigma", "skewness"), by_quadrature(pairs, blend), (1, 1, 5), strict=True):
            np.testing.assert_allclose(fit[name], expected, atol=2e-5 * error, err_msg=f"{name}, r = {r}")
        hard = pairs.fit(2, 0, 1e-7, method="closed_form")
        for name, exact in zip(("mean", "sigma"), pairs.clark(), strict=True):
            np.testing.assert_allclose(hard[name], exact, atol=2e-5)
    flat, rough = gn.GaussianProcess(0.1, 0.0, SE(1.0)), gn.GaussianProcess(0.3, 0.2, SE(1.0))
    fit = gn.compose_and_fit([flat, rough], "smooth_union", BOX, 2, 2, method="closed_form", blend=blend)
    x = np.linspace(-8, 8, 400_001)
    b = 0.3 + 0.2 * x
    f = np.minimum(0.1, b) - np.maximum(blend - np.abs(0.1 - b), 0) ** 2 / (4 * blend)
    mean = np.sum(f * phi(x)) * (x[1] - x[0])
    np.testing.assert_allclose(fit["mean"], mean, atol=1e-6)


@pytest.mark.stats
def test_two_hundred_random_pairs(full_size, seed):
    """Issue 5, 1: mean and deviation within 4 standard errors at n = 1,000, errors falling as 1/√n."""
    rms, most = {}, 10_000 if full_size else 1000
    for n in (50, 1000, most):
        z, relative = [], []
        for k, r in enumerate(CORRELATIONS):
            pairs = Pairs(seed, r)
            fit = pairs.fit(n, seed + k)
            for name, expected in zip(("mean", "sigma"), pairs.clark(), strict=True):
                error = fit[name] - expected
                relative.append(error / pairs.clark()[1])
                z.append(error / fit[f"{name}_error"])
        z, rms[n] = np.array(z), np.sqrt(np.mean(np.square(relative)))
        if n >= 1000:
            check_z(z, 0, 1, f"n = {n}")
            assert np.sum(np.abs(z) > 4) <= 2  # of 400: three have a probability of 3e-6
            check_z(np.mean(z**2), 1, np.sqrt(2 / z.size) * 1.5, "standard errors are what they say")
    slope = np.log(rms[most] / rms[50]) / np.log(most / 50)
    check_z(slope, -0.5, np.sqrt(2) * 0.05 / np.log(most / 50))


@pytest.mark.stats
@pytest.mark.parametrize("blend", [0.0, 0.7])
def test_shape_of_the_distribution(blend, seed):
    """Skewness and Kolmogorov distance against samples that numpy draws."""
    rng = np.random.default_rng(seed)
    n = 100_000
    for r in (-0.6, 0.0, 0.8, 1.0):
        pairs = Pairs(seed, r, 6)
        exact, sampled = pairs.fit(2, 0, blend, method="closed_form"), pairs.fit(20_000, seed, blend)
        for node in range(6):
            g = rng.normal(size=(2, n))
            g[1] = r * g[0] + np.sqrt(1 - r**2) * g[1]
            a, b = (pairs.m[k][node] + pairs.s[k][node] * g[k] for k in range(2))
            f = np.sort(np.minimum(a, b) - (np.maximum(blend - np.abs(a - b), 0) ** 2 / (4 * blend) if blend else 0))
            y = (f - f.mean()) / f.std()
            spread = max(6, np.std(y**3))  # where one operand wins seldom and by far, tails are long
            check_z(exact["skewness"][node], np.mean(y**3), spread / np.sqrt(n))
            check_z(sampled["skewness"][node], exact["skewness"][node], spread / np.sqrt(20_000))
            distance = np.max(np.abs(cdf(y[::100]) - np.arange(n)[::100] / n))
            assert abs(exact["kolmogorov"][node] - distance) < 0.01
            assert exact["kolmogorov"][node] - 0.03 < sampled["kolmogorov"][node] < exact["kolmogorov"][node] + 0.03


def slopes(fit):
    """Cov ∇g that the fitted process has: A⁻¹ + ⅛ tr(A⁻¹∂A A⁻¹∂A) (definitions E3)."""
    a = matrices(fit["anisotropy"].astype(float))
    inverse = np.linalg.inv(a)
    change = np.einsum("...ij,x...jk->x...ik", inverse, np.stack(np.gradient(a, fit["voxel_size"], axis=(0, 1, 2))))
    return inverse + np.einsum("x...ij,y...ji->...xy", change, change) / 8


def crease(kernel=None):
    """Two operands whose difference depends on x alone, deviations that vary, length scales of their own (or one kernel)."""
    a = gn.GaussianProcess(
        gn.PlaneField([0, 0, 0], [0.6, 0.3, 0]),
        (0.4 + 0.2 * gn.PlaneField([0, 0, 0], [1, 0, 0])).clamped(0.05, 5),
        kernel or SE([0.6, 0.3, 0.9]),
    )
    b = gn.GaussianProcess(gn.PlaneField([0, 0, 0], [-0.6, 0.3, 0]), 0.3, kernel or SE(0.4))
    return a, b


@pytest.mark.stats
@pytest.mark.parametrize("op", ["union", "difference", "smooth_union", "smooth_union of one noise"])
def test_moments_against_explicit_realisations(op, seed):
    """numpy composes values and gradients of realisations at points: mean, deviation, and the covariance of gradients."""
    op, *one_noise = op.split(" of ")
    a, b = crease(SE(0.4)) if one_noise else crease()
    points = np.array([[-0.5, 0, 0], [0, 0, 0], [0.25, 0.5, -0.5]])
    n, blend = 12_000, 0.3 if op == "smooth_union" else 0.0
    fa, fb = (gp.realisation_at(points, seed=seed + (0 if one_noise else k * n), n=n) for k, gp in enumerate((a, b)))
    (va, ga), (vb, gb) = ((f["value"], f["gradient"]) for f in (fa, fb))
    if op == "difference":
        va, ga, vb, gb = -va, -ga, vb, gb  # max(a, -b) = -min(-a, b)
    overlap = np.maximum(blend - np.abs(va - vb), 0)
    share = np.divide(overlap, 2 * blend, out=np.zeros_like(overlap), where=blend > 0)[..., None]
    lower = (va < vb)[..., None]
    f = np.minimum(va, vb) - (overlap**2 / (4 * blend) if blend else 0)
    g = np.where(lower, ga, gb) * (1 - share) + np.where(lower, gb, ga) * share
    if op == "difference":
        f, g = -f, -g
    m = 4000
    for method in ("sample", "closed_form"):
        # Central differences of A are compared: small voxels.
        correlation = 1.0 if one_noise else 0.0
        fit = gn.compose_and_fit([a, b], op, BOX, 17, m, seed, method=method, blend=blend, correlation=correlation)
        index = tuple(np.round((points + 1) / fit["voxel_size"]).astype(int).T)
        count = n if method == "closed_form" else min(n, m) / 2
        check_z(fit["mean"][index], f.mean(axis=0), f.std(axis=0) / np.sqrt(count), method)
        check_z(fit["sigma"][index], f.std(axis=0), f.std(axis=0) / np.sqrt(count), method)
        # Regress gradients on values: what is left is σ²G.
        d = f - f.mean(axis=0)
        along = np.einsum("np,npi->pi", d, g) / np.sum(d**2, axis=0)[:, None]
        rest = g - g.mean(axis=0) - d[..., None] * along
        expected = np.einsum("npi,npj->pij", rest, rest) / n / f.var(axis=0)[:, None, None]
        spread = np.einsum("pii->p", expected)[:, None, None]
        check_z(slopes(fit)[index], expected, 2 * spread / np.sqrt(count) + 0.002 * spread, method)


def test_varying_length_scales_are_given_back():
    """One operand: nothing is drawn, and the term of definitions E3 is taken off Cov ∇g again."""
    n = 33
    x = np.linspace(-1, 1, n)
    length = 0.4 * np.exp(0.4 * np.sin(2 * x))
    entries = np.zeros((n, 3, 3, 6))
    entries[..., :3] = (length**2)[:, None, None, None]
    tensor = gn.TensorGridField(entries, [2 / (n - 1), 1, 1], [-1, -1, -1])
    gp = gn.GaussianProcess(0.1, 0.2, SE(1.0), anisotropy=tensor)
    fit = gn.compose_and_fit([gp], "union", BOX, n, 10, 1)
    assert fit["counters"]["voxels_drawn"] == 0
    inner = np.s_[2:-2, n // 2, n // 2]
    fitted = np.sqrt(fit["anisotropy"][inner][:, 0])
    # The field's own gradient at a node is that of one of its cells; differences are central.
    assert np.max(np.abs(fitted / length[2:-2] - 1)) < 0.02
    without = 1 / np.sqrt(1 / length**2 + 1.5 * (np.gradient(np.log(length), x)) ** 2)
    assert np.max(np.abs(without / length - 1)) > 0.05
    for kernel, squared in [(gn.Matern(1.5, 0.6), 0.36 / 3), (0.7 * SE(0.3), 0.09), (gn.Matern(2.5, 0.6), 0.36 * 3 / 5)]:
        # Voxels shorter than the lengths.
        fit = gn.compose_and_fit([gn.GaussianProcess(0.1, 0.2, kernel)], "union", BOX, 17, 10, 1)
        np.testing.assert_allclose(fit["anisotropy"][..., :3], squared, rtol=1e-5)
        np.testing.assert_allclose(fit["sigma"], 0.2 * np.sqrt(kernel.variance), rtol=1e-6)


def test_length_scales_stay_within_the_grid():
    flat = gn.GaussianProcess(0.1, 0.2, SE([0.5, np.inf, 1e-3]))
    fit = gn.compose_and_fit([flat], "union", BOX, 5, 10, 1)
    assert fit["counters"]["length_scales_limited"] == 125
    lengths = np.sqrt(fit["anisotropy"][0, 0, 0, :3])
    np.testing.assert_allclose(lengths, [0.5, 4 * np.sqrt(12), 0.5], rtol=1e-5)


def union_over_a_voxel(x, h):
    """Mean and variance of the union of the two spheres at a point that is uniform in the voxel around x: Clark's formulas at
    4 x 4 x 4 points of Gauss and Legendre."""
    at, weight = np.polynomial.legendre.leggauss(4)
    z = np.linspace(-9, 9, 18_001)
    table = cdf(z)  # which takes its time
    first = second = 0
    for i in np.ndindex(4, 4, 4):
        means = [np.linalg.norm(x + at[list(i)] * h / 2 - [c, 0.8, 0], axis=-1) - r for c, r in ((-0.4, 0.8), (0.4, 0.5))]
        mean, sigma = clark(means[0], 0.1, means[1], 0.001, 0, lambda a: np.interp(a, z, table))
        w = np.prod(weight[list(i)]) / 8
        first, second = first + w * mean, second + w * (mean**2 + sigma**2)
    return first, second - first**2


@pytest.mark.stats
@pytest.mark.parametrize("resolution", [32, 64])
def test_two_spheres_of_the_paper(resolution, full_size, seed):
    """Issue 5, 2: the published voxels of the union of two stochastic spheres on the same nodes. They are moments over
    points that are drawn anew in the voxel around each node."""
    path = SHARED / f"csg-two-spheres-eval-avg-{resolution}.vdb"
    if not path.exists():
        pytest.skip("the shared data files are not there")
    n = 4000 if full_size else 1000 if resolution == 32 else 250
    data = gn.read_vdb(path)
    size, h = resolution, 3 / resolution
    low = np.array([-1.5, -0.499, -1.5])
    operands = [
        gn.GaussianProcess(gn.SphereField([x, 0.8, 0], r), s, SE(0.5)) for x, r, s in ((-0.4, 0.8, 0.1), (0.4, 0.5, 0.001))
    ]
    query = operands, "union", (low, low + h * (size - 1)), size
    fit, exact = gn.compose_and_fit(*query, n, seed), gn.compose_and_fit(*query, 2, method="closed_form")
    assert fit["mean"].shape == data["mean"].shape == (size,) * 3
    published = {k: data[k].astype(float) for k in ("mean", "variance")}
    of_voxel, variance_of_voxel = union_over_a_voxel(nodes_of(fit), h)

    # The mean at every node within noise + 5e-3, as the issue asks, but where a voxel holds the centre of a sphere (6 and 8
    # of them): a distance has a tip there, which their jitter rounds off by up to .024.
    theirs, ours = np.sqrt(published["variance"] / 1000), fit["mean_error"].astype(float)
    off = np.abs(fit["mean"] - published["mean"])
    means = [np.linalg.norm(nodes_of(fit) - [c, 0.8, 0], axis=-1) - r for c, r in ((-0.4, 0.8), (0.4, 0.5))]
    tips = np.minimum(means[0] + 0.8, means[1] + 0.5) < h
    assert tips.sum() <= 8
    check_z(np.maximum(off - 5e-3, 0)[~tips], 0, np.hypot(theirs, ours)[~tips])
    # With the same jitter, at every node, and nothing but noise.
    z = (published["mean"] - of_voxel) / theirs
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1, abs=0.03)
    check_z(np.maximum(np.abs(published["mean"] - of_voxel) - 5e-3, 0), 0, theirs)

    # The variance less the jitter term |grad mu|^2 h^2/12, RMS where the large sphere wins, drawn or not: within 5 %.
    wins = means[0] < means[1]
    slope = np.stack(np.gradient(exact["mean"].astype(float), h), axis=-1)
    without_jitter = published["variance"] - np.sum(slope**2, axis=-1) * h**2 / 12
    off = exact["sigma"][wins].astype(float) ** 2 / without_jitter[wins] - 1
    assert np.sqrt(np.mean(off**2)) < 0.05  # of which 4.5 % are the noise of their 1,000 samples
    assert abs(np.mean(off)) < 0.01
    # A fit by n realisations differs from that by the noise that it states itself (none where nothing was drawn). Some
    # hundred of its voxels are independent.
    drawn = wins & (fit["sigma_error"] > 0)
    ours, noise = (fit[name][drawn].astype(float) for name in ("sigma", "sigma_error"))
    z = (ours**2 - exact["sigma"][drawn].astype(float) ** 2) / (2 * ours * noise)
    assert np.sqrt(np.mean(z**2)) == pytest.approx(1, abs=0.25)
    assert np.abs(published["variance"] / variance_of_voxel - 1)[wins].mean() < 0.04
    assert fit["counters"]["voxels_drawn"] < 0.65 * size**3
