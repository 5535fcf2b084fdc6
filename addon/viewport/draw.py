"""Drawing with the GPU: a shaded surface with a colour at each vertex, and lines in front of it."""

import gpu
import numpy as np
from gpu_extras.batch import batch_for_shader
from mathutils import Vector

_shaders = {}
# Where the lamp is, seen from the eye: a little above and to the left.
_LAMP = Vector((-0.35, 0.45, 0.82))

_VERTEX = """
void main()
{
  shade_normal = normal;
  base_color = color;
  gl_Position = transform * vec4(position, 1.0);
}
"""

# A lamp beside the eye, in object space; the back of an open surface is darker.
_FRAGMENT = """
void main()
{
  float brightness = 0.55 + 0.45 * dot(normalize(shade_normal), light.xyz);
  // The view's buffer takes linear numbers, colours are given as they are to be seen.
  frag_color = vec4(pow(base_color.rgb * brightness, vec3(2.2)), base_color.a * light.w);
}
"""


def _surface_shader():
    if "surface" not in _shaders:
        between = gpu.types.GPUStageInterfaceInfo("gpis_surface")
        between.smooth("VEC3", "shade_normal")
        between.smooth("VEC4", "base_color")
        info = gpu.types.GPUShaderCreateInfo()
        info.push_constant("MAT4", "transform")
        info.push_constant("VEC4", "light")
        info.vertex_in(0, "VEC3", "position")
        info.vertex_in(1, "VEC3", "normal")
        info.vertex_in(2, "VEC4", "color")
        info.vertex_out(between)
        info.fragment_out(0, "VEC4", "frag_color")
        info.vertex_source(_VERTEX)
        info.fragment_source(_FRAGMENT)
        _shaders["surface"] = gpu.shader.create_from_info(info)
    return _shaders["surface"]


def surface_batch(vertices, normals, triangles, colours):
    """colours: (N, 3) or (N, 4)."""
    rgba = np.ones((len(vertices), 4), dtype=np.float32)
    rgba[:, : colours.shape[1]] = colours
    content = {
        "position": np.ascontiguousarray(vertices, dtype=np.float32),
        "normal": np.ascontiguousarray(normals, dtype=np.float32),
        "color": rgba,
    }
    return batch_for_shader(_surface_shader(), "TRIS", content, indices=np.ascontiguousarray(triangles, dtype=np.int32))


def surface(batch, matrix, region_data, opacity=1.0):
    """Draw a batch of `surface_batch`; matrix: object to world."""
    shader = _surface_shader()
    shader.bind()
    shader.uniform_float("transform", region_data.perspective_matrix @ matrix)
    eye = region_data.view_matrix.inverted_safe().to_3x3()
    light = matrix.to_3x3().transposed() @ (eye @ _LAMP)
    light.normalize()
    shader.uniform_float("light", (*light, opacity))
    transparent = opacity < 1
    gpu.state.depth_test_set("LESS_EQUAL")
    gpu.state.depth_mask_set(not transparent)
    gpu.state.blend_set("ALPHA" if transparent else "NONE")
    batch.draw(shader)
    gpu.state.depth_mask_set(False)
    gpu.state.blend_set("NONE")
    gpu.state.depth_test_set("NONE")


def lines(points, colour, matrix=None, width=1.5, depth=True, kind="LINES"):
    """points (2 N, 3) in object space (world without a matrix), in the current view."""
    if len(points) < 2:
        return
    shader = _line_shader()
    batch = batch_for_shader(shader, kind, {"pos": np.ascontiguousarray(points, dtype=np.float32)})
    gpu.state.blend_set("ALPHA")
    gpu.state.depth_test_set("LESS_EQUAL" if depth else "NONE")
    shader.bind()
    shader.uniform_float("viewportSize", gpu.state.viewport_get()[2:])
    shader.uniform_float("lineWidth", width)
    shader.uniform_float("color", colour)
    if matrix is None:
        batch.draw(shader)
    else:
        with gpu.matrix.push_pop():
            gpu.matrix.multiply_matrix(matrix)
            batch.draw(shader)
    gpu.state.depth_test_set("NONE")
    gpu.state.blend_set("NONE")


def _line_shader():
    return gpu.shader.from_builtin("POLYLINE_UNIFORM_COLOR")


def triangles(points, colours):
    """Coloured triangles in pixels of the region: points (3 N, 2), colours (3 N, 4)."""
    shader = gpu.shader.from_builtin("SMOOTH_COLOR")
    gpu.state.blend_set("ALPHA")
    content = {
        "pos": np.ascontiguousarray(np.pad(points, ((0, 0), (0, 1))), dtype=np.float32),
        "color": np.ascontiguousarray(colours, dtype=np.float32),
    }
    batch_for_shader(shader, "TRIS", content).draw(shader)
    gpu.state.blend_set("NONE")


def forget():
    _shaders.clear()
