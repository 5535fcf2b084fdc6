"""Operators: a GPIS from a mesh, and the same bake again."""

import bpy
import numpy as np
from bpy.props import FloatProperty, IntProperty

from ..native import native
from ..paint import bake as painting
from ..sync import meshes
from . import files
from .options import NARROW_BAND

# Of the longest side of the mesh. A surface of this roughness is clearly not the mesh any more, and still its shape.
DEFAULT_SIGMA = 0.02
DEFAULT_LENGTH_SCALE = 0.1
# The margin around the mesh, unless it is given: the surface at 4 σ is met once in 30,000 realisations.
_MARGIN_SIGMAS = 4.0
_LEAST_MARGIN = 0.1


def automatic_margin(sigma, size):
    """Room around a surface of this size, so that next to nothing of its random surface is cut off."""
    return max(_MARGIN_SIGMAS * sigma, _LEAST_MARGIN * size)


def mesh_arrays(depsgraph, source):
    """Vertices (N,3) and triangles (M,3) of a mesh object with its modifiers, in its own coordinates."""
    evaluated = source.evaluated_get(depsgraph)
    mesh = evaluated.to_mesh()
    try:
        if mesh is None or len(mesh.polygons) == 0:
            raise ValueError(f'Object "{source.name}" has no faces: there is nothing to make a GPIS of.')
        vertices, triangles, _ = meshes.triangles(mesh)
    finally:
        evaluated.to_mesh_clear()
    return vertices.astype(np.float64), triangles


def bake(context, volume_object, *, resolution, margin, narrow_band=0.0):
    """Bake the object's source into a new .vdb and give it to the object; returns what the native bake says."""
    settings = volume_object.gpis
    source = settings.source
    # The mesh's coordinates are the volume's: a GPIS that was moved away from its mesh stays there.
    vertices, triangles = mesh_arrays(context.evaluated_depsgraph_get(), source)
    size = float(max(vertices.max(axis=0) - vertices.min(axis=0)))
    if not np.isfinite(size):
        raise ValueError(f'Object "{source.name}" has vertices whose coordinates are not numbers.')
    if not size > 0:
        raise ValueError(f'Object "{source.name}" has no size: all its vertices are in one place.')
    if not settings.is_property_set("sigma"):
        settings.sigma = DEFAULT_SIGMA * size
    if not settings.is_property_set("length_scale"):
        settings.length_scale = DEFAULT_LENGTH_SCALE * size
    margin = margin or automatic_margin(settings.sigma, size)
    path = files.new_path(source.name)

    window_manager = context.window_manager
    window_manager.progress_begin(0, 100)
    try:
        report = native().bake_mesh_distance(
            vertices,
            triangles,
            str(path),
            resolution=resolution,
            margin=margin,
            narrow_band=narrow_band,
            progress=_Progress(window_manager),
        )
    finally:
        window_manager.progress_end()
    data = volume_object.data
    # Blender's Duplicate shares the data; a bake of another mesh is data of its own.
    if any(other.data == data and other.gpis.source != source for other in bpy.data.objects):
        data = volume_object.data = data.copy()
    files.point(data, path)
    settings.bake_resolution = resolution
    settings.bake_margin = margin
    settings.bake_narrow_band = narrow_band
    settings.mean_grid = "mean"
    painting.rebase(volume_object)
    return report


class _Progress:
    def __init__(self, window_manager):
        self._window_manager = window_manager

    def __call__(self, fraction, *_):
        self._window_manager.progress_update(100 * fraction)
        return True


def make(context, source, *, resolution, margin=0.0, narrow_band=0.0):
    """A Volume object in place of a mesh object. It follows the mesh, which stays as a wire and is not rendered."""
    data = bpy.data.volumes.new(f"{source.name} GPIS")
    volume_object = bpy.data.objects.new(f"{source.name} GPIS", data)
    for collection in source.users_collection:
        collection.objects.link(volume_object)
    # A child with no transform of its own: animation, constraints and parents of the mesh keep working, and deleting
    # the GPIS leaves the mesh where it is.
    volume_object.parent = source
    context.view_layer.update()
    volume_object.gpis.source = source
    try:
        report = bake(context, volume_object, resolution=resolution, margin=margin, narrow_band=narrow_band)
    except Exception:
        bpy.data.objects.remove(volume_object)
        bpy.data.volumes.remove(data)
        raise
    for slot in source.material_slots:
        data.materials.append(slot.material)
    volume_object.gpis.enabled = True
    volume_object.display_type = "BOUNDS"  # the distance drawn as fog would be a block
    source.hide_render = True
    source.display_type = "WIRE"
    source.gpis.is_source = True
    return volume_object, report


def made_of(source):
    """The GPIS objects that were made of a mesh object."""
    return [child for child in source.children if child.type == "VOLUME" and child.gpis.source == source]


def remove(source, volume_objects):
    """Delete GPIS objects of a mesh; without any the mesh is rendered again."""
    for volume_object in volume_objects:
        data = volume_object.data
        bpy.data.objects.remove(volume_object)
        if data.users == 0:
            bpy.data.volumes.remove(data)
    if not made_of(source):
        source.hide_render = False
        source.display_type = "TEXTURED"
        source.gpis.is_source = False


def note(volume_object, report):
    """What an artist should know about a bake."""
    name = volume_object.gpis.source.name
    text = f'Signed distance of "{name}": voxels of {report["voxel_size"]:.3g}'
    reasons = [f"has {report['open_edges']} open edges"] if report["open_edges"] else []
    reasons += ["meets itself"] if report["meets_itself"] else []
    if reasons:
        text += f". The mesh {' and '.join(reasons)}: it was closed by its winding number"
    return text + "."


class _Bake:
    bl_options = {"REGISTER", "UNDO"}

    resolution: IntProperty(
        name="Resolution",
        description="Grid nodes along the longest side of the bounds",
        default=96,
        min=8,
        max=2048,
        soft_max=512,
    )
    margin: FloatProperty(
        name="Margin",
        description="Room around the mesh for the surface, in object units (0: 4 σ, at least a tenth of the size)",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
    )
    narrow_band: NARROW_BAND

    def run(self, bake_one, objects):
        result = {"CANCELLED"}
        for obj in objects:
            try:
                volume_object, report = bake_one(obj)
            except (ValueError, RuntimeError, OSError) as error:
                self.report({"ERROR"}, f'"{obj.name}": {error}')
                return result
            self.report({"INFO"}, note(volume_object, report))
            result = {"FINISHED"}  # something to undo, whatever becomes of the others
        return result


class GPIS_OT_make(_Bake, bpy.types.Operator):
    """Make a GPIS of each selected mesh: its signed distance is baked, the mesh itself is no longer rendered"""

    bl_idname = "gpis.make"
    bl_label = "Make GPIS"

    @classmethod
    def poll(cls, context):
        obj = context.active_object
        if obj is None or obj.type != "MESH" or context.mode != "OBJECT":
            cls.poll_message_set("Select a mesh, in object mode.")
            return False
        return True

    def execute(self, context):
        active = context.active_object
        sources = [obj for obj in context.selected_objects if obj.type == "MESH"] or [active]
        made = {}

        def make_one(source):
            made[source], report = make(
                context, source, resolution=self.resolution, margin=self.margin, narrow_band=self.narrow_band
            )
            return made[source], report

        result = self.run(make_one, sources)
        for volume_object in made.values():
            volume_object.select_set(True)
        if active in made:
            context.view_layer.objects.active = made[active]
        return result


class GPIS_OT_rebake(_Bake, bpy.types.Operator):
    """Bake the signed distance of the source mesh again"""

    bl_idname = "gpis.rebake"
    bl_label = "Bake Again"

    @classmethod
    def poll(cls, context):
        obj = context.active_object
        return obj is not None and obj.type == "VOLUME" and obj.gpis.source is not None

    def invoke(self, context, event):
        settings = context.active_object.gpis
        self.resolution, self.narrow_band = settings.bake_resolution, settings.bake_narrow_band
        return self.execute(context)

    def execute(self, context):
        def bake_one(obj):
            return obj, bake(
                context, obj, resolution=self.resolution, margin=self.margin, narrow_band=self.narrow_band
            )

        return self.run(bake_one, [context.active_object])


class GPIS_OT_remove(bpy.types.Operator):
    """Delete the GPIS and render its mesh again"""

    bl_idname = "gpis.remove"
    bl_label = "Remove GPIS"
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        obj = context.active_object
        if obj is None or context.mode != "OBJECT":
            return False
        return obj.gpis.is_source if obj.type == "MESH" else obj.type == "VOLUME" and obj.gpis.source is not None

    def execute(self, context):
        obj = context.active_object
        source = obj if obj.type == "MESH" else obj.gpis.source
        remove(source, made_of(source) if obj == source else [obj])
        if source.name in context.view_layer.objects:
            source.select_set(True)
            context.view_layer.objects.active = source
        return {"FINISHED"}


_CLASSES = (GPIS_OT_make, GPIS_OT_rebake, GPIS_OT_remove)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
