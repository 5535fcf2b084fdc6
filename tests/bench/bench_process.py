"""First hits per second and core of the process alone, without light; `yardstick` is a fixed loop of numpy, so that
machines compare. Only rays that meet the uncertain region count; camera and secondary rays apart. Times are those of
the processor, one thread."""

import sys
import time
from pathlib import Path

import gpis_native as gn
import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))
from tensor_grids import VARYING  # noqa: E402

SHARED = Path(__file__).parents[3] / "shared" / "data" / "gpis-light-transport"
SAMPLERS = ("convolution", "markov", "spectral", "nystrom", "dense", "realisation")


def kernel_for(sampler, length_scale):
    """Markov lines serve no squared exponential."""
    return gn.Matern(2.5, length_scale) if sampler == "markov" else gn.SquaredExponential(length_scale)


def seconds(work, repetitions=5):
    best = np.inf
    for i in range(repetitions):
        start = time.process_time()
        result = work(i)
        best = min(best, time.process_time() - start)
    return best, result


def rate(gp, origins, directions, repetitions=5, **options):
    def trace(seed):
        return gn.first_hits(gp, origins, directions, 100.0, threads=1, seed=seed, **options)

    best, hits = seconds(trace, repetitions)
    c = hits["counters"]
    segments = max(c["line_segments"], 1)
    row = {
        "first_hits_per_second": c["line_segments"] / best,
        "hit_fraction": float(np.isfinite(hits["t"]).sum() / segments),
        "evaluations": c["line_evaluations"] / segments,
        "normals": c["line_normals"] / segments,
        "splits": c["line_splits"] / segments,
        "factorisations": c["factorisations"] / segments,
    }
    return row, hits


def missed_roots(gp, origins, directions, near, far, spacing, **options):
    """Fraction of rays whose own sample path is inside somewhere in front of its hit."""
    t = np.arange(near, far, spacing)
    values = gn.line_values(gp, origins, directions, t, threads=1, **options)
    return float(np.mean(np.nanmin(np.column_stack([values, np.ones(len(values))]), axis=1) < 0))


def diffuse(hits, directions, rng):
    """Rays that leave the hits, with what Renewal+ remembers."""
    hit = np.isfinite(hits["t"])
    normal = hits["gradient"][hit] / np.linalg.norm(hits["gradient"][hit], axis=1, keepdims=True)
    out = normal + (lambda v: v / np.linalg.norm(v, axis=1, keepdims=True))(rng.normal(size=normal.shape))
    out /= np.linalg.norm(out, axis=1, keepdims=True)
    return hits["position"][hit], out, {key: hits["state"][key][hit] for key in ("value", "gradient")}


def camera_and_secondary(gp, origins, directions, sampler, n, rng, repetitions=5):
    """Two rows, or one that says why the sampler does not serve the process. Slow samplers get fewer rays."""
    slow = {"nystrom": 20, "realisation": 50}.get(sampler, 1)
    m = max(n // slow, 200)
    try:
        row, hits = rate(gp, origins[:m], directions[:m], repetitions, sampler=sampler)
    except ValueError as error:
        return [{"sampler": sampler, "rays": str(error).split(":")[0][:60]}]
    starts, out, state = diffuse(hits, directions, rng)
    second, _ = rate(gp, starts, out, repetitions, start=state, sampler=sampler)
    return [{"sampler": sampler, "rays": "camera"} | row, {"sampler": sampler, "rays": "secondary"} | second]


def bench_yardstick():
    """A fixed amount of arithmetic in numpy."""
    x = np.linspace(0, 1, 1_000_000)
    best, _ = seconds(lambda _: [np.exp(-x * x).sum() for _ in range(20)])
    return {"exponentials_per_second": 2e7 / best}


def bench_sphere(quick=False):
    """Unit sphere, squared exponential (markov: Matern 5/2), l = .1, sigma = .05."""
    n = 10_000 if quick else 200_000
    rng = np.random.default_rng(1)
    bounds = ((-1.3, -1.3, -1.3), (1.3, 1.3, 1.3))
    radius, angle = 1.2 * np.sqrt(rng.uniform(size=n)), rng.uniform(0, 2 * np.pi, n)
    origins = np.column_stack([radius * np.cos(angle), radius * np.sin(angle), np.full(n, 4.0)])
    directions = np.tile([0.0, 0.0, -1.0], (n, 1))
    rows = []
    for sampler in SAMPLERS:
        gp = gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), 0.05, kernel_for(sampler, 0.1), bounds=bounds)
        rows += camera_and_secondary(gp, origins, directions, sampler, n, rng, 2 if quick else 5)
        if "first_hits_per_second" in rows[-1]:
            m = (400 if sampler in ("nystrom", "realisation") else 20_000) // (10 if quick else 1)
            missed = missed_roots(gp, origins[:m], directions[:m], 2.6, 5.4, 0.002, sampler=sampler, seed=9)
            rows[-2]["missed_roots"] = missed
    return rows


def bench_bunny(quick=False):
    """bunny.vdb as published (deviation half of its grid, l = .5; markov: Matern 5/2), seen from its camera."""
    path = SHARED / "bunny.vdb"
    if not path.exists():
        return {"sampler": "bunny.vdb is not beside this checkout"}
    n = 5_000 if quick else 50_000
    rng = np.random.default_rng(1)
    mean = gn.VdbField(str(path), "mean")
    sigma = 0.5 * gn.VdbField(str(path), "variance", meaning="value")  # its grid holds the deviation
    eye = np.array([2.0, 2.2, 7.0])
    directions = rng.uniform(-0.9, 0.9, (n, 3)) - eye
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    rows = []
    for sampler in SAMPLERS:
        gp = gn.GaussianProcess(mean, sigma, kernel_for(sampler, 0.5))
        rows += camera_and_secondary(gp, np.tile(eye, (n, 1)), directions, sampler, n, rng, 1 if quick else 3)
    return rows


def bench_varying_lengths(quick=False):
    """Planar mean with a tensor field A(x), what `auto` picks: the stated error of the correlation and the cost."""
    rng, n = np.random.default_rng(1), 200 if quick else 2000
    direction = np.array([0.9, 0.1, -0.3])
    origins = np.column_stack([rng.uniform(-1.5, 0, n), rng.uniform(-1, 1, n), np.full(n, 1.5)])
    directions = np.tile(direction / np.linalg.norm(direction), (n, 1))
    rows = []
    for name, field in VARYING.items():
        for kernel in (gn.SquaredExponential(1), gn.Matern(1.5, 1)):
            bounds = ((-2, -2, -2), (8, 2, 2))
            gp = gn.GaussianProcess(gn.PlaneField([0, 0, 0], [0, 0, 1]), 0.3, kernel, anisotropy=field, bounds=bounds)
            plan, (row, _) = gp.plan(), rate(gp, origins, directions, 1 if quick else 3)
            about = {"field": name, "kernel": repr(kernel), "sampler": plan["sampler"].split(":")[0]}
            rows.append(about | {"correlation_error": float(plan["correlation_error"])} | row)
    return rows
