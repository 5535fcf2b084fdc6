"""The thumbnails, and the gallery's choice of one."""

from pathlib import Path

import bpy
import bpy.utils.previews
from bpy.props import EnumProperty

from .table import PRESETS

FOLDER = Path(__file__).parent / "thumbnails"

_collection = None
_items = []  # Blender keeps no reference to the strings of a function's items


def thumbnail(name):
    """Path of a preset's picture."""
    return FOLDER / f"{name.lower()}.png"


def _choices(owner, context):
    return _items


def register():
    global _collection
    _collection = bpy.utils.previews.new()
    for i, (name, preset) in enumerate(PRESETS.items()):
        path = thumbnail(name)
        icon = _collection.load(name, str(path), "IMAGE").icon_id if path.is_file() else 0
        _items.append((name, preset.label, preset.description, icon, i))
    bpy.types.WindowManager.gpis_preset = EnumProperty(
        name="Preset", description="Preset that Apply gives to the selected GPIS objects", items=_choices
    )


def unregister():
    del bpy.types.WindowManager.gpis_preset
    _items.clear()
    bpy.utils.previews.remove(_collection)
