"""Meshes: modifiers, instances, curves, several materials and smooth shading, as in Cycles."""

import importlib

import bpy
import numpy as np
import pytest

from . import support


@pytest.fixture
def stage(empty_scene):
    support.settings(empty_scene, samples=64)
    support.world(empty_scene, (0.3, 0.35, 0.5))
    support.plane(empty_scene, material=support.diffuse("Grey", (0.5, 0.5, 0.5)))
    support.light(empty_scene, "SUN", 2, rotation=(0.95, 0.2, 0.2, 0.1), angle=0.1)
    support.camera(empty_scene, (1, -8, 4), (0, 0, 0.5))
    return empty_scene


def test_modifiers_are_applied(stage, tmp_path):
    box = support.cube(stage, "Box", 1, support.diffuse("Red", (0.7, 0.1, 0.1)), location=(-1.5, 0, 0.5))
    array = box.modifiers.new("Array", "ARRAY")
    array.count, array.relative_offset_displace = 3, (1.3, 0.2, 0)
    support.same_pictures(stage, tmp_path)


def test_flattened_by_its_scale(stage, tmp_path):
    """Zero along one axis: the object has faces all the same."""
    red = support.diffuse("Red", (0.7, 0.1, 0.1))
    support.plane(stage, "Sheet", 2, red, location=(0, 0, 0.9), rotation=(0.9, 0.4, 0.1, 0.4), scale=(1, 0.7, 0))
    support.same_pictures(stage, tmp_path)


def test_several_materials_on_one_mesh(stage, tmp_path):
    box = support.cube(stage, "Box", 1.6, support.diffuse("Red", (0.7, 0.1, 0.1)), location=(0, 0, 0.8))
    box.data.materials.append(support.diffuse("Green", (0.1, 0.7, 0.1)))
    box.data.materials.append(support.diffuse("Blue", (0.1, 0.1, 0.7)))
    for index, polygon in enumerate(box.data.polygons):
        polygon.material_index = index % 3
    box.rotation_euler.z = 0.5
    box.material_slots[2].link = "OBJECT"
    box.material_slots[2].material = support.diffuse("Yellow", (0.7, 0.6, 0.1))
    support.same_pictures(stage, tmp_path)


def test_collection_instances_share_their_mesh(stage, tmp_path, extension):
    box = support.cube(stage, "Box", 0.8, support.diffuse("Red", (0.7, 0.1, 0.1)), location=(0, 0, 0.4))
    group = bpy.data.collections.new("Group")
    stage.collection.objects.unlink(box)
    group.objects.link(box)
    for index in range(3):
        empty = support.link(stage, f"Instance {index}", None, location=(1.4 * index - 1.6, 0.5 * index, 0))
        empty.instance_type, empty.instance_collection = "COLLECTION", group
        empty.scale = (1, 1, 1 + index)
    support.same_pictures(stage, tmp_path)
    sync = importlib.import_module(extension + ".sync")
    description = sync.describe(bpy.context.evaluated_depsgraph_get(), 64, 48).description
    assert len(description["objects"]) == 4 and len(description["meshes"]) == 2


def test_geometry_nodes_instances(stage, tmp_path):
    """Instances without objects of their own, with the material of their mesh."""
    box = support.cube(stage, "Box", 0.6, support.diffuse("Red", (0.7, 0.1, 0.1)))
    box.hide_render = True
    tree = bpy.data.node_groups.new("Scatter", "GeometryNodeTree")
    tree.interface.new_socket("Geometry", in_out="OUTPUT", socket_type="NodeSocketGeometry")
    grid = tree.nodes.new("GeometryNodeMeshGrid")
    for name, value in (("Size X", 4), ("Size Y", 2), ("Vertices X", 3), ("Vertices Y", 2)):
        grid.inputs[name].default_value = value
    info = tree.nodes.new("GeometryNodeObjectInfo")
    info.inputs["Object"].default_value = box
    scatter = tree.nodes.new("GeometryNodeInstanceOnPoints")
    output = tree.nodes.new("NodeGroupOutput")
    tree.links.new(grid.outputs["Mesh"], scatter.inputs["Points"])
    tree.links.new(info.outputs["Geometry"], scatter.inputs["Instance"])
    tree.links.new(scatter.outputs["Instances"], output.inputs[0])
    carrier = support.plane(stage, "Carrier", 1, location=(0, 0, 0.3))
    carrier.modifiers.new("Scatter", "NODES").node_group = tree
    ours, cycles = support.same_pictures(stage, tmp_path)
    assert (cycles[..., 0] > 2 * cycles[..., 2]).any(), "the test must show the red instances"


def test_text_and_curves_arrive_as_meshes(stage, tmp_path):
    data = bpy.data.curves.new("Text", "FONT")
    data.body, data.extrude, data.align_x = "GPIS", 0.1, "CENTER"
    data.materials.append(support.diffuse("Red", (0.7, 0.1, 0.1)))
    support.link(stage, "Text", data, location=(0, 0, 0.3), rotation=(0.85, 0.53, 0, 0), scale=(1.5, 1.5, 1.5))
    support.same_pictures(stage, tmp_path)


def cylinder(smooth):
    """Coarse and open: its normals tell flat from smooth."""
    bpy.ops.mesh.primitive_cylinder_add(
        vertices=10, radius=0.8, depth=1.6, location=(0, 0, 0.8), end_fill_type="NOTHING"
    )
    body = bpy.context.object
    body.data.materials.append(support.diffuse("Red", (0.7, 0.1, 0.1)))
    for polygon in body.data.polygons:
        polygon.use_smooth = smooth(polygon)
    return body


@pytest.mark.parametrize("smooth", [False, True], ids=["flat", "smooth"])
def test_shading_normals(stage, tmp_path, smooth):
    """The light comes from the camera's side: renderers differ at the terminator of coarse smooth faces by design."""
    cylinder(lambda _: smooth)
    support.light(stage, "POINT", 900, (3, -7, 3), shadow_soft_size=0.1)
    support.same_pictures(stage, tmp_path, systematic=0.02)


def test_normals_of_a_mesh_that_is_flat_in_parts(extension):
    """As Blender's window shows it (Cycles averages flat faces into their smooth neighbours)."""
    meshes = importlib.import_module(extension + ".sync.meshes")
    mesh = cylinder(lambda polygon: polygon.index % 3 > 0).data
    arrays = meshes.describe(mesh, 1)
    assert arrays["normals"].shape == (20, 3, 3)
    for triangle, normals in zip(mesh.loop_triangles, arrays["normals"], strict=True):
        polygon = mesh.polygons[triangle.polygon_index]
        inclined = [normal @ np.array(polygon.normal) for normal in normals]
        if polygon.use_smooth:
            assert min(inclined) < 0.99
        else:
            assert min(inclined) == pytest.approx(1, abs=1e-5)


def test_hidden_objects_and_unrendered_kinds(stage, tmp_path):
    support.cube(stage, "Hidden", 2, location=(0, 0, 1)).hide_render = True
    support.link(stage, "Nothing", bpy.data.meshes.new("No faces"))
    support.same_pictures(stage, tmp_path)
