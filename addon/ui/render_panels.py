"""Render tab: Sampling, Light Paths, Film, Statistics."""

import math

import bpy
import bpy.utils.previews

from .. import error_plot, statistics
from ..session import clock
from .text import wrapped

ENGINE = "GPIS"
LEFT_OUT = "left out: "
SHOWN_ABOVE = {"width", "height", "seconds", "samples", "estimated_error"}  # counts that the panel says in words
# Of the plot in a panel, in icons: one pixel of the picture is one of a screen without scaling.
PLOT_SCALE = error_plot.SIZE / 20

_previews = None
_plotted = {}  # name of scene -> the history that its preview shows


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
            _row(column, "Frame", f"{entry['frame']}, {entry['view_layer']}")
            _row(column, "Size", f"{entry['width']} × {entry['height']}")
            _row(column, "Samples", f"{end['samples']:g}")
            _row(column, "Time", clock(end["seconds"]))
            _row(column, "Ended by", entry["stop"])
            if end["estimated_error"] is not None:
                _row(column, "Error left", f"{100 * math.sqrt(end['estimated_error']):.2f} %")
        layout.operator("gpis.save_statistics", icon="EXPORT")


class _OfLastRender(PropertiesPanel):
    bl_parent_id = "GPIS_PT_statistics"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and statistics.last(context.scene.name) is not None


class GPIS_PT_error_plot(_OfLastRender, bpy.types.Panel):
    """Estimated error against seconds, round by round, both axes logarithmic"""

    bl_label = "Error against Time"

    def draw(self, context):
        history = statistics.last(context.scene.name)["history"]
        icon = _plot_icon(context.scene.name, history)
        column = self.layout.column()
        if icon is None:
            wrapped(column, context, "A curve takes two rounds whose error is known: more samples")
            return
        column.template_icon(icon, scale=PLOT_SCALE)
        slope = error_plot.slope(error_plot.points(history))
        if slope is not None:
            wrapped(column, context, f"Error falls as seconds to the power {slope:.2f}; the grey line is -0.50")


class GPIS_PT_counts(_OfLastRender, bpy.types.Panel):
    """What the renderer did, in numbers that do not depend on the machine"""

    bl_label = "Counts"
    bl_options = {"DEFAULT_CLOSED"}

    def content(self, layout, context):
        column = layout.column(align=True)
        for name, value in statistics.last(context.scene.name)["stats"].items():
            if value and name not in SHOWN_ABOVE and not isinstance(value, (list, dict)):  # those are for the file
                _row(column, name.replace("_", " "), _number(value), factor=0.62)


class GPIS_PT_plan(_OfLastRender, bpy.types.Panel):
    """Which sampler serves each object and why, and what the render leaves out"""

    bl_label = "Plan"
    bl_options = {"DEFAULT_CLOSED"}

    def draw(self, context):
        left_out = []
        for owner, rows in statistics.plan_by_owner(context.scene.name).items():
            header, body = self.layout.panel(f"gpis_plan_{owner}", default_closed=owner.startswith(("Light", "Material")))
            header.label(text=owner, icon=_icon_of(owner))
            if body is None:
                continue
            column = body.column(align=True)
            for name, sentence in rows.items():
                title = name.replace("_", " ").capitalize().replace("Csg", "CSG")
                if sentence.startswith(LEFT_OUT):
                    left_out.append(f"{title}: {sentence.removeprefix(LEFT_OUT)}")
                else:
                    wrapped(column, context, f"{title}: {sentence}", icon="DOT")
            if left_out:
                column.separator()
                column.label(text="Left out", icon="X")
                for line in left_out:
                    wrapped(column, context, line, icon="BLANK1")
                left_out = []


def _plot_icon(scene_name, history):
    """The icon of a scene's plot, drawn when its history is a new one; None where there is no curve yet."""
    preview = _previews.get(scene_name)
    if preview is None or _plotted.get(scene_name) is not history:
        pixels = error_plot.picture(history)
        if pixels is None:
            return None
        preview = preview or _previews.new(scene_name)
        preview.image_size = preview.icon_size = (error_plot.SIZE, error_plot.SIZE)
        preview.image_pixels_float.foreach_set(pixels.ravel())
        preview.icon_pixels_float.foreach_set(pixels.ravel())
        _plotted[scene_name] = history
    return preview.icon_id


def _icon_of(owner):
    for start, icon in (("GPIS object", "VOLUME_DATA"), ("Object", "MESH_DATA"), ("Light", "LIGHT"), ("Material", "MATERIAL")):
        if owner.startswith(start):
            return icon
    return "SCENE_DATA"


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


def _row(column, name, text, factor=0.4):
    split = column.split(factor=factor)
    split.alignment = "RIGHT"
    split.label(text=name)
    split.label(text=text)


_CLASSES = (
    GPIS_PT_sampling,
    GPIS_PT_viewport,
    GPIS_PT_light_paths,
    GPIS_PT_film,
    GPIS_PT_statistics,
    GPIS_PT_error_plot,
    GPIS_PT_counts,
    GPIS_PT_plan,
)


def register():
    global _previews
    _previews = bpy.utils.previews.new()
    for cls in _CLASSES:
        bpy.utils.register_class(cls)


def unregister():
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
    bpy.utils.previews.remove(_previews)
    _plotted.clear()
