"""The render engine: takes a frame from Blender, lets a session render it, hands back pixels and sentences."""

import logging
from pathlib import Path

import bpy

from . import passes, statistics, sync
from .native import native
from .session import Limits, Session
from .sync import camera
from .viewport import preview

# Seconds between two looks at Esc and the progress: short enough to feel at once, long enough to cost nothing.
_POLL = 0.1

_log = logging.getLogger(__name__)


class GPISRenderEngine(bpy.types.RenderEngine):
    bl_idname = "GPIS"
    bl_label = "GPIS"
    bl_use_preview = False
    bl_use_eevee_viewport = True
    bl_use_shading_nodes_custom = False

    # Blender makes instances only to list passes and runs __init__ twice: no state is kept here but that of a viewport,
    # from its first picture on.
    _preview = None

    def update_render_passes(self, scene, view_layer):
        for entry in passes.enabled(view_layer):
            self.register_pass(scene, view_layer, entry.name, entry.channels, entry.chan_id, entry.kind)

    def render(self, depsgraph):
        # Only a report of type ERROR makes Blender's render fail; after an exception it would write an image.
        try:
            render_frame(self, depsgraph)
        except (ValueError, OSError, RuntimeError, MemoryError) as error:
            self.report({"ERROR"}, str(error) or type(error).__name__)
        except Exception as error:
            _log.exception("The render failed")
            self.report({"ERROR"}, f"The GPIS engine failed ({type(error).__name__}): {error}")

    def view_update(self, context, depsgraph):
        if self._preview is None:
            self._preview = preview.Preview()
        self._preview.change(depsgraph, context.region_data, preview.size_of(context.region, context.scene))

    def view_draw(self, context, depsgraph):
        if self._preview is not None:
            preview.draw(self, context, self._preview)


def limits_of(scene, view_layer):
    """The Sampling panel as a session's limits; ValueError where nothing ends the render. A view layer may have a
    number of samples of its own."""
    gpis = scene.gpis
    return Limits(
        samples=view_layer.samples or gpis.samples if gpis.use_samples else None,
        time_limit=gpis.time_limit or None,
        noise_threshold=gpis.noise_threshold if gpis.use_noise_threshold else None,
        seed=gpis.seed,
        threads=scene.render.threads if scene.render.threads_mode == "FIXED" else 0,
    )


def render_frame(engine, depsgraph):
    scene = depsgraph.scene
    view_layer = depsgraph.view_layer
    x0, y0, x1, y1 = camera.border(scene)
    width, height = x1 - x0, y1 - y0
    limits = limits_of(scene, view_layer)
    renderer = native()

    engine.update_stats("", "Reading the scene")
    state = sync.describe(depsgraph, width, height)
    for sentence in state.warnings:
        engine.report({"WARNING"}, sentence)
    try:
        native_scene = renderer.Scene(state.description)
        watched = not bpy.app.background and not engine.is_animation
        session = Session(renderer, native_scene, width, height, limits, watched)
        passes.add(engine, view_layer)
        result = _run(engine, session, view_layer, width, height)
    except (ValueError, OSError) as error:
        raise ValueError(sync.explain(state, str(error))) from error
    if result is None:
        return  # cancelled before there was anything to keep
    lost = statistics.lost(result.stats)
    for sentence in lost:
        engine.report({"WARNING"}, sentence)
    plan = {sync.explain(state, key): sentence for key, sentence in native_scene.plan().items()}
    entry = statistics.record(
        scene.name, view_layer.name, scene.frame_current, session, result, plan, [*state.warnings, *lost]
    )
    # An F12 in the window writes no picture by itself, so there is nothing to write beside; the panel saves it.
    if scene.gpis.write_statistics and not watched and session.stop != "cancelled":
        path = _beside_image(engine, scene, view_layer)
        if path is not None:
            _write_beside(engine, entry, path)


def _run(engine, session, view_layer, width, height):
    """Poll the session, show every round, stop at Esc; the last result."""
    session.start()
    shown = 0
    target = None
    try:
        while not session.wait(_POLL):
            if engine.test_break():
                session.cancel()
            progress = session.progress()
            engine.update_progress(progress.fraction)
            engine.update_stats("", progress.text())
            if progress.rounds > shown:
                shown = progress.rounds
                target = target or engine.begin_result(0, 0, width, height, layer=view_layer.name)
                passes.write(target.layers[0], session.latest())
                engine.update_result(target)
    except BaseException:
        session.cancel()
        raise
    finally:
        try:
            result = session.finish()
        except BaseException:
            if target is not None:
                engine.end_result(target, cancel=True)
            raise
    if result is not None:
        target = target or engine.begin_result(0, 0, width, height, layer=view_layer.name)
        passes.write(target.layers[0], result)
        _stamp(engine, session)
    if target is not None:
        engine.end_result(target)
    return result


def _stamp(engine, session):
    """The history of the render, and its end in words, as metadata of the image."""
    end = session.history[-1]
    whole = engine.get_result()
    whole.stamp_data_add_field("gpis.samples", str(end["samples"]))
    whole.stamp_data_add_field("gpis.seconds", f"{end['seconds']:.2f}")
    whole.stamp_data_add_field("gpis.estimated_error", str(end["estimated_error"]))
    whole.stamp_data_add_field("gpis.history", statistics.history_text(session.history))


def _beside_image(engine, scene, view_layer):
    """The image's path with .json for its extension; Blender numbers the frames of an animation only. None where the output
    path names a folder and no file, as in every new scene: a picture whose name is an extension alone is kept by nobody."""
    render = scene.render
    if not engine.is_animation and (not render.filepath or render.filepath.endswith(("/", "\\"))):
        return None
    path = render.frame_path(frame=scene.frame_current) if engine.is_animation else render.filepath
    path = bpy.path.abspath(path)
    if path.endswith(render.file_extension):
        path = path[: -len(render.file_extension)]
    if sum(layer.use for layer in scene.view_layers) > 1:
        path += f".{bpy.path.clean_name(view_layer.name)}"
    return path + ".json"


def _write_beside(engine, entry, path):
    """Never over a file that is not ours."""
    place = statistics.free_place(path)
    if place is not None:
        statistics.write(entry, place)
    if place != Path(path):
        instead = f"are in {place.name}" if place is not None else "were not written"
        engine.report({"WARNING"}, f"{path} is no file of GPIS and is kept: the statistics {instead}")


def register():
    bpy.utils.register_class(GPISRenderEngine)


def unregister():
    preview.stop_all()
    bpy.utils.unregister_class(GPISRenderEngine)
