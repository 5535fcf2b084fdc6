"""Properties that the operators of this folder share."""

from bpy.props import FloatProperty, IntProperty

# Of what is made in numpy: all of the box at once.
RESOLUTION = IntProperty(
    name="Resolution",
    description="Grid nodes along the longest side of the bounds",
    default=96,
    min=8,
    max=1024,
    soft_max=256,
)
NARROW_BAND = FloatProperty(
    name="Narrow Band",
    description="Distances beyond this are not kept: for high resolutions. More than 6 σ, or 0 for the whole box",
    default=0.0,
    min=0.0,
    subtype="DISTANCE",
)
