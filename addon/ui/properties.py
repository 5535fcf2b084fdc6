"""Properties on scenes, view layers, objects and volumes. Their names are those of the description and of the C++."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

from .. import volume
from ..bake.operators import DEFAULT_LENGTH_SCALE, DEFAULT_SIGMA


class GPIS_SceneProperties(bpy.types.PropertyGroup):
    use_samples: BoolProperty(
        name="Limit Samples", description="End the render after this many samples per pixel", default=True
    )
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
    use_max_bounces: BoolProperty(
        name="Limit Bounces",
        description="End light paths after a number of bounces. Without it no light is lost, paths end by chance",
        default=False,
    )
    max_bounces: IntProperty(
        name="Bounces", description="Bounces of a light path, at most", default=32, min=0, soft_max=128
    )
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
        description="Write the statistics of each frame as JSON to the output path, beside the image. What is not known, "
        "such as the error after a single sample, is null there",
        default=False,
    )


class GPIS_ViewLayerProperties(bpy.types.PropertyGroup):
    use_pass_albedo: BoolProperty(
        name="Albedo", description="Colour of the first surface, without light", default=False
    )
    use_pass_variance: BoolProperty(
        name="Variance", description="Variance of the pixel's mean: how far it may be from the truth", default=False
    )
    use_pass_sample_count: BoolProperty(name="Sample Count", description="Samples taken for the pixel", default=False)


def _tag(settings, context):
    """A render that keeps its data between frames must see the change."""
    settings.id_data.update_tag()


def _on_enabled(settings, context):
    """σ and ℓ that fit the object's size, and the mean grid where the file leaves no choice."""
    _tag(settings, context)
    data = settings.id_data.data
    if not settings.enabled or not isinstance(data, bpy.types.Volume):
        return
    if settings.id_data.display_type == "TEXTURED":
        settings.id_data.display_type = "BOUNDS"  # a distance drawn as fog would be a block
    names = volume.grid_names(data)
    if not settings.mean_grid and ("mean" in names or len(names) == 1):
        settings.mean_grid = "mean" if "mean" in names else names[0]
    if settings.mean_grid in names:
        size = volume.size(volume.path_of(data), settings.mean_grid)
        if not settings.is_property_set("sigma"):
            settings.sigma = DEFAULT_SIGMA * size
        if not settings.is_property_set("length_scale"):
            settings.length_scale = DEFAULT_LENGTH_SCALE * size


def _grid_names(settings, context, edit_text):
    data = settings.id_data.data
    return volume.grid_names(data) if isinstance(data, bpy.types.Volume) else []


class GPIS_ObjectProperties(bpy.types.PropertyGroup):
    enabled: BoolProperty(
        name="GPIS",
        description="Render this volume as a stochastic implicit surface: the zero level of a Gaussian process",
        default=False,
        update=_on_enabled,
    )
    mean_grid: StringProperty(
        name="Mean",
        description="Grid of the mean: positive outside. A signed distance, or any field with the surface at 0",
        search=_grid_names,
        update=_tag,
    )
    sigma_source: EnumProperty(
        name="σ from",
        description="Where the standard deviation comes from",
        items=(
            ("CONSTANT", "Constant", "The same everywhere"),
            ("GRID", "Grid", "A grid of the file, varying over the object"),
        ),
        default="CONSTANT",
        update=_tag,
    )
    sigma: FloatProperty(
        name="Standard Deviation σ",
        description="How far the surface wanders from its mean, in object units: small is crisp, large is fuzzy",
        default=0.04,
        min=0.0,
        soft_max=10.0,
        precision=4,
        step=1,
        subtype="DISTANCE",
        update=_tag,
    )
    sigma_grid: StringProperty(
        name="Grid", description="Grid of the standard deviation or variance", search=_grid_names, update=_tag
    )
    sigma_meaning: EnumProperty(
        name="Holds",
        description="What the numbers of the grid are. Files differ, and the name of a grid does not tell",
        items=(
            ("UNSET", "Choose…", "Not chosen yet: the render refuses to guess"),
            ("STANDARD_DEVIATION", "Standard Deviation (σ)", "The grid holds σ, in the units of the mean"),
            ("VARIANCE", "Variance (σ²)", "The grid holds σ²: its square root is taken"),
        ),
        default="UNSET",
        update=_tag,
    )
    sigma_factor: FloatProperty(
        name="Factor",
        description="σ is the grid's value times this",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        precision=3,
        update=_tag,
    )
    kernel: EnumProperty(
        name="Kernel",
        description="Correlation of the surface's displacement between two points, over their distance",
        items=(("SQUARED_EXPONENTIAL", "Squared Exponential", "Smooth bumps of one size"),),
        default="SQUARED_EXPONENTIAL",
        update=_tag,
    )
    length_scale: FloatProperty(
        name="Length Scale ℓ",
        description="Size of the bumps, in object units: the distance over which the displacement stays alike",
        default=0.2,
        min=0.0,
        soft_max=100.0,
        precision=4,
        step=1,
        subtype="DISTANCE",
        update=_tag,
    )
    memory: EnumProperty(
        name="Memory",
        description="What a light path remembers of the surface it has just left",
        items=(
            ("NONE", "None", "Nothing but that it is outside: fastest, no fine self-shadowing of its own bumps"),
            ("RENEWAL", "Renewal", "The point it left, not the slope there"),
            ("RENEWAL_PLUS", "Renewal+", "The point it left and the slope there: closest to a real rough surface"),
        ),
        default="RENEWAL_PLUS",
        update=_tag,
    )
    source: PointerProperty(
        name="Source", description="Mesh that the signed distance is baked from", type=bpy.types.Object
    )
    is_source: BoolProperty(
        name="Source of a GPIS", description="A GPIS was made of this mesh, which is not rendered itself", default=False
    )
    bake_resolution: IntProperty(
        name="Resolution", description="Grid nodes along the longest side at the last bake", default=96, min=8, max=2048
    )
    bake_margin: FloatProperty(
        name="Margin", description="Room around the mesh at the last bake", default=0.0, min=0.0, subtype="DISTANCE"
    )


_GROUPS = (
    (bpy.types.Scene, GPIS_SceneProperties),
    (bpy.types.ViewLayer, GPIS_ViewLayerProperties),
    (bpy.types.Object, GPIS_ObjectProperties),
)


def register():
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
