"""First hits per second and core of the process alone, without light."""

import time

import gpis_native as gn
import numpy as np


def rate(gp, origins, directions, **options):
    best = np.inf
    for seed in range(3):
        start = time.perf_counter()
        hits = gn.first_hits(gp, origins, directions, 100.0, threads=1, seed=seed, **options)
        best = min(best, time.perf_counter() - start)
    c = hits["counters"]
    segments = max(c["line_segments"], 1)
    row = {
        "first_hits_per_second": c["line_segments"] / best,
        "hit_fraction": float(np.isfinite(hits["t"]).mean()),
        "evaluations_per_segment": c["line_evaluations"] / segments,
        "normals_per_segment": c["line_normals"] / segments,
    }
    return row, hits


def bench_sphere():
    """Unit sphere, ℓ = .1, σ = .05; only rays that enter the uncertain band; camera and secondary rays apart."""
    n = 200_000
    rng = np.random.default_rng(1)
    bounds = ((-1.3, -1.3, -1.3), (1.3, 1.3, 1.3))
    gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 0.05, gn.SquaredExponential(0.1), bounds=bounds)
    radius, angle = 1.2 * np.sqrt(rng.uniform(size=n)), rng.uniform(0, 2 * np.pi, n)
    origins = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, 4.0)])
    directions = np.tile([0.0, 0.0, -1.0], (n, 1))
    rows = []
    for sampler in ("convolution", "dense"):
        row, hits = rate(gp, origins, directions, sampler=sampler)
        rows.append({"sampler": sampler, "rays": "camera"} | row)
        hit = np.isfinite(hits["t"])
        normal = hits["gradient"][hit] / np.linalg.norm(hits["gradient"][hit], axis=1, keepdims=True)
        out = normal + (lambda v: v / np.linalg.norm(v, axis=1, keepdims=True))(rng.normal(size=normal.shape))
        out /= np.linalg.norm(out, axis=1, keepdims=True)
        start = {key: value[hit] for key, value in hits["state"].items()}
        row, _ = rate(gp, hits["position"][hit], out, start=start, sampler=sampler)
        rows.append({"sampler": sampler, "rays": "secondary"} | row)
    return rows
