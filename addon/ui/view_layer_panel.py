"""View Layer tab: Passes, Override."""

import bpy

from .. import passes
from .render_panels import PropertiesPanel


class GPIS_PT_passes(PropertiesPanel, bpy.types.Panel):
    bl_label = "Passes"
    bl_context = "view_layer"

    def content(self, layout, context):
        column = layout.column(heading="Include")
        for entry in passes.PASSES:
            if entry.switch:
                owner = getattr(context.view_layer, entry.group) if entry.group else context.view_layer
                column.prop(owner, entry.switch, text=entry.name)


class GPIS_PT_override(PropertiesPanel, bpy.types.Panel):
    bl_label = "Override"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}

    def content(self, layout, context):
        layout.prop(context.view_layer, "material_override")
        if hasattr(context.view_layer, "world_override"):  # Blender 5
            layout.prop(context.view_layer, "world_override")
        layout.prop(context.view_layer, "samples")


register, unregister = bpy.utils.register_classes_factory((GPIS_PT_passes, GPIS_PT_override))
