"""Strokes of a hand: the mouse or pen over the mean surface -> dabs, shown as they come, one step of undo."""

import bpy
import numpy as np
from bpy.props import EnumProperty

from ..viewport import channels, colour, overlay
from . import bake, conditions, eyedropper, hover, settings, stroke

# The stroke in the making, None most of the time; what the header says of the place under the mouse.
_active = None
_readout = ""


def fields_of(context, obj):
    """The fields under the brush, those of the stroke while there is one; None where nothing can be painted on."""
    if _active is not None:
        return _active.fields
    try:
        bake.check(obj)
        return bake.fields(obj)
    except ValueError:
        return None


def smoothing():
    return _active is not None and _active.mode == "SMOOTH"


def set_pixel_size(found):
    settings.set_pixel_size(found.metres_per_pixel)


def readout():
    return _readout


def read(context, said):
    """Let the header say this."""
    global _readout
    if said == _readout:
        return
    _readout = said
    for region in context.area.regions:
        if region.type in {"TOOL_HEADER", "HEADER"}:
            region.tag_redraw()


def value_text(scene, brush, fields, location, radius):
    """The channel's value at a place in object space, with its unit. The mean is 0 all over its surface: of it, what
    a dab of this radius moves, or reaches."""
    if brush.channel == "MEAN":
        if brush.value_name:
            return f"{colour.length(scene, brush.strength * brush.displacement * radius)} a dab"
        return f"radius {colour.length(scene, radius)}"
    if brush.channel in {"DEVIATION", "LENGTH_SCALE"}:
        value = fields.values(brush.channel.lower(), [location])[0]
        return f"{'σ' if brush.channel == 'DEVIATION' else 'ℓ'} {colour.length(scene, value)}"
    if brush.channel == "ANISOTROPY":
        squares = np.linalg.eigvalsh(channels.matrices(fields.values("anisotropy", [location])))[0]
        return " : ".join(f"{length:.3g}" for length in np.sqrt(squares[::-1] / squares[0]))
    if brush.channel == "ALBEDO":
        return "albedo " + ", ".join(f"{part:.2f}" for part in fields.values("albedo", [location])[0])
    return ""


def view_of(context):
    return context.region, context.region_data


def under_mouse(context, event, obj, fields):
    return hover.under(*view_of(context), obj, fields, (event.mouse_region_x, event.mouse_region_y))


class _InView:
    @classmethod
    def poll(cls, context):
        if context.space_data is None or context.space_data.type != "VIEW_3D" or context.mode != "OBJECT":
            cls.poll_message_set("Paint in the 3D viewport, in object mode.")
            return False
        return True


class GPIS_OT_paint(_InView, bpy.types.Operator):
    """Paint on the active GPIS object"""

    bl_idname = "gpis.paint"
    bl_label = "Paint GPIS"
    bl_options = {"UNDO", "BLOCKING"}

    mode: EnumProperty(
        name="Mode",
        description="What the stroke does",
        items=(
            ("NORMAL", "Normal", "What the brush says"),
            ("INVERT", "Invert", "The opposite"),
            ("SMOOTH", "Smooth", "Even out what is there"),
        ),
        options={"SKIP_SAVE"},
    )

    def invoke(self, context, event):
        global _active
        brush = context.scene.gpis.paint
        obj = context.active_object
        try:
            bake.check(obj)
            if brush.channel == "CONDITION":
                return self._pin(context, event, obj, brush)
            self._begin(context, event, obj, brush)
        except (ValueError, OSError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if self._painting is None:
            return {"CANCELLED"}  # beside the surface; passed on, the drag would move the object
        _active = self
        self._move(context, event)
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def _begin(self, context, event, obj, brush):
        self._painting = None
        found = under_mouse(context, event, obj, bake.fields(obj))
        if found is None:
            return
        settings.set_pixel_size(found.metres_per_pixel)
        self._depth = found.world
        painted = stroke.Brush(**brush.brush(obj, self.mode))
        self._drag = painted.operation == "grab"
        self._radius = hover.radius_of(brush, found)
        self._spacing = stroke.Spacing(
            self._radius,
            brush.strength,
            brush.spacing / 100,
            pressure_radius=brush.use_pressure_radius,
            pressure_strength=brush.use_pressure_strength,
            drag=self._drag,
        )
        self._painting = bake.Painting(obj, painted)

    @property
    def fields(self):
        return self._painting.fields

    def _move(self, context, event):
        obj = self._painting.object
        if self._drag:
            xy = (event.mouse_region_x, event.mouse_region_y)
            location = hover.on_plane(*view_of(context), obj, xy, self._depth)
        else:
            found = under_mouse(context, event, obj, self.fields)
            if found is None:
                return  # off the surface: the stroke goes on where it comes back
            location = found.location
        dabs = self._spacing.add(location, _pressure(event))
        self._painting.add(dabs)
        overlay.painting(obj, self.fields, dabs, self._painting.stroke.brush.symmetry)
        brush = context.scene.gpis.paint
        said = value_text(context.scene, brush, self.fields, location, self._radius)
        context.area.header_text_set(f"{self._painting.stroke.brush.operation.title()}   {said}   {_KEYS}")

    def modal(self, context, event):
        try:
            if event.type in {"MOUSEMOVE", "INBETWEEN_MOUSEMOVE"}:
                self._move(context, event)
            elif event.type == "LEFTMOUSE" and event.value == "RELEASE":
                self._painting.add(self._spacing.finish())
                self._painting.finish()
                return self._end(context, {"FINISHED"})
            elif event.type in {"ESC", "RIGHTMOUSE"}:
                return self._cancel(context)
        except (ValueError, OSError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return self._cancel(context)
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        self._cancel(context)

    def _cancel(self, context):
        self._painting.cancel()
        return self._end(context, {"CANCELLED"})

    def _end(self, context, result):
        global _active
        _active = None
        overlay.painted()
        if context.area is not None:
            context.area.header_text_set(None)
        return result

    def _pin(self, context, event, obj, brush):
        found = under_mouse(context, event, obj, bake.fields(obj))
        if found is None:
            return {"CANCELLED"}
        places = [found.location]
        for axis in np.flatnonzero(brush.symmetry):
            places += [place * np.where(np.arange(3) == axis, -1.0, 1.0) for place in places if place[axis] != 0]
        if self.mode == "INVERT":
            gone = conditions.erase(obj, places, hover.radius_of(brush, found))
            self.report({"INFO"}, f"{gone} condition points erased")
        else:
            conditions.pin(obj, places)
        overlay.tag_redraw()
        return {"FINISHED"}


_KEYS = "Esc: cancel the stroke"


def _pressure(event):
    return event.pressure if event.is_tablet else 1.0


class GPIS_OT_paint_sample(_InView, bpy.types.Operator):
    """Take the brush's value from the surface under the mouse"""

    bl_idname = "gpis.paint_sample"
    bl_label = "Sample Value"
    bl_options = {"UNDO"}

    def invoke(self, context, event):
        brush = context.scene.gpis.paint
        obj = context.active_object
        try:
            bake.check(obj)
            fields = bake.fields(obj)
            found = under_mouse(context, event, obj, fields)
            if found is None:
                raise ValueError(f"{bake.owner_of(obj)}: its mean surface is not under the mouse.")
            said = eyedropper.take(context.scene, obj, brush, fields, found)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        self.report({"INFO"}, f"Brush: {said}")
        return {"FINISHED"}


_CLASSES = (GPIS_OT_paint, GPIS_OT_paint_sample)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
