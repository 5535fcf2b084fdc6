"""Settings of the paint tool: one brush for each channel in what differs, the rest shared. They are the scene's."""

import bpy
from bpy.props import (
    BoolProperty,
    BoolVectorProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    PointerProperty,
)

# Samples of a custom falloff that the brush takes, linear between.
_CURVE_SAMPLES = 65
_CURVE_NAME = "GPIS Falloff"

CHANNELS = (
    ("MEAN", "Mean", "Where the surface is: inflate, smooth, flatten, grab", "SCULPTMODE_HLT", 0),
    ("DEVIATION", "Deviation σ", "How far the surface wanders from its mean: crisp or fuzzy", "MOD_NOISE", 1),
    ("LENGTH_SCALE", "Length Scale ℓ", "How large the bumps are", "FULLSCREEN_ENTER", 2),
    ("ANISOTROPY", "Anisotropy", "Comb: bumps become long in the direction of the stroke", "PARTICLEMODE", 3),
    ("ALBEDO", "Albedo", "Colour that multiplies the base colour of the material", "COLOR", 4),
    (
        "CONDITION",
        "Condition Points",
        "Click: the surface goes through this point, with the normal of the mean. Ctrl: erase",
        "PINNED",
        5,
    ),
)

_SMOOTH = ("SMOOTH", "Smooth", "Even out what is there")
_OPERATIONS = {
    "mean": (
        ("INFLATE", "Inflate", "Move the surface outwards. Ctrl: inwards"),
        ("DEFLATE", "Deflate", "Move the surface inwards. Ctrl: outwards"),
        _SMOOTH,
        ("FLATTEN", "Flatten", "Towards the plane under the brush"),
        ("GRAB", "Grab", "Drag the surface along with the hand"),
    ),
    "deviation": (
        ("SET", "Set", "Towards the chosen σ. Ctrl: towards that of the object"),
        ("ADD", "Multiply", "Larger by a factor. Ctrl: smaller"),
        _SMOOTH,
    ),
    "length_scale": (
        ("SET", "Set", "Towards the chosen ℓ. Ctrl: towards that of the object"),
        ("ADD", "Multiply", "Larger by a factor. Ctrl: smaller"),
        _SMOOTH,
    ),
    "anisotropy": (
        ("COMB", "Comb", "The long axis follows the stroke, the third is the normal. Ctrl: equal in all directions"),
        _SMOOTH,
    ),
    "albedo": (("SET", "Set", "Towards the chosen colour. Ctrl: towards white, which changes nothing"), _SMOOTH),
}
_OPPOSITE = {"INFLATE": "DEFLATE", "DEFLATE": "INFLATE"}

_FALLOFFS = (
    ("SMOOTH", "Smooth", "", "SMOOTHCURVE", 0),
    ("SMOOTHER", "Smoother", "", "SMOOTHCURVE", 1),
    ("SPHERE", "Sphere", "", "SPHERECURVE", 2),
    ("ROOT", "Root", "", "ROOTCURVE", 3),
    ("SHARP", "Sharp", "", "SHARPCURVE", 4),
    ("SHARPER", "Sharper", "", "SHARPCURVE", 5),
    ("INVERSE_SQUARE", "Inverse Square", "", "INVERSESQUARECURVE", 6),
    ("LINEAR", "Linear", "", "LINCURVE", 7),
    ("CONSTANT", "Constant", "", "NOCURVE", 8),
    ("CUSTOM", "Custom", "The curve below: from the centre, left, to the rim", "RNDCURVE", 9),
)

# Of the object's own σ and ℓ: what the brushes paint until the artist says how much. Rougher and finer than what is there,
# to be seen on an object of any size.
_SHARES = {"sigma": 2.5, "length_scale": 0.5}
# Of an object that is no GPIS.
_LENGTH = 0.1
# The least that can be typed or taken; 0 follows the object.
LEAST_LENGTH = 1e-6

_PIXELS = 50.0

# Metres (object units of an object without scale) that a pixel is where the brush was last over a surface.
_metres_per_pixel = 0.01


def set_pixel_size(metres):
    global _metres_per_pixel
    if metres > 0:
        _metres_per_pixel = metres


def pixel_size():
    return _metres_per_pixel


def _read_pixels(settings):
    if settings.radius_unit == "SCENE":
        return settings.radius / _metres_per_pixel
    return settings.get("pixels", _PIXELS)


def _write_pixels(settings, value):
    if settings.radius_unit == "SCENE":
        settings.radius = value * _metres_per_pixel
    else:
        settings["pixels"] = value


def length_for(settings, name, obj):
    """`sigma` or `length_scale` of the brush in units of an object: the artist's, or else a share of what the object has."""
    chosen = settings.get(name, 0.0)
    if chosen > 0:
        return chosen
    return _SHARES[name] * getattr(obj.gpis, name) if obj is not None and obj.gpis.enabled else _LENGTH


def _length(name):
    """get and set of a length that follows the active object while it is 0, as it is until one is typed."""

    def read(settings):
        return length_for(settings, name, getattr(bpy.context, "active_object", None))

    def write(settings, value):
        settings[name] = max(value, LEAST_LENGTH) if value > 0 else 0.0

    return {"get": read, "set": write}


def _on_radius_unit(settings, context):
    # As large as it was on the screen, until there is a radius of the scene.
    if settings.radius_unit == "SCENE" and not settings.is_property_set("radius"):
        settings.radius = settings.get("pixels", _PIXELS) * _metres_per_pixel


def _on_falloff(settings, context):
    if settings.falloff == "CUSTOM":
        curve_brush(settings)


def curve_brush(settings):
    """The Brush datablock that holds the custom curve: Blender has curves in few other places."""
    if settings.curve is None:
        known = bpy.data.brushes.get(_CURVE_NAME)
        settings.curve = known or bpy.data.brushes.new(_CURVE_NAME, mode="SCULPT")
        mapping(settings.curve).initialize()
    return settings.curve


def mapping(brush):
    return getattr(brush, curve_name(brush))


def curve_name(brush):
    return "curve_distance_falloff" if hasattr(brush, "curve_distance_falloff") else "curve"  # before 5.0


class GPIS_PaintProperties(bpy.types.PropertyGroup):
    channel: EnumProperty(name="Channel", description="What is painted", items=CHANNELS, default="DEVIATION")
    mean_operation: EnumProperty(name="Brush", description="What a stroke does", items=_OPERATIONS["mean"])
    deviation_operation: EnumProperty(name="Brush", description="What a stroke does", items=_OPERATIONS["deviation"])
    length_scale_operation: EnumProperty(name="Brush", description="What a stroke does", items=_OPERATIONS["length_scale"])
    anisotropy_operation: EnumProperty(name="Brush", description="What a stroke does", items=_OPERATIONS["anisotropy"])
    albedo_operation: EnumProperty(name="Brush", description="What a stroke does", items=_OPERATIONS["albedo"])
    displacement: FloatProperty(
        name="Height",
        description="How far a dab moves the surface, in radii of the brush",
        default=0.05,
        min=0.0,
        max=10.0,
        soft_max=0.5,
        precision=3,
    )
    sigma: FloatProperty(
        name="σ",
        description="Standard deviation to paint, in object units. 0: two and a half times that of the object",
        min=0.0,
        soft_max=10.0,
        precision=4,
        step=1,
        subtype="DISTANCE",
        **_length("sigma"),
    )
    length_scale: FloatProperty(
        name="ℓ",
        description="Length scale to paint, in object units. 0: half of that of the object",
        min=0.0,
        soft_max=100.0,
        precision=4,
        step=1,
        subtype="DISTANCE",
        **_length("length_scale"),
    )
    factor: FloatProperty(
        name="Factor", description="What a dab multiplies by, at full strength", default=1.2, min=1.0, max=10.0, precision=3
    )
    ratios: FloatVectorProperty(
        name="Ratios",
        description="Lengths of the bumps along the stroke, across it, and along the normal, against each other",
        default=(6.0, 1.0, 1.0),
        min=0.01,
        max=100.0,
        soft_max=20.0,
        precision=2,
        subtype="XYZ",
    )
    color: FloatVectorProperty(
        name="Colour",
        description="Colour to paint; it multiplies the base colour of the material",
        default=(0.8, 0.2, 0.1),
        min=0.0,
        max=1.0,
        subtype="COLOR",
    )
    radius_unit: EnumProperty(
        name="Radius Unit",
        description="Whether the brush keeps its size on the screen or in the scene",
        items=(("VIEW", "View", "Pixels of the screen"), ("SCENE", "Scene", "Metres on the surface")),
        default="VIEW",
        update=_on_radius_unit,
    )
    view_radius: FloatProperty(
        name="Radius",
        description="Radius of the brush on the screen, where it last was over a surface",
        min=1.0,
        max=5000.0,
        soft_max=500.0,
        precision=0,
        subtype="PIXEL",
        get=_read_pixels,
        set=_write_pixels,
    )
    radius: FloatProperty(
        name="Radius",
        description="Radius of the brush on the surface",
        default=0.2,
        min=1e-5,
        soft_max=10.0,
        precision=3,
        subtype="DISTANCE",
    )
    strength: FloatProperty(
        name="Strength", description="How much of its effect a dab has", default=0.5, min=0.0, max=1.0, subtype="FACTOR"
    )
    use_pressure_radius: BoolProperty(
        name="Radius Pressure", description="The pressure of the pen scales the radius", default=False
    )
    use_pressure_strength: BoolProperty(
        name="Strength Pressure", description="The pressure of the pen scales the strength", default=True
    )
    spacing: FloatProperty(
        name="Spacing",
        description="Distance from dab to dab, of the diameter of the brush",
        default=10.0,
        min=1.0,
        soft_max=100.0,
        max=500.0,
        precision=0,
        subtype="PERCENTAGE",
    )
    falloff: EnumProperty(
        name="Falloff",
        description="How the effect falls from the centre to the rim",
        items=_FALLOFFS,
        default="SMOOTH",
        update=_on_falloff,
    )
    curve: PointerProperty(name="Curve", description="Brush that holds the custom falloff", type=bpy.types.Brush)
    symmetry: BoolVectorProperty(
        name="Symmetry",
        description="Mirror the strokes in the object's own x, y and z",
        default=(False, False, False),
        subtype="XYZ",
    )
    show_channel: BoolProperty(
        name="Channel", description="Colour the mean surface by what is painted, with a legend", default=True
    )
    show_realisation: BoolProperty(
        name="Realisation",
        description="Show one of the random surfaces in place of the mean, sampled again after each stroke",
        default=False,
    )
    show_shells: BoolProperty(
        name="Shells at ±σ", description="Show the surfaces one standard deviation outside and inside", default=False
    )
    show_axes: BoolProperty(
        name="Ellipses",
        description="Sections of the bumps through their two longest directions, where they are longer in one than in another",
        default=True,
    )

    @property
    def operation_name(self):
        return f"{self.channel.lower()}_operation"

    @property
    def operation(self):
        return getattr(self, self.operation_name)

    @property
    def value_name(self):
        """The property that holds what the brush paints; empty where it paints no value."""
        if self.operation in {"INFLATE", "DEFLATE"}:
            return "displacement"
        if self.operation == "ADD":
            return "factor"
        if self.operation == "COMB":
            return "ratios"
        if self.operation == "SET":
            return {"DEVIATION": "sigma", "LENGTH_SCALE": "length_scale", "ALBEDO": "color"}[self.channel]
        return ""

    def brush(self, obj, mode="NORMAL"):
        """Arguments of a stroke on this object, as the native brushes take them. mode: NORMAL, INVERT, SMOOTH."""
        operation = "SMOOTH" if mode == "SMOOTH" else self.operation
        inverted = mode == "INVERT"
        if inverted:
            operation = _OPPOSITE.get(operation, operation)
        brush = {
            "channel": self.channel.lower(),
            "operation": operation.lower(),
            "value": self._value(obj, operation, inverted),
            "symmetry": tuple(self.symmetry),
            "falloff": "smooth" if self.falloff == "CUSTOM" else self.falloff.lower(),
        }
        if operation == "COMB":
            brush["ratios"] = (1.0, 1.0, 1.0) if inverted else tuple(self.ratios)
        if self.falloff == "CUSTOM":
            brush["curve"] = self._curve()
        return brush

    def _value(self, obj, operation, inverted):
        if operation in {"INFLATE", "DEFLATE"}:
            return self.displacement
        if operation == "ADD":
            return 1 / self.factor if inverted else self.factor
        if operation == "SET":
            if self.channel == "ALBEDO":
                return (1.0, 1.0, 1.0) if inverted else tuple(self.color)
            name = "sigma" if self.channel == "DEVIATION" else "length_scale"
            return getattr(obj.gpis, name) if inverted else length_for(self, name, obj)
        return None

    def _curve(self):
        curves = mapping(curve_brush(self))
        curves.update()
        curve = curves.curves[0]
        places = (i / (_CURVE_SAMPLES - 1) for i in range(_CURVE_SAMPLES))
        return tuple(min(max(curves.evaluate(curve, place), 0.0), 1.0) for place in places)
