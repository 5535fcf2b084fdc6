"""Versioned .vdb files: never rewritten, copied beside the .blend when it is saved, collected when they are old.

Blender caches a .vdb by its path for the life of the process, so every bake gets a new name (`Suzanne.v0002.vdb`);
undo then works too, as the path is part of the datablock. A .blend owns one folder, `<its name>_gpis` beside it;
volumes whose file is elsewhere (a temporary one, or that of the .blend this one was saved from) are copied into it on
save, so that no .blend depends on the folder of another and each may collect its own.
"""

import os
import re
import shutil
from pathlib import Path

import bpy
from bpy.app.handlers import persistent

from ..volume import unpacked

_VERSIONED = re.compile(r"^(?P<name>.+)\.v(?P<version>\d{4,})\.vdb$")
# Versions of a name that stay although nothing uses them, beside those of the backups.
_KEPT = 2
# Blender's ID_VO, the letters of its file format.
_VOLUME_CODE = int.from_bytes(b"VO", "little")
# Files made or used since the last load: undo may bring any of them back.
_session = set()
# Those that can be made again out of any later one, and that no .blend on disk points at, the oldest first.
_repeatable = []
# So much of them stays on disk, two hundred strokes of an ordinary object. What undo finds missing is painted again.
_MOST_BYTES = 2 << 30
# (volume, its former file) of the save in hand.
_adopted = []


def folder(blend_path):
    """The folder of a .blend, or a temporary one before the first save."""
    if not blend_path:
        return Path(bpy.app.tempdir) / "gpis"
    path = Path(blend_path)
    return path.parent / f"{path.stem}_gpis"


def new_path(name, *, repeatable=False):
    """A path that was never used for this name; its folder is made. `repeatable`: what undo finds missing of it can be
    made again out of the next version that is left."""
    place = folder(bpy.data.filepath)
    place.mkdir(parents=True, exist_ok=True)
    path = _remember(_next(place, bpy.path.clean_name(name) or "gpis"))
    if repeatable:
        _repeatable.append(path)
    else:
        _repeatable.clear()
    return path


def trim():
    """Delete the oldest repeatable files that no volume uses, where there are too many of them."""
    used = {path for _, path in _baked()}
    left = [path for path in _repeatable if path.is_file()]
    size = sum(path.stat().st_size for path in left)
    for path in left:
        if size <= _MOST_BYTES:
            return
        if path not in used:
            size -= path.stat().st_size
            path.unlink()


def point(data, path):
    """Give a volume a file that was written for it."""
    if data.packed_file:  # the old bytes, which Blender would otherwise keep
        bpy.ops.file.unpack_item(id_name=data.name, id_type=_VOLUME_CODE, method="USE_ORIGINAL")
    data.filepath = bpy.path.relpath(str(path)) if bpy.data.filepath else str(path)
    data.gpis_baked = True


def name_of(path):
    """What a .vdb is called, without its version."""
    match = _VERSIONED.match(Path(path).name)
    return match["name"] if match else Path(path).stem


def versions_of(path):
    """The files beside a path that are versions of the same name, the newest last."""
    path = Path(path)
    return [found for name, _, found in sorted(_versions(path.parent)) if name == name_of(path)]


def _next(place, name):
    taken = [version for known, version, _ in _versions(place) if known == name]
    for path in _session:
        match = _VERSIONED.match(path.name)
        if match["name"] == name:
            taken.append(int(match["version"]))
    return place / f"{name}.v{max(taken, default=0) + 1:04d}.vdb"


def _versions(place):
    """(name, version, path) of every versioned file of a folder."""
    found = []
    for path in place.glob("*.vdb") if place.is_dir() else ():
        match = _VERSIONED.match(path.name)
        if match:
            found.append((match["name"], int(match["version"]), path))
    return found


def _remember(path):
    _session.add(path)
    return path


def _baked():
    """(volume, path) of every volume of this file whose .vdb was made here."""
    for volume in bpy.data.volumes:
        path = Path(os.path.normpath(bpy.path.abspath(volume.filepath)))
        # A file that was chosen by hand afterwards is not ours.
        if volume.library is None and volume.gpis_baked and _VERSIONED.match(path.name):
            yield volume, path


def adopt(blend_path):
    """Copy the volumes' files into the folder of the .blend that is about to be saved."""
    place = folder(blend_path)
    _adopted.clear()
    for volume, path in _baked():
        if path.parent == place or not path.is_file():
            continue
        place.mkdir(parents=True, exist_ok=True)
        target = _remember(_next(place, _VERSIONED.match(path.name)["name"]))
        shutil.copyfile(path, target)
        _adopted.append((volume, volume.filepath))
        # Absolute: Blender makes it relative to the new place while it writes, if the artist wants relative paths.
        volume.filepath = str(target)


def restore():
    """Give volumes their files again: in the folder of this .blend wherever it was moved or copied to, and where they
    are missing, but packed, in a temporary one, which the next save adopts."""
    for volume, path in _baked():
        beside = folder(bpy.data.filepath) / path.name
        if path != beside and beside.is_file():
            point(volume, beside)
    for volume in bpy.data.volumes:
        path = bpy.path.abspath(volume.filepath, library=volume.library)
        if volume.packed_file and not volume.is_sequence and not os.path.isfile(path):
            volume.filepath = unpacked(volume)
            volume.gpis_baked = True


def collect():
    """Delete versions that nothing can point at any more. A backup that was opened collects nothing."""
    if not bpy.data.filepath.endswith(".blend"):
        return
    for partial in folder(bpy.data.filepath).glob("*.vdb.part"):
        partial.unlink()  # a bake that was killed
    backups = _times_of_backups()
    used = {path for _, path in _baked()} | _session
    versions = {}
    for name, _version, path in sorted(_versions(folder(bpy.data.filepath)), key=lambda row: -row[1]):
        versions.setdefault(name, []).append(path)
    for newest_first in versions.values():
        kept = used.union(newest_first[:_KEPT])
        # What a backup points at was the newest when it was saved.
        kept.update(next((path for path in newest_first if path.stat().st_mtime <= time), None) for time in backups)
        for path in newest_first:
            if path not in kept:
                path.unlink()


def _times_of_backups():
    """When the .blend1, .blend2 … beside this .blend were saved."""
    backups = (Path(f"{bpy.data.filepath}{number}") for number in range(1, 33))  # 32: Blender's most
    return [path.stat().st_mtime for path in backups if path.is_file()]


@persistent
def _before_save(blend_path, _=None):
    adopt(blend_path or bpy.data.filepath)


@persistent
def _after_save(blend_path, _=None):
    if blend_path and os.path.normpath(blend_path) != os.path.normpath(bpy.data.filepath):
        for volume, filepath in _adopted:  # Save Copy: the copy has files of its own, this .blend keeps its
            volume.filepath = filepath
    _adopted.clear()
    _repeatable.clear()
    _session.update(path for _, path in _baked())
    collect()


@persistent
def _after_load(blend_path, _=None):
    _session.clear()
    _repeatable.clear()
    restore()
    _session.update(path for _, path in _baked())
    collect()


_HANDLERS = (("save_pre", _before_save), ("save_post", _after_save), ("load_post", _after_load))


def register():
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister():
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    _session.clear()
