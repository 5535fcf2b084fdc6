"""The list of operands of a GPIS object -> one CSG tree in the space of that object, with a material for each leaf."""

import numpy as np

from ..native import native
from . import materials
from .state import SyncError, array


def used(settings):
    """The items that count: those that are enabled, or of them those that are solo."""
    items = [item for item in settings.items if item.enabled]
    return [item for item in items if item.solo] or items


def reaches(obj, target):
    """Whether `target` is `obj` or somewhere in its list, or in those of its operands."""
    seen, waiting = set(), [obj]
    while waiting:
        one = waiting.pop()
        if one.name_full == target.name_full:
            return True
        if one.name_full not in seen:
            seen.add(one.name_full)
            waiting.extend(item.object for item in one.gpis_csg.items if item.object is not None)
    return False


def operands(objects):
    """Names of the objects in the lists of GPIS objects: parts of these, and none of their own. (What Blender
    hides in renders it would not evaluate either: an operand that is moved would stand still in an animation.) Objects
    whose lists lead back to themselves are no operands, so that compose() finds them."""
    return {
        item.object.name_full
        for obj in objects
        if obj.type == "VOLUME" and obj.gpis.enabled
        for item in obj.gpis_csg.items
        if item.object is not None and not reaches(item.object, obj)
    }


class Composed:
    """A process or tree, the names of its leaves' materials, and the box around it (min, max)."""

    def __init__(self, process, material_names, bounds):
        self.process, self.materials, self.bounds = process, material_names, bounds


def compose(sync, owner, obj, matrix, process_of, *, above=()):
    """The object with its operands. `process_of(obj)` gives (process, bounds) of one object without its list;
    `above`: names of the objects whose operand this is."""
    process, bounds = process_of(obj)
    result = Composed(process, materials.of_object(sync, obj)[:1], bounds)
    settings = obj.gpis_csg
    shared = settings.correlation == "SHARED"
    for item in used(settings):
        if item.object is None:
            raise SyncError(f"{owner}: its CSG list has a line without an operand: choose one, or remove the line.")
        if item.object.original.name_full in (*above, obj.name_full):
            raise SyncError(
                f'{owner}: its CSG list leads back to itself by "{item.object.name}": remove it from one of the lists.'
            )
        operand = _operand(sync, owner, obj, matrix, item, process_of, above)
        result = _combine(owner, result, operand, item, shared)
    return result


def _operand(sync, owner, obj, matrix, item, process_of, above):
    evaluated = item.object.evaluated_get(sync.depsgraph)
    if evaluated.type != "VOLUME" or not evaluated.gpis.enabled:
        raise SyncError(f'{owner}: the operand "{evaluated.name}" of its CSG list is no GPIS: switch GPIS on, or remove it.')
    placed = array(evaluated.matrix_world)
    if abs(np.linalg.det(placed[:3, :3])) <= 1e-12 * max(np.linalg.norm(placed[:3, :3], axis=0).max(), 1e-30) ** 3:
        raise SyncError(f'{owner}: the operand "{evaluated.name}" is scaled to zero along an axis: clear its scale.')
    operand = compose(sync, owner, evaluated, placed, process_of, above=(*above, obj.name_full))
    to_object = np.linalg.inv(matrix) @ placed
    to_object[3] = (0, 0, 0, 1)
    if not np.allclose(to_object, np.eye(4), rtol=0, atol=1e-12):
        operand.process = operand.process.transformed(to_object)
        operand.bounds = _moved(operand.bounds, to_object)
    return operand


def _combine(owner, a, b, item, shared):
    gn = native()
    names = a.materials + b.materials
    around = tuple(np.minimum(a.bounds[0], b.bounds[0])), tuple(np.maximum(a.bounds[1], b.bounds[1]))
    try:
        if item.operation == "UNION":
            return Composed(gn.union(a.process, b.process, shared_noise=shared), names, around)
        if item.operation == "SMOOTH_UNION":
            tree = gn.smooth_union(a.process, b.process, blend=item.blend, shared_noise=shared)
            return Composed(tree, names, around)
        if item.operation == "DIFFERENCE":
            return Composed(gn.difference(a.process, b.process, shared_noise=shared), names, a.bounds)
        inside = tuple(np.maximum(a.bounds[0], b.bounds[0])), tuple(np.minimum(a.bounds[1], b.bounds[1]))
        if any(low >= high for low, high in zip(*inside, strict=True)):
            raise SyncError(f'{owner}: its bounds and those of "{item.object.name}" do not meet: the intersection is empty.')
        return Composed(gn.intersection(a.process, b.process, shared_noise=shared), names, inside)
    except ValueError as error:
        if isinstance(error, SyncError):
            raise
        raise SyncError(f'{owner}: operand "{item.object.name}": {error}') from error


def _moved(bounds, matrix):
    corners = np.array([[bounds[i >> axis & 1][axis] for axis in range(3)] for i in range(8)])
    corners = corners @ matrix[:3, :3].T + matrix[:3, 3]
    return tuple(corners.min(axis=0)), tuple(corners.max(axis=0))
