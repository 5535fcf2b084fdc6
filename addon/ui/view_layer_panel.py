"""View Layer tab: Passes, Override."""

import bpy

from .. import passes
from .render_panels import ENGINE


class GPIS_PT_passes(bpy.types.Panel):
    bl_label = "Passes"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "view_layer"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        column = layout.column(heading="Include")
        for entry in passes.PASSES:
            if entry.switch:
                owner = getattr(context.view_layer, entry.group) if entry.group else context.view_layer
                column.prop(owner, entry.switch, text=entry.name)


class GPIS_PT_override(bpy.types.Panel):
    bl_label = "Override"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "view_layer"
    bl_options = {"DEFAULT_CLOSED"}
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        layout.prop(context.view_layer, "material_override")
        if hasattr(context.view_layer, "world_override"):  # Blender 5
            layout.prop(context.view_layer, "world_override")
        layout.prop(context.view_layer, "samples")


register, unregister = bpy.utils.register_classes_factory((GPIS_PT_passes, GPIS_PT_override))
