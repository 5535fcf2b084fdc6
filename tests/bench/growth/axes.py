"""What grows: each function yields (size, measure), where measure() gives (samples, counters of the native module)."""

import os
import subprocess
import sys
import tempfile

import gpis_native as gn
import numpy as np

SIGMA = 0.05
LENGTH = 0.1


def sphere(center=(0, 0, 0), radius=1.0, **more):
    reach = radius + 0.5
    bounds = (np.subtract(center, reach), np.add(center, reach))
    kernel = gn.SquaredExponential(LENGTH)
    return gn.GaussianProcess(gn.SphereField(center, radius), SIGMA, kernel, bounds=bounds, **more)


def scene(objects, width=2.4):
    """Lambert bodies under a grey sky, each direction seen straight on."""
    eye = np.eye(4)
    eye[2, 3] = 4
    return gn.Scene(
        {
            "version": 1,
            "settings": {"max_bounces": 4},
            "camera": {"type": "orthographic", "matrix": eye, "width": width},
            "world": {"color": (0.5, 0.5, 0.5)},
            "materials": {"Grey": {"type": "lambert", "color": (0.8, 0.8, 0.8)}},
            "objects": [{"name": str(i), "type": "gpis", "materials": ["Grey"]} | o for i, o in enumerate(objects)],
        }
    )


def rendered(planned, samples, side=32, threads=1):
    def measure():
        stats = gn.render(planned, side, side, samples=samples, threads=threads, seed=1).stats
        return side * side * samples, stats

    return measure


def traced(gp, origins, directions, t_max, **options):
    def measure():
        return len(origins), gn.first_hits(gp, origins, directions, t_max, threads=1, seed=1, **options)["counters"]

    return measure


def ray_length(quick):
    """Length scales from end to end of a mean of 3.9 deviations: few rays (exp(-3.9²/2)/2π a length scale) end before."""
    for n in (10, 30, 100, 300, 1000) + (() if quick else (3000,)):
        gp = gn.GaussianProcess(3.9, 1.0, gn.SquaredExponential(1.0), bounds=((0, -1, -1), (n, 1, 1)))
        count = max(100, (20_000 if quick else 200_000) // n)
        directions = np.tile([1.0, 0, 0], (count, 1))
        yield n, traced(gp, directions * [-1, 0, 0], directions, 2 + n)


# In a process of its own, for this OpenVDB is another one than ours: that of Blender's Python, the bpy package.
SPARSE_SPHERE = """
import sys
from importlib.util import find_spec
from pathlib import Path
[bpy] = find_spec("bpy").submodule_search_locations
sys.path += map(str, Path(bpy).glob("*/python/lib/python3*/site-packages"))
import openvdb
path, voxel, width = sys.argv[1], *map(float, sys.argv[2:])
grid = openvdb.createLevelSetSphere(radius=1.0, voxelSize=voxel, halfWidth=width / voxel)
grid.name = "mean"
openvdb.write(path, grids=[grid])
"""


def grid_resolution(quick):
    """The distance to a sphere on a sparse grid, so many voxels along a side of its bounds; the process is always the same:
    where there are no voxels it is certainly absent."""
    sigma, side = 0.006, 2.6
    for n in (64, 128, 256) if quick else (64, 128, 256, 512, 1024):
        with tempfile.TemporaryDirectory() as folder:
            path = f"{folder}/{n}.vdb"
            width = max(5.4 * sigma, 3 * side / n)
            subprocess.run([sys.executable, "-c", SPARSE_SPHERE, path, str(side / n), str(width)], check=True)
            field = gn.VdbField(path, "mean")
        gp = gn.GaussianProcess(field, sigma, gn.SquaredExponential(LENGTH))
        yield n, rendered(scene([{"process": gp}]), 16 if quick else 64)


def objects(quick):
    """Objects side by side that fill the picture, whatever their number."""
    for n in (1, 9, 100, 400, 1024):
        side = int(np.sqrt(n))
        places = (np.stack(np.meshgrid(*2 * [np.arange(side)]), -1).reshape(-1, 2) - (side - 1) / 2) * 3.0
        small = 1 / side
        entries = []
        for x, y in places:
            matrix = np.diag([small, small, small, 1.0])
            matrix[:2, 3] = small * x, small * y
            entries.append({"process": sphere(), "matrix": matrix})
        yield n, rendered(scene(entries, 3.0), 16, 32 if n < 1000 or not quick else 16)


def condition_points(quick):
    """Points on and about a sphere, values with noise; rays from the camera. Solving them once is not counted."""
    for n in (1, 10, 100, 1000) + (() if quick else (3000,)):
        rng = np.random.default_rng(1)
        at = rng.normal(size=(n, 3))
        at /= np.linalg.norm(at, axis=1, keepdims=True)
        known = {"points": at * (1 + 0.02 * rng.normal(size=(n, 1))), "values": np.zeros(n), "noise": np.full(n, 0.01)}
        count = max(20, (20_000 if quick else 100_000) // n)
        origins = np.c_[rng.uniform(-0.7, 0.7, (count, 2)), np.full(count, 3.0)]
        yield n, traced(sphere(conditions=known), origins, np.tile([0.0, 0, -1.0], (count, 1)), 10)


def csg_depth(quick):
    """A sphere of which others are cut off and put back on, one inside the other: n operations deep, n + 1 leaves."""
    for n in (1, 2, 4, 8, 16, 32) if quick else (1, 2, 4, 8, 16, 32, 64):
        rng = np.random.default_rng(1)
        tree = sphere()
        for i in range(n):
            at = rng.normal(size=3)
            other = sphere(0.9 * at / np.linalg.norm(at), 0.4)
            tree = gn.difference(tree, other) if i % 2 == 0 else gn.union(tree, other)
        yield n, rendered(scene([{"process": tree}], 3.0), 16, 16 if quick else 32)


def threads(quick):
    """Threads of one render; the machine's cores and twice as many."""
    planned = scene([{"process": sphere()}])
    most = 2 * (os.cpu_count() or 1)
    for n in sorted({1, 2, *(2**i for i in range(10) if 2**i <= most)}):
        yield n, rendered(planned, 64 if quick else 512, threads=n)


# name -> (sizes, what the axis is called)
AXES = {
    "ray length": (ray_length, "length scales across"),
    "grid": (grid_resolution, "nodes along one side, sparse"),
    "objects": (objects, "objects in the picture"),
    "conditions": (condition_points, "condition points"),
    "csg": (csg_depth, "operations deep"),
    "threads": (threads, "threads"),
}
