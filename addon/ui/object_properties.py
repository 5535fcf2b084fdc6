"""Properties of GPIS objects: the fields of the process, its kernel, and how light paths see it.

Old files keep their look: Blender stores what was set, enumerations by their numbers, so the default of every new
property is what files without it were rendered with, and items keep the numbers that they have.
"""

import bpy
from bpy.props import (
    BoolProperty,
    BoolVectorProperty,
    CollectionProperty,
    EnumProperty,
    FloatProperty,
    FloatVectorProperty,
    IntProperty,
    PointerProperty,
    StringProperty,
)

from .. import volume
from ..bake.operators import DEFAULT_LENGTH_SCALE, DEFAULT_SIGMA

KERNELS = (
    ("SQUARED_EXPONENTIAL", "Squared Exponential", "Smooth bumps of one size: melted, soft, polished", 0),
    ("MATERN_3_2", "Matérn 3/2", "Rough: slopes change abruptly, as on stone, rust and plaster", 1),
    ("MATERN_5_2", "Matérn 5/2", "Between Matérn 3/2 and the squared exponential: natural surfaces", 2),
    (
        "RATIONAL_QUADRATIC",
        "Rational Quadratic",
        "Bumps of many sizes at once, large waves under small ones: terrain, foam, crumpled things",
        3,
    ),
    (
        "LOCALLY_PERIODIC",
        "Locally Periodic",
        "Ridges that repeat along an axis and drift apart over the length scale: ripples, cloth, grooves",
        4,
    ),
    (
        "WONG",
        "Wong",
        "As rough as Matérn 3/2, and slightly wavy: the kernel whose first hits are known in closed form",
        5,
    ),
)

SAMPLERS = (
    ("AUTO", "Automatic", "The fastest that serves the kernel. The plan of the last render says which, and why", 0),
    ("CONVOLUTION", "Convolution", "White noise filtered along the ray. Serves: squared exponential", 1),
    (
        "MARKOV",
        "Markov",
        "A state of value and slopes carried along the ray, exact. Serves: Matérn 3/2, Matérn 5/2, Wong",
        2,
    ),
    (
        "SPECTRAL",
        "Spectral",
        "Waves of random phase along the ray. Serves: squared exponential, rational quadratic, locally periodic",
        3,
    ),
    ("NYSTROM", "Nyström", "Few functions fitted to the covariance. Serves: smooth kernels, and the anisotropy of a grid", 4),
    ("DENSE", "Dense", "The full covariance matrix of the points on a ray. Serves: all kernels; slow, for comparisons", 5),
    (
        "REALISATION",
        "Realisation",
        "Each path meets a noise field drawn for all of space. Serves: all kernels; with the anisotropy of a grid the "
        "squared exponential alone",
        6,
    ),
)

MEMORIES = (
    ("NONE", "None", "Nothing but that it is outside: fastest, no fine self-shadowing of its own bumps", 0),
    ("RENEWAL", "Renewal", "The point it left, not the slope there", 1),
    ("RENEWAL_PLUS", "Renewal+", "The point it left and the slope there: close to a real rough surface", 2),
    ("GLOBAL", "Global", "All of it: the whole path sees one and the same rough surface. The truth, and the slowest", 3),
)


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


class GPIS_ConditionPoint(bpy.types.PropertyGroup):
    """A place that every realisation of the surface goes through."""

    location: FloatVectorProperty(name="Location", description="In object space", size=3, subtype="XYZ", update=_tag)
    normal: FloatVectorProperty(
        name="Normal", description="Of the surface there, in object space", size=3, subtype="XYZ", default=(0, 0, 1), update=_tag
    )
    slope: FloatProperty(
        name="Slope",
        description="How steeply the process rises along the normal; 1 for a distance",
        default=1.0,
        min=1e-6,
        soft_max=10.0,
        precision=3,
        update=_tag,
    )
    noise: FloatProperty(
        name="Noise",
        description="How far the surface may still be from this point, as a standard deviation in object units",
        default=0.0,
        min=0.0,
        soft_max=1.0,
        precision=4,
        subtype="DISTANCE",
        update=_tag,
    )


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
        items=KERNELS,
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
    alpha: FloatProperty(
        name="Alpha α",
        description="Mixture of sizes: small values mix very different ones, large values are nearly the squared exponential",
        default=1.0,
        min=0.05,
        soft_max=20.0,
        precision=3,
        update=_tag,
    )
    period: FloatProperty(
        name="Period",
        description="Distance from one ridge to the next, in object units",
        default=0.2,
        min=0.0,
        soft_max=100.0,
        precision=4,
        step=1,
        subtype="DISTANCE",
        update=_tag,
    )
    axis: FloatVectorProperty(
        name="Axis",
        description="Direction in object space along which the ridges follow each other",
        default=(0.0, 0.0, 1.0),
        subtype="XYZ",
        update=_tag,
    )
    periodic_scale: FloatProperty(
        name="Softness",
        description="Shape of a ridge, without a unit: small is sharp with overtones, large is a pure wave",
        default=1.0,
        min=0.001,
        soft_max=10.0,
        precision=3,
        update=_tag,
    )
    anisotropy: EnumProperty(
        name="Anisotropy",
        description="Whether bumps are longer in one direction than in another",
        items=(
            ("UNIFORM", "Uniform", "Bumps as long as they are wide", 0),
            ("AXES", "Axes", "Another length along each of three axes, the same everywhere", 1),
            ("GRID", "Grid", "From the grids anisotropy_diagonal and anisotropy_offdiagonal of the file, varying", 2),
        ),
        default="UNIFORM",
        update=_tag,
    )
    ratios: FloatVectorProperty(
        name="Ratios",
        description="Length of the bumps along each axis, in units of ℓ: (10, 1, 1) is brushed along x",
        default=(1.0, 1.0, 1.0),
        min=0.0,
        soft_max=100.0,
        precision=3,
        subtype="XYZ",
        update=_tag,
    )
    infinite: BoolVectorProperty(
        name="Infinite",
        description="The displacement does not change at all along this axis. Along the normal of a plane it is a height "
        "field: no overhangs, no droplets",
        default=(False, False, False),
        subtype="XYZ",
        update=_tag,
    )
    rotation: FloatVectorProperty(
        name="Rotation",
        description="Turns the axes of the length scales against those of the object",
        default=(0.0, 0.0, 0.0),
        subtype="EULER",
        update=_tag,
    )
    anisotropy_factor: FloatProperty(
        name="Factor",
        description="Length scales are those of the grids times this",
        default=1.0,
        min=0.0,
        soft_max=10.0,
        precision=3,
        update=_tag,
    )
    use_albedo: BoolProperty(
        name="Albedo Grid",
        description="Multiply the material's base colour by the grid albedo of the file",
        default=False,
        update=_tag,
    )
    conditions: CollectionProperty(
        name="Condition Points",
        description="Places that every realisation of the surface goes through",
        type=GPIS_ConditionPoint,
    )
    memory: EnumProperty(
        name="Memory",
        description="What a light path remembers of the surface it has just left",
        items=MEMORIES,
        default="RENEWAL_PLUS",
        update=_tag,
    )
    sampler: EnumProperty(
        name="Sampler",
        description="How the random surface is drawn along a ray. All draw the same surface, at different speed",
        items=SAMPLERS,
        default="AUTO",
        update=_tag,
    )
    source: PointerProperty(name="Source", description="Mesh that the signed distance is baked from", type=bpy.types.Object)
    is_source: BoolProperty(
        name="Source of a GPIS", description="A GPIS was made of this mesh, which is not rendered itself", default=False
    )
    bake_resolution: IntProperty(
        name="Resolution", description="Grid nodes along the longest side at the last bake", default=96, min=8, max=2048
    )
    bake_margin: FloatProperty(
        name="Margin", description="Room around the mesh at the last bake", default=0.0, min=0.0, subtype="DISTANCE"
    )
    bake_narrow_band: FloatProperty(
        name="Narrow Band",
        description="Distances beyond this are not kept by a bake. More than 6 σ, or 0: the whole box",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
        update=_tag,
    )
