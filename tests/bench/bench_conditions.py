"""What conditions cost: solving them once, and rays of a unit sphere (length scale .1, deviation .05) near them; and what
memory global-n costs beside renewal+ and global."""

import re
import time

import gpis_native as gn
import numpy as np

MEAN, SIGMA, KERNEL = gn.SphereField((0, 0, 0), 1), 0.05, gn.SquaredExponential(0.1)


def camera_rays(n, rng):
    return np.c_[rng.uniform(-0.7, 0.7, (n, 2)), np.full(n, 3.0)], np.tile([0.0, 0, -1.0], (n, 1))


def bench_conditions(quick=False):
    rows = []
    for points in (0, 1, 10, 100) if quick else (0, 1, 10, 100, 1000, 10_000):
        for normals in (False, True):
            if points == 0 and normals:
                continue
            rng = np.random.default_rng(1)
            at = rng.normal(size=(points, 3))
            at /= np.maximum(np.linalg.norm(at, axis=1, keepdims=True), 1e-9)
            conditions = {"points": at * (1 + 0.02 * rng.normal(size=(points, 1))), "values": np.zeros(points)}
            conditions["noise"] = np.full(points, 0.01)
            if normals:
                conditions["normals"] = at
            start = time.perf_counter()
            gp = gn.GaussianProcess(MEAN, SIGMA, KERNEL, conditions=conditions if points else None)
            solved = time.perf_counter() - start
            n = 500 if points > 100 or quick else 5000
            begin = time.process_time()
            counters = gn.first_hits(gp, *camera_rays(n, rng), 10, threads=1)["counters"]
            spent = time.process_time() - begin
            stated = re.search(
                r"in (\d+) blocks.*error of (\S+)", gp.plan()["conditions"] if points else "in 0 blocks, error of 0 "
            )
            rows.append(
                {
                    "points": points,
                    "normals": str(normals),
                    "solve_seconds": solved,
                    "blocks": int(stated[1]),
                    "truncation_error": float(stated[2]),
                    "microseconds_per_ray": 1e6 * spent / n,
                    "condition_rows_per_ray": counters["condition_rows"] / n,
                }
            )
    return rows


def bench_memory(quick=False):
    """Four bounces in a cave of the same process, per path."""
    cave = gn.GaussianProcess(-1 * MEAN, SIGMA, KERNEL, bounds=([-2] * 3, [2] * 3))
    rows = []
    for memory in ("none", "renewal", "renewal+", "global-1", "global-2", "global-4", "global"):
        n = 20_000 if memory in ("none", "renewal", "renewal+") else 500
        n //= 10 if quick else 1
        directions = np.tile([0.0, 0, -1.0], (n, 1))
        begin = time.process_time()
        hits = gn.first_hits(cave, np.zeros((n, 3)), directions, 10, memory=memory, threads=1)
        for bounce in range(4):
            gradient = hits["gradient"]
            normal = gradient / np.linalg.norm(gradient, axis=1, keepdims=True)
            directions = directions - 2 * np.sum(directions * normal, axis=1, keepdims=True) * normal
            hits = gn.first_hits(
                cave, hits["position"], directions, 10, memory=memory, start=hits["state"], seed=bounce + 1, threads=1
            )
        rows.append({"memory": memory, "microseconds_per_path": 1e6 * (time.process_time() - begin) / n})
    return rows
