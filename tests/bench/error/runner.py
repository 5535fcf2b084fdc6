"""A run: all cells, then the references they need, then the numbers. What is there from an earlier call is not done again; a
changed module or a change of what is measured starts a new run, and the numbers of the last one stay for comparison."""

import hashlib
import json
import os
import platform
import resource
import shutil
import sys
import time
from pathlib import Path

import gpis_native as gn
import numpy as np

from . import rates
from .analysis import calibration, evaluate
from .measure import FULL, QUICK, cell_of, is_default, size_of
from .methods import methods_of, reference_of
from .references import reference_image
from .scenes import available

OUT = Path(__file__).parents[3] / "out" / "bench" / "error"
MEASURED_BY = ("scenes", "methods", "published", "references", "measure", "rates")  # what is kept depends on these
REFERENCE_WEIGHT = 3  # of the bar, over a cell's


def processor_seconds():
    """Of this process, its threads and the cells' processes: what other programs do on the machine counts little."""
    parts = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(part.ru_utime + part.ru_stime for part in parts)


class Bar:
    """One line on the terminal: how far, how long by the clock and of the processor, what."""

    def __init__(self, total):
        self.total, self.done, self.start, self.shown = total, 0.0, time.monotonic(), ""
        self.processor = processor_seconds()

    def show(self, what, part=0.0):
        fraction = min((self.done + part) / self.total, 1.0)
        passed = time.monotonic() - self.start
        spent = processor_seconds() - self.processor
        self.shown = f"[{'#' * int(30 * fraction):<30}] {100 * fraction:3.0f} %  {passed:5.0f} s ({spent:.0f} s CPU)  {what}"
        if sys.stderr.isatty():
            print(f"\r{self.shown:<110}"[:110], end="", file=sys.stderr, flush=True)

    def step(self, weight, what):
        self.done += weight
        self.show(what)
        if not sys.stderr.isatty():
            print(self.shown, file=sys.stderr, flush=True)

    def end(self):
        if sys.stderr.isatty():
            print(file=sys.stderr)


def module_hash():
    return hashlib.sha256(Path(gn.__file__).read_bytes()).hexdigest()[:16]


def sources_hash():
    digest = hashlib.sha256()
    for name in MEASURED_BY:
        digest.update(Path(__file__).with_name(name + ".py").read_bytes())
    return digest.hexdigest()[:16]


def processor():
    try:
        names = [line.split(":", 1)[1].strip() for line in Path("/proc/cpuinfo").read_text().splitlines() if "model name" in line]
    except OSError:
        names = []
    return names[0] if names else platform.machine()


def begin(folder, again):
    """The run's own folder, emptied where the module or what is measured has changed."""
    folder.mkdir(parents=True, exist_ok=True)
    state, made_by = folder / "run.json", {"module": module_hash(), "sources": sources_hash()}
    known = json.loads(state.read_text()) if state.exists() else {}
    if again or any(known.get(key) != value for key, value in made_by.items()):
        if (folder / "summary.json").exists():
            (folder / "summary.json").replace(folder / "previous.json")
        state.unlink(missing_ok=True)  # first: a call that is stopped here leaves nothing that looks like this run's
        for old in ("cells", "references", "files"):
            shutil.rmtree(folder / old, ignore_errors=True)
        known = made_by | {"begun": time.strftime("%Y-%m-%d %H:%M"), "yardstick": rates.yardstick()}
        known |= {"processor": processor(), "threads": os.cpu_count()}
        state.write_text(json.dumps(known, indent=1) + "\n")
    (folder / "cells").mkdir(exist_ok=True)
    return known


def end(folder, known, there):
    """The yardstick again, where this call has measured more than the cells' files that were there: machines change speed."""
    if "yardstick_end" not in known or there != kept(folder):
        known["yardstick_end"] = rates.yardstick()
        (folder / "run.json").write_text(json.dumps(known, indent=1) + "\n")


def kept(folder):
    return {path.name for path in (folder / "cells").iterdir()}


def yardstick(known):
    """Of a run: between its beginning and its end."""
    return (known["yardstick"] + known["yardstick_end"]) / 2


def cached(path, make):
    if not path.exists():
        path.write_text(json.dumps(make(), indent=1) + "\n")
    return json.loads(path.read_text())


def methods_for(scene, effort):
    """A quick run leaves out what is measured against whole realisations: those references are slow."""
    return [m for m in methods_of(scene) if effort is not QUICK or m.group != "truth"]


def preview(folder, scene, effort, files):
    path = folder / "cells" / f"{scene.name}.preview.npy"
    if not path.exists():
        size, samples = (96, 32) if effort is FULL else (32, 16)
        description = gn.Scene(scene.make("auto", "renewal+", files))
        result = gn.render(description, size, size, samples=samples, time_limit=20)
        np.save(path, result.passes["combined"][..., :3])
    return np.load(path)


def measure_all(plan, effort, folder, files, bar, cells, references):
    """Fills cells and references, by (scene, method) and (scene, reference)."""
    for scene, method in plan:
        bar.show(f"{scene.name}, {method.title}")
        cells[scene.name, method.key] = cell_of(scene, method, effort, folder / "cells")
        bar.step(1, f"{scene.name}, {method.title}")
    largest = {}
    for scene, method in plan:
        cell = cells[scene.name, method.key][0]
        key = scene.name, reference_of(scene, method).key
        largest[key] = max(largest.get(key, 0), *cell.get("samples", [0]))
    for scene, method in plan:
        reference = reference_of(scene, method)
        key = scene.name, reference.key
        if key in references or not largest[key]:
            continue
        what = f"reference of {scene.name}, {reference.title}"
        references[key] = reference_image(
            folder / "references", scene, reference, size_of(scene, effort), largest[key], files,
            lambda fraction, _, what=what: bar.show(what, REFERENCE_WEIGHT * fraction),
        )  # fmt: skip
        bar.step(REFERENCE_WEIGHT, what)


def run(quick=False, again=False):
    """All of it, as one dict that the report shows."""
    effort = QUICK if quick else FULL
    folder = OUT / effort.name
    files = folder / "files"
    known = begin(folder, again)
    scenes, missing = available()
    there = kept(folder)
    for scene in scenes:
        scene.make("auto", "renewal+", files)  # what it paints into files is not set-up of the cell that would come first
    plan = [(scene, method) for scene in scenes for method in methods_for(scene, effort)]
    needed = {(s.name, reference_of(s, m).key) for s, m in plan}
    bar = Bar(len(plan) + REFERENCE_WEIGHT * len(needed) + len(scenes))
    cells, references = {}, {}
    try:
        measure_all(plan, effort, folder, files, bar, cells, references)
    except KeyboardInterrupt:
        print("\nstopped: the page shows what there is; the next call goes on", file=sys.stderr)
    found = []
    for scene in scenes:
        found.append(numbers(scene, effort, cells, references) | {"picture": preview(folder, scene, effort, files)})
        bar.step(1, f"numbers of {scene.name}")
    bar.end()
    rate_rows = cached(folder / "cells" / "rates.json", lambda: rates.measure_rates(2 if quick else 5, missing))
    profile = cached(folder / "cells" / "profile.json", lambda: rates.sphere_profile(16 if quick else 256))
    end(folder, known, there)
    known |= {"effort": effort.name, "missing": missing, "scenes": found, "rates": rate_rows, "profile": profile}
    previous = folder / "previous.json"
    known["previous"] = json.loads(previous.read_text()) if previous.exists() else None
    (folder / "summary.json").write_text(json.dumps(summary(known), indent=1) + "\n")
    return known


def numbers(scene, effort, cells, references):
    rows, calibrated = [], None
    nothing = {"refused": "not measured yet"}, None
    for method in methods_for(scene, effort):
        reference = reference_of(scene, method)
        cell, images = cells.get((scene.name, method.key), nothing)
        if images is not None and (scene.name, reference.key) not in references:
            cell, images = nothing
        title = method.title
        if is_default(scene, method) and cell.get("drawn_by"):
            title += f" ({', '.join(cell['drawn_by'])})"
        row = {"key": method.key, "title": title, "group": method.group, "cell": cell}
        if images is not None:
            image, noise, samples = references[scene.name, reference.key]
            row["reference"] = {"title": reference.title, "samples": samples}
            row["found"] = evaluate(cell, images, image, noise)
            if is_default(scene, method):
                ratio, error = calibration(cell, images, image, noise)
                calibrated = {"samples": cell["samples"], "ratio": ratio.tolist(), "error": error.tolist()}
        rows.append(row)
    return {"scene": scene, "rows": rows, "calibration": calibrated}


def summary(known):
    """What the next run is compared with."""
    return {
        "module": known["module"],
        "begun": known["begun"],
        "yardstick": yardstick(known),
        "cells": {
            f"{found['scene'].name}.{row['key']}": {"rate": row["cell"]["paths_per_second"], "cost": row["found"]["cost"]}
            for found in known["scenes"]
            for row in found["rows"]
            if "found" in row and row["group"] != "published"  # its rate is not measured here
        },
    }
