"""Sampler against sampler: two-sample tests of (t, gradient) at first hits and at the hits of rays reflected there, over
every kernel x memory x anisotropy x mean and all samplers that serve the kernel (issue "the process, exact", must show 2).

Each comparison has the significance of statistics_checks.py: all of them together (some 6,000 at full size) raise a false
alarm with probability below 1e-3 (Bonferroni). More of memory `global`: test_realisation_path.py, test_segment_memory.py.
"""

from dataclasses import dataclass
from functools import lru_cache

import gpis_native as gn
import numpy as np
import pytest
from remembered import take
from statistics_checks import check_proportion, check_same_distribution
from tensor_grids import along_x, isotropic, rotating

pytestmark = pytest.mark.stats
BOUNDS = ((-1, -1, -1), (1, 1, 1))
TURN = [0.9, 0.3, -0.2, 0.1]
SHAPES = {"isotropic": {"length_scale": 0.3}, "turned 4:1": {"length_scale": [0.6, 0.15, 0.3], "rotation": TURN}}
MEANS = {"plane": gn.PlaneField([0, 0, 0], [0.3, 0.5, 0.8], 0.35), "constant": gn.ConstantField(0.1)}
MEMORIES = ["none", "renewal", "renewal+"]


@dataclass
class Case:
    """A kernel and its samplers, the one that all others are held against first. `joint`: `dense` draws each line from its
    own covariance. `again`: the same process written otherwise, which `again_by` serves."""

    kernel: gn.Kernel
    samplers: tuple
    joint: bool = False
    anisotropy: object = None
    again: gn.Kernel = None
    again_by: str = None


SMOOTH = ("spectral", "nystrom", "dense", "realisation")
ROUGH = ("markov", "dense", "realisation")
SE = gn.SquaredExponential
CASES = {
    "squared exponential": lambda s, turned: Case(SE(**s), ("convolution", *SMOOTH)),
    "matern 3/2": lambda s, turned: Case(gn.Matern(1.5, **s), ROUGH),
    "matern 5/2": lambda s, turned: Case(gn.Matern(2.5, **s), ROUGH),
    "wong": lambda s, turned: Case(gn.Wong(**s), ROUGH),
    "height field": lambda s, turned: Case(gn.Matern(2.5, [0.4, 0.2, np.inf], rotation=TURN if turned else [1, 0, 0, 0]), ROUGH),
    "rational quadratic": lambda s, turned: Case(gn.RationalQuadratic(0.7, **s), SMOOTH),
    "locally periodic": lambda s, turned: Case(
        gn.LocallyPeriodic(period=0.5, axis=[0, 0.6, 0.8], periodic_scale=0.9, **s), SMOOTH, joint=True
    ),
    "plane wave": lambda s, turned: Case(gn.PlaneWave([3, -4, 8] if turned else [1, 0, 7]), SMOOTH, joint=True),
    "sum": lambda s, turned: Case(0.5 * SE(**s) + 0.5 * gn.RationalQuadratic(1, 0.4), SMOOTH, joint=True),
    "sum with a rough term": lambda s, turned: Case(0.6 * SE(0.4) + 0.4 * gn.Matern(1.5, **s), ROUGH, joint=True),
    "sum of rough terms and a wave": lambda s, turned: Case(
        0.4 * gn.Matern(1.5, **s) + 0.3 * gn.Matern(2.5, 0.25) + 0.3 * gn.PlaneWave([2, 1, -5]) * SE(**s), ROUGH, joint=True
    ),
    "product": lambda s, turned: Case(gn.RationalQuadratic(1, **s) * gn.PlaneWave([2, 1, -2]), SMOOTH, joint=True),
    # The long factor is 1 to 1e-8 within the bounds, but no sampler knows.
    "product without normal form": lambda s, turned: Case(
        gn.Matern(2.5, **s), ("markov",), joint=True, again=gn.Matern(2.5, **s) * SE(1e4), again_by="dense"
    ),
    "product of rough kernels": lambda s, turned: Case(gn.Matern(1.5, **s) * SE(0.4), ("dense", "realisation"), joint=True),
    # The scale multiplies the deviation.
    "scaled": lambda s, turned: Case(1.7 * SE(**s), ("convolution", "spectral", "dense", "realisation")),
    "varying lengths": lambda s, turned: Case(
        SE(0.4),
        ("nystrom", "dense", "realisation"),
        joint=True,
        anisotropy=along_x(rotating if turned else lambda x: isotropic(np.exp(0.25 * x)), 3),
    ),
}


def number_of_rays(case, sampler, full_size):
    if sampler == "realisation":
        return 1000 if full_size else 300
    if sampler == "nystrom" or (sampler == "dense" and case.joint):
        return 5000 if full_size else 500
    return 60_000 if full_size else 6000


def camera_rays(n, seed):
    rng = np.random.default_rng(seed)
    origins = np.column_stack([rng.uniform(-0.4, 0.4, (n, 2)), np.full(n, 1.2)])
    directions = np.array([0.2, -0.3, -1.0]) + rng.normal(0, 0.05, (n, 3))
    return origins, directions / np.linalg.norm(directions, axis=1, keepdims=True)


@lru_cache
def processes(name, shape, mean):
    """The case and its processes: (sampler, process) with the reference first."""
    case = CASES[name](SHAPES[shape], shape != "isotropic")

    def process(kernel):
        return gn.GaussianProcess(MEANS[mean], 0.2, kernel, anisotropy=case.anisotropy, bounds=BOUNDS)

    pairs = [(sampler, process(case.kernel)) for sampler in case.samplers]
    return case, pairs + ([(case.again_by, process(case.again))] if case.again else [])


@lru_cache(maxsize=4)
def reference_hits(name, shape, mean, full_size, seed):
    """First hits by the reference, and the rays that are reflected there with the state they remember."""
    case, ((sampler, gp), *_) = processes(name, shape, mean)
    origins, directions = camera_rays(number_of_rays(case, sampler, full_size), seed)
    hits = gn.first_hits(gp, origins, directions, 10, sampler=sampler, seed=seed)
    hit = np.isfinite(hits["t"])
    gradient, d = hits["gradient"][hit], directions[hit]
    normal = gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
    out = d - 2 * np.sum(d * normal, axis=1, keepdims=True) * normal
    return hits, hits["position"][hit], out, {key: value[hit] for key, value in hits["state"].items()}


def across(directions):
    """Two unit vectors across each direction, (2, N, 3)."""
    first = np.cross(directions, [0.31, 0.87, 0.38])
    first /= np.linalg.norm(first, axis=1, keepdims=True)
    return np.stack([first, np.cross(directions, first)])


def quantities(hits, directions, start_gradient):
    """Numbers of each hit whose laws are compared: all of the gradient, alone and against the one at the start."""
    hit = np.isfinite(hits["t"])
    g, d = hits["gradient"][hit], directions[hit]
    slope = np.sum(g * d, axis=1)
    assert np.all(slope <= 0)  # definitions E8
    sides = np.einsum("knj,nj->kn", across(d), g)
    numbers = {"n·d": slope / np.linalg.norm(g, axis=1), "slope": slope, "across 1": sides[0], "across 2": sides[1]}
    if start_gradient is not None:
        before = np.einsum("knj,nj->kn", across(d), start_gradient[hit])
        numbers |= {f"memory {k + 1}": before[k] * sides[k] for k in range(2)}
    return numbers


def compare(a, b, directions, what, start_gradient=None):
    """Hits on the same rays: the first len(b) rows of `directions` for b. Else pairs of directions and of gradients."""
    n, m = len(a["t"]), len(b["t"])
    if not isinstance(directions, tuple):
        directions = directions, directions[:m]
        start_gradient = None if start_gradient is None else (start_gradient, start_gradient[:m])
    p = np.mean(np.isfinite(a["t"]))
    check_proportion(np.isfinite(b["t"]).sum(), m, p, np.sqrt(max(p * (1 - p), 1 / n) / n), f"{what}: hits")
    check_same_distribution(a["t"], b["t"], f"{what}: t")
    start = start_gradient or (None, None)
    of_a, of_b = (quantities(hits, *rest) for hits, *rest in zip((a, b), directions, start, strict=True))
    for key in of_a:
        check_same_distribution(of_a[key], of_b[key], f"{what}: {key}")
    assert min(len(of_a["slope"]), len(of_b["slope"])) > 20


def others(name, shape, mean, full_size):
    """The samplers to compare with the reference. CI draws realisations, which are slow, for one shape and mean only."""
    case, (_, *rest) = processes(name, shape, mean)
    for k, (sampler, gp) in enumerate(rest):
        if sampler != "realisation" or full_size or (shape == "turned 4:1" and mean == "plane"):
            yield 1000 * (k + 1), sampler, gp, number_of_rays(case, sampler, full_size)


everything = [pytest.mark.parametrize(*p) for p in (("mean", MEANS), ("shape", SHAPES), ("name", CASES))]


def over_all(test):
    for mark in everything:
        test = mark(test)
    return test


@over_all
def test_first_hits(name, shape, mean, full_size, seed):
    expected, *_ = reference_hits(name, shape, mean, full_size, seed)
    origins, directions = camera_rays(len(expected["t"]), seed)
    for offset, sampler, gp, n in others(name, shape, mean, full_size):
        n = min(n, len(origins))
        hits = gn.first_hits(gp, origins[:n], directions[:n], 10, sampler=sampler, seed=seed + offset)
        compare(expected, hits, directions, sampler)


@pytest.mark.parametrize("memory", MEMORIES)
@over_all
def test_second_hits(name, shape, mean, memory, full_size, seed):
    """Rays from the first hits of the reference, with the state that it left there: the law given a start."""
    _, origins, directions, state = reference_hits(name, shape, mean, full_size, seed)
    case, ((reference, gp), *_) = processes(name, shape, mean)

    def second(gp, sampler, n, seed):
        start = {key: value[:n] for key, value in state.items()}
        return gn.first_hits(gp, origins[:n], directions[:n], 10, memory=memory, start=start, sampler=sampler, seed=seed)

    expected = second(gp, reference, len(origins), seed + 500)
    for offset, sampler, gp, n in others(name, shape, mean, full_size):
        if sampler == "realisation" and memory != "renewal+" and not full_size:
            continue
        hits = second(gp, sampler, min(n, len(origins)), seed + 500 + offset)
        compare(expected, hits, directions, f"{memory}, {sampler}", state["gradient"])


def paths_of_two(gp, memory, sampler, n, seed):
    """Camera rays and those that are reflected at their hits: both hits, both directions, the gradient between."""
    origins, directions = camera_rays(n, seed)
    first = gn.first_hits(gp, origins, directions, 10, memory=memory, sampler=sampler, seed=seed)
    hit = np.isfinite(first["t"])
    normal = first["gradient"][hit] / np.linalg.norm(first["gradient"][hit], axis=1, keepdims=True)
    out = directions[hit] - 2 * np.sum(directions[hit] * normal, axis=1, keepdims=True) * normal
    start = take(first["state"], hit)
    second = gn.first_hits(gp, first["position"][hit], out, 10, memory=memory, start=start, sampler=sampler, seed=seed + 1)
    return first, second, directions, out, start["gradient"]


@over_all
def test_paths_that_remember_whole_segments(name, shape, mean, full_size, seed):
    """The second segment of a path knows all of the first under global-1, as it does where one realisation serves both
    (global): one law, by samplers that share nothing. At full size the joint samplers against each other too."""
    if not full_size and (shape, mean) != ("turned 4:1", "plane"):
        return
    case, pairs = processes(name, shape, mean)
    gp, smooth = pairs[0][1], "nystrom" in case.samplers
    n = 2000 if full_size else 250
    paths = {"global": paths_of_two(gp, "global", "auto", n, seed)}
    for k, sampler in enumerate(("nystrom", "dense") if smooth and full_size else ("auto",)):
        paths[sampler] = paths_of_two(pairs[-1][1], "global-1", sampler, 2 * n, seed + 100 * (k + 1))
    expected, *others = paths.items()
    for what, of in others:
        for segment in range(2):
            directions = expected[1][2 + segment], of[2 + segment]
            gradients = (expected[1][4], of[4]) if segment else None
            compare(expected[1][segment], of[segment], directions, f"{what}, segment {segment}", gradients)
