"""The list of operands on a GPIS object. Old files keep their look: items keep their numbers, lists start empty."""

import bpy
from bpy.props import BoolProperty, CollectionProperty, EnumProperty, FloatProperty, IntProperty, PointerProperty, StringProperty

OPERATIONS = (
    ("UNION", "Union", "What is inside of either", "SELECT_EXTEND", 0),
    ("INTERSECTION", "Intersection", "What is inside of both", "SELECT_INTERSECT", 1),
    ("DIFFERENCE", "Difference", "What is inside of the object so far, but not of this operand", "SELECT_SUBTRACT", 2),
    ("SMOOTH_UNION", "Smooth Union", "A union with a rounded crease", "MOD_SMOOTH", 3),
)

CORRELATIONS = (
    ("INDEPENDENT", "Independent", "Every operand has random bumps of its own", 0),
    ("SHARED", "Shared Noise", "All see the same random bumps, as parts of one block. They must have the same kernel", 1),
)


def _tag(settings, context):
    """A render that keeps its data between frames must see the change."""
    settings.id_data.update_tag()


def _is_other_gpis(item, obj):
    return obj.type == "VOLUME" and obj.gpis.enabled and obj != item.id_data


class GPIS_CSGItem(bpy.types.PropertyGroup):
    object: PointerProperty(
        name="Operand",
        description="GPIS that is combined with this one, with its own kernel, material, transform and animation",
        type=bpy.types.Object,
        poll=_is_other_gpis,
        update=_tag,
    )
    operation: EnumProperty(
        name="Operation",
        description="How the operand is combined with all above it, in every single realisation",
        items=OPERATIONS,
        default="UNION",
        update=_tag,
    )
    blend: FloatProperty(
        name="Blend Radius",
        description="Values of f closer than this are blended, in object units",
        default=0.1,
        min=1e-6,
        soft_max=10.0,
        precision=3,
        subtype="DISTANCE",
        update=_tag,
    )
    enabled: BoolProperty(name="Enabled", description="Use this operand", default=True, update=_tag)
    solo: BoolProperty(
        name="Solo", description="Use only the operands that are marked so, with the object itself", default=False, update=_tag
    )


class GPIS_CSGProperties(bpy.types.PropertyGroup):
    items: CollectionProperty(type=GPIS_CSGItem)
    active: IntProperty(name="Active Operand", description="Operand whose settings are shown below the list", default=0, min=0)
    correlation: EnumProperty(
        name="Noise",
        description="What the operands' random bumps have in common",
        items=CORRELATIONS,
        default="INDEPENDENT",
        update=_tag,
    )
    quality: StringProperty(name="Fit", description="How well the fit says what was composed")
    fitted_from: PointerProperty(name="Fitted From", description="The GPIS to whose list this was fitted", type=bpy.types.Object)
    comparison: StringProperty(name="Comparison", description="What a render of the list and one of the fit have shown")
    comparison_image: PointerProperty(
        name="Comparison Image",
        description="The list, its fit and their difference, and below them how good the fit is where it is seen",
        type=bpy.types.Image,
    )


_CLASSES = (GPIS_CSGItem, GPIS_CSGProperties)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.Object.gpis_csg = PointerProperty(type=GPIS_CSGProperties)


def unregister():
    del bpy.types.Object.gpis_csg
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
