"""One surface out of all that a GPIS object can be, as a mesh."""

import bpy
import numpy as np
from bpy.props import IntProperty

from .. import sync
from ..native import native


def mesh_of(obj, process, resolution, seed):
    """Vertices (N, 3) and triangles (M, 3) of a realisation, in the object's space."""
    grid = process.realisation(sync.gpis.bounds_of(obj), resolution, seed)
    return native().level_set_mesh(grid["realisation"], grid["voxel_size"], grid["origin"])


class GPIS_OT_realise(bpy.types.Operator):
    """Add a mesh of one realisation of the active GPIS object: what a single one of its random surfaces looks like"""

    bl_idname = "gpis.realise"
    bl_label = "Realisation as Mesh"
    bl_options = {"REGISTER", "UNDO"}

    seed: IntProperty(name="Seed", description="Another seed is another surface", default=0, min=0)
    resolution: IntProperty(
        name="Resolution", description="Nodes along the longest side", default=128, min=8, max=512, soft_max=256
    )

    @classmethod
    def poll(cls, context):
        obj = context.active_object
        if obj is None or obj.type != "VOLUME" or not obj.gpis.enabled or context.mode != "OBJECT":
            cls.poll_message_set("Select a GPIS object, in object mode.")
            return False
        return True

    def execute(self, context):
        obj = context.active_object
        try:
            process = sync.gpis.process_of(sync.Sync(context.evaluated_depsgraph_get()), obj)
            vertices, triangles = mesh_of(obj, process, self.resolution, self.seed)
        except (ValueError, OSError, RuntimeError) as error:
            self.report({"ERROR"}, str(error))
            return {"CANCELLED"}
        if len(triangles) == 0:
            self.report({"ERROR"}, f'"{obj.name}": this realisation has no surface; try another seed.')
            return {"CANCELLED"}
        mesh = bpy.data.meshes.new(f"{obj.name} Realisation")
        fill(mesh, vertices, triangles)
        for material in obj.data.materials:
            mesh.materials.append(material)
        made = bpy.data.objects.new(mesh.name, mesh)
        made.matrix_world = obj.matrix_world
        made.hide_render = True  # beside the GPIS itself it would be a second surface in the picture
        for collection in obj.users_collection:
            collection.objects.link(made)
        for other in context.selected_objects:
            other.select_set(False)
        made.select_set(True)
        context.view_layer.objects.active = made
        return {"FINISHED"}


def fill(mesh, vertices, triangles):
    mesh.vertices.add(len(vertices))
    mesh.vertices.foreach_set("co", np.ascontiguousarray(vertices, dtype=np.float32).ravel())
    mesh.loops.add(3 * len(triangles))
    mesh.loops.foreach_set("vertex_index", np.ascontiguousarray(triangles, dtype=np.int32).ravel())
    mesh.polygons.add(len(triangles))
    mesh.polygons.foreach_set("loop_start", np.arange(0, 3 * len(triangles), 3, dtype=np.int32))
    mesh.polygons.foreach_set("use_smooth", np.ones(len(triangles), dtype=bool))
    mesh.update(calc_edges=True)
    mesh.validate()


register, unregister = bpy.utils.register_classes_factory((GPIS_OT_realise,))
