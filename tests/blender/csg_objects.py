"""GPIS objects for the tests of CSG lists and fits."""

import importlib

import bpy
import numpy as np

from . import support


def add_gpis(scene, name, location, radius, color=(0.8, 0.8, 0.8), sigma=0.05, **placed):
    """A GPIS of a sphere, without a mesh: a small grid of its distance."""
    gn = importlib.import_module("gpis_native")
    n, side = 25, 1.6 * radius
    x = np.linspace(-side, side, n)
    distance = np.sqrt(x[:, None, None] ** 2 + x[:, None] ** 2 + x**2) - radius
    path = f"{bpy.app.tempdir}/{name}.vdb"
    gn.write_vdb(path, {"mean": distance, "origin": (-side,) * 3, "voxel_size": x[1] - x[0]})
    data = bpy.data.volumes.new(name)
    data.filepath = path
    data.materials.append(support.diffuse(f"{name} Material", color))
    obj = support.link(scene, name, data, location=location, **placed)
    obj.gpis.enabled = True
    obj.gpis.sigma, obj.gpis.length_scale = sigma, 0.4
    return obj


def make_operands(stage):
    """A base of radius 1 and two smaller ones, b turned and stretched; the base is active, all are selected."""
    a = add_gpis(stage, "A", (0, 0, 0), 1.0, (1, 0, 0))
    b = add_gpis(stage, "B", (0.9, 0, 0), 0.6, (0, 1, 0), rotation=(1, 0.2, 0.4, 0), scale=(1, 1.3, 0.7))
    c = add_gpis(stage, "C", (0, -0.9, 0), 0.5, (0, 0, 1))
    for obj in (a, b, c):
        obj.select_set(True)
    bpy.context.view_layer.objects.active = a
    bpy.context.view_layer.update()
    return a, b, c


def build(a, operations):
    assert bpy.ops.gpis.csg_add() == {"FINISHED"}
    for item, operation in zip(a.gpis_csg.items, operations, strict=True):
        item.operation = operation


def entry_of(describe):
    entries, warnings = describe()
    (entry,) = (entry for entry in entries if not bpy.data.objects[entry["name"]].hide_render)
    return entry, warnings
