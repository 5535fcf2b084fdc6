"""Sample, compose, fit: 128³ nodes, two operands, n = 1,000 realisations; against the same generator without skipping."""

import resource

import gpis_native as gn
import numpy as np


def two_spheres():
    """The scene of the published voxels (shared/data): a rough sphere and an almost certain one."""
    return [
        gn.GaussianProcess(gn.SphereField([x, 0.8, 0], radius), sigma, gn.SquaredExponential(0.5))
        for x, radius, sigma in ((-0.4, 0.8, 0.1), (0.4, 0.5, 0.001))
    ]


def bench_two_spheres():
    """Peak memory is the process's own, so rows that come later include those before."""
    bounds = ((-1.5, -0.499, -1.5), (1.5, 2.501, 1.5))
    rows = []
    for method, certainty in (("closed_form", 5.0), ("sample", 5.0), ("sample", np.inf)):
        query = two_spheres(), "union", bounds, 128, 1000
        plan = gn.compose_and_fit_plan(*query, method=method, certainty=certainty)
        counters = gn.compose_and_fit(*query, method=method, certainty=certainty)["counters"]
        rows.append(
            {
                "method": method if certainty < np.inf else "sample, no skipping",
                "seconds": counters["seconds"],
                "planned_seconds": plan["seconds"],
                "voxels": counters["voxels"],
                "voxels_drawn": counters["voxels_drawn"],
                "planned_MB": plan["memory"] / 2**20,
                "peak_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10,
            }
        )
    return rows
