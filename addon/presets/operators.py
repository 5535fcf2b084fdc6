"""Applying a preset to GPIS objects: its lengths scaled to each, and room for its surface."""

import bpy
from bpy.props import BoolProperty, EnumProperty, FloatProperty

from .. import volume
from ..bake import extend
from .table import LENGTHS, PRESETS

# The settings that a preset stands for; those it does not name go back to their defaults.
_OWNED = (
    "sigma_source",
    "sigma",
    "kernel",
    "length_scale",
    "alpha",
    "period",
    "axis",
    "periodic_scale",
    "anisotropy",
    "ratios",
    "infinite",
    "rotation",
    "memory",
)


def size_of(obj):
    """Longest side of an object's mean surface, in object units: that of its grid without the margin."""
    settings = obj.gpis
    whole = volume.size(volume.path_of(obj.data), settings.mean_grid)
    return max(whole - 2 * settings.bake_margin, 0.1 * whole)


def apply(obj, name, scale=1.0):
    """Give a GPIS object the settings of a preset; ValueError or FileNotFoundError with a sentence."""
    factor = scale * size_of(obj)
    settings = obj.gpis
    for key in _OWNED:
        settings.property_unset(key)
    for key, value in PRESETS[name].settings.items():
        setattr(settings, key, factor * value if key in LENGTHS else value)
    extend.ensure_margin(obj, settings.sigma)


def material_of(name):
    """The preset's micro-BRDF; made once, so that an artist's changes to it stay."""
    preset = PRESETS[name]
    label = f"GPIS {preset.label}"
    material = bpy.data.materials.get(label)
    if material is not None:
        return material
    material = bpy.data.materials.new(label)
    if bpy.app.version < (5, 0):
        material.use_nodes = True
    material.diffuse_color = (*preset.color, 1.0)
    material.metallic, material.roughness = preset.metallic, preset.roughness
    kind = "Principled" if preset.metallic else "Glass" if preset.ior else "Diffuse"
    nodes, links = material.node_tree.nodes, material.node_tree.links
    nodes.clear()
    shader, output = nodes.new(f"ShaderNodeBsdf{kind}"), nodes.new("ShaderNodeOutputMaterial")
    output.location = (300, 0)
    shader.inputs["Base Color" if kind == "Principled" else "Color"].default_value = (*preset.color, 1.0)
    if kind != "Diffuse":
        shader.inputs["Roughness"].default_value = preset.roughness
    if kind == "Principled":
        shader.inputs["Metallic"].default_value = preset.metallic
    if kind == "Glass":
        shader.inputs["IOR"].default_value = preset.ior
    links.new(shader.outputs[0], output.inputs["Surface"])
    return material


class GPIS_OT_apply_preset(bpy.types.Operator):
    """Give the selected GPIS objects the settings of a preset, scaled to their size"""

    bl_idname = "gpis.apply_preset"
    bl_label = "Apply Preset"
    bl_options = {"REGISTER", "UNDO"}

    preset: EnumProperty(
        name="Preset",
        description="Which kind of surface",
        items=[(name, entry.label, entry.description) for name, entry in PRESETS.items()],
    )
    scale: FloatProperty(
        name="Scale",
        description="Size of the structure against that of the object: 2 is twice as coarse",
        default=1.0,
        min=1e-3,
        soft_min=0.1,
        soft_max=10.0,
    )
    use_material: BoolProperty(name="Material", description="Also put the preset's material into the first slot", default=True)

    @classmethod
    def description(cls, context, properties):
        return f"{PRESETS[properties.preset].description}. Applied to the selected GPIS objects, scaled to their size"

    @classmethod
    def poll(cls, context):
        if not _targets(context):
            cls.poll_message_set("Select a GPIS object (Add > GPIS).")
            return False
        return True

    def execute(self, context):
        for obj in _targets(context):
            try:
                apply(obj, self.preset, self.scale)
            except (ValueError, RuntimeError, OSError) as error:
                self.report({"ERROR"}, f'"{obj.name}": {error}')
                return {"CANCELLED"}
            if self.use_material:
                materials = obj.data.materials
                if materials:
                    materials[0] = material_of(self.preset)
                else:
                    materials.append(material_of(self.preset))
        return {"FINISHED"}


def _targets(context):
    chosen = {*context.selected_objects, context.active_object} - {None}
    return [obj for obj in chosen if obj.type == "VOLUME" and obj.gpis.enabled]


register, unregister = bpy.utils.register_classes_factory((GPIS_OT_apply_preset,))
