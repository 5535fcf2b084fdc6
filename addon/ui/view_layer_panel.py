"""View Layer tab: Passes."""

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


def register():
    bpy.utils.register_class(GPIS_PT_passes)


def unregister():
    bpy.utils.unregister_class(GPIS_PT_passes)
