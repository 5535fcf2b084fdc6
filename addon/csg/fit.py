"""Sample & Compose → Fit: one GPIS with the moments of an object and its operands, as a new Volume."""

import bpy
from bpy.props import EnumProperty, IntProperty

from ..bake import files
from ..native import native
from ..sync import Sync, gpis
from .quality import summary
from .work import Asking, Working

METHODS = (
    ("SAMPLE", "Sample", "Draw realisations of all operands together, compose each of them, and sum up", 0),
    (
        "CLOSED_FORM",
        "Closed Form",
        "By formulas: at once, exact for two operands; further ones as if the result so far were normal",
        1,
    ),
)


class _Query:
    """What compose_and_fit takes, from an object with its list."""

    def __init__(self, context, obj, *, resolution, realisations, method):
        depsgraph = context.evaluated_depsgraph_get()
        self.owner = obj
        composed = gpis.composed_of(Sync(depsgraph), obj.evaluated_get(depsgraph))
        self.materials = composed.materials
        self.arguments = ([composed.process], "union", composed.bounds, resolution, realisations)
        self.method = method.lower()

    def plan(self):
        return native().compose_and_fit_plan(*self.arguments, method=self.method)

    def run(self, seed, progress):
        return native().compose_and_fit(*self.arguments, seed, method=self.method, progress=progress)


def make_volume(context, obj, fit, sentence):
    """The fit as a new GPIS object in place of `obj`, which is no longer rendered itself."""
    path = files.new_path(f"{obj.name} Fit")
    native().write_vdb(str(path), fit)
    data = bpy.data.volumes.new(f"{obj.name} Fit")
    data.filepath = bpy.path.relpath(str(path)) if bpy.data.filepath else str(path)
    data.gpis_baked = True
    material = obj.material_slots[0].material if obj.material_slots else None
    data.materials.append(material)
    fitted = bpy.data.objects.new(f"{obj.name} Fit", data)
    # What is linked from another file cannot be added to.
    own = [collection for collection in obj.users_collection if collection.library is None]
    for collection in own or [context.collection]:
        collection.objects.link(fitted)
    fitted.matrix_world = obj.matrix_world
    settings = fitted.gpis
    settings.mean_grid = "mean"
    settings.sigma_source, settings.sigma_grid, settings.sigma_meaning = "GRID", "sigma", "STANDARD_DEVIATION"
    settings.kernel, settings.anisotropy, settings.anisotropy_factor = "SQUARED_EXPONENTIAL", "GRID", 1.0
    settings.memory = obj.gpis.memory
    # Not rendered, grids are; what a brush begins with follows them.
    settings.sigma, settings.length_scale = obj.gpis.sigma, obj.gpis.length_scale
    settings.enabled = True
    fitted.display_type = "BOUNDS"
    fitted.gpis_csg.quality, fitted.gpis_csg.fitted_from = sentence, obj
    obj.hide_render = True
    for other in context.selected_objects:
        other.select_set(False)
    fitted.select_set(True)
    context.view_layer.objects.active = fitted
    return fitted


class _Fit:
    """Properties that the dialog and the work share."""

    resolution: IntProperty(
        name="Resolution", description="Grid nodes along the longest side of the bounds", default=64, min=8, max=512, soft_max=256
    )
    realisations: IntProperty(
        name="Realisations",
        description="Joint realisations of the operands. Errors fall as one over its square root; memory does not grow",
        default=1000,
        min=2,
        soft_max=100_000,
        max=100_000_000,
    )
    seed: IntProperty(name="Seed", description="Another seed draws other realisations", default=0, min=0)
    method: EnumProperty(name="Method", description="How the moments are found", items=METHODS, default="SAMPLE")

    @classmethod
    def poll(cls, context):
        obj = context.object
        if obj is None or obj.type != "VOLUME" or not obj.gpis.enabled:
            cls.poll_message_set("Make a GPIS with a CSG list the active object first")
            return False
        if not obj.gpis_csg.items:
            cls.poll_message_set("Add operands to the CSG list first")
            return False
        return True

    def query(self, context):
        return _Query(context, context.object, resolution=self.resolution, realisations=self.realisations, method=self.method)


class GPIS_OT_csg_fit(_Fit, Asking, bpy.types.Operator):
    """Fit one GPIS (mean, σ and length scales that vary) to the object and its operands, as a new Volume"""

    bl_idname = "gpis.csg_fit"
    bl_label = "Sample & Compose → Fit"
    bl_options = set()
    runs, handed = "csg_fit_run", ("resolution", "realisations", "seed", "method")

    def invoke(self, context, event):
        self._planned = None
        return super().invoke(context, event)

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        layout.prop(self, "method")
        layout.prop(self, "resolution")
        if self.method == "SAMPLE":
            layout.prop(self, "realisations")
            layout.prop(self, "seed")
        column = layout.column(align=True)
        for line in self._estimate(context):
            column.label(text=line)

    def _estimate(self, context):
        key = (self.resolution, self.realisations, self.method)
        if self._planned is None or self._planned[0] != key:
            try:
                plan = self.query(context).plan()
                x, y, z = plan["resolution"]
                lines = [
                    f"{x} × {y} × {z} voxels of {plan['voxel_size']:.3g}",
                    f"{plan['voxels_drawn'] / plan['voxels']:.0%} of them are uncertain and sampled"
                    if self.method == "SAMPLE"
                    else "Nothing is sampled",
                    f"About {bpy.utils.smpte_from_seconds(plan['seconds'])[:8]} and {plan['memory'] / 2**20:.0f} MB",
                ]
            except (ValueError, RuntimeError, OSError) as error:
                lines = [str(error)]
            self._planned = (key, lines)
        return self._planned[1]


class GPIS_OT_csg_fit_run(_Fit, Working, bpy.types.Operator):
    """Fit one GPIS to the object and its operands; Esc cancels"""

    bl_idname = "gpis.csg_fit_run"
    bl_label = "Fit GPIS"
    bl_options = {"INTERNAL", "UNDO"}
    doing = "Fitting a GPIS"
    cancelled = "The fit was cancelled."

    def prepare(self, context):
        query, seed = self.query(context), self.seed
        self._query = query
        return lambda progress: query.run(seed, progress)

    def finish(self, context, result):
        obj = self._query.owner
        sentence = summary(result, self.realisations, self.method)
        first, *others = self._query.materials
        if any(other != first for other in others):
            sentence += f' All of it has the material of "{obj.name}"; those of other operands are not kept.'
        if obj.library is not None:
            sentence += f' "{obj.name}" is linked: hide it by yourself, for that is not kept in this file.'
        fitted = make_volume(context, obj, result, sentence)
        self.report({"INFO"}, f'"{fitted.name}" is fitted; "{obj.name}" is no longer rendered itself. {sentence}')
        return {"FINISHED"}


_CLASSES = (GPIS_OT_csg_fit, GPIS_OT_csg_fit_run)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
