"""Kernels of one length scale, the samplers that serve them, and how many rays each is worth in a test."""

import gpis_native as gn

KERNELS = {
    "squared exponential": gn.SquaredExponential(1),
    "matern 3/2": gn.Matern(1.5, 1),
    "matern 5/2": gn.Matern(2.5, 1),
    "wong": gn.Wong(1),
    "rational quadratic": gn.RationalQuadratic(0.7, 1),
    "locally periodic": gn.LocallyPeriodic(1.5, 2.5, [0.6, 0.8, 0], 1.2),
    "plane wave": gn.PlaneWave([1.0, 0.5, 0.3]),
    "sum with a rough term": 0.6 * gn.SquaredExponential(1) + 0.4 * gn.Matern(1.5, 1),
    "sum of rough terms": 0.5 * gn.Matern(1.5, 1) + 0.3 * gn.Matern(2.5, 0.6) + 0.2 * gn.Wong(0.8),
}
# With a length scale to be given.
LONG = {
    "squared exponential": gn.SquaredExponential,
    "matern 3/2": lambda length: gn.Matern(1.5, length),
    "matern 5/2": lambda length: gn.Matern(2.5, length),
    "wong": gn.Wong,
    "rational quadratic": lambda length: gn.RationalQuadratic(0.7, length),
    "locally periodic": lambda length: gn.LocallyPeriodic(length, length, [0.6, 0.8, 0], 1.0),
    "plane wave": lambda length: gn.PlaneWave([1 / length, 0, 0]),
    "sum with a rough term": lambda length: 0.6 * gn.SquaredExponential(length) + 0.4 * gn.Matern(1.5, length),
    "sum of rough terms": lambda length: 0.6 * gn.Wong(length) + 0.4 * gn.Matern(2.5, length),
}
SMOOTH = ["spectral", "nystrom", "dense", "realisation"]
ROUGH = ["markov", "dense", "realisation"]
SAMPLERS = {
    "squared exponential": ["convolution", *SMOOTH],
    "matern 3/2": ROUGH,
    "matern 5/2": ROUGH,
    "wong": ROUGH,
    "rational quadratic": SMOOTH,
    "locally periodic": SMOOTH,
    "plane wave": SMOOTH,
    "sum with a rough term": ROUGH,
    "sum of rough terms": ROUGH,
}
SERVED = [(kernel, sampler) for kernel, samplers in SAMPLERS.items() for sampler in samplers]
# g'' of these jumps about: it has no variance.
ROUGH_KERNELS = ("matern 3/2", "wong", "sum with a rough term", "sum of rough terms")
# `dense` of these draws every line from its own covariance.
JOINT = ["locally periodic", "plane wave", "sum with a rough term", "sum of rough terms"]


def factorises(kernel, sampler):
    return sampler == "nystrom" or (sampler == "dense" and kernel in JOINT)


def worth(kernel, sampler, n):
    """n rays of the fast samplers, fewer of the slow ones."""
    if sampler == "realisation":
        return n // (500 if kernel.startswith("sum") else 100)
    return n // 30 if factorises(kernel, sampler) else n
