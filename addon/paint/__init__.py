"""Painting on GPIS objects.

brush = stroke.Brush("deviation", "set", value=0.2, symmetry=(True, False, False))
spacing = stroke.Spacing(radius=0.3, strength=0.5)             # points of a hand -> dabs, in object space
painting = bake.Painting(obj, brush)
painting.add(spacing.add(location, pressure))                  # as often as the hand moves; painting.fields is live
painting.add(spacing.finish()); painting.finish()              # or painting.cancel()
bake.fields(obj).first_surface(origin, direction)              # what is under the cursor
conditions.pin(obj, [location]); conditions.erase(obj, [location], radius)
"""

import logging

import bpy
from bpy.app.handlers import persistent

from . import bake, modal, operators, tool

_PARTS = (operators, modal, tool)

_log = logging.getLogger(__name__)


@persistent
def _after_load(*_):
    bake.forget()


@persistent
def _after_undo(*_):
    try:
        bake.rebuild_missing()
    except (ValueError, OSError) as error:
        _log.error(str(error))  # the render says the same of the file that is missing


_HANDLERS = (("load_post", _after_load), ("undo_post", _after_undo), ("redo_post", _after_undo))


def register():
    bpy.types.Volume.gpis_strokes = bpy.props.StringProperty(
        name="Strokes", description="What was painted, as data: addon/paint/stroke.py", options={"HIDDEN"}
    )
    for part in _PARTS:
        part.register()
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).append(handler)


def unregister():
    for name, handler in _HANDLERS:
        getattr(bpy.app.handlers, name).remove(handler)
    for part in reversed(_PARTS):
        part.unregister()
    bake.forget()
    del bpy.types.Volume.gpis_strokes
