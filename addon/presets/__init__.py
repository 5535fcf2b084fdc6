"""Presets of GPIS objects, with thumbnails that examples/preset_thumbnails.py renders."""

from . import operators, previews

_PARTS = (previews, operators)


def register():
    for part in _PARTS:
        part.register()


def unregister():
    for part in reversed(_PARTS):
        part.unregister()
