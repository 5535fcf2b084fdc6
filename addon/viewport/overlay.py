"""Draws GPIS objects in the 3D viewport: their mean surface, and under the paint tool what is painted on it."""

import bpy
import numpy as np

from ..paint import bake
from ..paint.stroke import Dabs
from ..sync import csg
from . import channels, draw, legend, sampling, surface
from .areas import tag_redraw
from .look import Look

_SHELLS = ((0.35, 0.65, 1.0), (1.0, 0.55, 0.25))  # at +σ, at -σ
_SHELL_OPACITY = 0.22
_ELLIPSES = (0.05, 0.05, 0.05, 0.9)
_PINS = (1.0, 0.35, 0.1, 1.0)

# The stroke that is being painted: (full name of the object, its live fields, symmetry), or None; and its dabs since the
# object was drawn last.
_live = None
_new = Dabs()
# full name of the object (a linked one may be called the same) -> _Drawn; made again when what it shows has changed.
_drawn = {}
_handles = []


class _Drawn:
    """Batches of one object, what they show and the key of that."""

    def __init__(self, key, look, shape, found):
        self.key, self.look = key, look
        self.pins = np.empty((0, 3))
        self._shape, self._found = shape, found
        self.fill()

    def fill(self):
        shape, found, look = self._shape, self._found, self.look
        self.batch = draw.surface_batch(look.vertices, shape.normals, shape.triangles, look.colours)
        self.ellipses = look.ellipses
        self.shells = [
            draw.surface_batch(vertices, found.normals, found.triangles, np.broadcast_to(tint, vertices.shape))
            for vertices, tint in zip(look.shells, _SHELLS, strict=False)
        ]


def painting(obj, fields, dabs, symmetry):
    """Show these fields for the object, as they are now, until `painted`. `dabs`: what changed since the last call."""
    global _live, _new
    _live, _new = (obj.name_full, fields, symmetry), _new + dabs
    tag_redraw()


def painted():
    """The stroke is over: what is shown is made again as a whole."""
    global _live, _new
    if _live is not None:
        _drawn.pop(_live[0], None)
    _live, _new = None, Dabs()
    tag_redraw()


def tool_is_active(context):
    if context.mode != "OBJECT" or context.workspace is None:
        return False
    tool = context.workspace.tools.from_space_view3d_mode("OBJECT", create=False)
    return tool is not None and tool.idname == "gpis.paint"


def _shown(context):
    """The GPIS objects of the view, but operands, which are drawn as bounds unless they are at work."""
    space = context.space_data
    if space is None or space.type != "VIEW_3D" or not space.overlay.show_overlays or space.shading.type == "RENDERED":
        return
    operands = csg.operands(context.scene.objects)
    for obj in context.view_layer.objects:
        if obj.type != "VOLUME" or not obj.gpis.enabled or not obj.visible_get(viewport=space):
            continue
        if obj.name_full not in operands or obj == context.active_object:
            yield obj


def _draw_view():
    context = bpy.context
    region_data = context.region_data
    for obj in _shown(context):
        found = surface.of(obj)
        if found is None or len(found.vertices) == 0:
            continue
        drawn = _refreshed(context, obj, found)
        matrix = obj.matrix_world.copy()
        draw.surface(drawn.batch, matrix, region_data)
        draw.lines(drawn.ellipses, _ELLIPSES, matrix, width=1.4)
        draw.lines(drawn.pins, _PINS, matrix, width=4.0)
        for batch in drawn.shells:
            draw.surface(batch, matrix, region_data, _SHELL_OPACITY)


def _draw_pixels():
    context = bpy.context
    obj = context.active_object
    drawn = _drawn.get(obj.name_full) if obj is not None else None
    if drawn is not None and drawn.look.legend is not None and tool_is_active(context) and obj in set(_shown(context)):
        legend.draw_legend(context, drawn.look.legend)


def _refreshed(context, obj, found):
    """What is drawn of an object: made again where its file, its settings or what the tool shows have changed, and in
    part where a stroke went on."""
    global _new
    brush = context.scene.gpis.paint
    active = obj == context.active_object and tool_is_active(context)
    live = _live is not None and _live[0] == obj.name_full
    settings = obj.gpis
    sampled = sampling.of(context, obj) if active and brush.show_realisation and not live else None
    if sampled is not None and sampled.vertices is None:
        sampled = None  # not done yet: the mean, meanwhile
    key = (
        found.path,
        active and (brush.channel, brush.show_channel, brush.show_shells, brush.show_axes),
        active and (settings.sigma, settings.length_scale, settings.anisotropy, settings.use_albedo),
        active and (settings.sigma_source, settings.sigma_grid, settings.sigma_meaning, settings.sigma_factor),
        tuple(settings.ratios) + tuple(settings.rotation) + tuple(settings.infinite),
        len(settings.conditions),
        sampled and sampled.key,
    )
    drawn = _drawn.get(obj.name_full)
    known = drawn is not None and (not active or channels.holds(drawn.look.legend, brush))
    dabs = Dabs()
    if live:
        dabs, _new = _new, dabs
    if known and drawn.key == key:
        if len(dabs) and drawn.look.follow(_live[1], dabs, _live[2]):
            drawn.fill()
        return drawn
    fields = _live[1] if live else _fields(obj) if active else None
    shape = sampled or found
    kept = drawn.look.legend if known and live and drawn.key[1] == key[1] else None
    look = Look(context.scene, brush, fields, found, shape, moved=live, legend=kept)
    drawn = _drawn[obj.name_full] = _Drawn(key, look, shape, found)
    if fields is not None and brush.channel == "CONDITION":
        drawn.pins = channels.pins(settings.conditions, found)
    return drawn


def _fields(obj):
    try:
        return bake.fields(obj)
    except ValueError:
        return None  # the tool's poll says why it cannot be painted on


def register():
    if bpy.app.background:
        return  # no window, no GPU
    space = bpy.types.SpaceView3D
    _handles.append(space.draw_handler_add(_draw_view, (), "WINDOW", "POST_VIEW"))
    _handles.append(space.draw_handler_add(_draw_pixels, (), "WINDOW", "POST_PIXEL"))


def unregister():
    global _live, _new
    for handle in _handles:
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
    _handles.clear()
    _drawn.clear()
    _live, _new = None, Dabs()
    surface.forget()
    sampling.forget()
    draw.forget()
