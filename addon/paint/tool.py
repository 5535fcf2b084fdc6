"""The paint tool of the 3D viewport: its place in the toolbar, its settings in the header, its keys and its ring."""

from pathlib import Path

import bpy

from ..viewport import draw, legend
from . import hover, modal
from .settings import curve_name

_ICON = Path(__file__).parent / "icons" / "ops.gpis.paint"
_RING = (1.0, 1.0, 1.0, 0.9)
_RING_SMOOTH = (0.4, 0.7, 1.0, 0.9)
_RING_NOWHERE = (1.0, 1.0, 1.0, 0.35)


def _radial(path):
    return {"properties": [("data_path_primary", f"scene.gpis.paint.{path}")]}


class GPISPaintTool(bpy.types.WorkSpaceTool):
    bl_space_type = "VIEW_3D"
    bl_context_mode = "OBJECT"
    bl_idname = "gpis.paint"
    bl_label = "GPIS Paint"
    bl_description = (
        "Paint on a GPIS object.\n"
        "Drag: paint. Ctrl: the opposite. Shift: smooth. F: radius. Shift F: strength. S: take the value under the mouse"
    )
    bl_icon = str(_ICON)
    bl_cursor = "PAINT_CROSS"
    bl_keymap = (
        ("gpis.paint", {"type": "LEFTMOUSE", "value": "PRESS"}, {"properties": [("mode", "NORMAL")]}),
        ("gpis.paint", {"type": "LEFTMOUSE", "value": "PRESS", "ctrl": True}, {"properties": [("mode", "INVERT")]}),
        ("gpis.paint", {"type": "LEFTMOUSE", "value": "PRESS", "shift": True}, {"properties": [("mode", "SMOOTH")]}),
        ("wm.radial_control", {"type": "F", "value": "PRESS"}, _radial("view_radius")),
        ("wm.radial_control", {"type": "F", "value": "PRESS", "shift": True}, _radial("strength")),
        ("gpis.paint_sample", {"type": "S", "value": "PRESS"}, None),
    )

    def draw_settings(context, layout, tool):
        brush = context.scene.gpis.paint
        obj = context.active_object
        layout.prop(brush, "channel", text="")
        if obj is None or obj.type != "VOLUME" or not obj.gpis.enabled:
            layout.label(text="Select a GPIS object", icon="INFO")
        if brush.channel != "CONDITION":
            layout.prop(brush, brush.operation_name, text="")
            value = brush.value_name
            if value:
                row = layout.row()
                row.ui_units_x = 9 if value == "ratios" else 5
                row.prop(brush, value, text="" if value in {"ratios", "color"} else None, slider=value == "ratios")
        row = layout.row(align=True)
        row.ui_units_x = 6.5
        scene_unit = brush.radius_unit == "SCENE"
        row.prop(brush, "radius" if scene_unit else "view_radius", text="Radius")
        row.prop(brush, "radius_unit", text="", icon="WORLD" if scene_unit else "RESTRICT_VIEW_OFF", icon_only=True)
        row.prop(brush, "use_pressure_radius", text="", icon="STYLUS_PRESSURE")
        if brush.channel != "CONDITION":
            row = layout.row(align=True)
            row.ui_units_x = 7
            row.prop(brush, "strength", slider=True)
            row.prop(brush, "use_pressure_strength", text="", icon="STYLUS_PRESSURE")
        layout.popover("GPIS_PT_brush", text="Brush")
        row = layout.row(align=True)
        row.label(text="", icon="MOD_MIRROR")
        for i, axis in enumerate("XYZ"):
            row.prop(brush, "symmetry", index=i, text=axis, toggle=True)
        layout.popover("GPIS_PT_brush_overlay", text="", icon="OVERLAY")
        layout.popover("GPIS_PT_brush_channel", text="Grid")
        if modal.readout():
            layout.label(text=modal.readout())

    @staticmethod
    def draw_cursor(context, tool, xy):
        _draw_ring(context, xy)


class GPIS_PT_brush(bpy.types.Panel):
    bl_label = "Brush"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"
    bl_ui_units_x = 13

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        brush = context.scene.gpis.paint
        layout.prop(brush, "spacing")
        layout.prop(brush, "falloff")
        if brush.falloff == "CUSTOM" and brush.curve is not None:
            layout.template_curve_mapping(brush.curve, curve_name(brush.curve), brush=True, use_negative_slope=True)


class GPIS_PT_brush_overlay(bpy.types.Panel):
    bl_label = "Overlay"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"

    def draw(self, context):
        layout = self.layout
        brush = context.scene.gpis.paint
        layout.label(text="While Painting")
        for name in ("show_channel", "show_axes", "show_shells", "show_realisation"):
            layout.prop(brush, name)


class GPIS_PT_brush_channel(bpy.types.Panel):
    bl_label = "Grid"
    bl_space_type = "VIEW_3D"
    bl_region_type = "HEADER"

    def draw(self, context):
        layout = self.layout
        channel = context.scene.gpis.paint.channel
        if channel == "CONDITION":
            layout.operator("gpis.erase_conditions")
        else:
            layout.operator("gpis.paint_reset").channel = channel
            layout.operator("gpis.paint_mirror").channel = channel
            layout.operator("gpis.paint_copy").channel = channel
        layout.separator()
        layout.operator("gpis.paint_resample")
        layout.operator("gpis.paint_rebuild")
        layout.operator("gpis.paint_recover")


def _draw_ring(context, xy):
    """The brush on the surface under the mouse, and the value there."""
    region, region_data, obj = context.region, context.region_data, context.active_object
    if region is None or region_data is None or region.type != "WINDOW":
        return
    brush = context.scene.gpis.paint
    # Blender draws cursors in the window, and says where they are there.
    corner = (region.x, region.y, 0.0)
    place = (xy[0] - region.x, xy[1] - region.y)
    fields = modal.fields_of(context, obj)
    found = None if fields is None else hover.under(region, region_data, obj, fields, place)
    if found is None:
        modal.read(context, "")
        points = hover.circle(xy, brush.view_radius)
        draw.lines(points, _RING_NOWHERE, width=1.0, depth=False, kind="LINE_STRIP")
        return
    modal.set_pixel_size(found)
    radius = hover.radius_of(brush, found)
    points = hover.projected(region, region_data, hover.ring(found, radius)) + corner
    draw.lines(points, _RING_SMOOTH if modal.smoothing() else _RING, width=2.0, depth=False, kind="LINE_STRIP")
    said = modal.value_text(context.scene, brush, fields, found.location, radius)
    modal.read(context, said)
    if said:
        scale = context.preferences.system.ui_scale
        legend.text(context, said, xy[0] + 18 * scale, xy[1] - 26 * scale)


def _put_away():
    """Another tool in the views that hold this one: Blender would go on drawing its ring."""
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D":
                with bpy.context.temp_override(window=window, area=area):
                    tool = bpy.context.workspace.tools.from_space_view3d_mode("OBJECT", create=False)
                    if tool is not None and tool.idname == GPISPaintTool.bl_idname:
                        bpy.ops.wm.tool_set_by_id(name="builtin.select_box", space_type="VIEW_3D")


_CLASSES = (GPIS_PT_brush, GPIS_PT_brush_overlay, GPIS_PT_brush_channel)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    if not bpy.app.background:
        bpy.utils.register_tool(GPISPaintTool, after={"builtin.transform"}, separator=True)


def unregister():
    if not bpy.app.background:
        _put_away()
        bpy.utils.unregister_tool(GPISPaintTool)
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
