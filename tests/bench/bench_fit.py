"""Sample, compose, fit: 128³ nodes, two operands, n = 1,000 realisations; against the same generator without skipping."""

import json
import resource
import subprocess
import sys
import time
from pathlib import Path

import gpis_native as gn
import numpy as np

OUT = Path(__file__).resolve().parents[2] / "out" / "bench"


def two_spheres():
    """The scene of the published voxels (shared/data): a rough sphere and an almost certain one."""
    return [
        gn.GaussianProcess(gn.SphereField([x, 0.8, 0], radius), sigma, gn.SquaredExponential(0.5))
        for x, radius, sigma in ((-0.4, 0.8, 0.1), (0.4, 0.5, 0.001))
    ]


def one_fit(method, certainty, resolution, realisations):
    bounds = ((-1.5, -0.499, -1.5), (1.5, 2.501, 1.5))
    query = two_spheres(), "union", bounds, resolution, realisations
    plan = gn.compose_and_fit_plan(*query, method=method, certainty=certainty)
    before = time.process_time()
    counters = gn.compose_and_fit(*query, method=method, certainty=certainty)["counters"]
    return {
        "method": method if certainty < np.inf else "sample, no skipping",
        "seconds": counters["seconds"],
        "cpu_seconds": time.process_time() - before,  # of all threads: what other programs do counts little
        "planned_seconds": plan["seconds"],
        "voxels": counters["voxels"],
        "voxels_drawn": counters["voxels_drawn"],
        "planned_MB": plan["memory"] / 2**20,
        "peak_MB": resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**10,
    }


def bench_two_spheres(quick=False):
    """Every row in a process of its own, whose peak memory is the fit's: about 60 MB of it are the interpreter's."""
    size = ("32", "100") if quick else ("128", "1000")
    rows = []
    for method, certainty in (("closed_form", 5.0), ("sample", 5.0), ("sample", np.inf)):
        done = subprocess.run([sys.executable, __file__, method, str(certainty), *size], check=True, stdout=subprocess.PIPE)
        rows.append(json.loads(done.stdout))
    return rows


def bench_against_clark(quick=False):
    """200 random pairs (means, deviations and correlations differ): RMS error of the sampled mean and deviation in units of the
    exact deviation, against the number of realisations; and as a plot in out/bench/fit_against_clark.svg."""
    rng = np.random.default_rng(5)
    pairs = 40
    counts = (50, 100, 200, 500) + (() if quick else (1000, 2000, 5000, 10_000))
    error = np.zeros((len(counts), 2))
    for correlation in (-0.6, 0.0, 0.3, 0.8, 1.0):
        mean, sigma = rng.normal(size=(2, pairs)), np.exp(rng.normal(-0.3, 0.7, size=(2, pairs)))
        sheets = gn.SquaredExponential([0.2, np.inf, np.inf])  # a node knows nothing of the next
        fields = [[gn.GridField(np.broadcast_to(v[:, None, None], (pairs, 2, 2)), 1.0) for v in of] for of in (mean, sigma)]
        operands = [gn.GaussianProcess(m, s, sheets) for m, s in zip(*fields, strict=True)]
        query = operands, "union", ((0, 0, 0), (pairs - 1.0, 1, 1)), pairs
        options = {"correlation": correlation, "certainty": np.inf}
        exact = gn.compose_and_fit(*query, 2, method="closed_form", **options)
        for row, n in zip(error, counts, strict=True):
            fit = gn.compose_and_fit(*query, n, **options)
            for k, name in enumerate(("mean", "sigma")):
                row[k] += np.sum(((fit[name] - exact[name]) / exact["sigma"])[:, 0, 0].astype(float) ** 2)
    error = np.sqrt(error / (5 * pairs))
    plot_against_clark(np.array(counts), error)
    return [
        {"n": n, "error_of_mean": m, "error_of_sigma": s, "mean_times_root_n": m * n**0.5, "sigma_times_root_n": s * n**0.5}
        for n, (m, s) in zip(counts, error, strict=True)
    ]


def plot_against_clark(n, error):
    import matplotlib

    matplotlib.use("svg")
    from matplotlib import pyplot

    figure, axes = pyplot.subplots(figsize=(5.5, 3.6), layout="constrained")
    axes.loglog(n, 1 / np.sqrt(n), color="0.7", label="$1/\\sqrt{n}$")
    for k, (name, mark) in enumerate((("mean", "o"), ("σ", "s"))):
        axes.loglog(n, error[:, k], mark, label=f"error of the {name}")
    axes.set(xlabel="realisations n", ylabel="RMS error / σ, 200 pairs")
    axes.legend()
    OUT.mkdir(parents=True, exist_ok=True)
    figure.savefig(OUT / "fit_against_clark.svg")
    pyplot.close(figure)


if __name__ == "__main__":
    print(json.dumps(one_fit(sys.argv[1], float(sys.argv[2]), *map(int, sys.argv[3:]))))
