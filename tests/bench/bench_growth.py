"""Cost as the work grows: CPU seconds and operations a sample against ray length, grid resolution, objects, condition
points, CSG depth and threads, with the exponent of each; `./dev bench growth` (or `--quick`) plots out/bench/growth.png."""

import time
from pathlib import Path

import numpy as np
from growth.axes import AXES
from growth.plot import figure

OUT = Path(__file__).parents[2] / "out" / "bench"
# Counters that are shown a sample, by their titles.
SHOWN = {"line_evaluations": "evaluations", "line_segments": "segments", "condition_rows": "condition_rows"}


def exponent(rows, key, decades=1.0):
    """Slope of log cost against log size over the last decade of sizes (two sizes at least)."""
    x, y = np.log([row["size"] for row in rows]), np.log([max(row[key], 1e-12) for row in rows])
    last = x >= min(x[-2], x[-1] - decades * np.log(10) - 1e-9)
    return float(np.polyfit(x[last], y[last], 1)[0])


def measured(size, measure, repetitions):
    """The least CPU seconds of several runs, those of all threads together."""
    best = wall = np.inf
    for _ in range(repetitions):
        begun, start = time.perf_counter(), time.process_time()
        samples, counters = measure()
        best = min(best, time.process_time() - start)
        wall = min(wall, time.perf_counter() - begun)
    row = {"size": size, "cpu_s/sample": best / samples, "wall_s/sample": wall / samples}
    return row | {f"{title}/sample": counters[name] / samples for name, title in SHOWN.items()}


def bench_growth(quick=False):
    """One row a size; `exponent` is that of CPU seconds over the last decade of sizes, on the last row of its axis."""
    table, found = [], {}
    for name, (sizes, title) in AXES.items():
        rows = [measured(size, measure, 2 if quick else 3) for size, measure in sizes(quick)]
        of_cost = exponent(rows, "cpu_s/sample")
        found[name] = title, rows, of_cost
        rows[-1] = rows[-1] | {"exponent": of_cost, "of evaluations": exponent(rows, "evaluations/sample")}
        table += [{"axis": name} | row for row in rows]
    OUT.mkdir(parents=True, exist_ok=True)
    figure(found, OUT / "growth.png")
    print(f"written: {OUT / 'growth.png'}")
    return table
