"""The viewport's Rendered shading: the frame as it converges, at a part of the resolution, again after each change."""

import bpy
import gpu
import numpy as np
from gpu_extras.presets import draw_texture_2d

from .. import sync
from ..native import native
from ..session import Limits, Session
from ..sync import camera

# Seconds between two looks whether there is a better picture.
_POLL = 0.1

# Previews that render. A timer looks after them: an engine may be gone at any time, and cannot be asked.
_running = set()


class Preview:
    """What one viewport shows: the scene as it last was, the camera it was rendered from, the picture so far."""

    def __init__(self):
        self.scene = None
        self.state = None
        self.view = None
        self.session = None
        self.texture = None
        self.rounds = -1
        self.failure = ""

    def change(self, depsgraph, region_data, size):
        """Read the scene again."""
        self.stop()
        self.failure = ""
        try:
            self.state = sync.describe(depsgraph, *size, camera.of_view(region_data))
            self.scene = native().Scene(self.state.description)
            self.view = None
        except (ValueError, OSError, RuntimeError) as error:
            self._fail(error)

    def look(self, scene, region_data, size):
        """Start again where the view or the size of the picture is another one."""
        view = (size, tuple(tuple(row) for row in region_data.perspective_matrix))
        if self.scene is None or view == self.view:
            return
        self.stop()
        self.view = view
        try:
            self.state.description["camera"] = camera.of_view(region_data)
            self.scene = native().Scene(self.state.description)
            threads = scene.render.threads if scene.render.threads_mode == "FIXED" else 0
            limits = Limits(samples=scene.gpis.preview_samples, seed=scene.gpis.seed, threads=threads)
            self.session = Session(native(), self.scene, *size, limits, patience=0.0)
            self.session.start()
        except (ValueError, OSError, RuntimeError) as error:
            self._fail(error)
            return
        self.rounds = -1
        _running.add(self)
        if not bpy.app.timers.is_registered(_poll):
            bpy.app.timers.register(_poll, first_interval=_POLL)

    def update(self):
        """Take the newest picture; a sentence about how far it is."""
        if self.failure:
            return self.failure
        if self.session is None:
            return ""
        progress = self.session.progress()
        latest = self.session.latest()
        if latest is not None and progress.rounds != self.rounds:
            self.rounds = progress.rounds
            pixels = np.ascontiguousarray(latest.passes["combined"], dtype=np.float32)
            height, width = pixels.shape[:2]
            buffer = gpu.types.Buffer("FLOAT", width * height * 4, pixels.reshape(-1))
            self.texture = gpu.types.GPUTexture((width, height), format="RGBA16F", data=buffer)
        return progress.text()

    def has_news(self):
        return self.session is not None and self.session.progress().rounds != self.rounds

    def is_over(self):
        """Whether the last picture is drawn; a failure of the renderer is kept as a sentence."""
        if self.session is None:
            return True
        if not self.session.wait(0) or self.has_news():
            return False
        try:
            self.session.finish()
        except (ValueError, OSError, RuntimeError, MemoryError) as error:
            self._fail(error)
        return True

    def stop(self):
        _running.discard(self)
        session, self.session = self.session, None
        if session is not None:
            session.cancel()
            try:
                session.finish()
            except (ValueError, OSError, RuntimeError, MemoryError) as error:
                self._fail(error)

    def _fail(self, error):
        text = str(error) or type(error).__name__
        self.failure = sync.explain(self.state, text) if self.state is not None else text
        self.scene = self.session = None


def _poll():
    areas = list(_rendered_areas())
    if not areas:
        stop_all()  # nobody looks any more; an engine does not say when it goes
    over = [preview for preview in _running if preview.is_over()]
    if over or any(preview.has_news() for preview in _running):
        for area in areas:
            area.tag_redraw()
    _running.difference_update(over)
    return _POLL if _running else None


def _rendered_areas():
    for window in bpy.context.window_manager.windows:
        for area in window.screen.areas:
            if area.type == "VIEW_3D" and area.spaces.active.shading.type == "RENDERED":
                yield area


def size_of(region, scene):
    """Pixels of the picture of a region."""
    coarse = int(scene.gpis.preview_pixel)
    return max(1, region.width // coarse), max(1, region.height // coarse)


def draw(engine, context, preview):
    region, scene = context.region, context.scene
    preview.look(scene, context.region_data, size_of(region, scene))
    engine.update_stats("", preview.update())
    if preview.texture is None:
        return
    gpu.state.blend_set("ALPHA_PREMULT")
    engine.bind_display_space_shader(scene)
    draw_texture_2d(preview.texture, (0, 0), region.width, region.height)
    engine.unbind_display_space_shader()
    gpu.state.blend_set("NONE")


def stop_all():
    for preview in list(_running):
        preview.stop()
