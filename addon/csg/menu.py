"""Object menu: what can be done with lists, so that the search of the menus (F3) finds it."""

import bpy

from .properties import OPERATIONS


class VIEW3D_MT_gpis_csg(bpy.types.Menu):
    bl_label = "GPIS CSG"

    def draw(self, context):
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        for identifier, label, _, icon, _ in OPERATIONS:
            layout.operator("gpis.csg_add", text=f"Add Operands: {label}", icon=icon).operation = identifier
        layout.separator()
        layout.operator("gpis.csg_fit", icon="VOLUME_DATA")
        layout.operator("gpis.csg_compare", icon="IMAGE_DATA")


def _menu(self, context):
    self.layout.separator()
    self.layout.menu(VIEW3D_MT_gpis_csg.__name__)


def register():
    bpy.utils.register_class(VIEW3D_MT_gpis_csg)
    bpy.types.VIEW3D_MT_object.append(_menu)


def unregister():
    bpy.types.VIEW3D_MT_object.remove(_menu)
    bpy.utils.unregister_class(VIEW3D_MT_gpis_csg)
