"""A picture of how good a fit is: the list live, its fit and their difference, at equal samples, with the time each took; and
the numbers that the fit states itself, as colours of its surface."""

import math
import time

import bpy
import numpy as np
from bpy.props import IntProperty

from .. import sync, volume
from ..native import native
from ..sync import camera, gpis
from . import quality
from .work import Asking, Working

_LUMINANCE = (0.2126, 0.7152, 0.0722)
# Samples of a block, of which there must be several to tell the noise.
_BLOCK = 16
# Samples that are enough for colours of a surface, and the part of the progress that they take.
_SEEN_SAMPLES, _SEEN_PART = 16, 0.1


class Comparison:
    """Renders of the frame with the object that has the list, and with the fit in its place."""

    def __init__(self, context, fitted, *, width, samples, seed):
        depsgraph = context.evaluated_depsgraph_get()
        frame = camera.frame_size(context.scene)
        self.size = width, max(1, round(width * frame[1] / frame[0]))
        self.samples, self.seed = samples, seed
        self.fit = native().read_vdb(volume.path_of(fitted.data))
        self._states = []
        for obj in (fitted.gpis_csg.fitted_from, fitted):
            # As a viewport's frame: its depsgraph also holds what is not rendered, the operands.
            state = sync.describe(depsgraph, *self.size, camera.describe(sync.Sync(depsgraph), *self.size))
            names = {fitted.name, fitted.gpis_csg.fitted_from.name}
            objects = state.description["objects"]
            objects[:] = [entry for entry in objects if entry["type"] != "gpis" or entry["name"] not in names]
            evaluated = obj.evaluated_get(depsgraph)
            gpis.add(state, evaluated, evaluated.matrix_world)
            self._states.append(state)

    def run(self, progress):
        """(live, fitted, colours): twice (result, seconds), and what quality.seen gives; None where it was cancelled."""
        out = []
        for k, state in enumerate(self._states):
            try:
                scene = native().Scene(state.description)
                began = time.monotonic()
                result = native().render(
                    scene,
                    *self.size,
                    samples=self.samples,
                    seed=self.seed + k,  # noise of its own
                    progress=lambda fraction, stats, k=k: progress((1 - _SEEN_PART) * (k + fraction) / 2),
                )
            except ValueError as error:
                raise ValueError(sync.explain(state, str(error))) from error
            if result.stats["cancelled"]:
                return None
            out.append((result, time.monotonic() - began))
        description = self._states[1].description
        colours = quality.seen(
            description,
            description["objects"][-1],
            self.fit,
            self.size,
            _SEEN_SAMPLES,
            lambda fraction: progress(1 - _SEEN_PART + _SEEN_PART * fraction),
        )
        return None if colours is None else (*out, colours)


def pixels_of(live, fitted, colours):
    """Pictures side by side (rows H, 3 W, 4), row 0 at the bottom: live, fitted, and their difference times the gain; below
    them the colours, three in a row."""
    a, b = (np.asarray(result.passes["combined"], dtype=np.float32) for result, _ in (live, fitted))
    difference = np.abs(a[..., :3] - b[..., :3])
    gain = 2.0 ** math.floor(math.log2(1 / max(np.percentile(difference, 99.5), 1e-4)))
    opaque = np.ones_like(a[..., :1])
    third, *below = (np.concatenate([picture, opaque], axis=-1) for picture in (gain * difference, *colours))
    rows = [np.concatenate([a, b, third], axis=1)]
    rows += [np.concatenate(below[k : k + 3], axis=1) for k in range(0, len(below), 3)]
    return np.concatenate(rows[::-1]), gain


def sentence(live, fitted, samples, gain, titles):
    a, b = (np.asarray(result.passes["combined"], dtype=float)[..., :3] @ _LUMINANCE for result, _ in (live, fitted))
    noise = sum(np.asarray(result.passes["variance"], dtype=float) @ _LUMINANCE for result, _ in (live, fitted))
    text = f"Live {live[1]:.2g} s, fitted {fitted[1]:.2g} s at {samples} samples. "
    off = np.mean(a - b)
    if samples >= 2 * _BLOCK:
        rms, expected = np.sqrt(np.mean((a - b) ** 2)), np.sqrt(np.mean(noise))
        text += (
            f"Pixels differ by {rms:.2g} (noise alone: {expected:.2g}), the whole picture by {off:+.2g} "
            f"± {np.sqrt(noise.sum()) / noise.size:.1g}. "
        )
    text += f"From left to right: live, fitted, difference times {gain:g}."
    if titles:
        text += f" Below, of the fit where it is seen, violet to yellow: {'; '.join(titles)}."
    return text


def write_image(fitted, name, pixels):
    """The image of a fit's comparison, made (with about that name) or written over."""
    height, width = pixels.shape[:2]
    settings = fitted.gpis_csg
    image = settings.comparison_image
    if any(obj != fitted and obj.gpis_csg.comparison_image == image for obj in bpy.data.objects):
        image = None  # this one is a copy of the object whose image it is
    if image is not None and tuple(image.size) != (width, height):
        bpy.data.images.remove(image)
        image = None
    if image is None:
        image = bpy.data.images.new(name, width, height, alpha=True, float_buffer=True)
        settings.comparison_image = image
    image.use_view_as_render = True
    image.pixels.foreach_set(np.ascontiguousarray(pixels, dtype=np.float32).reshape(-1))
    image.update()
    image.pack()
    return image


def show(context, image):
    """In an Image Editor, where one is open."""
    for window in context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "IMAGE_EDITOR":
                area.spaces.active.image = image
                return


class _Compare:
    """Properties that the dialog and the work share."""

    samples: IntProperty(name="Samples", description="Of both pictures, for each pixel", default=64, min=1, soft_max=4096)
    width: IntProperty(name="Width", description="Pixels of each of the pictures", default=320, min=8, soft_max=1920)
    seed: IntProperty(name="Seed", description="Another seed gives other noise", default=0, min=0)

    @classmethod
    def poll(cls, context):
        obj = context.object
        if obj is None or obj.type != "VOLUME" or obj.gpis_csg.fitted_from is None:
            cls.poll_message_set("Make a GPIS that was fitted to a CSG list the active object first")
            return False
        if not (obj.gpis.enabled and obj.gpis_csg.fitted_from.gpis.enabled):
            cls.poll_message_set("Switch on GPIS, in the Object properties, of both the fit and the object with its list")
            return False
        return True


class GPIS_OT_csg_compare(_Compare, Asking, bpy.types.Operator):
    """Render the CSG list that this was fitted to, and the fit, at equal samples: an image of both and their difference,
    with the time each took, and of the errors, shape and length scales of the fit where it is seen"""

    bl_idname = "gpis.csg_compare"
    bl_label = "Compare with the List"
    bl_options = set()
    runs, handed = "csg_compare_run", ("samples", "width", "seed")

    def draw(self, context):
        layout = self.layout
        layout.use_property_split = True
        for name in self.handed:
            layout.prop(self, name)


class GPIS_OT_csg_compare_run(_Compare, Working, bpy.types.Operator):
    """Render the list and its fit"""

    bl_idname = "gpis.csg_compare_run"
    bl_label = "Compare with the List"
    bl_options = {"INTERNAL", "UNDO"}
    doing = "Rendering the list and its fit"
    cancelled = "The comparison was cancelled."

    def prepare(self, context):
        self._fitted = context.object
        self._comparison = Comparison(context, self._fitted, width=self.width, samples=self.samples, seed=self.seed)
        return self._comparison.run

    def finish(self, context, result):
        *both, colours = result
        pixels, gain = pixels_of(*both, colours)
        settings = self._fitted.gpis_csg
        titles = [quantity.title for quantity in quality.quantities(self._comparison.fit)]
        settings.comparison = sentence(*both, self.samples, gain, titles)
        image = write_image(self._fitted, f"{self._fitted.name}: Live, Fitted, Difference", pixels)
        show(context, image)
        self.report({"INFO"}, f'Image "{image.name}". {settings.comparison}')
        return {"FINISHED"}


_CLASSES = (GPIS_OT_csg_compare, GPIS_OT_csg_compare_run)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
