"""Sample & Compose → Fit: one GPIS with the moments of an object and its operands, as a new Volume."""

import threading

import bpy
import numpy as np
from bpy.props import EnumProperty, IntProperty

from ..bake import files
from ..native import native
from ..sync import Sync, gpis

METHODS = (
    ("SAMPLE", "Sample", "Draw realisations of all operands together, compose each of them, and sum up", 0),
    (
        "CLOSED_FORM",
        "Closed Form",
        "Clark's formulas: at once, exact for two operands; further ones as if the result so far were normal",
        1,
    ),
)

# Of a node to count in the summary: where the surface may be.
_NEAR = 3.0


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


def summary(fit, realisations, method):
    """Sentences about how well the fit says what was composed."""
    near = np.abs(fit["mean"]) < _NEAR * np.maximum(fit["sigma"], fit["voxel_size"])
    counters = fit["counters"]
    drawn = fit["kolmogorov"] > 0
    lines = [
        f"{counters['voxels']:,} voxels of {fit['voxel_size']:.3g}, {counters['voxels_drawn']:,} sampled"
        f" ({counters['voxels_drawn'] / counters['voxels']:.0%}), {counters['seconds']:.1f} s."
    ]
    if method == "SAMPLE" and counters["voxels_drawn"]:
        sampled = fit["mean_error"] > 0
        lines.append(
            f"{realisations:,} realisations: standard error of the mean up to {fit['mean_error'].max():.2g}, of σ up to "
            f"{fit['sigma_error'].max():.2g} (σ there {np.median(fit['sigma'][sampled]):.2g})."
        )
    if np.any(drawn & near):
        where = drawn & near
        lines.append(
            f"Near the surface {np.mean(drawn[near]):.0%} of the voxels mix operands: Kolmogorov distance to a normal distribution "
            f"{np.median(fit['kolmogorov'][where]):.2g}, at most {fit['kolmogorov'][where].max():.2g}; skewness "
            f"{fit['skewness'][where].min():.2g} to {fit['skewness'][where].max():.2g}."
        )
    else:
        lines.append("Near the surface one operand wins everywhere: the fit is exact.")
    lengths = np.sqrt(np.linalg.eigvalsh(_matrices(fit["anisotropy"][near])))
    if len(lengths):
        lines.append(f"Length scales {lengths.min():.2g} to {lengths.max():.2g}.")
    if counters["length_scales_limited"]:
        lines.append(f"At {counters['length_scales_limited']:,} voxels they were brought into one voxel to 4 diagonals.")
    return " ".join(lines)


def _matrices(entries):
    out = np.empty((len(entries), 3, 3))
    for k, (i, j) in enumerate(((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))):
        out[:, i, j] = out[:, j, i] = entries[:, k]
    return out


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
    for collection in obj.users_collection:
        collection.objects.link(fitted)
    fitted.matrix_world = obj.matrix_world
    settings = fitted.gpis
    settings.mean_grid = "mean"
    settings.sigma_source, settings.sigma_grid, settings.sigma_meaning = "GRID", "sigma", "STANDARD_DEVIATION"
    settings.kernel, settings.anisotropy, settings.anisotropy_factor = "SQUARED_EXPONENTIAL", "GRID", 1.0
    settings.memory = obj.gpis.memory
    settings.enabled = True
    fitted.display_type = "BOUNDS"
    fitted.gpis_csg.quality = sentence
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


class GPIS_OT_csg_fit(_Fit, bpy.types.Operator):
    """Fit one GPIS (mean, σ and length scales that vary) to the object and its operands, as a new Volume"""

    bl_idname = "gpis.csg_fit"
    bl_label = "Sample & Compose → Fit"
    bl_options = {"REGISTER"}

    def invoke(self, context, event):
        self._planned = None
        return context.window_manager.invoke_props_dialog(self, width=360)

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

    def execute(self, context):
        how = "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT"
        values = {name: getattr(self, name) for name in ("resolution", "realisations", "seed", "method")}
        return bpy.ops.gpis.csg_fit_run(how, **values)


class GPIS_OT_csg_fit_run(_Fit, bpy.types.Operator):
    """Fit one GPIS to the object and its operands; Esc cancels"""

    bl_idname = "gpis.csg_fit_run"
    bl_label = "Fit GPIS"
    bl_options = {"INTERNAL", "UNDO"}

    def execute(self, context):
        return self._finish(context, self._start(context, wait=True))

    def invoke(self, context, event):
        self._work = self._start(context, wait=False)
        if self._work is None:
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.1, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        work = self._work
        if event.type == "ESC" and event.value == "PRESS":
            work.cancel()
        if event.type != "TIMER":
            # The scene waits: the fit is of what it was when it began.
            return {"RUNNING_MODAL"}
        context.window_manager.progress_update(100 * work.fraction)
        context.workspace.status_text_set(f"Fitting a GPIS: {work.fraction:.0%}  (Esc: cancel)")
        if work.running():
            return {"RUNNING_MODAL"}
        self._stop(context)
        return self._finish(context, work)

    def cancel(self, context):
        self._work.cancel()
        self._work.join()
        self._stop(context)

    def _stop(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)

    def _start(self, context, wait):
        try:
            work = _Work(self.query(context), self.seed)
        except (ValueError, RuntimeError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return None
        if wait:
            work.join()
        return work

    def _finish(self, context, work):
        if work is None:
            return {"CANCELLED"}
        if work.error is not None:
            self.report({"ERROR"}, str(work.error))
            return {"CANCELLED"}
        if work.result is None:
            self.report({"INFO"}, "The fit was cancelled.")
            return {"CANCELLED"}
        obj = work.query.owner
        sentence = summary(work.result, self.realisations, self.method)
        first, *others = work.query.materials
        if any(other != first for other in others):
            sentence += f' All of it has the material of "{obj.name}"; those of other operands are not kept.'
        fitted = make_volume(context, obj, work.result, sentence)
        self.report({"INFO"}, f'"{fitted.name}" is fitted; "{obj.name}" is no longer rendered itself. {sentence}')
        return {"FINISHED"}


class _Work:
    """A fit in a thread of its own: the native module lets go of Python meanwhile."""

    def __init__(self, query, seed):
        self.query, self.fraction, self.result, self.error = query, 0.0, None, None
        self._cancelled = False
        self._thread = threading.Thread(target=self._run, args=(seed,), daemon=True)
        self._thread.start()

    def _run(self, seed):
        try:
            self.result = self.query.run(seed, self._progress)
        except Exception as error:  # told by whoever looks: a thread has nobody to raise to
            self.error = error

    def _progress(self, fraction):
        self.fraction = fraction
        return not self._cancelled

    def running(self):
        return self._thread.is_alive()

    def cancel(self):
        self._cancelled = True

    def join(self):
        self._thread.join()


_CLASSES = (GPIS_OT_csg_fit, GPIS_OT_csg_fit_run)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
