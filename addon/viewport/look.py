"""What the overlay shows of an object at the vertices of its mean surface: made once, and after that only where a stroke
goes, for the whole of a large surface takes longer than a dab."""

import numpy as np

from ..paint.stroke import mirrored
from . import channels

GREY = (0.72, 0.72, 0.72)


class Look:
    """`vertices` and `colours` (N, 3) of what is drawn, `shells`: (N, 3) at +σ and at -σ or none, `ellipses` (M, 3) as
    `channels.ellipses` makes them, `legend` of the colours or None.

    `surface` is that of the mean, `shape` the same or a realisation. Without fields all is grey. `moved`: the mean is no
    longer that of the surface. `legend`: one whose ends stay.
    """

    def __init__(self, scene, brush, fields, surface, shape, *, moved=False, legend=None):
        self._scene, self._brush, self._surface = scene, brush, surface
        self.vertices, self.legend = np.array(shape.vertices), legend
        self.colours = np.tile(np.array(GREY), (len(self.vertices), 1))
        self.shells = np.tile(surface.vertices, (2, 1, 1)) if fields is not None and brush.show_shells else ()
        with_ellipses = fields is not None and brush.show_axes and brush.channel == "ANISOTROPY"
        self._bumps = channels.some_vertices(surface) if with_ellipses else np.empty(0, dtype=int)
        self._lines = np.empty((len(self._bumps), channels.SIDES, 2, 3))
        self._seen = np.zeros(len(self._bumps), dtype=bool)
        if fields is not None:
            self._show(fields, slice(None), slice(None), moved)
        else:
            self.legend = None

    @property
    def ellipses(self):
        return self._lines[self._seen].reshape(-1, 3)

    def follow(self, fields, dabs, symmetry):
        """Look again at the vertices of the mean's surface where these dabs changed the fields; how many."""
        # A value is interpolated between the nodes of a voxel, and one of them may lie under the brush.
        at = near(self._surface.vertices, dabs, symmetry, margin=float(np.sum(fields.voxel_size())))
        if len(at):
            self._show(fields, at, np.isin(self._bumps, at), moved=True)
        return len(at)

    def _show(self, fields, at, bumps, moved):
        surface = self._surface
        if moved and self._brush.channel == "MEAN":
            self.vertices[at] = channels.moved(fields, surface, at)
        if self._brush.show_channel:
            self._colour(fields, at)
        if len(self.shells):
            way = fields.values("deviation", surface.vertices[at])[:, None] * surface.normals[at]
            for side, shell in zip((1, -1), self.shells, strict=True):
                shell[at] = surface.vertices[at] + side * way
        if len(self._bumps):
            self._lines[bumps], self._seen[bumps] = channels.ellipses(fields, surface, self._bumps[bumps])


    def _colour(self, fields, at):
        view = channels.shown(self._scene, self._brush, fields, self.vertices[at], self.legend)
        known, self.legend = self.legend, view.legend
        if known is not None and known.span != view.legend.span:
            at = slice(None)  # each value has another colour now
            view = channels.shown(self._scene, self._brush, fields, self.vertices, self.legend)
        if view.colours is not None:
            self.colours[at] = view.colours


def near(places, dabs, symmetry, margin):
    """Indices of the places (N, 3) that dabs reach, or their mirror images, with a margin around them."""
    reached = np.zeros(len(places), dtype=bool)
    centers = mirrored(dabs.centers.astype(np.float64), symmetry)
    radii = np.resize(dabs.radii.astype(np.float64) + margin, len(centers))
    for center, radius in zip(centers, radii, strict=True):
        at = np.flatnonzero(np.abs(places[:, 0] - center[0]) < radius)  # most are out already
        reached[at[np.linalg.norm(places[at] - center, axis=1) < radius]] = True
    return np.flatnonzero(reached)
