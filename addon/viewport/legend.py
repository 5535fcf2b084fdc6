"""The legend of the overlay's colour map, beside the view's left edge, and text in the view."""

import blf
import numpy as np

from . import colour, draw

_STEPS = 32
_SIZE = 12


def text(context, string, x, y, size=_SIZE, align="LEFT"):
    """A text in pixels of the region, readable on any background."""
    blf.size(0, size * context.preferences.system.ui_scale)
    width, _ = blf.dimensions(0, string)
    blf.enable(0, blf.SHADOW)
    blf.shadow(0, 5, 0.0, 0.0, 0.0, 0.9)
    blf.color(0, 1.0, 1.0, 1.0, 1.0)
    blf.position(0, x - (width / 2 if align == "CENTER" else 0), y, 0)
    blf.draw(0, string)
    blf.disable(0, blf.SHADOW)


def draw_legend(context, legend):
    scale = context.preferences.system.ui_scale
    toolbar = next((region.width for region in context.area.regions if region.type == "TOOLS"), 0)
    x, y = toolbar + 24 * scale, 64 * scale  # above the panel of the last operator
    width, height = 16 * scale, 160 * scale
    parts = np.linspace(0, 1, _STEPS + 1)
    colours = np.hstack([colour.of(parts), np.ones((_STEPS + 1, 1))])
    points, tints = [], []
    for i in range(_STEPS):
        low, high = y + parts[i] * height, y + parts[i + 1] * height
        corners = [(x, low), (x + width, low), (x + width, high), (x, high)]
        ends = [colours[i], colours[i], colours[i + 1], colours[i + 1]]
        for corner in (0, 1, 2, 0, 2, 3):
            points.append(corners[corner])
            tints.append(ends[corner])
    draw.triangles(np.array(points), np.array(tints))
    for part, string in ((0, legend.low), (0.5, legend.middle), (1, legend.high)):
        text(context, string, x + width + 8 * scale, y + part * height - 4 * scale)
    text(context, legend.title, x, y + height + 14 * scale, 13)
