"""Samples (camera paths over the full frame) per second of the processor, one thread, beside the paper's renderer; and the
standard sphere's mean radiance beside it, so that a rate is seen with its bias."""

import json
import time

import gpis_native as gn
import numpy as np

from .scenes import LAMBERT, SHARED, WHITE, bunny, csg, standard_sphere, wedge

SIZE, SAMPLES = 128, 16
EXAMPLE_PATHS = 128 * 128 * 8  # of the published example scenes
SPHERE = "sphere Lambert, Renewal+"
ROWS = (  # name, scene, its row in baseline.json, what the project asks for
    (SPHERE, standard_sphere(LAMBERT, WHITE), None, 1_000_000),
    ("bunny.vdb, mirror", bunny, "bunny.vdb, mirror, 8 points at .9", 150_000),
    ("two spheres CSG, mirror", csg, "csg two spheres, mirror, 8 points at .9", 500_000),
    ("wedge, constant mean, ℓ .1", wedge, "wedge, constant mean, length .1", 3_000_000),
    (
        "wedge, constant mean, ℓ .01",
        lambda sampler, memory, folder: wedge(sampler, memory, folder, length_scale=0.01),
        "wedge, constant mean, length .01",
        3_000_000,
    ),
)


def baseline():
    path = SHARED / "baseline.json"
    return json.loads(path.read_text()) if path.exists() else None


def paper_sphere_rate():
    """Paths per second of the processor of the paper's renderer on the standard sphere, memory Renewal+; None without its file."""
    known = baseline()
    return known and known["standard_sphere"]["samples_per_cpu_second"]["renewal+"]


def yardstick():
    """A fixed loop of numpy: exponentials per second, so that machines compare."""
    x, best = np.linspace(0, 1, 1_000_000), np.inf
    for _ in range(5):
        start = time.process_time()
        for _ in range(10):
            np.exp(-x * x).sum()
        best = min(best, time.process_time() - start)
    return 1e7 / best


def best_rate(make, repetitions):
    scene = gn.Scene(make("auto", "renewal+", None))
    best = np.inf
    for i in range(repetitions):
        start = time.process_time()
        gn.render(scene, SIZE, SIZE, samples=SAMPLES, seed=i, threads=1)
        best = min(best, time.process_time() - start)
    return SIZE * SIZE * SAMPLES / best


def measure_rates(repetitions, missing):
    """A row for each published scene whose files are there."""
    known, rows = baseline(), []
    for name, make, key, asked in ROWS:
        if name.split()[0].split(".")[0].rstrip(",") in missing:
            continue
        paper = None
        if known and key:
            paper = EXAMPLE_PATHS / known["example_scenes_128x128_8_samples"][key]["cpu_seconds"]
        elif known:
            paper = paper_sphere_rate()
        rows.append({"name": name, "rate": best_rate(make, repetitions), "paper": paper, "asked": asked})
    return rows


def impact_parameters(size):
    half = np.tan(np.radians(35) / 2)
    x = ((np.arange(size) + 0.5) / size * 2 - 1) * half
    across = np.hypot(*np.meshgrid(x, x))
    return 4 * across / np.sqrt(1 + across**2)


def interval(text):
    """'<.5' or '.5-.8' as numbers."""
    if text.startswith("<"):
        return 0.0, float(text[1:])
    low, high = text.split("-")
    return float(low), float(high)


def sphere_profile(samples):
    """Mean radiance of the standard sphere by impact parameter, with standard errors, beside baseline.json's."""
    known = baseline()
    if known is None:
        return None
    known = known["standard_sphere"]
    scene = gn.Scene(standard_sphere(LAMBERT, WHITE)())
    result = gn.render(scene, SIZE, SIZE, samples=samples, seed=7)
    pixels, noise = (result.passes[p][..., 0].astype(float) for p in ("combined", "variance"))
    impact = impact_parameters(SIZE)
    ours = []
    for low, high in map(interval, known["bins_of_b"]):
        inside = (impact >= low) & (impact < high)
        ours.append((float(pixels[inside].mean()), float(np.sqrt(noise[inside].sum()) / inside.sum())))
    return {"bins": known["bins_of_b"], "ours": ours, "known": known["mean_radiance"]}
