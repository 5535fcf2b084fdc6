"""Add > GPIS: a GPIS object out of nothing, and one from a grid of a Volume object."""

import bpy
import numpy as np
from bpy.props import EnumProperty, FloatProperty, StringProperty
from bpy_extras.object_utils import AddObjectHelper, object_data_add

from .. import volume
from ..native import native
from . import files, shapes
from .operators import DEFAULT_LENGTH_SCALE, DEFAULT_SIGMA, automatic_margin
from .options import NARROW_BAND, RESOLUTION

ENGINE = "GPIS"

_KINDS = (
    ("SPHERE", "Sphere", "A ball", "MESH_UVSPHERE"),
    ("BOX", "Box", "A cube", "MESH_CUBE"),
    ("SUZANNE", "Suzanne", "Blender's monkey", "MESH_MONKEY"),
    (
        "HEIGHT_FIELD",
        "Height Field",
        "A slab whose displacement does not change with height: no overhangs and no droplets",
        "MESH_GRID",
    ),
    ("CLOUD", "Cloud", "Melted balls with a large deviation: nearly a volume", "OUTLINER_DATA_VOLUME"),
)


class GPIS_OT_add(bpy.types.Operator, AddObjectHelper):
    """Add a GPIS object: a random surface around a shape"""

    bl_idname = "gpis.add"
    bl_label = "Add GPIS"
    bl_options = {"REGISTER", "UNDO"}

    kind: EnumProperty(
        name="Shape",
        description="Mean surface",
        items=[(name, label, text, icon, i) for i, (name, label, text, icon) in enumerate(_KINDS)],
        options={"SKIP_SAVE"},
    )
    radius: FloatProperty(
        name="Radius",
        description="Half of the size of the shape",
        default=1.0,
        min=1e-4,
        soft_max=100.0,
        subtype="DISTANCE",
    )
    resolution: RESOLUTION
    margin: FloatProperty(
        name="Margin",
        description="Room around the shape for the surface (0: 4 σ, at least a tenth of the size)",
        default=0.0,
        min=0.0,
        subtype="DISTANCE",
    )
    narrow_band: NARROW_BAND

    @classmethod
    def description(cls, context, properties):
        text = next(text for name, _, text, _ in _KINDS if name == properties.kind)
        return f"Add a GPIS object. {text}"

    @classmethod
    def poll(cls, context):
        if context.mode != "OBJECT":
            cls.poll_message_set("Leave the edit mode first.")
            return False
        return True

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        for name in ("kind", "radius", "resolution", "margin", "narrow_band", "align", "location", "rotation"):
            layout.prop(self, name)

    def execute(self, context):
        shape = shapes.SHAPES[self.kind]
        sigma = shape.sigma * self.radius
        margin = self.margin or automatic_margin(sigma, self.radius * max(shape.size))
        label = next(label for name, label, _, _ in _KINDS if name == self.kind)
        path = files.new_path(label)
        try:
            voxel_size = shapes.write(
                self.kind, self.radius, path, resolution=self.resolution, margin=margin, narrow_band=self.narrow_band
            )
        except (ValueError, RuntimeError, OSError) as error:
            self.report({"ERROR"}, f"The {label} is not added: {error}")
            return {"CANCELLED"}
        data = bpy.data.volumes.new(label)
        files.point(data, path)
        obj = object_data_add(context, data, operator=self)
        settings = obj.gpis
        settings.bake_margin, settings.bake_resolution = margin, self.resolution
        settings.bake_narrow_band = self.narrow_band
        settings.sigma, settings.length_scale = sigma, shape.length_scale * self.radius
        settings.kernel = shape.kernel
        if any(shape.infinite):
            settings.anisotropy, settings.infinite = "AXES", shape.infinite
        settings.enabled = True
        self.report({"INFO"}, f"{obj.name}: voxels of {voxel_size:.3g}{hint(context)}")
        return {"FINISHED"}


def hint(context):
    """A new GPIS is not in the picture of another engine, and an artist would search for it."""
    return "" if context.scene.render.engine == ENGINE else ". It is rendered by the engine GPIS (Render properties)"


class GPIS_OT_from_volume(bpy.types.Operator):
    """Render the active Volume object as a GPIS: its grid is the mean itself, or the surface is where a fog has a value"""

    bl_idname = "gpis.from_volume"
    bl_label = "GPIS from Volume"
    bl_options = {"REGISTER", "UNDO"}

    def _names(self, context, edit_text):
        return volume.grid_names(context.active_object.data)

    grid: StringProperty(name="Grid", description="Grid of the file that is read", search=_names, options={"SKIP_SAVE"})
    meaning: EnumProperty(
        name="Holds",
        description="What the numbers of the grid are",
        items=(
            ("AUTO", "Automatic", "A fog where no number is negative, else a mean"),
            ("MEAN", "Mean", "Positive outside, the surface at 0, as a signed distance: used as it is"),
            ("FOG", "Fog", "A density: the distance from the surface where it has a value is baked into a new file"),
        ),
        options={"SKIP_SAVE"},
    )
    level: FloatProperty(name="Density", description="Of a fog: density at the surface", default=0.1, min=0.0, soft_max=10.0)
    resolution: RESOLUTION
    narrow_band: NARROW_BAND

    @classmethod
    def poll(cls, context):
        obj = context.active_object
        if obj is None or obj.type != "VOLUME" or context.mode != "OBJECT":
            cls.poll_message_set("Select a Volume object (Add > Volume > Import OpenVDB).")
            return False
        return True

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "grid", icon="VOLUME_DATA")
        layout.prop(self, "meaning")
        column = layout.column()
        column.active = self.meaning != "MEAN"
        column.prop(self, "level")
        column.prop(self, "resolution")
        column.prop(self, "narrow_band")

    def execute(self, context):
        obj = context.active_object
        try:
            text = self._make(obj)
        except (ValueError, RuntimeError, OSError) as error:
            self.report({"ERROR"}, f'"{obj.name}": {error}')
            return {"CANCELLED"}
        self.report({"INFO"}, text + hint(context))
        return {"FINISHED"}

    def _make(self, obj):
        path = volume.path_of(obj.data)
        grids = {grid["name"]: grid for grid in volume.grids(path)}
        if not grids:
            raise ValueError(f'"{path}" holds no grid of numbers.')
        if not self.grid:
            self.grid = next((name for name in ("mean", "density") if name in grids), next(iter(grids)))
        if self.grid not in grids:
            raise ValueError(f'there is no grid "{self.grid}" in "{path}"; it holds {", ".join(grids)}.')
        low, high = grids[self.grid]["value_range"]
        fog = self.meaning == "FOG" or (self.meaning == "AUTO" and low >= 0)
        if fog:
            self._bake_fog(obj, path, low, high)
        obj.gpis.mean_grid = "mean" if fog else self.grid
        obj.gpis.enabled = True
        return f'{obj.name}: {"the surface of the fog" if fog else "the mean is"} "{self.grid}"'

    def _bake_fog(self, obj, path, low, high):
        if not low < self.level < high:
            raise ValueError(
                f'the densities of grid "{self.grid}" go from {low:.3g} to {high:.3g}: take a Density between them, it '
                f"is {self.level:.3g}."
            )
        gn = native()
        read = gn.read_vdb(path, names=[self.grid])
        # Nothing outside of the grid: the surface closes there.
        density = np.pad(read[self.grid], 1)
        step = np.broadcast_to(np.asarray(read["voxel_size"], dtype=np.float64), 3)
        origin = np.asarray(read["origin"]) - step
        vertices, triangles = gn.level_set_mesh(-density, tuple(step), tuple(origin), -self.level)
        size = float(max(vertices.max(axis=0) - vertices.min(axis=0)))
        margin = automatic_margin(DEFAULT_SIGMA * size, size)
        target = files.new_path(obj.name)
        gn.bake_mesh_distance(
            vertices, triangles, str(target), resolution=self.resolution, margin=margin, narrow_band=self.narrow_band
        )
        if len([other for other in bpy.data.objects if other.data == obj.data]) > 1:
            obj.data = obj.data.copy()
        obj.data.is_sequence = False
        files.point(obj.data, target)
        settings = obj.gpis
        settings.sigma, settings.length_scale = DEFAULT_SIGMA * size, DEFAULT_LENGTH_SCALE * size
        settings.bake_margin, settings.bake_resolution = margin, self.resolution
        settings.bake_narrow_band = self.narrow_band


class VIEW3D_MT_gpis_add(bpy.types.Menu):
    bl_label = "GPIS"

    def draw(self, context):
        layout = self.layout
        layout.operator_context = "INVOKE_REGION_WIN"
        for name, label, _, icon in _KINDS:
            layout.operator("gpis.add", text=label, icon=icon).kind = name
        layout.separator()
        layout.operator("gpis.make", text="From Mesh", icon="MESH_DATA")
        layout.operator("gpis.from_volume", text="From Volume", icon="VOLUME_DATA")


def _menu(self, context):
    self.layout.menu(VIEW3D_MT_gpis_add.__name__, icon="OUTLINER_OB_VOLUME")


_CLASSES = (GPIS_OT_add, GPIS_OT_from_volume, VIEW3D_MT_gpis_add)


def register():
    for cls in _CLASSES:
        bpy.utils.register_class(cls)
    bpy.types.VIEW3D_MT_add.append(_menu)


def unregister():
    bpy.types.VIEW3D_MT_add.remove(_menu)
    for cls in reversed(_CLASSES):
        bpy.utils.unregister_class(cls)
