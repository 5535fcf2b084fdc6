"""Properties on scenes, view layers, objects and volumes. Their names are those of the description and of the C++."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty

from ..paint.settings import GPIS_PaintProperties
from .object_properties import GPIS_ConditionPoint, GPIS_ObjectProperties


class GPIS_SceneProperties(bpy.types.PropertyGroup):
    paint: PointerProperty(name="Paint", description="Settings of the paint tool", type=GPIS_PaintProperties)
    use_samples: BoolProperty(name="Limit Samples", description="End the render after this many samples per pixel", default=True)
    samples: IntProperty(name="Samples", description="Samples per pixel", default=128, min=1, soft_max=4096)
    time_limit: FloatProperty(
        name="Time Limit",
        description="End the render after this time (0: no limit)",
        default=0.0,
        min=0.0,
        step=100,
        precision=1,
        subtype="TIME_ABSOLUTE",
        unit="TIME_ABSOLUTE",
    )
    use_noise_threshold: BoolProperty(
        name="Noise Threshold", description="End the render when the error left is this small", default=False
    )
    noise_threshold: FloatProperty(
        name="Noise Threshold",
        description="Error left at which the render ends: square root of the mean relative squared error of a pixel",
        default=0.05,
        min=1e-4,
        soft_max=0.5,
        precision=3,
    )
    seed: IntProperty(name="Seed", description="Another seed gives another noise pattern", default=0, min=0)
    preview_samples: IntProperty(
        name="Viewport Samples", description="Samples per pixel of the viewport's picture", default=64, min=1, soft_max=1024
    )
    preview_pixel: EnumProperty(
        name="Pixel Size",
        description="Pixels of the screen along a side of one of the viewport's picture: larger is faster",
        items=tuple((str(size), f"{size}x", "", size) for size in (1, 2, 4, 8)),
        default="4",
    )
    use_max_bounces: BoolProperty(
        name="Limit Bounces",
        description="End light paths after a number of bounces. Without it no light is lost, paths end by chance",
        default=False,
    )
    max_bounces: IntProperty(name="Bounces", description="Bounces of a light path, at most", default=32, min=0, soft_max=128)
    light_sampling: BoolProperty(
        name="Light Sampling",
        description="Send a ray towards the lights at every bounce. Off, they are only met by chance: for comparisons",
        default=True,
    )
    missed_root: FloatProperty(
        name="Missed Surface",
        description="Probability per ray that a thin piece of the random surface is stepped over. Smaller is slower",
        default=1e-3,
        min=1e-6,
        max=0.5,
        precision=5,
    )
    clamp: FloatProperty(
        name="Clamp",
        description="Largest contribution of a light path (0: off). Darkens the picture where it removes bright specks",
        default=0.0,
        min=0.0,
    )
    filter_type: EnumProperty(
        name="Filter",
        description="How the samples of a pixel are weighted",
        items=(
            ("BOX", "Box", "The mean over the pixel. Neighbouring pixels are independent"),
            ("BLACKMAN_HARRIS", "Blackman-Harris", "Smooth, as in Cycles"),
        ),
        default="BLACKMAN_HARRIS",
    )
    filter_width: FloatProperty(
        name="Width", description="Width of the filter in pixels", default=1.5, min=0.5, max=10.0, subtype="PIXEL"
    )
    write_statistics: BoolProperty(
        name="Write beside the Image",
        description="Animations and renders in the background write statistics, plan and the error of every round as "
        "JSON to the output path, beside each image. What is not known, such as the error after a single sample, is null",
        default=True,
    )


class GPIS_ViewLayerProperties(bpy.types.PropertyGroup):
    use_pass_albedo: BoolProperty(name="Albedo", description="Colour of the first surface, without light", default=False)
    use_pass_variance: BoolProperty(
        name="Variance", description="Variance of the pixel's mean: how far it may be from the truth", default=False
    )
    use_pass_sample_count: BoolProperty(name="Sample Count", description="Samples taken for the pixel", default=False)


# Groups inside of others come first.
_INNER = (GPIS_PaintProperties, GPIS_ConditionPoint)
_GROUPS = (
    (bpy.types.Scene, GPIS_SceneProperties),
    (bpy.types.ViewLayer, GPIS_ViewLayerProperties),
    (bpy.types.Object, GPIS_ObjectProperties),
)


def register():
    for group in _INNER:
        bpy.utils.register_class(group)
    for owner, group in _GROUPS:
        bpy.utils.register_class(group)
        owner.gpis = PointerProperty(type=group)
    bpy.types.Volume.gpis_baked = BoolProperty(
        name="Baked by GPIS", description="The file belongs to this .blend and is kept beside it", default=False
    )


def unregister():
    del bpy.types.Volume.gpis_baked
    for owner, group in reversed(_GROUPS):
        del owner.gpis
        bpy.utils.unregister_class(group)
    for group in reversed(_INNER):
        bpy.utils.unregister_class(group)
