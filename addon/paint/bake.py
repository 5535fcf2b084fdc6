"""The .vdb of a painted object as a bake: what was there, and the strokes on it.

A stroke is applied to the grids that the last bake left in memory, only leaves under it change, and then written to a
new version of the file: undo goes back to the version before, as the path and the strokes are data of the Volume. A
file also holds what its painted leaves were before, and the strokes themselves. So out of any one of them a channel is
reset, all is painted again on another grid, and after a crash the last stroke that was written is found again.
"""

import os
from pathlib import Path

import bpy
import numpy as np
from mathutils import Euler

from .. import volume
from ..bake import files
from ..native import native
from . import stroke as strokes
from .stroke import Brush, Stroke

# Grids as they are in a file: (path, what the object says of it) -> native PaintedFields. The last two: two objects are
# painted in turns, no more.
_live = {}
_MOST_LIVE = 2

# A dab on these extends the grid, as the surface may follow it; others are cut at its end.
_EXTENDING = ("mean", "deviation")
# By so much of the grid's longest side, at most, is it extended for one dab; further off than the other it is refused.
_MOST_REACH = 0.25
_MOST_DISTANCE = 2.0


def owner_of(obj):
    return f'GPIS object "{obj.name}"'


def check(obj):
    """ValueError with a sentence where an object cannot be painted on."""
    owner = "The active object" if obj is None else owner_of(obj)
    if obj is None or obj.type != "VOLUME":
        raise ValueError(f"{owner} is no GPIS: select one, or make one (Add, GPIS).")
    if not obj.gpis.enabled:
        raise ValueError(f"{owner} is switched off: switch GPIS on in its Object properties.")
    if obj.library is not None:
        raise ValueError(f"{owner} is linked from another file: make it local (Object, Relations, Make Local).")
    if obj.override_library is not None:
        raise ValueError(
            f"{owner} is a library override, of which Blender does not save what is painted: make it local (Object, "
            "Relations, Make Local)."
        )
    if obj.data.is_sequence:
        raise ValueError(f"{owner} shows a sequence of files: paint on a single one.")
    if not obj.gpis.mean_grid:
        raise ValueError(f"{owner}: choose the grid of its mean (Object properties, GPIS).")


def _source(obj, path, base=False):
    """What the native fields take: the file, and what the object says of it. `base`: nothing was painted on the file."""
    settings = obj.gpis
    source = {"path": path, "mean": settings.mean_grid, "sigma": settings.sigma, "length_scale": settings.length_scale}
    if not settings.sigma > 0:
        raise ValueError(f"its standard deviation σ is {settings.sigma:g}, painting takes one above 0.")
    if settings.sigma_source == "GRID" and not base:
        if settings.sigma_meaning == "UNSET":
            raise ValueError(f'say whether its grid "{settings.sigma_grid}" holds σ or σ² (Object properties, GPIS).')
        least = volume.least(path, settings.sigma_grid)
        if least is not None and least < 0:
            raise ValueError(f'its grid "{settings.sigma_grid}" of σ holds {least:.3g}: a deviation is 0 or more.')
        source["sigma_grid"] = settings.sigma_grid
        source["sigma_meaning"] = "variance" if settings.sigma_meaning == "VARIANCE" else "value"
        source["sigma_factor"] = settings.sigma_factor
    if settings.anisotropy == "AXES":
        source["length_scale"] = _tensor(settings)
    source["anisotropy"] = settings.anisotropy == "GRID" and not base
    source["albedo"] = settings.use_albedo and not base
    return source


def _tensor(settings):
    """A, the squared length scales, of lengths along three axes: (xx, yy, zz, xy, xz, yz)."""
    if any(settings.infinite):
        raise ValueError("its length scale is infinite along an axis, painting takes finite ones (GPIS, Anisotropy).")
    axes = np.array(Euler(settings.rotation).to_matrix())
    a = (axes * (settings.length_scale * np.array(settings.ratios)) ** 2) @ axes.T
    return tuple(a[[0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]])


def _opened(source):
    rest = {key: value for key, value in source.items() if key != "path"}
    return native().PaintedFields(source["path"], **rest)


def _key(source):
    return tuple(source.values())


def fields(obj):
    """The object's fields as they are now, to look at: PaintedFields.values, first_surface, bounds."""
    try:
        source = _source(obj, volume.path_of(obj.data))
        if _key(source) not in _live:
            _keep(source, _opened(source))
    except (ValueError, OSError, RuntimeError) as error:
        raise ValueError(f"{owner_of(obj)}: {error}") from error
    return _live[_key(source)]


def _keep(source, opened):
    _live.pop(_key(source), None)
    while len(_live) >= _MOST_LIVE:
        _live.pop(next(iter(_live)))
    _live[_key(source)] = opened


def forget():
    _live.clear()


class Painting:
    """One stroke in the making: `add` dabs as they come, look at `fields`, then `finish` or `cancel`.

    Until `finish` nothing of the object changes.
    """

    def __init__(self, obj, brush):
        check(obj)
        if brush.channel == "condition":
            raise ValueError("Condition points are no channel of the grid: paint.conditions pins them.")
        self.object = obj
        self.stroke = Stroke(brush)
        self.fields = fields(obj)
        forget()  # what a stroke that fails leaves behind is nobody's
        self._before = _in_use(obj.data.gpis_strokes, brush.channel, self.fields.painted())
        self.counts = {}

    def add(self, dabs):
        if self.stroke.brush.operation == "comb":
            dabs = dabs[np.any(dabs.directions != 0, axis=1)]  # a click says no direction
        if len(dabs):
            _count(self.counts, paint(self.fields, Stroke(self.stroke.brush, dabs)))
            self.stroke.dabs = self.stroke.dabs + dabs

    def finish(self):
        """Bake the stroke; what it changed, as counts."""
        if len(self.stroke.dabs) or self.stroke.brush.operation in strokes.WHOLE:
            text = strokes.appended(self._before, self.stroke)
            commit(self.object, self.fields, text, repeatable=self.stroke.brush.operation != "copy")
        return self.counts

    def cancel(self):
        self.fields = None


# Layer -> the first of its grids, those that a file always has left out.
_GRIDS = {"deviation": "sigma", "anisotropy": volume.ANISOTROPY_GRIDS[0], "albedo": "albedo"}


def _in_use(text, channel, painted):
    """The strokes without those of a channel that begins anew, as the object was given a constant in its place."""
    layer = layer_of(channel)
    if not text or layer not in _GRIDS or _GRIDS[layer] in painted:
        return text
    return "\n".join(stroke.to_line() for stroke in strokes.read(text) if layer_of(stroke.brush.channel) != layer)


def paint(opened, stroke, copied=None):
    """Apply a stroke to native fields; its counts. `copied`: the fields that a channel is copied of."""
    brush = stroke.brush
    if brush.operation == "reset":
        return opened.reset(brush.channel)
    if brush.operation == "mirror":
        axis, from_positive = brush.value
        return opened.mirror(brush.channel, int(axis), bool(from_positive))
    if brush.operation == "extend":
        opened.extend(np.reshape(brush.value, (2, 3)))
        return {}
    if brush.operation == "copy":
        return opened.copy(copied, brush.channel) if copied is not None else {}
    counts = {}
    # Dab by dab where the grid grows, so that it does not matter in which portions they came.
    start = 0
    for i in range(len(stroke.dabs)):
        wanted = _wanted(opened, brush, stroke.dabs, i)
        if wanted is not None:
            _count(counts, _apply(opened, brush, stroke.dabs[start:i]))
            opened.extend(wanted)
            start = i
    _count(counts, _apply(opened, brush, stroke.dabs[start:]))
    return counts


def _count(counts, more):
    for name, number in more.items():
        counts[name] = counts.get(name, 0) + number


def _apply(opened, brush, dabs):
    if not len(dabs):
        return {}
    return opened.apply(
        brush.channel,
        brush.operation,
        dabs.centers,
        radius=dabs.radii,
        strength=dabs.strengths,
        directions=dabs.directions,
        value=brush.value,
        ratios=brush.ratios,
        falloff=brush.falloff,
        curve=brush.curve,
        symmetry=brush.symmetry,
    )


def _wanted(opened, brush, dabs, i):
    """The box that a dab needs where it is more than there is, else None."""
    low, high = np.array(opened.bounds())
    size = (high - low).max()
    centers = strokes.mirrored(dabs.centers[i : i + 1].astype(np.float64), brush.symmetry)
    beyond = max(np.max([low - centers, centers - high]), 0)
    if beyond > _MOST_DISTANCE * size:
        raise ValueError(
            f"A dab at ({', '.join(f'{part:.3g}' for part in centers[0])}) is {beyond:.3g} away from the grid, which is "
            f"{size:.3g} long: paint on the surface, or extend the grid first."
        )
    if brush.channel not in _EXTENDING:
        return None
    reach = min(float(dabs.radii[i]), _MOST_REACH * size)
    box = (
        np.min([low, *(centers - reach)], axis=0),
        np.max([high, *(centers + reach)], axis=0),
    )
    return box if np.any(box[0] < low) or np.any(box[1] > high) else None


def extend(obj, by):
    """`by` more room on all sides of an object's grids."""
    low, high = np.array(fields(obj).bounds())
    painting = Painting(obj, Brush("mean", "extend", value=(*(low - by), *(high + by))))
    paint(painting.fields, painting.stroke)
    painting.finish()


def commit(obj, opened, text, repeatable):
    """Write native fields to a new version of the object's file, and give it that and the strokes. `repeatable`: the
    strokes on what the file was before make it again."""
    data = obj.data
    # σ and ℓ are the object's: what is painted with them is, too.
    if data.library is not None or any(other.data == data and other != obj for other in bpy.data.objects):
        data = obj.data = data.copy()
    path = files.new_path(files.name_of(data.filepath), repeatable=repeatable)
    opened.write(str(path), text.encode())
    files.point(data, path)
    files.trim()
    data.gpis_strokes = text
    take(obj, opened.painted())
    forget()
    _keep(_source(obj, os.path.normpath(path)), opened)


def take(obj, names):
    """Let the object be rendered with painted grids of these names."""
    settings = obj.gpis
    if "sigma" in names:
        settings.sigma_source, settings.sigma_grid = "GRID", "sigma"
        settings.sigma_meaning, settings.sigma_factor = "STANDARD_DEVIATION", 1.0
    if set(volume.ANISOTROPY_GRIDS) <= set(names):
        if settings.anisotropy != "GRID":
            settings.anisotropy_factor = 1.0
        settings.anisotropy = "GRID"
    if "albedo" in names:
        settings.use_albedo = True


def replayed(opened, text):
    """Paint the strokes of a text on fields that nothing was painted on."""
    all_strokes = strokes.read(text)
    for i, stroke in enumerate(all_strokes):
        # A channel that was copied from elsewhere starts there.
        layer = layer_of(stroke.brush.channel)
        later = (other.brush for other in all_strokes[i:])
        copied = any(brush.operation == "copy" and layer_of(brush.channel) == layer for brush in later)
        if stroke.brush.operation == "extend" or not copied:
            paint(opened, stroke)


def layer_of(channel):
    """Length scale and anisotropy are one tensor."""
    return "anisotropy" if channel == "length_scale" else channel


def rebase(obj):
    """Paint the object's strokes on a file that was made without them: its mesh was baked again."""
    # The new file has the room that it needs.
    kept = [stroke for stroke in strokes.read(obj.data.gpis_strokes) if stroke.brush.operation != "extend"]
    text = "\n".join(stroke.to_line() for stroke in kept)
    if not text:
        obj.data.gpis_strokes = ""
        return
    try:
        opened = _opened(_source(obj, volume.path_of(obj.data), base=True))
        replayed(opened, text)
    except (ValueError, OSError, RuntimeError) as error:
        raise ValueError(f"{owner_of(obj)}: its strokes could not be painted again: {error}") from error
    commit(obj, opened, text, repeatable=False)


def rebuild(obj, voxel_size=None):
    """Paint all strokes again, on voxels of another size if one is given; where the object's file is gone, on what
    another version of it holds."""
    check(obj)
    data = obj.data
    try:
        source = _source(obj, str(_present(data)))
        opened = _opened(source)
        opened.restart()
        if voxel_size is not None:
            opened.resample(voxel_size)
        replayed(opened, data.gpis_strokes)
    except (ValueError, OSError, RuntimeError) as error:
        raise ValueError(f"{owner_of(obj)}: {error}") from error
    commit(obj, opened, data.gpis_strokes, repeatable=voxel_size is None)


def rebuild_missing():
    """Paint again what undo came back to, and is no longer on disk."""
    for obj in bpy.data.objects:
        if obj.type == "VOLUME" and obj.library is None and obj.data.library is None and obj.data.gpis_strokes:
            path = Path(bpy.path.abspath(obj.data.filepath))
            if not path.is_file() and not obj.data.packed_file and files.versions_of(path):
                rebuild(obj)


def _present(data):
    """A volume's file, or the next version of it, which goes back to the same before anything was painted."""
    if not data.filepath:
        volume.path_of(data)  # says so
    path = Path(os.path.normpath(bpy.path.abspath(data.filepath, library=data.library)))
    others = files.versions_of(path)
    if path.is_file() or not others:
        return path
    return next((other for other in others if (len(other.name), other.name) > (len(path.name), path.name)), others[-1])


def recoverable(data):
    """The newest version beside a volume's file that goes on with its strokes (painted before a crash), or None."""
    path = Path(os.path.normpath(bpy.path.abspath(data.filepath, library=data.library)))
    for other in reversed(files.versions_of(path)):
        if other == path:
            return None
        try:
            text = native().read_strokes(str(other)).decode()
        except (ValueError, OSError, RuntimeError):
            continue  # no file of ours
        if text != data.gpis_strokes and text.startswith(data.gpis_strokes):
            return other
    return None


def recover(obj):
    """Take what `recoverable` finds; how many strokes came back."""
    check(obj)
    path = recoverable(obj.data)
    if path is None:
        raise ValueError(f"{owner_of(obj)}: beside its file is none that goes on with its strokes.")
    text = native().read_strokes(str(path)).decode()
    more = text.count("\n") - obj.data.gpis_strokes.count("\n") + (not obj.data.gpis_strokes)
    files.point(obj.data, path)
    obj.data.gpis_strokes = text
    take(obj, [name for name in volume.all_grid_names(str(path)) if name != obj.gpis.mean_grid])
    return more
