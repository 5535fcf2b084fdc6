"""Presets of GPIS objects, with thumbnails that examples/preset_thumbnails.py renders."""

from ..parts import register_parts_factory
from . import operators, previews

_PARTS = (previews, operators)

register, unregister = register_parts_factory(_PARTS)
