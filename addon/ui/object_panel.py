"""Object tab: the GPIS of a Volume object, or the way from a mesh to one."""

import bpy
import numpy as np

from .. import volume
from ..bake.operators import made_of
from .render_panels import ENGINE


def world_lengths(matrix_world, length):
    """What a length in object units is in the world, along the object's three axes."""
    return length * np.linalg.norm(np.array(matrix_world)[:3, :3], axis=0)


class GPIS_PT_object(bpy.types.Panel):
    bl_label = "GPIS"
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        obj = context.object
        return context.engine in cls.COMPAT_ENGINES and obj is not None and obj.type in {"MESH", "VOLUME"}

    def draw_header(self, context):
        if context.object.type == "VOLUME":
            self.layout.prop(context.object.gpis, "enabled", text="")

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.use_property_decorate = False
        if context.object.type == "MESH":
            _draw_mesh(layout, context.object)
            return
        layout.active = context.object.gpis.enabled
        _draw_fields(layout, context)
        _draw_kernel(layout, context)
        _draw_source(layout, context.object.gpis)


def _draw_mesh(layout, obj):
    if not obj.gpis.is_source:
        layout.operator("gpis.make", icon="VOLUME_DATA")
        return
    column = layout.column(align=True)
    for volume_object in made_of(obj):
        column.label(text=f'Source of "{volume_object.name}"', icon="VOLUME_DATA")
    if not made_of(obj):
        column.label(text="Its GPIS was deleted", icon="INFO")
    if obj.hide_render:
        column.label(text="Not rendered itself")
    layout.operator("gpis.remove", icon="X", text="Remove GPIS" if made_of(obj) else "Render the Mesh Again")


def _draw_fields(layout, context):
    obj, settings = context.object, context.object.gpis
    try:
        volume.grids(volume.path_of(obj.data))
    except (ValueError, OSError, RuntimeError) as error:
        layout.label(text=str(error), icon="ERROR")
    layout.prop(settings, "mean_grid", icon="VOLUME_DATA")
    column = layout.column()
    column.row().prop(settings, "sigma_source", expand=True)
    if settings.sigma_source == "CONSTANT":
        column.prop(settings, "sigma", text="Deviation σ")
        _draw_world(column, context, settings.sigma)
    else:
        column.prop(settings, "sigma_grid", icon="VOLUME_DATA")
        row = column.row()
        row.alert = settings.sigma_meaning == "UNSET"
        row.prop(settings, "sigma_meaning")
        column.prop(settings, "sigma_factor")


def _draw_kernel(layout, context):
    settings = context.object.gpis
    column = layout.column()
    column.prop(settings, "kernel")
    column.prop(settings, "length_scale")
    _draw_world(column, context, settings.length_scale)
    layout.prop(settings, "memory")


def _draw_world(layout, context, length):
    """The length that is typed is in object units; under it what that is in the world, along the axes."""
    lengths = world_lengths(context.object.matrix_world, length)
    low, high = (_length(context, entry) for entry in (lengths.min(), lengths.max()))
    row = layout.row()
    row.alignment = "RIGHT"
    row.active = False
    row.label(text=f"World: {low}" if low == high else f"World: {low} to {high}")


def _length(context, value):
    units = context.scene.unit_settings
    return bpy.utils.units.to_string(units.system, "LENGTH", float(value) * units.scale_length, precision=3)


def _draw_source(layout, settings):
    if settings.source is None:
        return
    layout.separator()
    layout.prop(settings, "source")
    layout.prop(settings, "bake_resolution")
    row = layout.row(align=True)
    row.operator("gpis.rebake", icon="FILE_REFRESH")
    row.operator("gpis.remove", icon="X", text="Remove")


def register():
    bpy.utils.register_class(GPIS_PT_object)


def unregister():
    bpy.utils.unregister_class(GPIS_PT_object)
