"""Object tab, below GPIS: the list of operands, and the fit."""

import bpy

from ..ui.render_panels import ENGINE
from ..ui.text import wrapped
from .properties import OPERATIONS

_ICONS = {identifier: icon for identifier, _, _, icon, _ in OPERATIONS}


class GPIS_UL_csg(bpy.types.UIList):
    def draw_item(self, context, layout, data, item, icon, active_data, active_property, index=0, flt_flag=0):
        row = layout.row(align=True)
        row.active = item.enabled
        row.operator("gpis.csg_drag", text="", icon="GRIP", emboss=False).index = index
        row.prop(item, "operation", text="", icon=_ICONS[item.operation], icon_only=True, emboss=False)
        if item.object is None:
            row.label(text="Choose an operand", icon="ERROR")
        else:
            row.prop(item.object, "name", text="", emboss=False, icon="VOLUME_DATA")
        row = layout.row(align=True)
        row.prop(item, "solo", text="", icon="SOLO_ON" if item.solo else "SOLO_OFF", emboss=False)
        row.prop(item, "enabled", text="", icon="CHECKBOX_HLT" if item.enabled else "CHECKBOX_DEHLT", emboss=False)


class GPIS_PT_csg(bpy.types.Panel):
    bl_label = "CSG"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"
    bl_parent_id = "GPIS_PT_object"
    bl_options = {"DEFAULT_CLOSED"}
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.object.type == "VOLUME"

    def draw(self, context):
        layout = self.layout
        obj, settings = context.object, context.object.gpis_csg
        layout.active = obj.gpis.enabled
        row = layout.row()
        row.template_list("GPIS_UL_csg", "", settings, "items", settings, "active", rows=4)
        column = row.column(align=True)
        column.operator("gpis.csg_add", text="", icon="ADD")
        column.operator("gpis.csg_remove", text="", icon="REMOVE")
        column.separator()
        column.operator("gpis.csg_move", text="", icon="TRIA_UP").direction = "UP"
        column.operator("gpis.csg_move", text="", icon="TRIA_DOWN").direction = "DOWN"
        layout.use_property_split = True
        layout.use_property_decorate = False
        if 0 <= settings.active < len(settings.items):
            item = settings.items[settings.active]
            layout.prop(item, "object")
            layout.prop(item, "operation")
            if item.operation == "SMOOTH_UNION":
                layout.prop(item, "blend")
        if settings.items:
            layout.prop(settings, "correlation")
            layout.operator("gpis.csg_fit", icon="VOLUME_DATA")
        if settings.quality:
            wrapped(layout.column(align=True), context, settings.quality)
        if settings.fitted_from is not None:
            layout.operator("gpis.csg_compare", icon="IMAGE_DATA")
        if settings.comparison:
            wrapped(layout.column(align=True), context, settings.comparison)


_CLASSES = (GPIS_UL_csg, GPIS_PT_csg)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
