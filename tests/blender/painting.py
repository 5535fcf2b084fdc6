"""What the tests of painting share: strokes, and what became of them."""

import os
from pathlib import Path

import bpy
import numpy as np

RADIUS, STRENGTH = 0.35, 0.7


def points(locations):
    return [{"name": "", "location": tuple(map(float, place)), "pressure": 1.0} for place in locations]


def arc(seed, count=5):
    """Places along a random great circle of the unit sphere, in single precision as Blender keeps them."""
    rng = np.random.default_rng(seed)
    a, b = np.linalg.qr(rng.normal(size=(3, 2)))[0].T
    angle = np.linspace(0, 0.8, count)[:, None]
    return (a * np.cos(angle) + b * np.sin(angle)).astype(np.float32)


def paint(channel, operation, locations, undo=True, **brush):
    properties = {"radius": RADIUS, "strength": STRENGTH, "spacing": 0.0} | brush
    stroke = points(locations)
    assert bpy.ops.gpis.paint_stroke("EXEC_DEFAULT", undo, stroke=stroke, channel=channel, operation=operation, **properties) == {
        "FINISHED"
    }


def file_of(obj):
    return Path(os.path.normpath(bpy.path.abspath(obj.data.filepath)))


def grids_of(gn, obj):
    return gn.read_vdb(file_of(obj), names=[g["name"] for g in gn.vdb_grids(file_of(obj)) if "gpis_base" not in g["name"]])
