"""Draws GPIS objects in the 3D viewport: their mean surface, and under the paint tool what is painted on it."""

import bpy
import numpy as np

from ..paint import bake
from ..sync import csg
from . import channels, draw, legend, sampling, surface
from .areas import tag_redraw

GREY = (0.72, 0.72, 0.72)
_SHELLS = ((1.0, (0.35, 0.65, 1.0)), (-1.0, (1.0, 0.55, 0.25)))
_SHELL_OPACITY = 0.22
_ELLIPSES = (0.05, 0.05, 0.05, 0.9)
_PINS = (1.0, 0.35, 0.1, 1.0)

# The stroke that is being painted: (name of the object, its live fields), or None; and how often it went on.
_live = None
_step = 0
# name of the object -> _Drawn; made again when what it shows has changed.
_drawn = {}
_handles = []


class _Drawn:
    """Batches of one object, and the key of what they show."""

    def __init__(self, key):
        self.key = key
        self.batch = None
        self.shells = []
        self.ellipses = np.empty((0, 3))
        self.pins = np.empty((0, 3))
        self.legend = None


def painting(obj, fields):
    """Show these fields for the object, as they are now, until `painted`."""
    global _live, _step
    _live = (obj.name, fields)
    _step += 1
    tag_redraw()


def painted():
    global _live
    if _live is not None:
        _drawn.pop(_live[0], None)
    _live = None
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
    operands = csg.operands(context.scene)
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
    drawn = _drawn.get(obj.name) if obj is not None else None
    if drawn is not None and drawn.legend is not None and tool_is_active(context) and obj in set(_shown(context)):
        legend.draw_legend(context, drawn.legend)


def _refreshed(context, obj, found):
    """What is drawn of an object, made again where its file, its settings or what the tool shows have changed."""
    brush = context.scene.gpis.paint
    active = obj == context.active_object and tool_is_active(context)
    live = _live is not None and _live[0] == obj.name
    settings = obj.gpis
    sampled = sampling.of(context, obj) if active and brush.show_realisation and not live else None
    if sampled is not None and sampled.vertices is None:
        sampled = None  # not done yet: the mean, meanwhile
    key = (
        found.path,
        active and (brush.channel, brush.show_channel, brush.show_shells, brush.show_axes),
        active and (settings.sigma, settings.length_scale, settings.sigma_source, settings.anisotropy),
        tuple(settings.ratios) + tuple(settings.rotation) + tuple(settings.infinite),
        len(settings.conditions),
        live and _step,
        sampled and sampled.key,
    )
    drawn = _drawn.get(obj.name)
    if drawn is not None and drawn.key == key:
        return drawn
    legend_before = drawn.legend if drawn is not None else None
    drawn = _drawn[obj.name] = _Drawn(key)
    fields = _live[1] if live else _fields(obj) if active else None
    shape = sampled or found
    vertices, normals = shape.vertices, shape.normals
    colours = np.broadcast_to(np.array(GREY), vertices.shape)
    if fields is not None:
        if live and brush.channel == "MEAN":
            vertices = channels.moved(fields, found)
        if brush.show_channel:
            view = channels.shown(context.scene, brush, fields, vertices, legend_before if live else None)
            colours = colours if view.colours is None else view.colours
            drawn.legend = view.legend
        if brush.show_axes and brush.channel == "ANISOTROPY":
            drawn.ellipses = channels.ellipses(fields, found)
        if brush.channel == "CONDITION":
            drawn.pins = channels.pins(settings.conditions, found)
        if brush.show_shells:
            drawn.shells = _shells(fields, found)
    drawn.batch = draw.surface_batch(vertices, normals, shape.triangles, colours)
    return drawn


def _fields(obj):
    try:
        return bake.fields(obj)
    except ValueError:
        return None  # the tool's poll says why it cannot be painted on


def _shells(fields, found):
    way = fields.values("deviation", found.vertices)[:, None] * found.normals
    return [
        draw.surface_batch(found.vertices + side * way, found.normals, found.triangles, np.broadcast_to(tint, way.shape))
        for side, tint in _SHELLS
    ]


def register():
    if bpy.app.background:
        return  # no window, no GPU
    space = bpy.types.SpaceView3D
    _handles.append(space.draw_handler_add(_draw_view, (), "WINDOW", "POST_VIEW"))
    _handles.append(space.draw_handler_add(_draw_pixels, (), "WINDOW", "POST_PIXEL"))


def unregister():
    global _live
    for handle in _handles:
        bpy.types.SpaceView3D.draw_handler_remove(handle, "WINDOW")
    _handles.clear()
    _drawn.clear()
    _live = None
    surface.forget()
    sampling.forget()
    draw.forget()
