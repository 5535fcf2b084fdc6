"""Operators that paint without a mouse: a script paints exactly what a hand does."""

import bpy
import numpy as np
from bpy.props import (
    BoolProperty,
    BoolVectorProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
)

from . import bake, conditions
from .stroke import FALLOFFS, OPERATIONS, Brush, Spacing, Stroke

CHANNELS = (
    ("MEAN", "Mean", "Where the surface is: inflate, deflate, smooth, flatten, grab", 0),
    ("DEVIATION", "Deviation σ", "How far the surface wanders from its mean", 1),
    ("LENGTH_SCALE", "Length Scale ℓ", "How large its bumps are", 2),
    ("ANISOTROPY", "Anisotropy", "Along which direction its bumps are long", 3),
    ("ALBEDO", "Albedo", "A colour that multiplies the material's", 4),
    ("CONDITION", "Condition Points", "Places that every realisation of the surface goes through", 5),
)
_GRID_CHANNELS = CHANNELS[:5]
OPERATION_ITEMS = (
    ("DEFAULT", "Default", "What the channel is painted with first: inflate, set, comb, pin", 0),
    ("INFLATE", "Inflate", "Move the mean surface outwards", 1),
    ("DEFLATE", "Deflate", "Move the mean surface inwards", 2),
    ("SMOOTH", "Smooth", "Towards the mean of the neighbours", 3),
    ("FLATTEN", "Flatten", "Towards the plane under the brush", 4),
    ("GRAB", "Grab", "Drag the mean surface along", 5),
    ("SET", "Set", "Towards the value of the brush", 6),
    ("ADD", "Add", "Multiply by the value of the brush", 7),
    ("COMB", "Comb", "Long along the stroke, and in ratios across it and along the normal", 8),
    ("PIN", "Pin", "The surface goes through this point, with the normal of the mean", 9),
    ("ERASE", "Erase", "Remove condition points", 10),
)
FALLOFF_ITEMS = tuple((name.upper(), name.replace("_", " ").title(), "", i) for i, name in enumerate(FALLOFFS)) + (
    ("CUSTOM", "Custom", "The values of Curve, at equal distances from the centre to the rim", len(FALLOFFS)),
)
CURVE_SIZE = 32  # the most that Blender's vectors hold
# What `value` 0 stands for.
_DEFAULT_VALUES = {"inflate": 0.1, "deflate": 0.1, "add": 1.5}


class GPIS_StrokePoint(bpy.types.PropertyGroup):
    """A point of a stroke. Blender wants all of it from a script: {"name": "", "location": (x, y, z), "pressure": 1.0}."""

    location: FloatVectorProperty(name="Location", description="In object space", size=3, subtype="XYZ")
    pressure: FloatProperty(name="Pressure", description="Of the pen", default=1.0, min=0.0, max=1.0)


class _OnObject:
    """Operators on the active GPIS object: whatever it refuses is a sentence."""

    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        try:
            bake.check(context.active_object)
        except ValueError as error:
            cls.poll_message_set(str(error))
            return False
        return True

    def execute(self, context):
        obj = context.active_object
        try:
            self.paint(context, obj)
        except (ValueError, OSError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        return {"FINISHED"}

    def whole(self, obj, brush, copied=None):
        """A stroke on a whole channel."""
        painting = bake.Painting(obj, brush)
        bake.paint(painting.fields, Stroke(brush), copied)
        painting.finish()


class GPIS_OT_paint_stroke(_OnObject, bpy.types.Operator):
    """Paint a stroke on the active GPIS object"""

    # No property is saved: a script gets the defaults, not what a hand painted with last.
    bl_idname = "gpis.paint_stroke"
    bl_label = "Paint Stroke"
    bl_options = {"UNDO"}

    stroke: CollectionProperty(
        name="Stroke", description="Points that the brush goes through", type=GPIS_StrokePoint, options={"SKIP_SAVE"}
    )
    channel: EnumProperty(
        name="Channel", description="What is painted", items=CHANNELS, default="DEVIATION", options={"SKIP_SAVE"}
    )
    operation: EnumProperty(
        name="Operation", description="How it is painted", items=OPERATION_ITEMS, default="DEFAULT", options={"SKIP_SAVE"}
    )
    radius: FloatProperty(
        name="Radius",
        description="Of the brush, in object units",
        default=0.2,
        min=1e-6,
        soft_max=10.0,
        subtype="DISTANCE",
        options={"SKIP_SAVE"},
    )
    strength: FloatProperty(
        name="Strength", description="Of a dab, at its centre", default=0.5, min=0.0, max=1.0, options={"SKIP_SAVE"}
    )
    value: FloatProperty(
        name="Value",
        description="Set: the deviation or length scale in object units. Add: the factor of a dab. Inflate and deflate: the "
        "displacement in radii. 0: the operation's own",
        default=0.0,
        precision=4,
        options={"SKIP_SAVE"},
    )
    color: FloatVectorProperty(
        name="Color",
        description="Albedo that is painted",
        size=3,
        subtype="COLOR",
        default=(1.0, 1.0, 1.0),
        min=0.0,
        max=1.0,
        options={"SKIP_SAVE"},
    )
    ratios: FloatVectorProperty(
        name="Ratios",
        description="Lengths of the combed bumps: along the stroke, across it, along the normal",
        size=3,
        default=(4.0, 1.0, 1.0),
        min=0.01,
        soft_max=10.0,
        options={"SKIP_SAVE"},
    )
    falloff: EnumProperty(
        name="Falloff",
        description="How the strength falls from centre to rim",
        items=FALLOFF_ITEMS,
        default="SMOOTH",
        options={"SKIP_SAVE"},
    )
    curve: FloatVectorProperty(
        name="Curve",
        description="The custom falloff, at equal distances from the centre to the rim",
        size=CURVE_SIZE,
        default=tuple(1 - i / (CURVE_SIZE - 1) for i in range(CURVE_SIZE)),
        min=0.0,
        max=1.0,
        options={"SKIP_SAVE"},
    )
    symmetry: BoolVectorProperty(
        name="Symmetry",
        description="Mirror the stroke in object space",
        size=3,
        subtype="XYZ",
        default=(False, False, False),
        options={"SKIP_SAVE"},
    )
    spacing: FloatProperty(
        name="Spacing",
        description="Distance of the dabs, in percent of the brush's diameter. 0: one at each point of the stroke",
        default=10.0,
        min=0.0,
        soft_max=100.0,
        subtype="PERCENTAGE",
        options={"SKIP_SAVE"},
    )
    use_pressure_radius: BoolProperty(
        name="Radius Pressure", description="The pen's pressure sets the radius", default=False, options={"SKIP_SAVE"}
    )
    use_pressure_strength: BoolProperty(
        name="Strength Pressure", description="The pen's pressure sets the strength", default=False, options={"SKIP_SAVE"}
    )

    def paint(self, context, obj):
        if not len(self.stroke):
            raise ValueError(
                "The stroke has no points: give a list of {'name': '', 'location': (x, y, z), 'pressure': 1.0}, in object space."
            )
        if self.channel == "CONDITION":
            self._conditions(obj)
            return
        brush = self.brush()
        spacing = Spacing(
            self.radius,
            self.strength,
            self.spacing / 100,
            pressure_radius=self.use_pressure_radius,
            pressure_strength=self.use_pressure_strength,
            drag=brush.operation == "grab",
        )
        painting = bake.Painting(obj, brush)
        for point in self.stroke:
            painting.add(spacing.add(point.location, point.pressure))
        painting.add(spacing.finish())
        if not len(painting.stroke.dabs):
            raise ValueError("The stroke has no direction to comb along: it takes two points that differ.")
        painting.finish()

    def brush(self):
        channel = self.channel.lower()
        operation = OPERATIONS[channel][0] if self.operation == "DEFAULT" else self.operation.lower()
        Brush(channel, operation)  # refuses what is none of its operations
        value = self.value or _DEFAULT_VALUES.get(operation)
        if operation == "set":
            value = tuple(self.color) if channel == "albedo" else self.value
            if not value:
                raise ValueError(f"{self.channel.replace('_', ' ').capitalize()} is to be set: say which value above 0.")
        return Brush(
            channel,
            operation,
            value=value,
            ratios=tuple(self.ratios) if operation == "comb" else (1.0, 1.0, 1.0),
            falloff="constant" if self.falloff == "CUSTOM" else self.falloff.lower(),
            curve=tuple(self.curve) if self.falloff == "CUSTOM" else None,
            symmetry=tuple(self.symmetry),
        )

    def _conditions(self, obj):
        """Mirrored as strokes are."""
        operation = OPERATIONS["condition"][0] if self.operation == "DEFAULT" else self.operation.lower()
        Brush("condition", operation)  # refuses what is none of its operations
        places = np.array([point.location for point in self.stroke], dtype=np.float64)
        for axis in np.flatnonzero(self.symmetry):
            off = places[:, axis] != 0  # a point on the plane is its own image
            places = np.vstack([places, places[off] * np.where(np.arange(3) == axis, -1.0, 1.0)])
        if operation == "erase":
            conditions.erase(obj, places, self.radius)
        else:
            conditions.pin(obj, places)


class _OnChannel(_OnObject):
    channel: EnumProperty(name="Channel", description="Which", items=_GRID_CHANNELS, default="DEVIATION", options={"SKIP_SAVE"})


class GPIS_OT_paint_reset(_OnChannel, bpy.types.Operator):
    """Take back all that was painted on a channel"""

    bl_idname = "gpis.paint_reset"
    bl_label = "Reset Channel"

    def paint(self, context, obj):
        self.whole(obj, Brush(self.channel.lower(), "reset"))


class GPIS_OT_paint_mirror(_OnChannel, bpy.types.Operator):
    """Make one half of a channel the mirror image of the other, in object space"""

    bl_idname = "gpis.paint_mirror"
    bl_label = "Mirror Channel"

    axis: EnumProperty(
        name="Axis", description="Across which the image is", items=(("X", "X", ""), ("Y", "Y", ""), ("Z", "Z", ""))
    )
    from_positive: BoolProperty(
        name="From Positive", description="The half of positive coordinates is kept, the other becomes its image", default=True
    )

    def paint(self, context, obj):
        value = ("XYZ".index(self.axis), self.from_positive)
        self.whole(obj, Brush(self.channel.lower(), "mirror", value=value))


class GPIS_OT_paint_copy(_OnChannel, bpy.types.Operator):
    """Copy a channel of the active GPIS object to the other selected ones, in object space"""

    bl_idname = "gpis.paint_copy"
    bl_label = "Copy Channel to Selected"

    def paint(self, context, obj):
        others = [other for other in context.selected_objects if other != obj and other.type == "VOLUME"]
        if not others:
            raise ValueError("Select the GPIS objects to copy to, and then the one to copy of.")
        for other in others:
            bake.check(other)
        for other in others:
            self.whole(other, Brush(self.channel.lower(), "copy"), copied=bake.fields(obj))


class GPIS_OT_paint_resample(_OnObject, bpy.types.Operator):
    """Give the grids of the active GPIS object another resolution, and paint its strokes again on it"""

    bl_idname = "gpis.paint_resample"
    bl_label = "Resample"

    resolution: IntProperty(
        name="Resolution", description="Nodes along the longest side", default=128, min=8, max=2048, soft_max=512
    )

    def invoke(self, context, event):
        try:
            fields = bake.fields(context.active_object)
        except ValueError as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        low, high = np.array(fields.bounds())
        voxel = min(fields.voxel_size())
        self.resolution = round((high - low).max() / voxel) + 1
        return context.window_manager.invoke_props_dialog(self)

    def paint(self, context, obj):
        low, high = np.array(bake.fields(obj).bounds())
        bake.rebuild(obj, voxel_size=float((high - low).max() / (self.resolution - 1)))


class GPIS_OT_paint_rebuild(_OnObject, bpy.types.Operator):
    """Paint all strokes of the active GPIS object again: its file is missing, or was changed elsewhere"""

    bl_idname = "gpis.paint_rebuild"
    bl_label = "Paint Strokes Again"

    def paint(self, context, obj):
        bake.rebuild(obj)


class GPIS_OT_paint_recover(_OnObject, bpy.types.Operator):
    """Take back strokes that were painted before a crash, and not saved"""

    bl_idname = "gpis.paint_recover"
    bl_label = "Recover Strokes"

    def paint(self, context, obj):
        count = bake.recover(obj)
        self.report({"INFO"}, f"{count} {'stroke' if count == 1 else 'strokes'} recovered.")


class GPIS_OT_erase_conditions(_OnObject, bpy.types.Operator):
    """Remove all condition points of the active GPIS object"""

    bl_idname = "gpis.erase_conditions"
    bl_label = "Erase Condition Points"

    def paint(self, context, obj):
        obj.gpis.conditions.clear()


_CLASSES = (
    GPIS_StrokePoint,
    GPIS_OT_paint_stroke,
    GPIS_OT_paint_reset,
    GPIS_OT_paint_mirror,
    GPIS_OT_paint_copy,
    GPIS_OT_paint_resample,
    GPIS_OT_paint_rebuild,
    GPIS_OT_paint_recover,
    GPIS_OT_erase_conditions,
)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
