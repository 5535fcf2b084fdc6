"""What the overlay shows of a channel: colours on the mean surface with a legend, and ellipses of the bumps."""

from dataclasses import dataclass

import numpy as np

from . import colour

# Ellipses of the bumps, over the whole surface; sides of one.
_ELLIPSES, SIDES = 1500, 12


@dataclass
class Legend:
    """title, and the texts at the low end, in the middle and at the high end of the colour map."""

    title: str
    low: str
    middle: str
    high: str
    span: tuple


@dataclass
class View:
    colours: np.ndarray | None
    legend: Legend | None


def shown(scene, brush, fields, vertices, before=None):
    """The View of the brush's channel at these points. `before`: a legend whose ends stay, as a stroke goes on, unless
    there are values beyond them."""
    if brush.channel == "ALBEDO":
        return View(_display(fields.values("albedo", vertices)), None)
    if brush.channel in {"DEVIATION", "LENGTH_SCALE"}:
        deviation = brush.channel == "DEVIATION"
        values = fields.values(brush.channel.lower(), vertices)
        own = brush.sigma if deviation else brush.length_scale
        low, high = colour.widened(before.span, values) if before else colour.log_range(values, own)
        title = "Deviation σ" if deviation else "Length Scale ℓ"
        texts = [colour.length(scene, value) for value in (low, np.sqrt(low * high), high)]
        return View(colour.of(colour.log_parts(values, low, high)), Legend(title, *texts, (low, high)))
    if brush.channel == "ANISOTROPY":
        values = ratio(fields.values("anisotropy", vertices))
        own = (1.0, max(2.0, float(values.max(initial=0)), _longest(brush.ratios)))
        low, high = colour.widened(before.span, values) if before else own
        texts = [f"{value:.3g} : 1" for value in (low, np.sqrt(low * high), high)]
        legend = Legend("Longest : shortest", *texts, (low, high))
        return View(colour.of(colour.log_parts(values, low, high)), legend)
    return View(None, None)


def holds(legend, brush):
    """Whether what the brush paints has a place on the legend."""
    value = {"DEVIATION": brush.sigma, "LENGTH_SCALE": brush.length_scale, "ANISOTROPY": _longest(brush.ratios)}
    if legend is None or brush.channel not in value:
        return True
    low, high = legend.span
    return (1 - 1e-6) * low <= value[brush.channel] <= (1 + 1e-6) * high


def _longest(ratios):
    return max(ratios) / max(min(ratios), 1e-6)


def _display(linear):
    """Linear colours for a viewport that takes them as they are shown."""
    return np.where(linear <= 0.0031308, 12.92 * linear, 1.055 * np.maximum(linear, 0) ** (1 / 2.4) - 0.055)


def matrices(entries):
    """(N, 6) of xx,yy,zz,xy,xz,yz -> (N, 3, 3)."""
    return entries[:, [[0, 3, 4], [3, 1, 5], [4, 5, 2]]]


def ratio(entries):
    """Longest to shortest length scale."""
    squares = np.linalg.eigvalsh(matrices(entries))
    return np.sqrt(squares[:, 2] / np.maximum(squares[:, 0], 1e-300))


def some_vertices(surface):
    """Indices of the vertices at which bumps are drawn, spread evenly: of each cell of a coarse grid through whose middle
    the surface goes, the one nearest to it."""
    if len(surface.vertices) <= _ELLIPSES:
        return np.arange(len(surface.vertices))
    a, b, c = (surface.vertices[surface.triangles[:, i]] for i in range(3))
    area = np.linalg.norm(np.cross(b - a, c - a), axis=1).sum() / 2
    # A ball of diameter 1 in each of the cells: as many of them are met as the area has squares of their size.
    places = (surface.vertices - surface.low) / np.sqrt(area / _ELLIPSES)
    cells = np.floor(places).astype(int)
    off = np.linalg.norm(places - cells - 0.5, axis=1)
    order = np.lexsort((off, *cells.T))
    new = np.append(True, np.any(np.diff(cells[order], axis=0) != 0, axis=1))
    nearest = order[new]
    return np.sort(nearest[off[nearest] < 0.5])


def ellipses(fields, surface, chosen):
    """Lines (N, SIDES, 2, 3) around sections of the bumps at the chosen vertices, each through its two longest
    directions: combed bumps are needles, discs are round. And (N,) whether there is one to be seen."""
    vertices, normal = surface.vertices[chosen], surface.normals[chosen]
    a = matrices(fields.values("anisotropy", vertices))
    # Where two lengths are nearly alike either direction is right, and that in the surface is seen best.
    least = 0.01 * np.trace(a, axis1=1, axis2=2)[:, None, None]
    squares, vectors = np.linalg.eigh(a - least * normal[:, :, None] * normal[:, None, :])
    lengths = np.sqrt(np.maximum(squares, 0))
    # None where it is as long in every direction: arbitrary axes would look like painted ones.
    strength = np.clip(lengths[:, 2] / np.maximum(lengths[:, 0], 1e-300) - 1, 0, 1)
    half = float(np.linalg.norm(surface.high - surface.low)) / 100 * strength / lengths[:, 2]
    first, second = (vectors[:, :, i] * (half * lengths[:, i])[:, None] for i in (2, 1))
    lifted = vertices + 0.1 * np.linalg.norm(first, axis=1, keepdims=True) * normal
    angle = np.linspace(0, 2 * np.pi, SIDES + 1)[:, None, None]
    around = lifted + np.cos(angle) * first + np.sin(angle) * second
    return np.stack([around[:-1], around[1:]], axis=2).transpose(1, 0, 2, 3), strength >= 0.05


def moved(fields, surface, at=slice(None)):
    """The vertices `at` on the mean surface as it is now: a step of Newton along the gradient as it was."""
    vertices, gradients = surface.vertices[at], surface.gradients[at]
    square = np.sum(gradients**2, axis=1, keepdims=True)
    return vertices - fields.values("mean", vertices)[:, None] * gradients / np.maximum(square, 1e-12)


def pins(conditions, surface):
    """Ends (2 N, 3) of lines that stand on the condition points, along their normals."""
    length = float(np.linalg.norm(surface.high - surface.low)) / 40
    places = np.array([point.location for point in conditions]).reshape(-1, 3)
    normals = np.array([point.normal for point in conditions]).reshape(-1, 3)
    return np.stack([places, places + length * normals], axis=1).reshape(-1, 3)
