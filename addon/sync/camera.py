"""The camera -> `camera` of the description.

Focal length, sensor, sensor fit and shift all end in Blender's projection matrix; the description's few numbers are
read back from it, so no rule of Blender's is written a second time here.
"""

import math

import numpy as np

from .state import SyncError, array

# Widths of an orthographic view that its camera steps back, to see what is in front of the plane of the view.
_BEHIND = 100.0


def describe(sync, width, height):
    """The part of the frame that the render border keeps is a camera of its own: narrower and shifted."""
    camera = sync.scene.camera
    if camera is None:
        raise SyncError(f'Scene "{sync.scene.name}" has no camera: add one, or choose it in the Scene properties.')
    if camera.type != "CAMERA":
        raise SyncError(
            f'Scene "{sync.scene.name}" looks through "{camera.name}", an object of type {camera.type}: choose a '
            "camera in the Scene properties."
        )
    camera = camera.evaluated_get(sync.depsgraph)
    data = camera.data
    if data.type not in {"PERSP", "ORTHO"}:
        raise SyncError(
            f'Camera "{camera.name}" is of type {data.type}: the GPIS engine renders perspective and '
            "orthographic cameras."
        )
    if sync.scene.render.use_multiview:
        raise SyncError("Stereoscopy is switched on: the GPIS engine renders one view. Switch it off in Output.")
    if data.dof.use_dof:
        sync.warn(f'Camera "{camera.name}" renders without depth of field: the GPIS engine does not have it.')

    render = sync.scene.render
    aspect = render.pixel_aspect_x / render.pixel_aspect_y
    if abs(aspect - 1) > 1e-6:
        raise SyncError(
            f"The pixel aspect is {render.pixel_aspect_x:g} to {render.pixel_aspect_y:g}: the GPIS engine renders "
            "square pixels. Set both to 1 in Output."
        )
    full_width, full_height = frame_size(sync.scene)
    projection = array(camera.calc_matrix_camera(sync.depsgraph, x=full_width, y=full_height, scale_x=1, scale_y=1))
    # Frame coordinates, −1 to 1, of the part that is rendered, and what they are on the camera's plane.
    x0, y0, x1, y1 = border(sync.scene)
    left, right = (2 * x / full_width - 1 for x in (x0, x1))
    bottom, top = (2 * y / full_height - 1 for y in (y0, y1))
    orthographic = data.type == "ORTHO"
    offset = projection[:2, 3] if orthographic else -projection[:2, 2]
    scale = np.array([projection[0, 0], projection[1, 1]])
    low = (np.array([left, bottom]) - offset) / scale
    high = (np.array([right, top]) - offset) / scale
    size = high - low
    shift = (low + high) / 2 / max(size)  # in units of the larger side

    result = {
        "type": "orthographic" if orthographic else "perspective",
        "matrix": rigid(array(camera.matrix_world)),
        "shift": shift,
        "clip": (data.clip_start, data.clip_end),
    }
    if orthographic:
        result["width"] = size[0]
    else:
        result["fov_x"] = 2 * math.atan(size[0] / 2)
    return result


def of_view(region_data):
    """The camera of a 3D viewport, for a picture that fills its region."""
    projection = array(region_data.window_matrix)
    orthographic = not region_data.is_perspective
    offset = projection[:2, 3] if orthographic else -projection[:2, 2]
    extent = 2 / np.array([projection[0, 0], projection[1, 1]])
    result = {
        "type": "orthographic" if orthographic else "perspective",
        "matrix": rigid(np.linalg.inv(array(region_data.view_matrix))),
        "shift": -offset / 2 * extent / max(extent),
        # An orthographic view begins behind the eye.
        "clip": (0.0 if orthographic else 1e-3, math.inf),
    }
    if orthographic:
        result["matrix"][:3, 3] += _BEHIND * extent[0] * result["matrix"][:3, 2]
        result["width"] = extent[0]
    else:
        result["fov_x"] = 2 * math.atan(extent[0] / 2)
    return result


def frame_size(scene):
    """Pixels of the full frame, rounded as Blender does."""
    render = scene.render
    percentage = render.resolution_percentage / 100
    return max(1, int(render.resolution_x * percentage)), max(1, int(render.resolution_y * percentage))


def border(scene):
    """The rendered part of the frame in pixels: x0, y0, x1, y1."""
    width, height = frame_size(scene)
    render = scene.render
    if not render.use_border:
        return 0, 0, width, height
    x0, x1 = int(render.border_min_x * width), int(render.border_max_x * width)
    y0, y1 = int(render.border_min_y * height), int(render.border_max_y * height)
    return x0, y0, x1, y1


def rigid(matrix):
    """A camera's scale does not change its picture: only place and direction count."""
    matrix = matrix.copy()
    lengths = np.linalg.norm(matrix[:3, :3], axis=0)
    if not np.all(lengths > 0):
        raise SyncError("The camera is scaled to zero: clear its scale.")
    matrix[:3, :3] /= lengths
    return matrix
