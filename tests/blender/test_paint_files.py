"""What keeps painted work: saving, copies, linking, appending, packing, lost files and crashes."""

import importlib
import os
import shutil
import signal
import subprocess
import time
from pathlib import Path

import bpy
import numpy as np
import pytest

from . import support
from .painting import arc, file_of, grids_of, paint


def test_save_as_copies_and_a_moved_folder(painted_sphere, gn, tmp_path):
    paint("DEVIATION", "SET", arc(2), value=0.2)
    expected = grids_of(gn, painted_sphere)["sigma"]
    (tmp_path / "a").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a" / "first.blend"))
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a" / "second.blend"))
    shutil.rmtree(tmp_path / "a" / "first_gpis")
    shutil.move(tmp_path / "a", tmp_path / "b")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "b" / "second.blend"))
    obj = bpy.context.object
    assert file_of(obj).parent == tmp_path / "b" / "second_gpis"
    assert np.array_equal(grids_of(gn, obj)["sigma"], expected) and obj.data.gpis_strokes
    paint("DEVIATION", "ADD", arc(2), value=2.0)
    assert not np.array_equal(grids_of(gn, obj)["sigma"], expected)


@pytest.mark.parametrize("how", ["linked", "overridden", "appended"])
def test_linked_and_appended(painted_sphere, gn, tmp_path, how):
    link = how != "appended"
    paint("DEVIATION", "SET", arc(2), value=0.2)
    name, strokes, expected = painted_sphere.name, painted_sphere.data.gpis_strokes, grids_of(gn, painted_sphere)["sigma"]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "library.blend"))
    bpy.ops.wm.read_homefile(use_factory_startup=False, use_empty=True)
    (tmp_path / "here").mkdir()
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "here" / "scene.blend"))
    with bpy.data.libraries.load(str(tmp_path / "library.blend"), link=link, relative=True) as (_, wanted):
        wanted.objects = [name]
    (obj,) = wanted.objects
    bpy.context.collection.objects.link(obj)
    if how == "overridden":
        obj = obj.override_create(remap_local_usages=True)
    bpy.context.view_layer.objects.active = obj
    assert obj.data.gpis_strokes == strokes
    path = Path(os.path.normpath(bpy.path.abspath(obj.data.filepath, library=obj.data.library)))
    assert np.array_equal(gn.read_vdb(path, names=["mean", "sigma"])["sigma"], expected)
    if link:
        sentence = "is linked from another file" if how == "linked" else "is a library override, of which Blender does not save"
        for channel, operation in (("DEVIATION", "ADD"), ("CONDITION", "PIN")):
            with pytest.raises(RuntimeError, match=f"{sentence}.*make it local"):
                paint(channel, operation, arc(2), value=2.0)
        # Local, with data that is not: it gets data and a file of its own, and the library keeps its.
        obj.select_set(True)
        bpy.ops.object.make_local(type="SELECT_OBJECT")
        obj = bpy.context.object
        assert obj.data.library is not None
        paint("DEVIATION", "ADD", arc(2), value=2.0)
        assert obj.data.library is None and file_of(obj).parent == tmp_path / "here" / "scene_gpis"
        assert np.array_equal(gn.read_vdb(path, names=["mean", "sigma"])["sigma"], expected)
        return
    paint("DEVIATION", "ADD", arc(2), value=2.0)
    assert file_of(obj).parent == tmp_path / "here" / "scene_gpis" and path.is_file()


def test_a_copy_that_shares_its_data(painted_sphere, gn, tmp_path):
    """Alt D: a stroke on the copy leaves the original as it was, also when versions are collected and in the file."""
    name = painted_sphere.name
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    paint("DEVIATION", "SET", arc(2), value=0.2)
    expected, strokes = grids_of(gn, painted_sphere)["sigma"], painted_sphere.data.gpis_strokes
    bpy.ops.object.duplicate(linked=True)
    copy = bpy.context.object
    assert copy.data == painted_sphere.data
    for _ in range(4):
        paint("DEVIATION", "ADD", arc(2), value=1.5)
    assert copy.data != painted_sphere.data and copy.data.gpis_strokes.startswith(strokes)
    changed, copied = grids_of(gn, copy)["sigma"], copy.name
    bpy.ops.wm.save_mainfile()
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    original, copy = bpy.data.objects[name], bpy.data.objects[copied]
    assert original.data.gpis_strokes == strokes
    assert np.array_equal(grids_of(gn, original)["sigma"], expected)
    assert np.array_equal(grids_of(gn, copy)["sigma"], changed) and not np.array_equal(changed, expected)


def test_packed_strokes(painted_sphere, gn, bake, tmp_path):
    """Packed, and its files lost: the bake comes back, and with it what was there before it was painted on."""
    paint("DEVIATION", "SET", arc(2), value=0.2)
    expected = grids_of(gn, painted_sphere)["sigma"]
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "packed.blend"))
    bpy.ops.file.pack_all()
    bpy.ops.wm.save_mainfile()
    (tmp_path / "there").mkdir()
    shutil.move(tmp_path / "packed.blend", tmp_path / "there")
    shutil.rmtree(tmp_path / "packed_gpis")
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "there" / "packed.blend"))
    obj = bpy.context.object
    assert np.array_equal(grids_of(gn, obj)["sigma"], expected)
    assert bpy.ops.gpis.paint_rebuild() == {"FINISHED"}
    assert np.array_equal(grids_of(gn, obj)["sigma"], expected)
    bpy.ops.gpis.paint_reset(channel="DEVIATION")
    assert np.ptp(bake.fields(obj).values("deviation", arc(2).astype(float))) < 1e-7


def test_versions_are_collected_on_save(painted_sphere, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    for seed in range(5):
        paint("DEVIATION", "SET", arc(seed), value=0.2)
    assert len(list((tmp_path / "a_gpis").glob("*.vdb"))) == 6
    (tmp_path / "a_gpis" / "Sphere.v0099.vdb.part").write_bytes(b"half")
    bpy.ops.wm.save_mainfile()
    assert len(list((tmp_path / "a_gpis").glob("*.vdb"))) == 6, "undo may go back to any of them"
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    assert len(list((tmp_path / "a_gpis").iterdir())) <= 3  # the last two, and what a backup has


def test_a_lost_file_is_painted_again(painted_sphere, gn, tmp_path):
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    paint("DEVIATION", "SET", arc(0), value=0.2)
    paint("MEAN", "INFLATE", arc(1))
    expected = grids_of(gn, painted_sphere)
    file_of(painted_sphere).unlink()
    assert bpy.ops.gpis.paint_rebuild() == {"FINISHED"}
    got = grids_of(gn, painted_sphere)
    for name in ("mean", "sigma"):
        assert np.array_equal(got[name], expected[name])


def test_undo_to_a_version_that_is_no_longer_on_disk(painted_sphere, gn, extension, monkeypatch):
    """A long session does not fill the disk; what undo finds missing is painted again."""
    name = painted_sphere.name
    bpy.ops.ed.undo_push(message="before")
    paint("DEVIATION", "SET", arc(0), value=0.2)
    paint("MEAN", "INFLATE", arc(1))
    expected = grids_of(gn, bpy.data.objects[name])
    first = file_of(bpy.data.objects[name])
    monkeypatch.setattr(importlib.import_module(extension + ".bake.files"), "_MOST_BYTES", 2 * first.stat().st_size)
    for seed in range(4):
        paint("ALBEDO", "SET", arc(seed), color=(1, 0, 0))
    assert not first.is_file() and file_of(bpy.data.objects[name]).is_file()
    for _ in range(4):
        bpy.ops.ed.undo()
    obj = bpy.data.objects[name]
    assert file_of(obj).is_file() and file_of(obj) != first and not obj.gpis.use_albedo
    got = grids_of(gn, obj)
    for grid in ("mean", "sigma"):
        assert np.array_equal(got[grid], expected[grid]), grid


KILLED = """
import bpy, importlib
assert bpy.ops.extensions.package_install_files(
    filepath={zip!r}, repo="user_default", enable_on_install=True) == {{"FINISHED"}}
bpy.ops.mesh.primitive_uv_sphere_add(segments=32, ring_count=16)
bpy.ops.gpis.make(resolution=96)
bpy.ops.wm.save_as_mainfile(filepath={blend!r})
print("saved", flush=True)
bake = importlib.import_module("bl_ext.user_default.gpis.paint.bake")
new_path = bake.files.new_path

def told(*arguments, **keywords):
    path = new_path(*arguments, **keywords)
    print("bakes", path, flush=True)
    return path

bake.files.new_path = told
for i in range(10000):
    place = ((i * 0.37) % 2 - 1, (i * 0.61) % 2 - 1, 0.5)
    bpy.ops.gpis.paint_stroke(
        stroke=[{{"name": "", "location": place, "pressure": 1.0}}], channel="MEAN", radius=0.4, value=0.01, spacing=0.0)
    print("stroke", i + 1, flush=True)
"""


def stopped_in_a_bake(process, path, size_before, share):
    """Stop the process while it writes this file, under whatever name, when it has written that share of the bytes that
    the version before has; whether it was."""
    almost_all = 0.95 * size_before

    def written():
        return max((found.stat().st_size for found in path.parent.glob(path.name + "*")), default=-1)

    end = time.monotonic() + 20
    while time.monotonic() < end:
        try:
            size = written()
        except FileNotFoundError:  # renamed meanwhile
            continue
        if size >= almost_all:
            return False
        if size >= share * size_before:
            process.send_signal(signal.SIGSTOP)
            while Path(f"/proc/{process.pid}/stat").read_text().rpartition(")")[2].split()[0] != "T":
                pass
            # It stands still: nothing is written any more between the look and the kill.
            if written() < almost_all:
                return True
            process.send_signal(signal.SIGCONT)
            return False
    return False


@pytest.mark.parametrize("share", [0.0, 0.6])
def test_killed_while_painting(extension_zip, gn, bake, stage, tmp_path, share):
    """kill -9 in the middle of the bake of a stroke: all but that one are there again."""
    script, blend = tmp_path / "script.py", tmp_path / "killed.blend"
    script.write_text(KILLED.format(zip=str(extension_zip), blend=str(blend)))
    (tmp_path / "user").mkdir()
    process = subprocess.Popen(
        support.command(script),
        env={**os.environ, "BLENDER_USER_RESOURCES": str(tmp_path / "user")},
        stdout=subprocess.PIPE,
        stderr=subprocess.STDOUT,
        text=True,
    )
    done, caught, path, size, lines = 0, None, None, None, []
    for line in process.stdout:
        lines.append(line)
        if line.startswith("stroke "):
            done, size = int(line.split()[1]), path.stat().st_size
        if line.startswith("bakes "):
            path = Path(line.removeprefix("bakes ").strip())
            if done >= 2 and stopped_in_a_bake(process, path, size, share):
                caught = path
                process.send_signal(signal.SIGKILL)
                break
        assert done < 200, "no bake was caught"
    assert caught is not None, "".join(lines)
    done = max([done] + [int(line.split()[1]) for line in process.stdout if line.startswith("stroke ")])
    process.wait()
    assert not caught.exists(), "what is half written has no name that anything could read it by"

    bpy.ops.wm.open_mainfile(filepath=str(blend))
    obj = bpy.context.object
    assert not obj.data.gpis_strokes, "saved before the first stroke"
    assert bpy.ops.gpis.paint_recover() == {"FINISHED"}
    found = len(obj.data.gpis_strokes.split("\n"))
    assert found == done
    # And it is whole: the same strokes on what was there before make the same grid.
    expected = grids_of(gn, obj)["mean"]
    assert bpy.ops.gpis.paint_rebuild() == {"FINISHED"}
    assert np.array_equal(grids_of(gn, obj)["mean"], expected)
    with pytest.raises(RuntimeError, match="beside its file is none that goes on with its strokes"):
        bpy.ops.gpis.paint_recover()
