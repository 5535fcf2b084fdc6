"""GPIS objects: from a mesh, from a Volume object, and what is kept of them in the file."""

import importlib
import shutil
from pathlib import Path

import bpy
import numpy as np
import pytest

from . import support
from .support import coverage

BUNNY = Path(__file__).parents[3] / "shared" / "data" / "gpis-light-transport" / "bunny.vdb"


def test_make_puts_a_volume_in_place_of_the_mesh(ball):
    mesh = ball.gpis.source
    assert ball.type == "VOLUME" and ball.gpis.enabled and ball.display_type == "BOUNDS"
    assert ball.gpis.mean_grid == "mean" and Path(bpy.path.abspath(ball.data.filepath)).is_file()
    assert mesh.hide_render and mesh.display_type == "WIRE" and ball.parent == mesh
    assert [material.name for material in ball.data.materials] == ["Black"]
    # Of an object two metres wide.
    assert ball.gpis.sigma == pytest.approx(0.04, rel=1e-3) and ball.gpis.length_scale == pytest.approx(0.2, rel=1e-3)
    assert ball.gpis.bake_margin >= 4 * ball.gpis.sigma


def test_small_deviation_is_the_mesh(stage, ball, tmp_path):
    """σ → 0: the picture is that of the sphere in Cycles, to a fraction of a voxel."""
    ball.gpis.sigma = 1e-3
    stage.render.engine = "GPIS"
    fuzzy = coverage(stage, tmp_path)
    ball.hide_render, ball.gpis.source.hide_render = True, False
    exact = 1 - support.picture(stage, tmp_path, "CYCLES")[..., 0]
    assert 0.1 < exact.mean() < 0.5
    assert abs(fuzzy.mean() / exact.mean() - 1) < 0.02
    assert np.abs(fuzzy - exact).mean() < 0.01


def test_deviation_blurs_the_silhouette(stage, ball, tmp_path):
    """The larger σ, the more pixels that are neither covered nor free; the middle stays covered."""
    soft = []
    for sigma in (0.005, 0.05, 0.2):
        ball.gpis.sigma = sigma
        ball.gpis.length_scale = 0.3
        picture = coverage(stage, tmp_path)
        assert picture[16:20, 22:26].min() > 0.99
        soft.append(np.mean((picture > 0.1) & (picture < 0.9)))
    assert soft[0] < soft[1] < soft[2]


def test_object_transform_moves_the_process(stage, ball, tmp_path):
    """Turned, scaled and moved is the same as the mesh turned, scaled and moved."""
    ball.gpis.sigma = 1e-3
    mesh = ball.gpis.source
    mesh.location, mesh.scale, mesh.rotation_euler = (0.6, 0, -0.4), (1.2, 0.5, 0.4), (0.3, 0.5, 0.2)
    ours = coverage(stage, tmp_path)
    ball.hide_render, mesh.hide_render = True, False
    cycles = 1 - support.picture(stage, tmp_path, "CYCLES")[..., 0]
    assert np.abs(ours - cycles).mean() < 0.01


def test_instances_of_a_gpis(stage, ball, tmp_path):
    one = coverage(stage, tmp_path).sum()
    group = bpy.data.collections.new("Group")
    mesh = ball.gpis.source
    mesh.scale = (0.4, 0.4, 0.4)
    for obj in (ball, mesh):
        stage.collection.objects.unlink(obj)
        group.objects.link(obj)
    for x in (-1, 1):
        empty = support.link(stage, "Instance", None, location=(x, 0, 0))
        empty.instance_type, empty.instance_collection = "COLLECTION", group
    assert coverage(stage, tmp_path).sum() == pytest.approx(2 * 0.16 * one, rel=0.1)


def test_open_mesh_is_closed_with_a_note(stage, extension):
    operators = importlib.import_module(extension + ".bake.operators")
    bpy.ops.mesh.primitive_monkey_add()
    obj, report = operators.make(bpy.context, bpy.context.object, resolution=32)
    assert not report["closed"] and "closed by its winding number" in operators.note(obj, report)
    bpy.ops.mesh.primitive_cube_add()
    obj, report = operators.make(bpy.context, bpy.context.object, resolution=32)
    assert report["closed"] and "winding" not in operators.note(obj, report)


def test_modifiers_are_baked_and_bake_again_is_a_new_file(stage, ball, tmp_path):
    before = ball.data.filepath
    first = coverage(stage, tmp_path).sum()
    ball.gpis.source.modifiers.new("Cast", "CAST").cast_type = "CUBOID"
    ball.gpis.source.modifiers["Cast"].factor = 1.0
    bpy.context.view_layer.objects.active = ball
    assert bpy.ops.gpis.rebake(resolution=48) == {"FINISHED"}
    assert ball.data.filepath != before and Path(bpy.path.abspath(before)).is_file()
    assert coverage(stage, tmp_path).sum() > 1.05 * first


def bunny(stage):
    if not BUNNY.is_file():
        pytest.skip("the shared data files are not there")
    data = bpy.data.volumes.new("Bunny")
    data.filepath = str(BUNNY)
    obj = support.link(stage, "Bunny", data, rotation=(0.7071, 0.7071, 0, 0))
    data.materials.append(support.diffuse("Black", (0, 0, 0)))
    return obj


def test_bunny_as_a_volume_object(stage, tmp_path):
    obj = bunny(stage)
    settings = obj.gpis
    settings.enabled = True
    assert settings.mean_grid == "mean"
    assert "variance" not in settings.sigma_grid and settings.sigma_meaning == "UNSET"  # never guessed
    settings.sigma_source, settings.sigma_grid = "GRID", "variance"
    assert "standard deviation σ or the variance σ²" in support.failure(stage, tmp_path)
    settings.sigma_meaning, settings.sigma_factor, settings.length_scale = "STANDARD_DEVIATION", 0.5, 0.5
    deviation = coverage(stage, tmp_path)
    assert 0.05 < deviation.mean() < 0.6 and deviation.max() > 0.99
    # The same numbers taken for σ² are a larger σ: a softer picture.
    settings.sigma_meaning = "VARIANCE"
    variance = coverage(stage, tmp_path)
    soft = [np.mean((picture > 0.1) & (picture < 0.9)) for picture in (deviation, variance)]
    assert soft[1] > soft[0]


def test_grid_lists_hold_the_grids_of_the_file(stage, extension):
    volume = importlib.import_module(extension + ".volume")
    assert sorted(volume.grid_names(bunny(stage).data)) == ["mean", "variance"]


def test_volume_without_gpis_is_left_out_and_said(ball, describe):
    ball.gpis.enabled = False
    entries, warnings = describe()
    assert not entries and any('"Sphere GPIS" is left out' in sentence for sentence in warnings)


def test_sigma_beyond_the_margin_is_said(ball, describe):
    assert describe()[1] == []
    ball.gpis.sigma = 1.0
    assert any("cut off at the bounds" in sentence for sentence in describe()[1])


def test_save_and_reload(stage, ball, tmp_path):
    ball.gpis.sigma, ball.gpis.length_scale, ball.gpis.memory = 0.07, 0.33, "RENEWAL"
    stage.gpis.samples, stage.gpis.seed = 77, 5
    stage.view_layers[0].gpis.use_pass_variance = True
    blend = tmp_path / "first.blend"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    scene, ball = bpy.context.scene, bpy.data.objects["Sphere GPIS"]
    assert ball.data.filepath.startswith("//first_gpis/")
    assert Path(bpy.path.abspath(ball.data.filepath)).is_file()
    assert (ball.gpis.sigma, ball.gpis.length_scale) == pytest.approx((0.07, 0.33))
    assert ball.gpis.memory == "RENEWAL" and ball.gpis.source.name == "Sphere" and ball.gpis.enabled
    assert (scene.gpis.samples, scene.gpis.seed) == (77, 5) and scene.render.engine == "GPIS"
    assert scene.view_layers[0].gpis.use_pass_variance
    assert coverage(scene, tmp_path).max() > 0.99


def test_old_versions_are_collected_and_backups_stay_whole(stage, ball, tmp_path):
    """Four bakes, three saves and a load: what the .blend, its backup or undo can point at is kept, the rest is not."""
    blend = tmp_path / "scene.blend"
    folder = tmp_path / "scene_gpis"
    bpy.context.view_layer.objects.active = ball
    for _ in range(2):
        bpy.ops.wm.save_as_mainfile(filepath=str(blend))
        bpy.ops.gpis.rebake(resolution=16)
    bpy.ops.gpis.rebake(resolution=16)
    used = Path(bpy.path.abspath(ball.data.filepath))
    assert len(list(folder.iterdir())) == 4, "undo may want any version of this session"
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    assert len(list(folder.iterdir())) == 4
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    kept = sorted(folder.iterdir())
    assert len(kept) == 3 and kept[-1] == used, "the newest two and the backup's"


def test_save_as_gives_the_copy_files_of_its_own(stage, ball, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    first = Path(bpy.path.abspath(ball.data.filepath))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "b.blend"))
    second = Path(bpy.path.abspath(ball.data.filepath))
    assert first.parent.name == "a_gpis" and second.parent.name == "b_gpis"
    assert first.read_bytes() == second.read_bytes()


def test_save_copy_changes_nothing_here(stage, ball, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    first = ball.data.filepath
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "copy.blend"), copy=True)
    assert ball.data.filepath == first and first.startswith("//a_gpis")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "copy.blend"))
    assert Path(bpy.path.abspath(bpy.data.volumes[0].filepath)).parent.name == "copy_gpis"


def test_a_packed_file_renders_elsewhere(stage, ball, tmp_path):
    """The .blend alone, its folder gone: as before; the next save puts the bake beside it."""
    there = tmp_path / "there"
    there.mkdir()
    expected = coverage(stage, tmp_path)
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "packed.blend"))
    bpy.ops.file.pack_all()
    bpy.ops.wm.save_mainfile()
    shutil.move(tmp_path / "packed.blend", there)
    shutil.rmtree(tmp_path / "packed_gpis")
    bpy.ops.wm.open_mainfile(filepath=str(there / "packed.blend"))
    assert Path(bpy.data.volumes[0].filepath).is_file()
    assert np.array_equal(coverage(bpy.context.scene, tmp_path), expected)
    bpy.ops.wm.save_mainfile()
    ball = bpy.data.objects["Sphere GPIS"]
    assert Path(bpy.path.abspath(ball.data.filepath)).parent == there / "packed_gpis"
    bpy.context.view_layer.objects.active = ball
    assert bpy.ops.gpis.rebake(resolution=16) == {"FINISHED"}
    assert ball.data.packed_file is None, "the old bytes"


def test_appended_from_a_packed_file(stage, ball, tmp_path):
    """No load, so nothing is restored before the render asks for it."""
    expected = coverage(stage, tmp_path)
    bpy.ops.file.pack_all()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "packed.blend"), copy=True)
    shutil.rmtree(tmp_path / "packed_gpis")
    for obj in (ball, ball.gpis.source):
        bpy.data.objects.remove(obj)
    with bpy.data.libraries.load(str(tmp_path / "packed.blend"), link=True) as (_, loaded):
        loaded.objects = ["Sphere GPIS"]
    stage.collection.objects.link(loaded.objects[0])
    assert np.array_equal(coverage(stage, tmp_path), expected)


def test_choosers_list_scalar_grids_only(stage, ball, extension, tmp_path):
    values = np.ones((4, 4, 4))
    grids = {"mean": values, "sigma": values, "albedo": np.ones((4, 4, 4, 3)), "origin": (0.0,) * 3, "voxel_size": 1.0}
    importlib.import_module("gpis_native").write_vdb(str(tmp_path / "many.vdb"), grids)
    ball.data.filepath = str(tmp_path / "many.vdb")
    assert set(importlib.import_module(extension + ".volume").grid_names(ball.data)) == {"mean", "sigma"}


def test_remove_gives_the_mesh_back(stage, ball):
    mesh = ball.gpis.source
    bpy.context.view_layer.objects.active = ball
    assert bpy.ops.gpis.remove() == {"FINISHED"}
    assert list(bpy.data.volumes) == [] and bpy.context.object == mesh
    assert not mesh.hide_render and mesh.display_type == "TEXTURED" and not bpy.ops.gpis.remove.poll()


def test_remove_after_the_gpis_was_deleted(stage, ball):
    mesh = ball.gpis.source
    mesh.select_set(False)
    bpy.ops.object.delete()
    bpy.context.view_layer.objects.active = mesh
    assert bpy.ops.gpis.remove() == {"FINISHED"} and not mesh.hide_render


def test_a_duplicate_of_another_mesh_bakes_for_itself(stage, ball):
    """Blender's Duplicate shares a volume's data: one bake would change both."""
    mesh = ball.gpis.source
    for obj in (mesh, ball):
        obj.select_set(True)
    bpy.ops.object.duplicate()
    copy = next(obj for obj in bpy.context.selected_objects if obj.type == "VOLUME")
    assert copy.data == ball.data and copy.gpis.source not in (None, mesh)
    before = ball.data.filepath
    bpy.context.view_layer.objects.active = copy
    bpy.ops.gpis.rebake(resolution=12)
    assert copy.data != ball.data and ball.data.filepath == before != copy.data.filepath


def test_a_moved_gpis_stays_there_when_baked_again(stage, ball, extension):
    mesh = ball.gpis.source
    mesh.location, ball.location = (0, 5, 0), (2, 0, 0)
    bpy.context.view_layer.objects.active = ball
    bpy.ops.gpis.rebake(resolution=16)
    volume = importlib.import_module(extension + ".volume")
    (grid,) = volume.grids(volume.path_of(ball.data))
    assert np.add(grid["min"], grid["max"]) == pytest.approx(0, abs=0.05)
    assert tuple(ball.matrix_world.translation) == (2, 5, 0)


def test_undo_of_a_bake(stage, ball):
    """The path is part of the datablock, and no file is rewritten."""
    bpy.context.view_layer.objects.active = ball
    bpy.ops.ed.undo_push(message="made")
    before = ball.data.filepath
    bpy.ops.gpis.rebake(resolution=12)
    ball.gpis.sigma, ball.gpis.memory = 0.3, "NONE"
    bpy.ops.ed.undo_push(message="baked")
    after = ball.data.filepath
    bpy.ops.ed.undo()
    ball = bpy.data.objects["Sphere GPIS"]
    assert ball.data.filepath == before != after and Path(before).is_file()
    assert ball.gpis.memory == "RENEWAL_PLUS" and ball.gpis.sigma == pytest.approx(0.04, rel=1e-3)
    bpy.ops.ed.redo()
    ball = bpy.data.objects["Sphere GPIS"]
    assert ball.data.filepath == after and Path(after).is_file() and ball.gpis.memory == "NONE"


def test_the_bake_of_a_backup_stays(stage, ball, tmp_path):
    """Several bakes between two saves: the .blend1 still opens with its own."""
    blend = tmp_path / "scene.blend"
    bpy.context.preferences.filepaths.save_version = 1
    bpy.ops.wm.save_as_mainfile(filepath=str(blend))
    first = Path(bpy.path.abspath(ball.data.filepath))
    for resolution in (12, 13, 14, 15):
        bpy.ops.gpis.rebake(resolution=resolution)
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(blend))
    assert first.is_file() and len(list(first.parent.iterdir())) == 3  # the backup's, and the two newest
    bpy.ops.wm.open_mainfile(filepath=f"{blend}1")
    assert Path(bpy.path.abspath(bpy.data.volumes[0].filepath)) == first
    assert len(list(first.parent.iterdir())) == 3
