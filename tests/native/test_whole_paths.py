"""Paths of many segments against what is exact of all of them: oracle 14 (one normal), with every memory that a path can have."""

import gpis_native as gn
import numpy as np
import pytest
from line_samplers import LONG, SERVED, factorises
from statistics_checks import check_z

pytestmark = pytest.mark.stats
BOUNDS = ((-1.8,) * 3, (1.8,) * 3)
SIGMA = 0.1


def radii(gp, n, inside, seed, **how):
    """Of the successive hits of paths by mirror reflection, from an eye that is not in the centre: (4, n)."""
    directions = np.random.default_rng(seed).normal(size=(n, 3))
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    side = {"inside": np.ones(n, bool)} if inside else {}
    hits, found = gn.first_hits(gp, np.tile([0.3, 0, 0], (n, 1)), directions, 10, seed=seed, **side, **how), []
    for k in range(4):
        assert np.isfinite(hits["t"]).all(), f"segment {k}"
        found.append(np.linalg.norm(hits["position"], axis=1))
        normals = hits["gradient"] / np.linalg.norm(hits["gradient"], axis=1, keepdims=True)
        directions = directions - 2 * np.sum(directions * normals, axis=1, keepdims=True) * normals
        start = {"start": hits["state"]}
        hits = gn.first_hits(gp, hits["position"], directions, 10, seed=seed + 1 + k, **start, **side, **how)
    return np.array(found)


def check_one_normal(found, off):
    """Every hit of a path at the radius of its first, 1 + σξ."""
    assert np.max(np.abs(found - found[0])) < off, np.max(np.abs(found - found[0]), axis=1)
    xi = (found[0] - 1) / SIGMA
    check_z(xi.mean(), 0, 1 / np.sqrt(len(xi)))
    check_z((xi**2).mean(), 1, np.sqrt(2 / len(xi)))


# Kernels that take one have a length that is infinite, the others one of 1e4 radii.
ENDLESS = {name: of(1e4 if name in ("locally periodic", "plane wave") else np.inf) for name, of in LONG.items()}


def shape(where, kernel):
    mean = gn.SphereField([0, 0, 0], 1)
    return gn.GaussianProcess(mean if where == "ball" else -1 * mean, SIGMA, kernel, bounds=BOUNDS)


@pytest.mark.parametrize("where", ["cave", "ball"])
@pytest.mark.parametrize(("kernel", "sampler"), SERVED)
def test_infinite_length_scales_are_one_normal_for_a_path(kernel, sampler, where, full_size, seed):
    """Oracle 14: f = μ + σξ with one ξ for the path, in a cave, and from the inside of a ball. Without memory
    each hit has its own."""
    n = (40 if sampler == "realisation" or factorises(kernel, sampler) else 300) * (20 if full_size else 1)
    gp = shape(where, ENDLESS[kernel])
    for memory in ("renewal", "renewal+"):
        check_one_normal(radii(gp, n, where == "ball", seed, memory=memory, sampler=sampler), 2e-3)
    forgetful = radii(gp, n, where == "ball", seed, memory="none", sampler=sampler)
    assert np.median(np.abs(forgetful - forgetful[0]), axis=1)[1:].min() > 0.3 * SIGMA


@pytest.mark.parametrize("where", ["cave", "ball"])
@pytest.mark.parametrize("memory", ["global-2", "global"])
@pytest.mark.parametrize("kernel", LONG)
def test_infinite_length_scales_are_one_normal_for_what_is_remembered(kernel, memory, where, full_size, seed):
    """The same for memories that have a sampler of their own."""
    n = (40 if kernel.startswith("sum") else 100) * (20 if full_size else 1)
    check_one_normal(radii(shape(where, ENDLESS[kernel]), n, where == "ball", seed, memory=memory), 2e-3)
