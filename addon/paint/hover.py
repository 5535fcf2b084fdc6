"""What is under the brush: a ray of the view against the mean surface of an object."""

from dataclasses import dataclass

import numpy as np
from bpy_extras import view3d_utils
from mathutils import Vector


@dataclass
class Hover:
    """Where the brush is over a surface."""

    location: np.ndarray  # in object space
    normal: np.ndarray  # in object space, towards the outside
    world: Vector
    world_normal: Vector
    metres_per_pixel: float  # in the plane of the screen there
    scale: float  # world lengths to object units


def scale_of(matrix):
    """Mean factor of a transform on lengths."""
    return abs(matrix.to_3x3().determinant()) ** (1 / 3)


def under(region, region_data, obj, fields, xy):
    """The Hover at pixel `xy` of a region, or None where the mean surface is not there."""
    matrix = obj.matrix_world
    scale = scale_of(matrix)
    if scale == 0:
        return None
    inverse = matrix.inverted()
    origin = view3d_utils.region_2d_to_origin_3d(region, region_data, xy)
    direction = view3d_utils.region_2d_to_vector_3d(region, region_data, xy)
    start = np.array(inverse @ origin)
    along = np.array(inverse.to_3x3() @ direction)
    length = np.linalg.norm(along)
    found = fields.first_surface(tuple(start), tuple(along / length))
    if found is None:
        return None
    _, location, gradient = found
    normal = np.array(gradient) / max(np.linalg.norm(gradient), 1e-30)
    world = matrix @ Vector(location)
    world_normal = (inverse.to_3x3().transposed() @ Vector(normal)).normalized()
    here = view3d_utils.region_2d_to_location_3d(region, region_data, xy, world)
    beside = view3d_utils.region_2d_to_location_3d(region, region_data, (xy[0] + 100, xy[1]), world)
    return Hover(np.array(location), normal, world, world_normal, (beside - here).length / 100, scale)


def on_plane(region, region_data, obj, xy, depth):
    """The point in object space under pixel `xy`, as deep in the view as the world point `depth`."""
    return np.array(obj.matrix_world.inverted() @ view3d_utils.region_2d_to_location_3d(region, region_data, xy, depth))


def radius_of(settings, hover):
    """Radius of the brush in object units."""
    metres = settings.radius if settings.radius_unit == "SCENE" else settings.view_radius * hover.metres_per_pixel
    return metres / hover.scale


def ring(hover, radius, points=64):
    """World points of the brush's circle on the surface: (points, 3)."""
    normal = Vector(hover.world_normal)
    first = normal.orthogonal().normalized()
    second = normal.cross(first)
    angle = np.linspace(0, 2 * np.pi, points)[:, None]
    return np.array(hover.world) + radius * hover.scale * (np.cos(angle) * first + np.sin(angle) * second)


def projected(region, region_data, points):
    """World points in pixels of the region, as (N, 3) with depth 0; those behind the eye are left out."""
    pixels = [view3d_utils.location_3d_to_region_2d(region, region_data, Vector(point)) for point in points]
    return np.array([(pixel.x, pixel.y, 0.0) for pixel in pixels if pixel is not None]).reshape(-1, 3)


def circle(place, radius, points=64):
    """A circle in pixels of the region."""
    angle = np.linspace(0, 2 * np.pi, points)
    flat = np.zeros(points)
    return np.stack([place[0] + radius * np.cos(angle), place[1] + radius * np.sin(angle), flat], axis=1)
