"""Presets: scaled to the object, undone as one step, with room for the surface, and each with its thumbnail."""

import importlib
import struct

import bpy
import pytest

from . import support


@pytest.fixture
def presets(extension):
    return importlib.import_module(extension + ".presets")


@pytest.fixture
def sphere(stage):
    def add(radius=0.5):
        bpy.ops.gpis.add(kind="SPHERE", radius=radius, resolution=32)
        return bpy.context.object

    return add


def test_each_preset_has_a_small_thumbnail(presets):
    assert len(presets.table.PRESETS) >= 10
    for name in presets.table.PRESETS:
        data = presets.previews.thumbnail(name).read_bytes()
        assert data[:8] == b"\x89PNG\r\n\x1a\n" and len(data) < 40_000
        width, height = struct.unpack(">2I", data[16:24])
        assert width == height >= 64


def test_every_preset_can_be_rendered(presets, sphere, describe):
    for name in presets.table.PRESETS:
        obj = sphere()
        assert bpy.ops.gpis.apply_preset(preset=name) == {"FINISHED"}
        (entry,), warnings = describe()
        assert warnings == [], name
        assert entry["process"].plan()["sampler"]
        bpy.data.objects.remove(obj)


@pytest.mark.parametrize("radius", [0.5, 5.0])
def test_lengths_follow_the_size(presets, sphere, radius):
    obj = sphere(radius)
    bpy.ops.gpis.apply_preset(preset="GROOVED_COPPER", scale=2.0)
    wanted = presets.table.PRESETS["GROOVED_COPPER"].settings
    for key in ("sigma", "length_scale", "period"):
        assert getattr(obj.gpis, key) == pytest.approx(2 * wanted[key] * 2 * radius, rel=0.02), key
    assert obj.gpis.periodic_scale == pytest.approx(wanted["periodic_scale"])


def test_a_preset_leaves_nothing_of_the_one_before(presets, sphere, describe):
    obj = sphere()
    bpy.ops.gpis.apply_preset(preset="FUR")
    assert obj.gpis.anisotropy == "AXES" and obj.data.materials[0].name == "GPIS Fur"
    bpy.ops.gpis.apply_preset(preset="CHALK")
    assert obj.gpis.anisotropy == "UNIFORM" and obj.gpis.kernel == "MATERN_3_2"
    assert [material.name for material in obj.data.materials] == ["GPIS Chalk"]


def test_a_large_deviation_gets_room_in_a_new_file(sphere):
    gn = importlib.import_module("gpis_native")
    obj = sphere()
    before = obj.data.filepath
    points = [(0.55, 0, 0), (0, 0.2, -0.4)]
    expected = gn.VdbField(before, "mean")(points)
    bpy.ops.gpis.apply_preset(preset="MIST")
    assert obj.data.filepath != before and obj.gpis.bake_margin >= 4 * obj.gpis.sigma
    mean = gn.VdbField(obj.data.filepath, "mean")
    assert mean(points) == pytest.approx(expected, abs=1e-6)
    assert mean([(0.7, 0, 0)])[0] == pytest.approx(0.2, abs=0.02), "distances go on"


def test_undo_of_a_preset(presets, sphere):
    sphere()
    bpy.ops.ed.undo_push(message="added")
    bpy.ops.gpis.apply_preset(preset="MIST")
    bpy.ops.ed.undo_push(message="preset")
    bpy.ops.ed.undo()
    obj = next(obj for obj in bpy.data.objects if obj.type == "VOLUME")
    assert obj.gpis.sigma == pytest.approx(0.02) and obj.gpis.memory == "RENEWAL_PLUS"
    bpy.ops.ed.redo()
    obj = next(obj for obj in bpy.data.objects if obj.type == "VOLUME")
    assert obj.gpis.memory == "RENEWAL"


def test_nothing_to_apply_to(stage):
    support.cube(stage)
    assert not bpy.ops.gpis.apply_preset.poll()
