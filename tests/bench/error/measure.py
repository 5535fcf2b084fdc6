"""One cell of the bench: a scene by a method, rendered several times to growing budgets, in a process of its own (so that
its memory is its own, and a crash is a line of the report). A cell is a .json file, its pictures an .npz beside it."""

import contextlib
import json
import multiprocessing
import time
from dataclasses import dataclass
from pathlib import Path

import gpis_native as gn
import numpy as np

from . import published
from .methods import default, drawn_by, methods_of, reference_of
from .rates import paper_sphere_rate
from .scenes import SCENES

LUMINANCE = np.array((0.2126, 0.7152, 0.0722))
BLOCK = 16  # samples: slices of a render are multiples of it
REFERENCE_FACTOR = 100  # samples of a reference, over those of the largest budget it judges
PILOT_SEED, REFERENCE_SEED = 10**6, 2 * 10**6
COUNTERS = (
    "path_vertices", "shadow_rays", "mesh_rays", "line_segments", "line_evaluations", "line_normals", "line_splits",
    "factorisations", "mean_lookups", "sigma_lookups",
)  # fmt: skip


@dataclass(frozen=True)
class Effort:
    name: str
    size: int  # pixels a side
    slow_size: int  # of scenes that take more than a hundredth of a millisecond a path
    seconds: float  # of the processor, for a cell
    reference_seconds: float  # of the processor, for a reference, at most
    largest: int  # samples per pixel
    repeats: int
    default_repeats: int  # of the default method: those of the calibration
    published_repeats: int  # of the copy of the paper's sampler: its bias is small, and what is asked


FULL = Effort("full", 24, 12, 5.0, 200.0, 128, 6, 30, 40)
QUICK = Effort("quick", 16, 4, 0.4, 6.0, 32, 3, 12, 3)
SLOW = ("painted", "everything")


def size_of(scene, effort):
    return effort.slow_size if scene.name in SLOW else effort.size


def scene_named(name):
    return next(s for s in SCENES if s.name == name)


def method_named(scene, key):
    if key.startswith("by_") or key == "truth":
        return next(r for r in (reference_of(scene, m) for m in methods_of(scene)) if r.key == key)
    return next(m for m in methods_of(scene) if m.key == key)


def memory_mb(name):
    """VmRSS, what this process holds, or VmHWM, the most it has held; None where the system does not say. (ru_maxrss of a
    spawned process begins at the peak of the one that started it.)"""
    try:
        lines = Path("/proc/self/status").read_text().splitlines()
    except OSError:
        return None
    return next((int(line.split()[1]) / 1024 for line in lines if line.startswith(name + ":")), None)


def begin_peak():
    """What the process holds, from where its peak is counted anew."""
    with contextlib.suppress(OSError):  # not allowed everywhere; a cell's process has held little more before
        Path("/proc/self/clear_refs").write_text("5")
    return memory_mb("VmRSS")


def set_up(make, size):
    """The scene, and its set-up in seconds of the processor, those of all threads: the scene itself, and what its first render
    takes beyond the second. That is its tables, which a process keeps: the first call in a process alone sees them."""
    clock = [time.process_time()]
    scene = gn.Scene(make())
    clock.append(time.process_time())
    for _ in range(2):
        gn.render(scene, size, size, samples=1, seed=PILOT_SEED, threads=1)
        clock.append(time.process_time())
    made, first, second = np.diff(clock)
    return scene, float(made + max(first - second, 0))


def rate(description, size, seconds):
    """Paths per second of the processor, from a short render."""
    gn.render(description, size, size, samples=1, seed=PILOT_SEED, threads=1)  # tables are set-up
    paths, spent, sample = 0, 0.0, 0
    while spent < seconds and sample < 16 * BLOCK:
        start = time.process_time()
        gn.render(description, size, size, samples=BLOCK, first_sample=sample, seed=PILOT_SEED, threads=1)
        spent += time.process_time() - start
        paths += BLOCK * size * size
        sample += BLOCK
    return paths / spent


def doubled(largest):
    steps = [BLOCK]
    while 2 * steps[-1] <= largest:
        steps.append(2 * steps[-1])
    return steps


def budgets(scene, method, effort, folder, speed):
    """Samples per pixel: powers of two times 16 that the cell's seconds and its reference's seconds allow."""
    size = size_of(scene, effort)
    reference = gn.Scene(reference_of(scene, method).describe(scene, folder))
    repeats = effort.default_repeats if method.key == "default" else effort.repeats
    reference_speed = rate(reference, size, 0.05 * effort.seconds)
    pixels = size * size
    allowed = min(effort.seconds * speed / (repeats * pixels), effort.reference_seconds * reference_speed / (100 * pixels))
    return doubled(min(allowed, effort.largest)), repeats


def measure_published(scene, method, effort):
    """The same of the paper's sampler: its pictures by our copy of its method, its seconds by the rate of its renderer."""
    rate = paper_sphere_rate()
    if rate is None:
        return {"refused": "its rate is in baseline.json of the shared data, which is not beside this checkout"}, None
    setting, size, steps = published.setting_of(scene.name, method.key), size_of(scene, effort), doubled(effort.largest)
    images = np.zeros((effort.published_repeats, len(steps), size, size))
    counters, start = dict.fromkeys(COUNTERS, 0), time.process_time()
    for k in range(len(images)):
        total = np.zeros((size, size))
        for b, samples in enumerate(steps):
            more = samples - (steps[b - 1] if b else 0)
            total += more * published.picture(scene.name, setting, size, more, (k, b), counters)
            images[k, b] = total / samples
    paths = len(images) * steps[-1] * size * size
    cell = {
        "samples": steps,
        "size": size,
        "repeats": len(images),
        "seconds": [[samples * size * size / rate for samples in steps]] * len(images),
        "copy_seconds": time.process_time() - start,
        "setup_seconds": None,  # was not measured
        "paths_per_second": rate,
        "per_path": {name: count / paths for name, count in counters.items()},
        "memory_mb": None,
    }
    return cell, images


def measure(scene, method, effort, folder):
    """The cell as a dict for .json, and luminance (repeats, budgets, H, W)."""
    if method.group == "published":
        return measure_published(scene, method, effort)
    size, before = size_of(scene, effort), begin_peak()
    try:
        planned, setup = set_up(lambda: method.describe(scene, folder), size)
    except ValueError as error:
        return {"refused": str(error)}, None
    speed, peak = rate(planned, size, 0.05 * effort.seconds), memory_mb("VmHWM")
    # Only now, for tables and memory of the reference are not this method's.
    steps, repeats = budgets(scene, method, effort, folder, speed)
    images = np.zeros((repeats, len(steps), size, size))
    seconds, estimates, counters = np.zeros(images.shape[:2]), np.zeros(images.shape[:2]), dict.fromkeys(COUNTERS, 0)
    for k in range(repeats):
        so_far, spent = None, 0.0
        for b, samples in enumerate(steps):
            first = steps[b - 1] if b else 0
            start = time.process_time()
            slice_ = gn.render(planned, size, size, samples=samples - first, first_sample=first, seed=k, threads=1)
            spent += time.process_time() - start
            so_far = gn.merge([so_far, slice_]) if b else slice_
            images[k, b] = so_far.passes["combined"][..., :3].astype(float) @ LUMINANCE
            seconds[k, b], estimates[k, b] = spent, so_far.stats["estimated_error"]
        for name in COUNTERS:
            counters[name] += so_far.stats[name]
    paths = repeats * steps[-1] * size * size
    cell = {
        "samples": steps,
        "size": size,
        "repeats": repeats,
        "seconds": seconds.tolist(),
        "estimated_error": estimates.tolist(),
        "setup_seconds": setup,
        "paths_per_second": paths / float(seconds[:, -1].sum()),
        "per_path": {name: count / paths for name, count in counters.items()},
        "memory_mb": None if peak is None else peak - before,
        "drawn_by": drawn_by(planned.plan()),
    }
    return cell, images


def _work(scene_name, key, effort, folder):
    scene = scene_named(scene_name)
    path = folder / f"{scene_name}.{key}"
    cell, images = measure(scene, method_named(scene, key), effort, folder.parent / "files")
    if images is not None:
        np.save(path.with_name(path.name + ".npy"), images.astype(np.float32))
    path.with_name(path.name + ".json").write_text(json.dumps(cell, indent=1) + "\n")


def cell_of(scene, method, effort, folder):
    """The cell from its file, or measured now."""
    path = folder / f"{scene.name}.{method.key}.json"
    if not path.exists():
        child = multiprocessing.get_context("spawn").Process(target=_work, args=(scene.name, method.key, effort, folder))
        child.start()
        child.join()
        if child.exitcode:
            return {"refused": f"ended with exit code {child.exitcode}"}, None
    cell = json.loads(path.read_text())
    pictures = path.with_suffix(".npy")
    return cell, np.load(pictures).astype(float) if pictures.exists() else None


def is_default(scene, method):
    return method == default(scene)
