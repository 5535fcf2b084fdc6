"""Grids that are too small, empty, not finite or negative outside, and other values that no process can have: refused
by a sentence, or the exact answer of the field that they still describe."""

import os
import tempfile

import gpis_native as gn
import numpy as np
from line_samplers import KERNELS
from statistics_checks import normal_cdf

from stability.verdicts import Cell, few_hits, first_hits, of_cdf, of_rate, within

BOX = ((-1,) * 3, (1,) * 3)
SE = gn.SquaredExponential(0.5)


def sphere_values(nodes=9, low=-1.0, step=0.25):
    x = low + step * np.arange(nodes)
    return np.sqrt(x[:, None, None] ** 2 + x[None, :, None] ** 2 + x[None, None, :] ** 2) - 0.5


def spoiled(value):
    values = sphere_values()
    values[4, 4, 4] = value
    return values


def process(mean, sigma=0.1, kernel=SE, **more):
    return gn.GaussianProcess(mean, sigma, kernel, bounds=BOX, **more)


def grid(values, **more):
    return gn.GridField(values, more.pop("voxel", 0.25), (-1, -1, -1), **more)


def vdb(values, background=None):
    """A grid by way of a .vdb file."""
    handle, path = tempfile.mkstemp(suffix=".vdb")
    os.close(handle)
    try:
        gn.write_vdb(path, {"mean": values, "origin": (-1.0, -1, -1), "voxel_size": 0.25})
        return gn.VdbField(path, "mean")
    finally:
        os.remove(path)


def hit(gp, n=100, **options):
    return first_hits(gp, n, [0, 0, 0.999], [0, 0, -1], 3, seed=5, **options)


def certain(gp, n):
    """σ = 0 with a sphere of radius .5."""
    hits = hit(gp, n)
    return within(hits["t"], 0.499, 0.02, "the sphere", [hits])


def tensors(entries):
    return gn.TensorGridField(np.tile(np.array(entries, float), (3, 3, 3, 1)), 1.0, (-1,) * 3)


def refused(name, make):
    def run(n):
        made = make()
        gp = made if isinstance(made, gn.GaussianProcess) else process(made)
        hits = hit(gp)
        return within(np.nan, 0, 1, "a refusal", [hits])

    return Cell("values that are refused", name, "refused", run, refusal=True)


def one_voxel(n):
    """Two nodes a side: f is known on the cell, a plane."""
    values = np.broadcast_to(np.array([-1.0, 1.0]), (2, 2, 2)).copy()
    gp = gn.GaussianProcess(gn.GridField(values, 2.0, (-1, -1, -1)), 0.05, SE)
    hits = hit(gp, n)
    return of_cdf(hits["t"], lambda t: 1 - normal_cdf((0.999 - np.minimum(t, 2)) / 0.05), "Φ(μ/σ) of a falling f", [hits])


def one_voxel_sigma(n):
    sigma = gn.GridField(np.full((2, 2, 2), 0.05), 2.0, (-1, -1, -1))
    gp = process(gn.PlaneField([0, 0, 0], [0, 0, 1]), sigma)
    hits = hit(gp, n)
    return of_cdf(hits["t"], lambda t: 1 - normal_cdf((0.999 - np.minimum(t, 2)) / 0.05), "Φ(μ/σ) of a falling f", [hits])


def empty_vdb(_):
    hits = hit(process(vdb(np.full((5, 5, 5), 1.0))))
    return few_hits(hits, 1e-20, "no hit where the mean is 10 σ")


def far_background(n):
    """A grid of a millionth of the scene."""
    values = sphere_values(9, -1e-6, 0.25e-6)
    values = (values + 0.5) - 0.5e-6
    gp = gn.GaussianProcess(gn.GridField(values, 0.25e-6, (-1e-6,) * 3), 0.0, SE)
    hits = first_hits(gp, n, [0, 0, 1], [0, 0, -1], 3, seed=5)
    return within((1 - hits["t"]) / 1e-6, 0.5, 0.02, "the sphere", [hits])


def negative_background(n):
    """Outside of the grid there is no surface, whatever its background: only the sphere in it is hit."""
    values = sphere_values()
    return certain(process(grid(values, background=-1.0), 0.0), n)


def certain_grid(n):
    return certain(process(vdb(sphere_values()), 0.0), n)


def steep(n):
    """A mean that falls by 1e8 a metre: a plane at 0, whatever σ of 1 says."""
    gp = process(gn.PlaneField([0, 0, 0], [0, 0, 1], 1e8), 1.0)
    hits = hit(gp, n)
    return of_cdf((hits["t"] - 0.999) * 1e8, normal_cdf, "a normal about the plane", [hits])


def sigma_falls_to_zero(n):
    """σ = 0 below the middle: where the path has not hit before, the surface is the plane itself."""
    sigma = gn.PlaneField([0, 0, 0], [0, 0, 1], 0.2).clamped(0.0, 0.1)
    hits = hit(process(gn.PlaneField([0, 0, -0.3], [0, 0, 1]), sigma), n)
    before = np.mean(hits["t"] < 0.999)
    on_plane = np.abs(hits["t"][hits["t"] >= 0.999] - 1.299).max(initial=0)
    return within([np.isinf(hits["t"]).sum(), on_plane], 0, 1e-5, f"the plane where σ = 0 ({before:.2g} hit before)", [hits])


def huge(n):
    gp = process(gn.PlaneField([0, 0, 0], [0, 0, 1], 1e150), 1e149)
    hits = hit(gp, n)
    return of_cdf((hits["t"] - 0.999) * 10, normal_cdf, "a normal about the plane", [hits])


def tiny(n):
    gp = process(gn.PlaneField([0, 0, 0], [0, 0, 1], 1e-150), 1e-151)
    hits = hit(gp, n)
    return of_cdf((hits["t"] - 0.999) * 10, normal_cdf, "a normal about the plane", [hits])


def far_inside(n):
    """Outside for certain, where the mean is 1e160 deviations inside: the surface is met at once."""
    hits = hit(process(-1e160, 1.0), n)
    return within(hits["t"], 0, 1e-5, "the start", [hits])


def fast(kernel, sampler):
    return sampler == "auto" and kernel in ("squared exponential", "matern 3/2")


def hits_of_a_line(kernel, sampler, level, lengths, n):
    """And Rice's rate of them, per ray that is outside at the start."""
    gp = gn.GaussianProcess(level, 1, KERNELS[kernel], bounds=((-1, -1, -1), (lengths, 1, 1)))
    slope = np.sqrt(KERNELS[kernel].derivative_variance([1.0, 0, 0]))
    rate = slope / (2 * np.pi) * np.exp(-level * level / 2) / normal_cdf(level)
    return first_hits(gp, n, [0, 0, 0], [1, 0, 0], lengths, sampler=sampler, seed=5), float(rate)


# Means at which most lines of so many length scales are hit, late.
LATE = {1e2: 2.5, 1e3: 3.3, 1e4: 3.5, 1e5: 3.7}


def long_lines(kernel, sampler, lengths):
    """Constant mean over bounds of so many length scales: an answer in bounded time, or a refusal."""

    def run(_):
        n = 200 if fast(kernel, sampler) else 48 if lengths <= 1e3 else 16
        level = LATE[lengths]
        hits, rate = hits_of_a_line(kernel, sampler, level, lengths, n)
        # Of 1 to 1.2 crossings in a cluster only the first is a hit.
        return of_rate(hits, rate, 0.8, lengths, f"Rice's rate at {level:g} σ, evidence for another")

    return Cell("lines of so many length scales, μ = 2.5 to 3.7 σ", f"{kernel}, {sampler}", f"{lengths:g}", run)


def endless_lines(kernel, sampler, lengths):
    """A mean of 5.5 deviations is uncertain over all of the line, and next to no ray hits: every step is taken."""

    def run(_):
        hits, rate = hits_of_a_line(kernel, sampler, 5.5, lengths, 200 if fast(kernel, sampler) else 4)
        return few_hits(hits, rate * lengths, "Rice: 1 hit of 2e7 length scales")

    refusal = True if lengths > 1e5 else None
    return Cell("lines of so many length scales, μ = 5.5 σ", f"{kernel}, {sampler}", f"{lengths:g}", run, refusal)


INF, NAN = np.inf, np.nan
PLANE = gn.PlaneField([0, 0, 0], [0, 0, 1])
REFUSED = {
    "one node": lambda: grid(np.ones((1, 1, 1))),
    "no node": lambda: grid(np.ones((0, 3, 3))),
    "a voxel of NaN": lambda: grid(spoiled(NAN)),
    "a voxel of Inf": lambda: grid(spoiled(INF)),
    "a voxel of -Inf": lambda: grid(spoiled(-INF)),
    "a voxel beyond float": lambda: grid(spoiled(1e300)),
    ".vdb: a voxel of NaN": lambda: vdb(spoiled(NAN)),
    ".vdb: a voxel of Inf": lambda: vdb(spoiled(INF)),
    "σ grid: negative": lambda: process(PLANE, grid(np.full((3, 3, 3), -1.0))),
    "σ grid: NaN": lambda: process(PLANE, grid(spoiled(NAN))),
    "σ unbounded": lambda: process(PLANE, gn.SphereField([0, 0, 0], 0.1) + 0.2),
    "σ = -1": lambda: process(1.0, -1.0),
    "σ = NaN": lambda: process(1.0, NAN),
    "μ = NaN": lambda: process(NAN, 1.0),
    "μ = σ = 0": lambda: process(0.0, 0.0),
    "ℓ = 0": lambda: process(1.0, 1.0, gn.SquaredExponential(0)),
    "ℓ = NaN": lambda: process(1.0, 1.0, gn.SquaredExponential(NAN)),
    "A(x) not positive": lambda: process(1.0, 1.0, gn.SquaredExponential(1), anisotropy=tensors([1, -1, 1, 0, 0, 0.0])),
    "A(x) of NaN": lambda: process(1.0, 1.0, gn.SquaredExponential(1), anisotropy=tensors([NAN] * 6)),
    "voxel size 0": lambda: grid(sphere_values(), voxel=0.0),
    "bounds turned round": lambda: gn.GaussianProcess(1.0, 1.0, SE, bounds=((1,) * 3, (-1,) * 3)),
    "bounds of NaN": lambda: gn.GaussianProcess(1.0, 1.0, SE, bounds=((NAN,) * 3, (1,) * 3)),
    "condition without place": lambda: process(0.5, 1.0, conditions={"points": [[NAN, 0, 0]], "values": [0.0]}),
    "ℓ = σ / 1e7": lambda: process(PLANE, 0.1, gn.SquaredExponential(1e-8)),
}
EXACT = {
    "one voxel": one_voxel,
    "one voxel of σ": one_voxel_sigma,
    "an empty .vdb": empty_vdb,
    "a grid of 2e-6 m": far_background,
    "negative background": negative_background,
    "a certain .vdb": certain_grid,
    "a slope of 1e8": steep,
    "σ falls to 0": sigma_falls_to_zero,
    "μ and σ of 1e149": huge,
    "μ and σ of 1e-151": tiny,
    "μ of -1e160 σ": far_inside,
}


LINES = [
    (kernel, sampler, lengths)
    for kernel, samplers in (
        ("squared exponential", ("auto", "spectral", "nystrom", "dense", "realisation")),
        ("matern 3/2", ("auto", "dense")),
        ("rational quadratic", ("auto", "nystrom", "dense")),
        ("locally periodic", ("auto", "nystrom", "dense")),
        ("sum with a rough term", ("auto",)),
    )
    for sampler in samplers
    for lengths in (1e2, 1e3, 1e4, 1e5)
]
ENDLESS = [line[:2] + (lengths,) for line in LINES if line[2] == 1e2 for lengths in (1e3, 1e4, 1e6)]


def cells():
    return (
        [refused(name, make) for name, make in REFUSED.items()]
        + [Cell("values that are served", name, "exact", run, refusal=False) for name, run in EXACT.items()]
        + [long_lines(*line) for line in LINES]
        + [endless_lines(*line) for line in ENDLESS]
    )
