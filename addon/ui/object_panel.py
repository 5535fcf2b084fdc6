"""Object tab: the GPIS of a Volume object, or the way from a mesh to one."""

import bpy
import numpy as np

from .. import statistics, volume
from ..bake.operators import made_of
from ..presets.table import PRESETS
from .render_panels import ENGINE
from .text import wrapped


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

    def draw_header_preset(self, context):
        if context.object.type == "VOLUME" and context.object.gpis.enabled:
            self.layout.popover("GPIS_PT_presets", text="Presets", icon="PRESET")

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
        layout.operator("gpis.realise", icon="MESH_DATA")


class GPIS_PT_presets(bpy.types.Panel):
    """Settings and materials to begin with, scaled to the object"""

    bl_label = "Presets"
    bl_space_type = "PROPERTIES"
    bl_region_type = "HEADER"
    bl_ui_units_x = 9

    def draw(self, context):
        layout = self.layout
        choice = context.window_manager.gpis_preset
        layout.template_icon_view(context.window_manager, "gpis_preset", show_labels=True, scale=7, scale_popup=5)
        layout.operator("gpis.apply_preset", text=f"Apply {PRESETS[choice].label}").preset = choice


class _VolumePanel:
    """Below the GPIS panel of a Volume object."""

    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "object"
    bl_parent_id = "GPIS_PT_object"

    @classmethod
    def poll(cls, context):
        return context.object.type == "VOLUME"

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.layout.active = context.object.gpis.enabled
        self.content(self.layout, context)


class GPIS_PT_anisotropy(_VolumePanel, bpy.types.Panel):
    bl_label = "Anisotropy"
    bl_options = {"DEFAULT_CLOSED"}

    def content(self, layout, context):
        obj, settings = context.object, context.object.gpis
        row = layout.row()
        row.use_property_split = False
        row.prop(settings, "anisotropy", expand=True)
        if settings.anisotropy == "AXES":
            column = layout.column()
            column.prop(settings, "ratios")
            column.row(heading="Infinite").prop(settings, "infinite", toggle=True, text="")
            column.prop(settings, "rotation")
        elif settings.anisotropy == "GRID":
            _draw_anisotropy_grids(layout, obj)
            layout.prop(settings, "anisotropy_factor")


class GPIS_PT_paths(_VolumePanel, bpy.types.Panel):
    bl_label = "Light Paths"

    def content(self, layout, context):
        settings = context.object.gpis
        layout.prop(settings, "memory")
        layout.prop(settings, "sampler")
        sentence = statistics.sampler_of(context.scene.name, context.object.name)
        if sentence:
            wrapped(layout.column(align=True), context, f"Last render: {sentence}", indent=True)


class GPIS_PT_source(_VolumePanel, bpy.types.Panel):
    bl_label = "Source Mesh"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and context.object.gpis.source is not None

    def content(self, layout, context):
        settings = context.object.gpis
        layout.prop(settings, "source")
        layout.prop(settings, "bake_resolution")
        layout.prop(settings, "bake_narrow_band")
        row = layout.row(align=True)
        row.operator("gpis.rebake", icon="FILE_REFRESH")
        row.operator("gpis.remove", icon="X", text="Remove")


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
    if settings.anisotropy == "GRID":
        column.label(text="Length scales come from grids", icon="VOLUME_DATA")
    else:
        column.prop(settings, "length_scale")
        _draw_world(column, context, settings.length_scale)
    if settings.kernel == "RATIONAL_QUADRATIC":
        column.prop(settings, "alpha")
    elif settings.kernel == "LOCALLY_PERIODIC":
        column.prop(settings, "period")
        column.prop(settings, "periodic_scale")
        column.prop(settings, "axis")


def _draw_anisotropy_grids(layout, obj):
    try:
        names = volume.vector_grid_names(volume.path_of(obj.data))
    except (ValueError, OSError, RuntimeError):
        return  # the fields above say why
    for name in volume.ANISOTROPY_GRIDS:
        there = name in names
        layout.label(text=name if there else f"No grid {name}", icon="VOLUME_DATA" if there else "ERROR")


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


_CLASSES = (GPIS_PT_object, GPIS_PT_presets, GPIS_PT_anisotropy, GPIS_PT_paths, GPIS_PT_source)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
