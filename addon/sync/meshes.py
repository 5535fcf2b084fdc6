"""Evaluated meshes (modifiers applied; curves and text arrive as meshes too) and their instances -> `meshes`,
`objects`.
"""

import numpy as np

from . import materials
from .state import SyncError, array


def add(sync, obj, matrix_world):
    mesh = obj.data
    matrix = array(matrix_world)
    names = materials.of_object(sync, obj)
    # Instances share the evaluated mesh: one entry for all of them, told apart by its address within this evaluation.
    key = f"{mesh.name_full} {mesh.as_pointer():x}"
    flattened = _flattens(matrix)
    if flattened:  # a mesh of its own, in the world
        key += f" of {obj.name} {len(sync.description['objects'])}"
    if key not in sync.description["meshes"]:
        arrays = describe(mesh, len(names))
        if arrays is None:
            return  # no faces: nothing to see, in Cycles too
        bad = np.flatnonzero(~np.isfinite(arrays["vertices"]).all(axis=1))
        if bad.size:
            raise SyncError(
                f'Object "{obj.name}": vertex {bad[0]} of its mesh (modifiers applied) has a coordinate that is not a '
                "finite number. Delete the vertex, or look for the modifier that made it."
            )
        if flattened:
            arrays["vertices"] = arrays["vertices"] @ matrix[:3, :3].T + matrix[:3, 3]
            arrays.pop("normals", None)  # all in one plane
        sync.description["meshes"][key] = arrays
        sync.mesh_owners[key] = obj.name
    _warn_about_flags(sync, obj)
    sync.description["objects"].append(
        {"name": obj.name, "type": "mesh", "mesh": key, "matrix": np.eye(4) if flattened else matrix, "materials": names}
    )


def _flattens(matrix):
    """Scaled to zero along an axis or two, as artists flatten meshes: the transform has no inverse, the faces are there."""
    linear = matrix[:3, :3]
    return linear.any() and abs(np.linalg.det(linear)) <= 1e-12 * np.prod(np.linalg.norm(linear, axis=1))


def triangles(mesh):
    """(vertices (N,3), triangles (M,3), corners (M,3)); corners index the mesh's face corners."""
    mesh.calc_loop_triangles()
    count = len(mesh.loop_triangles)
    vertices = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
    mesh.vertices.foreach_get("co", vertices)
    corners = np.empty(count * 3, dtype=np.int32)
    mesh.loop_triangles.foreach_get("loops", corners)
    # Reading corners and indexing is faster than loop_triangles' own vertices (.4 s against .65 s for 2 million).
    corner_vertices = np.empty(len(mesh.loops), dtype=np.int32)
    mesh.attributes[".corner_vert"].data.foreach_get("value", corner_vertices)
    return vertices.reshape(-1, 3), corner_vertices[corners].reshape(-1, 3).astype(np.uint32), corners.reshape(-1, 3)


def describe(mesh, slots):
    """The arrays of one mesh, None where it has no faces."""
    if len(mesh.polygons) == 0:
        return None
    vertices, indices, corners = triangles(mesh)
    result = {"vertices": vertices, "triangles": indices}
    normals = _normals(mesh, corners)
    if normals is not None:
        result["normals"] = normals
    if slots > 1:
        index = np.empty(len(indices), dtype=np.int32)
        mesh.loop_triangles.foreach_get("material_index", index)
        result["material_index"] = np.clip(index, 0, slots - 1)  # as Blender shows faces whose slot was removed
    return result


def _normals(mesh, corners):
    """Shading normals: None for flat faces, (N,3) where all is smooth, (M,3,3) where the mesh has both."""
    if mesh.normals_domain == "FACE":
        return None
    if mesh.normals_domain == "POINT":
        normals = np.empty(len(mesh.vertices) * 3, dtype=np.float32)
        mesh.vertex_normals.foreach_get("vector", normals)
        return normals.reshape(-1, 3)
    normals = np.empty(len(mesh.loops) * 3, dtype=np.float32)
    mesh.corner_normals.foreach_get("vector", normals)
    return normals.reshape(-1, 3)[corners]


def _warn_about_flags(sync, obj):
    for flag, words in (("is_holdout", "a holdout"), ("is_shadow_catcher", "a shadow catcher")):
        if getattr(obj, flag, False):
            sync.warn(f'Object "{obj.name}" is {words}: the GPIS engine renders it as an ordinary object.')
