"""Every memory with every sampler, on smooth and on wild surfaces: where and how the second segment of a path ends,
mirrored at the first hit, against another sampler.

Around a ball, most rays that are mirrored at a surface of σ = ℓ or less leave for good: these rays are inside a hollow one, along
its wall, and every one of them hits it again. Of memory global-2, whose samplers (nystrom, dense) share how they keep a
segment, and of which rough kernels have one only, the other sampler is the realisation with memory global: of a second
segment two segments hold all.
"""

import gpis_native as gn
import numpy as np
from line_samplers import JOINT, KERNELS, SAMPLERS

from stability.verdicts import Cell, first_hits, of_sample

MEMORIES = ["none", "renewal", "renewal+", "global-2", "global"]
KINDS = {"σ = ℓ/10, hollow": 0.1, "σ = ℓ, hollow": 1.0, "σ = 10 ℓ": 10.0}
JOINT_ONLY = ("nystrom", "dense")  # that keep segments


def rows_of(state, rows):
    """The state of some of the rays: as they would have been traced alone."""
    out = {key: state[key][rows] for key in ("value", "gradient")}
    if "realisation" in state:
        out["realisation"] = {key: value[rows] for key, value in state["realisation"].items()}
    if "segments" in state:
        kept = state["segments"]
        number = np.full(len(state["value"]), -1)
        number[rows] = np.arange(rows.sum())
        of_these = rows[kept["row"]]
        out["segments"] = {key: value[of_these] for key, value in kept.items()} | {"row": number[kept["row"][of_these]]}
    return out


def second_segment(kernel, sampler, memory, ratio, n, seed):
    """t of the second segment; -1 where the first one hit nothing."""
    mean, origin, direction = gn.SphereField([0, 0, 0], 4), [0.9, 0.4, 5.9], np.array([0.0, 0, -1])
    if ratio <= 1:
        mean, origin, direction = mean * -1.0, [-0.7, 0.4, 3.7], np.array([1.0, 0, 0])
    gp = gn.GaussianProcess(mean, ratio, KERNELS[kernel], bounds=((-6,) * 3, (6,) * 3))
    options = {"sampler": sampler, "memory": memory, "seed": seed}
    first = first_hits(gp, n, origin, direction, 14, **options)
    hit = np.isfinite(first["t"])
    t = np.full(n, -1.0)
    if not hit.any():
        return t, [first]
    normal = first["gradient"][hit] / np.linalg.norm(first["gradient"][hit], axis=1, keepdims=True)
    incoming = np.tile(direction, (hit.sum(), 1))
    away = incoming - 2 * np.sum(incoming * normal, axis=1, keepdims=True) * normal
    state = first["state"]
    state = rows_of(state, hit)
    options["seed"] = seed + 1000
    away /= np.linalg.norm(away, axis=1, keepdims=True)
    second = gn.first_hits(gp, first["position"][hit], away, 14, start=state, threads=1, **options)
    t[hit] = second["t"]
    return t, [first, second]


def fits(sampler, memory):
    if memory == "global":
        return sampler == "realisation"
    return memory != "global-2" or sampler in JOINT_ONLY


def reference_of(kernel, sampler, memory):
    if memory == "global":
        return "nystrom" if kernel == "squared exponential" else "dense", "global-2"
    if memory == "global-2":
        return "realisation", "global"
    return next((s for s in SAMPLERS[kernel] if s not in (sampler, "realisation")), "realisation"), memory


def worth(kernel, sampler, memory, n):
    if memory.startswith("global"):
        return max(150, n // (15 if kernel.startswith("sum") else 5))
    slow = sampler == "realisation" or (sampler == "dense" and kernel in JOINT)
    return max(150, n // 20) if slow else max(200, n // 4) if sampler == "nystrom" else n


def cell(kernel, sampler, memory, kind):
    def run(n):
        t, hits = second_segment(kernel, sampler, memory, KINDS[kind], worth(kernel, sampler, memory, n), 5)
        other, its_memory = reference_of(kernel, sampler, memory)
        again, more = second_segment(kernel, other, its_memory, KINDS[kind], worth(kernel, other, its_memory, n), 7)
        against = other if its_memory == memory else f"{other}, {its_memory}"
        return of_sample(t, again, against, hits + more, stated=0.005)

    return Cell("second segment: samplers × memories", f"{kernel}, {sampler}, {memory}", kind, run)


def cells():
    return [
        cell(kernel, sampler, memory, kind)
        for kernel, samplers in SAMPLERS.items()
        if kernel != "plane wave"
        for sampler in samplers
        for memory in MEMORIES
        if fits(sampler, memory)
        for kind in KINDS
    ]
