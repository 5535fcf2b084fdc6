"""Materials: Diffuse, Glossy, Glass and Principled nodes give what they give in Cycles; whatever else there is is named."""

import importlib

import bpy
import pytest

from . import support

MATERIALS = {
    "diffuse": ("ShaderNodeBsdfDiffuse", {"Color": (0.7, 0.3, 0.1, 1)}),
    "mirror": ("ShaderNodeBsdfAnisotropic", {"Color": (0.9, 0.6, 0.3, 1), "Roughness": 0.0}),
    "rough metal": ("ShaderNodeBsdfAnisotropic", {"Color": (0.9, 0.6, 0.3, 1), "Roughness": 0.5}),
    "principled dull": ("ShaderNodeBsdfPrincipled", {"Base_Color": (0.7, 0.3, 0.1, 1), "Roughness": 1.0}),
    "principled": ("ShaderNodeBsdfPrincipled", {"Base_Color": (0.7, 0.3, 0.1, 1), "Roughness": 0.4}),
    "principled metal": (
        "ShaderNodeBsdfPrincipled",
        {"Base_Color": (0.9, 0.6, 0.3, 1), "Roughness": 0.4, "Metallic": 1.0},
    ),
    "glass": ("ShaderNodeBsdfGlass", {"Color": (0.9, 0.7, 0.5, 1), "IOR": 1.5, "Roughness": 0.0}),
    "rough glass": ("ShaderNodeBsdfGlass", {"Color": (0.9, 0.7, 0.5, 1), "IOR": 1.5, "Roughness": 0.4}),
    "principled glass": (
        "ShaderNodeBsdfPrincipled",
        {"Base_Color": (0.9, 0.6, 0.3, 1), "Roughness": 0.2, "IOR": 1.33, "Transmission_Weight": 1.0},
    ),
}
# Cycles scales Principled's diffuse part by the albedo of the lobes above it; ours is one diffuse and one GGX lobe:
# 5.5 % at the most, at 512 samples of both.
SYSTEMATIC = {"principled dull": 0.06, "principled": 0.06}


@pytest.fixture
def stage(empty_scene):
    support.settings(empty_scene, samples=64)
    support.world(empty_scene, (0.4, 0.45, 0.6))
    support.plane(empty_scene, material=support.diffuse("Grey", (0.5, 0.5, 0.5)))
    support.light(empty_scene, "AREA", 300, (-2, -2, 4), (0.9, 0.3, -0.2, 0.1), size=2.5)
    support.camera(empty_scene, (1, -7, 3), (0, 0, 0.8))
    return empty_scene


@pytest.mark.parametrize("name", MATERIALS)
def test_material_is_that_of_cycles(stage, tmp_path, name):
    node_type, inputs = MATERIALS[name]
    material = support.node_material("Body", node_type, **inputs)
    for node in material.node_tree.nodes:
        if hasattr(node, "distribution"):
            node.distribution = "GGX"  # Cycles' default adds multiple scattering, ours is single
    bpy.ops.mesh.primitive_uv_sphere_add(segments=64, ring_count=32, location=(0, 0, 1))
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(material)
    if "glass" in name:  # the noise of a lamp's caustics is not to be told from two pictures
        bpy.data.objects.remove(next(obj for obj in stage.objects if obj.type == "LIGHT"))
    support.same_pictures(stage, tmp_path, systematic=SYSTEMATIC.get(name, 0.02))


@pytest.fixture
def convert(stage, extension):
    """(description, warnings) of a scene with a box of this material."""
    sync = importlib.import_module(extension + ".sync")

    def convert(material):
        support.cube(stage, "Box", 1, material)
        bpy.context.view_layer.update()
        state = sync.describe(bpy.context.evaluated_depsgraph_get(), 64, 48)
        return state.description["materials"].get(material.name if material else "Default Surface"), state.warnings

    return convert


def test_no_material_is_grey(convert):
    assert convert(None) == ({"type": "lambert", "color": (0.8, 0.8, 0.8)}, [])


def test_plain_materials_warn_of_nothing(convert):
    described, warnings = convert(bpy.data.materials.new("Plain"))
    assert described["color"] == pytest.approx((0.8, 0.8, 0.8)) and warnings == []
    described, warnings = convert(support.node_material("Metal", "ShaderNodeBsdfPrincipled", Metallic=1.0))
    assert described["type"] == "principled" and described["metallic"] == 1 and warnings == []
    described, warnings = convert(support.node_material("Window", "ShaderNodeBsdfGlass", IOR=1.6, Roughness=0.25))
    assert described == {
        "type": "dielectric",
        "ior": pytest.approx(1.6),
        "roughness": 0.25,
        "color": (1.0, 1.0, 1.0),
        "reflection": (1.0, 1.0, 1.0),
    }
    assert warnings == []


@pytest.mark.parametrize(
    "node_type, inputs, word",
    [
        ("ShaderNodeEmission", {}, "is not converted"),
        ("ShaderNodeBsdfTranslucent", {}, "is not converted"),
        ("ShaderNodeBsdfGlass", {"Color": (1.5, 0.2, 0.2, 1)}, "cut to 0..1"),
        ("ShaderNodeBsdfPrincipled", {"Transmission_Weight": 1.0, "Metallic": 0.5}, "Transmission Weight"),
        ("ShaderNodeBsdfPrincipled", {"Transmission_Weight": 1.0, "Coat_Weight": 0.5}, "Coat Weight"),
        ("ShaderNodeBsdfPrincipled", {"Transmission_Weight": 0.5}, "Transmission Weight"),
        ("ShaderNodeBsdfPrincipled", {"Alpha": 0.5}, "Alpha"),
        ("ShaderNodeBsdfPrincipled", {"Emission_Strength": 2.0}, "Emission Strength"),
        ("ShaderNodeBsdfDiffuse", {"Roughness": 0.3}, "without its roughness"),
        ("ShaderNodeBsdfDiffuse", {"Color": (1.5, 0.2, 0.2, 1)}, "cut to 0..1"),
    ],
)
def test_what_is_not_converted_is_named(convert, node_type, inputs, word):
    described, warnings = convert(support.node_material("Odd", node_type, **inputs))
    assert len(warnings) == 1
    assert '"Odd"' in warnings[0] and word in warnings[0]
    assert all(0 <= part <= 1 for key in ("color", "reflection") for part in described.get(key, ()))


def test_texture_on_a_colour_is_named(convert):
    material = support.node_material("Textured", "ShaderNodeBsdfDiffuse", Color=(0.1, 0.2, 0.3, 1))
    tree = material.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    shader = next(node for node in tree.nodes if node.type == "BSDF_DIFFUSE")
    tree.links.new(noise.outputs[0], shader.inputs["Color"])
    described, warnings = convert(material)
    assert described["color"] == pytest.approx((0.1, 0.2, 0.3))
    assert len(warnings) == 1 and noise.name in warnings[0] and '"Textured"' in warnings[0]


def test_constant_nodes_are_followed(convert):
    material = support.node_material("Constant", "ShaderNodeBsdfDiffuse")
    tree = material.node_tree
    rgb, reroute = tree.nodes.new("ShaderNodeRGB"), tree.nodes.new("NodeReroute")
    rgb.outputs[0].default_value = (0.3, 0.4, 0.5, 1)
    shader = next(node for node in tree.nodes if node.type == "BSDF_DIFFUSE")
    tree.links.new(rgb.outputs[0], reroute.inputs[0])
    tree.links.new(reroute.outputs[0], shader.inputs["Color"])
    described, warnings = convert(material)
    assert described["color"] == pytest.approx((0.3, 0.4, 0.5)) and warnings == []
