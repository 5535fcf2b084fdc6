"""Add > GPIS: shapes, From Mesh, From Volume; in the redo panel, in undo, and in a picture."""

import importlib
from pathlib import Path

import bpy
import numpy as np
import pytest

from . import support

KINDS = ("SPHERE", "BOX", "SUZANNE", "HEIGHT_FIELD", "CLOUD")


@pytest.fixture
def gn():
    return importlib.import_module("gpis_native")


def mean_of(gn, obj):
    return gn.VdbField(bpy.path.abspath(obj.data.filepath), "mean")


@pytest.mark.parametrize("kind", KINDS)
def test_shapes_of_the_menu_render(stage, tmp_path, kind):
    stage.camera.location = (0, -6, 0)
    assert bpy.ops.gpis.add(kind=kind, radius=1.0, resolution=40) == {"FINISHED"}
    obj = bpy.context.object
    assert obj.gpis.enabled and obj.gpis.mean_grid == "mean" and obj.display_type == "BOUNDS" and obj.select_get()
    obj.data.materials.append(support.diffuse("Black", (0, 0, 0)))
    obj.rotation_euler.x = 1.2 if kind == "HEIGHT_FIELD" else 0.0
    support.settings(stage, width=24, height=18, samples=16)
    picture = support.coverage(stage, tmp_path)
    assert 0.03 < picture.mean() < 0.6 and picture.max() > 0.9 and picture[0].max() < 0.1


@pytest.mark.parametrize(("kind", "top"), [("SPHERE", 1.0), ("BOX", 1.0), ("HEIGHT_FIELD", 0.0)])
def test_means_are_signed_distances(gn, stage, kind, top):
    bpy.ops.gpis.add(kind=kind, radius=1.0, resolution=64, margin=0.6)
    points = [(0, 0, top + 0.4), (0, 0, top), (1.3, 0, top - 0.1), (0, 0, top - 0.1)]
    beside = np.hypot(1.3, 0.9) - 1 if kind == "SPHERE" else 0.3
    expected = [0.4, 0, beside, -0.1]
    assert mean_of(gn, bpy.context.object)(points) == pytest.approx(expected, abs=0.01)


@pytest.mark.parametrize("kind", ["SPHERE", "SUZANNE"])
def test_a_narrow_band_is_kept_and_watched(gn, stage, describe, kind):
    bpy.ops.gpis.add(kind=kind, radius=1.0, resolution=64, margin=0.8, narrow_band=0.3)
    obj = bpy.context.object
    mean = mean_of(gn, obj)([(1.7, 0, 0), (1.1, 0, 0), (0, 0, 0)])
    assert mean[0] == pytest.approx(0.3) and abs(mean[2]) <= 0.3 + 1e-6
    assert obj.gpis.bake_narrow_band == pytest.approx(0.3) and describe()[1] == []
    obj.gpis.sigma = 0.06
    assert "narrow band of 0.3 is less than 6 σ" in describe()[1][0] and "0.36 or more" in describe()[1][0]
    with pytest.raises(RuntimeError, match="narrow.band is 0.05; with voxels of .* at least three"):
        bpy.ops.gpis.add(kind=kind, radius=1.0, resolution=64, narrow_band=0.05)


def test_a_narrow_band_from_a_mesh_and_from_a_fog(gn, stage, tmp_path):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24)
    assert bpy.ops.gpis.make(resolution=64, margin=0.8, narrow_band=0.3) == {"FINISHED"}
    of_mesh = bpy.context.object
    of_fog = fog(gn, tmp_path / "fog.vdb")
    assert bpy.ops.gpis.from_volume(level=0.4, resolution=48, narrow_band=0.1) == {"FINISHED"}
    for obj, radius, band in ((of_mesh, 1.0, 0.3), (of_fog, 0.6, 0.1)):
        assert obj.gpis.bake_narrow_band == pytest.approx(band)
        mean = mean_of(gn, obj)([(radius, 0, 0), (radius + band / 2, 0, 0), (0, 0, 0), (1.1 * radius + band, 0, 0)])
        assert mean == pytest.approx([0, band / 2, -band, band], abs=0.02)


def test_height_field_does_not_change_with_height(stage, describe):
    bpy.ops.gpis.add(kind="HEIGHT_FIELD", radius=1.0, resolution=32)
    (entry,), _ = describe()
    up = entry["process"].covariance([(0, 0, 0)], [(0, 0, 0.1)])
    assert up == pytest.approx(entry["process"].covariance([(0, 0, 0)], [(0, 0, 0)]))


def test_radius_scales_everything(gn, stage, describe):
    bpy.ops.gpis.add(kind="SPHERE", radius=0.05, resolution=32)
    settings = bpy.context.object.gpis
    assert (settings.sigma, settings.length_scale) == pytest.approx((0.002, 0.01))
    assert mean_of(gn, bpy.context.object)([(0.05, 0, 0)])[0] == pytest.approx(0, abs=5e-4)
    assert describe()[1] == []


def test_undo_and_redo_of_an_addition(stage):
    bpy.ops.ed.undo_push(message="empty")
    bpy.ops.gpis.add(kind="BOX", radius=1.0, resolution=16)
    bpy.ops.ed.undo_push(message="added")
    bpy.ops.ed.undo()
    assert not [obj for obj in bpy.data.objects if obj.type == "VOLUME"]
    bpy.ops.ed.redo()
    (obj,) = (obj for obj in bpy.data.objects if obj.type == "VOLUME")
    assert obj.gpis.enabled and Path(bpy.path.abspath(obj.data.filepath)).is_file()


def test_another_shape_is_another_file(stage):
    paths = set()
    for _ in range(2):
        bpy.ops.gpis.add(kind="SPHERE", radius=1.0, resolution=12)
        paths.add(bpy.context.object.data.filepath)
    assert len(paths) == 2


def fog(gn, path):
    x = np.linspace(-1, 1, 33)
    density = np.maximum(0, 1 - np.sqrt(x[:, None, None] ** 2 + x[:, None] ** 2 + x**2))
    gn.write_vdb(str(path), {"density": density, "origin": (-1.0, -1.0, -1.0), "voxel_size": 2 / 32})
    data = bpy.data.volumes.new("Fog")
    data.filepath = str(path)
    obj = support.link(bpy.context.scene, "Fog", data)
    bpy.context.view_layer.objects.active = obj
    return obj


def test_from_a_fog(gn, stage, tmp_path):
    """Density 1 - r: the surface of density 0.4 is the sphere of radius 0.6."""
    obj = fog(gn, tmp_path / "fog.vdb")
    assert bpy.ops.gpis.from_volume(level=0.4, resolution=48) == {"FINISHED"}
    assert obj.gpis.enabled and obj.gpis.mean_grid == "mean"
    points = [(0.6, 0, 0), (0, 0, 0.68), (0.3, 0, 0)]
    assert mean_of(gn, obj)(points) == pytest.approx([0, 0.08, -0.3], abs=0.02)
    assert (tmp_path / "fog.vdb").is_file() and Path(obj.data.filepath) != tmp_path / "fog.vdb"


def test_from_a_fog_without_that_density(gn, stage, tmp_path):
    fog(gn, tmp_path / "fog.vdb")
    with pytest.raises(RuntimeError, match="go from 0 to 1: take a Density between them, it is 3"):
        bpy.ops.gpis.from_volume(level=3.0)


def test_from_a_volume_that_holds_a_mean(gn, stage, tmp_path):
    bpy.ops.gpis.add(kind="SPHERE", radius=1.0, resolution=16)
    obj = bpy.context.object
    obj.gpis.enabled = False
    before = obj.data.filepath
    assert bpy.ops.gpis.from_volume() == {"FINISHED"}
    assert obj.gpis.enabled and obj.data.filepath == before and obj.gpis.mean_grid == "mean"


def test_from_volume_takes_volumes_only(stage):
    bpy.ops.mesh.primitive_cube_add()
    assert not bpy.ops.gpis.from_volume.poll()
