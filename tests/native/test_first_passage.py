"""Tables of first passages (native/process/first_passage.h) against closed forms and against the march that draws them. A table
holds finitely many excursions: what it is off by is the same for every ray, and stated here beside the error of the test."""

from math import erf, exp, pi, sqrt

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_proportion, check_same_distribution

pytestmark = pytest.mark.stats
X = np.array([1.0, 0, 0])
# Standard deviations of a probability: √(1/4n) of the n = 2^19 excursions for all slopes together, of the 12,000 that a slope
# of 1 chooses among for that slope.
TABLE, TABLE_OF_A_SLOPE = 7e-4, 4.6e-3
KERNELS = {
    "squared exponential": gn.SquaredExponential(1),
    "matern 3/2": gn.Matern(1.5, 1),
    "matern 5/2": gn.Matern(2.5, 1),
    "wong": gn.Wong(1),
}
# Oracles 5 and 6: survival to these distances from outside, of an excursion, given a slope of 1; 4e-4 of error in SE.
DISTANCES = {"wong": (0.5, 1, 2, 5), "squared exponential": (0.5, 1, 2, 5, 8)}
SURVIVAL = {
    "wong": {
        "outside": (0.85624, 0.73684, 0.54929, 0.23051),
        "excursion": (0.81842, 0.68804, 0.50282, 0.20911),
        "slope 1": (0.81637, 0.66014, 0.47057, 0.19405),
    },
    "squared exponential": {
        "outside": (0.84229, 0.69407, 0.45573, 0.12893, 0.03639),
        "excursion": (0.96922, 0.88063, 0.61086, 0.17080, 0.04818),
        "slope 1": (0.99669, 0.88074, 0.58803, 0.16682, 0.04701),
    },
}


@pytest.fixture
def n(full_size):
    return 1_000_000 if full_size else 100_000


def process(kernel, level=0.0, length=40.0):
    return gn.GaussianProcess(gn.ConstantField(level), 1.0, KERNELS[kernel], bounds=((-1, -1, -1), (length, 1, 1)))


def hits_along_x(gp, n, seed, start=None, memory="renewal+", sampler="first_passage", t_max=40.0):
    if start is not None:
        start = {"value": np.zeros(n), "gradient": np.broadcast_to(np.asarray(start, float), (n, 3)).copy()}
    return gn.first_hits(
        gp, np.zeros((n, 3)), np.tile(X, (n, 1)), t_max, memory=memory, start=start, sampler=sampler, seed=seed
    )


@pytest.mark.parametrize("start", ["outside", "excursion", "slope 1"])
@pytest.mark.parametrize("kernel", SURVIVAL)
def test_survival_is_that_of_the_oracles(kernel, start, n, seed):
    """Wong's closed form and the brute force of SE."""
    memory = {"outside": "none", "excursion": "renewal", "slope 1": "renewal+"}[start]
    t = hits_along_x(process(kernel), n, seed, None if start == "outside" else X, memory)["t"]
    survived = [(t > x).sum() for x in DISTANCES[kernel]]
    error = np.hypot(4e-4 if kernel == "squared exponential" else 0, TABLE_OF_A_SLOPE if start == "slope 1" else TABLE)
    check_proportion(survived, n, SURVIVAL[kernel][start], error, f"{kernel}, {start}")


@pytest.mark.parametrize("level", [-1.5, 0.0, 1.0, 3.0])
def test_short_rays_meet_the_surface_at_rices_rate(level, n, seed):
    """From outside P(t < x) = x · rate/Φ(level) up to x³: exact in the table, whose excursions have the exact mean length."""
    x = 0.05
    t = hits_along_x(process("squared exponential", level, 20.0), n, seed, memory="none")["t"]
    rate = exp(-level * level / 2) / (2 * pi)
    check_proportion((t < x).sum(), n, x * rate / (0.5 * (1 + erf(level / sqrt(2)))), 2e-5, f"level {level}")


@pytest.mark.parametrize("start", ["outside", "renewal", (0.0, 0.1), (0.2, 0.4), (0.9, 1.1), (2.3, 2.7)])
@pytest.mark.parametrize(
    ("kernel", "level"),
    [("squared exponential", level) for level in (-1.0, 0.0, 1.0, 2.5)]
    + [("matern 3/2", 0.0), ("matern 3/2", 1.0), ("matern 5/2", 0.0), ("wong", 0.0)],
)
def test_table_and_march_draw_the_same_hits(kernel, level, start, n, seed):
    """Distance, slope and the gradient across, of rays from outside, under Renewal, and given gradients whose slopes (in
    deviations) lie in a range. A range holds 10,000 excursions or more: what a table is off by is a fourth of what the test sees."""
    n, gp, memory, starts = n // 10, process(kernel, level, 12.0), "none", (None, None)
    if start != "outside":
        memory = "renewal" if start == "renewal" else "renewal+"
        low, high = (1, 1) if start == "renewal" else start
        slopes = np.random.default_rng(seed).uniform(low, high, (2, n)) * sqrt(KERNELS[kernel].derivative_variance(X))
        starts = [np.column_stack([s, np.full(n, 0.7), np.full(n, -0.4)]) for s in slopes]
    table = hits_along_x(gp, n, seed, starts[0], memory, t_max=9.0)
    march = hits_along_x(gp, n, seed + 1, starts[1], memory, "auto", t_max=9.0)
    assert table["counters"]["line_evaluations"] == 0 < march["counters"]["line_evaluations"]
    check_same_distribution(table["t"], march["t"], "distance")
    hit = [np.isfinite(h["t"]) for h in (table, march)]
    near = [h["t"] < np.median(march["t"]) for h in (table, march)]
    for rows, what in ((hit, "hits"), (near, "near hits")):
        for axis in range(3):
            check_same_distribution(table["gradient"][rows[0], axis], march["gradient"][rows[1], axis], f"{what}, {axis}")


def test_directions_and_transforms_of_length_scales(n, seed):
    """Anisotropic and rotated length scales, one of them infinite: rays in all directions."""
    rng = np.random.default_rng(seed)
    n = n // 5
    directions = rng.normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    start = {"value": np.zeros(n), "gradient": directions * rng.rayleigh(size=(n, 1))}
    for lengths in ((0.3, 1.0, 2.0), (0.5, 0.5, np.inf)):
        kernel = gn.SquaredExponential(lengths, rotation=(0.9, 0.1, 0.3, -0.3))
        gp = gn.GaussianProcess(gn.ConstantField(0.1), 0.5, kernel, bounds=((-3,) * 3, (3,) * 3))
        for how in (None, start):
            memory = "none" if how is None else "renewal+"
            table, march = (
                gn.first_hits(gp, np.zeros((n, 3)), directions, 6, memory=memory, start=how, sampler=s, seed=seed + i)
                for i, s in enumerate(("first_passage", "auto"))
            )
            check_same_distribution(table["t"], march["t"], "distance")
            for axis in range(3):
                a, b = (h["gradient"][np.isfinite(h["t"]), axis] for h in (table, march))
                check_same_distribution(a, b, f"gradient {axis}")
            slopes = np.sum(table["gradient"] * directions, axis=1)[np.isfinite(table["t"])]
            assert (slopes <= 0).all()


def test_rays_inside_see_the_process_turned_over(n, seed):
    """Definitions B7: the hits of -f from inside are those of f from outside, gradients turned round."""
    inside = np.ones(n, bool)
    gp, turned = (process("squared exponential", level) for level in (-0.7, 0.7))
    a = gn.first_hits(
        gp, np.zeros((n, 3)), np.tile(X, (n, 1)), 30, memory="none", inside=inside, sampler="first_passage", seed=seed
    )
    b = hits_along_x(turned, n, seed + 1, memory="none", t_max=30)
    check_same_distribution(a["t"], b["t"], "distance")
    check_same_distribution(a["gradient"][:, 0], -b["gradient"][:, 0], "slope")


def test_hits_depend_on_neither_threads_nor_what_was_drawn_before(seed):
    n = 2000
    for k in range(6):  # more tables than are kept
        hits_along_x(process("squared exponential", 0.1 * k), 10, seed)
    calls = [
        gn.first_hits(
            process("squared exponential"), np.zeros((n, 3)), np.tile(X, (n, 1)), 30, sampler="first_passage", seed=seed,
            threads=threads,
        )["t"]
        for threads in (1, 2)
    ]  # fmt: skip
    assert np.array_equal(*calls)


BOUNDS = ((-1,) * 3, (1,) * 3)


@pytest.mark.parametrize(
    ("gp", "why"),
    [
        (lambda: gn.GaussianProcess(gn.SphereField((0, 0, 0), 0.5), 0.1, gn.SquaredExponential(1)), "the mean varies"),
        (
            lambda: gn.GaussianProcess(
                0.0, gn.GridField(np.linspace(0.1, 0.2, 8).reshape(2, 2, 2), 2.0, (-1,) * 3), gn.SquaredExponential(1), bounds=BOUNDS
            ),
            "the deviation varies",
        ),
        (lambda: gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1)), "there are no bounds"),
        (
            lambda: gn.GaussianProcess(0.0, 1.0, gn.SquaredExponential(1) + gn.Matern(1.5, 1), bounds=BOUNDS),
            "not one radial correlation",
        ),
        (lambda: gn.GaussianProcess(0.0, 1.0, gn.Matern(0.5, 1), bounds=BOUNDS), "the kernel has no slopes"),
        (lambda: gn.GaussianProcess(0.0, 1.0, gn.RationalQuadratic(2, 1), bounds=BOUNDS), "take long to draw"),
        (lambda: gn.GaussianProcess(4.5, 1.0, gn.SquaredExponential(0.01), bounds=BOUNDS), "at 4.5 standard deviations"),
        (lambda: gn.GaussianProcess(-6.0, 1.0, gn.SquaredExponential(1), bounds=BOUNDS), "at -6 standard deviations"),
        (
            lambda: gn.GaussianProcess(
                0.0, 1.0, gn.SquaredExponential(1), bounds=BOUNDS, conditions={"points": [(0, 0, 0)], "values": [0.0]}
            ),
            "condition",
        ),
    ],
)
def test_what_no_table_serves_is_refused_by_name(gp, why):
    with pytest.raises(ValueError, match=why):
        gn.first_hits(gp(), np.zeros((1, 3)), X[None], 1, sampler="first_passage")


def test_what_a_table_does_not_know_is_refused(seed):
    gp, one = process("squared exponential"), (np.zeros((1, 3)), X[None])
    known = {"value": np.array([0.3]), "gradient": np.zeros((1, 3))}
    with pytest.raises(ValueError, match="starts where f is known"):
        gn.first_hits(gp, *one, 1, start=known, sampler="first_passage")
    with pytest.raises(ValueError, match="nothing of the way"):
        gn.line_values(gp, *one, np.array([0.5]), sampler="first_passage")
    with pytest.raises(ValueError, match="with conditions or memory 'global-n'"):
        gn.first_hits(gp, *one, 1, memory="global-1", sampler="first_passage")
    with pytest.raises(ValueError, match="takes sampler 'auto' or"):
        gn.first_hits(gp, *one, 1, memory="global", sampler="first_passage")
    with pytest.raises(ValueError, match="leaves of a tree"):
        gn.first_hits(gn.union(gp, gp), *one, 1, sampler="first_passage")
    with pytest.raises(ValueError, match="too large a table"):
        gn.first_hits(gp, *one, 1, tolerance=1e-5, sampler="first_passage")
