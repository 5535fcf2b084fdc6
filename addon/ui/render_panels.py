"""Render tab: Sampling, Light Paths, Film, Statistics."""

import math

import bpy

from .. import statistics
from ..session import clock
from .text import wrapped

ENGINE = "GPIS"


class PropertiesPanel:
    bl_space_type = "PROPERTIES"
    bl_region_type = "WINDOW"
    bl_context = "render"
    COMPAT_ENGINES = {ENGINE}

    @classmethod
    def poll(cls, context):
        return context.engine in cls.COMPAT_ENGINES

    def draw(self, context):
        self.layout.use_property_split = True
        self.layout.use_property_decorate = False
        self.content(self.layout, context)


class GPIS_PT_sampling(PropertiesPanel, bpy.types.Panel):
    bl_label = "Sampling"

    def content(self, layout, context):
        scene = context.scene
        gpis = scene.gpis
        _switched(layout, gpis, "use_samples", "samples", "Samples")
        _switched(layout, gpis, "use_noise_threshold", "noise_threshold", "Noise Threshold")
        layout.prop(gpis, "time_limit")
        if not (gpis.use_samples or gpis.use_noise_threshold or gpis.time_limit):
            layout.label(text="Nothing ends this render", icon="ERROR")
        layout.prop(gpis, "seed")
        column = layout.column()
        column.prop(scene.render, "threads_mode", text="Threads")
        if scene.render.threads_mode == "FIXED":
            column.prop(scene.render, "threads", text="Number")


class GPIS_PT_viewport(PropertiesPanel, bpy.types.Panel):
    bl_label = "Viewport"
    bl_parent_id = "GPIS_PT_sampling"
    bl_options = {"DEFAULT_CLOSED"}

    def content(self, layout, context):
        scene = context.scene
        layout.prop(scene.gpis, "preview_samples", text="Samples")
        layout.prop(scene.gpis, "preview_pixel")


class GPIS_PT_light_paths(PropertiesPanel, bpy.types.Panel):
    bl_label = "Light Paths"
    bl_options = {"DEFAULT_CLOSED"}

    def content(self, layout, context):
        scene = context.scene
        gpis = scene.gpis
        _switched(layout, gpis, "use_max_bounces", "max_bounces", "Bounces")
        layout.prop(gpis, "light_sampling")
        layout.prop(gpis, "missed_root")
        layout.prop(gpis, "clamp")


class GPIS_PT_film(PropertiesPanel, bpy.types.Panel):
    bl_label = "Film"
    bl_options = {"DEFAULT_CLOSED"}

    def content(self, layout, context):
        scene = context.scene
        layout.prop(scene.gpis, "filter_type")
        layout.prop(scene.gpis, "filter_width")


class GPIS_PT_statistics(PropertiesPanel, bpy.types.Panel):
    bl_label = "Statistics"
    bl_options = {"DEFAULT_CLOSED"}

    def content(self, layout, context):
        scene = context.scene
        layout.prop(scene.gpis, "write_statistics")
        entry = statistics.last(scene.name)
        if entry is None:
            layout.label(text="No render yet")
            return
        column = layout.column(align=True)
        if entry["history"]:
            end = entry["history"][-1]
            _row(column, "Frame", f"{entry['frame']}, {entry['view_layer']}, {entry['width']} × {entry['height']}")
            _row(column, "Samples", f"{end['samples']} in {clock(end['seconds'])} (ended by: {entry['stop']})")
            if end["estimated_error"] is not None:
                _row(column, "Error left", f"{100 * math.sqrt(end['estimated_error']):.2f} %")
        for name, value in entry["stats"].items():
            if value and not isinstance(value, (list, dict)):  # those are for the file
                _row(column, name.replace("_", " "), _number(value))
        layout.operator("gpis.save_statistics", icon="EXPORT")


class GPIS_PT_plan(PropertiesPanel, bpy.types.Panel):
    """Which sampler serves each object and why, and what the render leaves out"""

    bl_label = "Plan"
    bl_parent_id = "GPIS_PT_statistics"
    bl_options = {"DEFAULT_CLOSED"}

    @classmethod
    def poll(cls, context):
        return super().poll(context) and statistics.last(context.scene.name) is not None

    def draw(self, context):
        for owner, rows in statistics.plan_by_owner(context.scene.name).items():
            column = self.layout.column(align=True)
            column.label(text=owner, icon="VOLUME_DATA" if owner.startswith("GPIS object") else "SCENE_DATA")
            for name, sentence in rows.items():
                wrapped(column, context, f"{name.replace('_', ' ').capitalize()}: {sentence}", icon="BLANK1")


def _switched(layout, owner, switch, name, text):
    row = layout.row(heading=text)
    row.prop(owner, switch, text="")
    value = row.row()
    value.active = getattr(owner, switch)
    value.prop(owner, name, text="")


def _number(value):
    if isinstance(value, float):
        return f"{value:,.0f}" if abs(value) >= 1000 else f"{value:.3g}"
    return f"{value:,}" if isinstance(value, int) else str(value)


def _row(column, name, text):
    split = column.split(factor=0.4)
    split.alignment = "RIGHT"
    split.label(text=name)
    split.label(text=text)


_CLASSES = (GPIS_PT_sampling, GPIS_PT_viewport, GPIS_PT_light_paths, GPIS_PT_film, GPIS_PT_statistics, GPIS_PT_plan)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
