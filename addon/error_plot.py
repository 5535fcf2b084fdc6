"""A small log-log picture of error against seconds, for a panel: pixels alone, nothing of Blender in here."""

import math

import numpy as np

SIZE = 256
_LEFT, _BOTTOM, _RIGHT, _TOP = 46, 26, 10, 18  # margins, in pixels
_GROUND, _GRID, _INK, _CURVE, _GUIDE = 0.11, 0.2, 0.75, (0.33, 0.66, 1.0), 0.42
# Characters of three columns by five rows, a row an octal digit from the top down.
_GLYPHS = {
    "0": 0o75557, "1": 0o26227, "2": 0o71747, "3": 0o71717, "4": 0o55711, "5": 0o74717, "6": 0o74757, "7": 0o71122,
    "8": 0o75757, "9": 0o75717, ".": 0o00002, "%": 0o51245, "s": 0o34216, "m": 0o07755, "h": 0o44755, " ": 0,
}  # fmt: skip


def points(history):
    """Rows (seconds, relative error) of a history: the rounds whose error is known and not zero."""
    rows = [(row["seconds"], row["estimated_error"]) for row in history]
    return [(s, math.sqrt(e)) for s, e in rows if e is not None and e > 0 and s > 0]


def slope(rows):
    """Of log error against log seconds, by least squares; None where the rows span less than a factor of two."""
    if len(rows) < 2 or rows[-1][0] < 2 * rows[0][0]:
        return None
    x, y = np.log(np.array(rows)).T
    return float(np.polyfit(x, y, 1)[0])


def _range(values):
    """Ends of an axis, in log10, about the values and at least half a decade apart."""
    low, high = math.log10(min(values)), math.log10(max(values))
    missing = max(0.0, 0.5 - (high - low)) / 2
    return low - missing - 0.06, high + missing + 0.06


def _ticks(low, high):
    """1, 2, 5 of every decade; where these are many, 1 alone."""
    steps = (1, 2, 5) if high - low < 2.2 else (1,)
    decades = range(math.floor(low), math.ceil(high) + 1)
    return [m * 10.0**d for d in decades for m in steps if low <= math.log10(m) + d <= high]


def _number(value):
    """Three digits and no exponent: there are no characters for one."""
    return np.format_float_positional(value, precision=3, fractional=False, trim="-")


def seconds_text(seconds):
    for length, unit in ((3600, "h"), (60, "m"), (1, "s")):
        if seconds >= length:
            return f"{_number(seconds / length)}{unit}"
    return f"{_number(seconds)}s"


def _write(pixels, text, right, bottom, scale=2):
    """Text whose last column is `right` pixels from the left."""
    x = right - 4 * scale * len(text)
    for character in text:
        glyph = [[int(bit) for bit in f"{int(row, 8):03b}"] for row in f"{_GLYPHS[character]:05o}"]
        block = np.kron(np.array(glyph[::-1]), np.ones((scale, scale))) > 0
        height, width = block.shape
        x0 = min(max(x, 0), SIZE - width)
        pixels[bottom : bottom + height, x0 : x0 + width, :3][block] = _INK
        x += 4 * scale


def _stroke(pixels, a, b, width, color):
    """A line from a to b with smooth edges, and round ends: a dot where they are one point."""
    # Only the pixels about it: a night's history has thousands of strokes.
    ends = np.clip(np.array([a, b]), -SIZE, 2 * SIZE)
    x0, y0 = np.maximum(np.floor(ends.min(0) - width / 2 - 1), (_LEFT, _BOTTOM)).astype(int)
    x1, y1 = np.minimum(np.ceil(ends.max(0) + width / 2 + 1), (SIZE, SIZE - _TOP + 6)).astype(int)
    if x0 >= x1 or y0 >= y1:
        return
    y, x = np.mgrid[y0:y1, x0:x1] + 0.5
    (ax, ay), d = a, np.subtract(b, a)
    along = np.clip(((x - ax) * d[0] + (y - ay) * d[1]) / max(d @ d, 1e-9), 0, 1)
    distance = np.hypot(x - ax - along * d[0], y - ay - along * d[1])
    cover = np.clip(width / 2 + 0.5 - distance, 0, 1)[..., None]
    pixels[y0:y1, x0:x1, :3] += cover * (np.broadcast_to(color, 3) - pixels[y0:y1, x0:x1, :3])


def picture(history):
    """(SIZE, SIZE, 4) float32, row 0 at the bottom; None where fewer than two rounds have an error."""
    rows = points(history)
    if len(rows) < 2:
        return None
    pixels = np.full((SIZE, SIZE, 4), _GROUND, np.float32)
    pixels[..., 3] = 1
    (x0, x1), (y0, y1) = _range([s for s, _ in rows]), _range([e for _, e in rows])
    plot_width, plot_height = SIZE - _LEFT - _RIGHT, SIZE - _BOTTOM - _TOP

    def place(seconds, error):
        right = _LEFT + plot_width * (math.log10(seconds) - x0) / (x1 - x0)
        return right, _BOTTOM + plot_height * (math.log10(error) - y0) / (y1 - y0)

    last = -SIZE
    for seconds in _ticks(x0, x1):
        x = round(place(seconds, 1)[0])
        pixels[_BOTTOM : SIZE - _TOP, x, :3] = _GRID
        text = seconds_text(seconds)
        if x - last > 8 * len(text) + 6:  # no label over another
            _write(pixels, text, x + 4 * len(text), 9)
            last = x
    for error in _ticks(y0, y1):
        y = round(place(1, error)[1])
        pixels[y, _LEFT : SIZE - _RIGHT, :3] = _GRID
        _write(pixels, f"{_number(100 * error)}%", _LEFT - 4, min(y - 5, SIZE - 10))
    # What the error does where twice the samples halve its square, through the last round.
    seconds, error = rows[-1]
    first = 10**x0
    _stroke(pixels, place(first, error * math.sqrt(seconds / first)), place(seconds, error), 1, _GUIDE)
    where = [place(*rows[0])]
    for at in (place(*row) for row in rows[1:]):
        if math.dist(at, where[-1]) > 4 or at == place(*rows[-1]):  # no dot on another
            where.append(at)
    for a, b in zip(where, where[1:], strict=False):
        _stroke(pixels, a, b, 2, _CURVE)
    for at in where:
        _stroke(pixels, at, at, 6, _CURVE)
    return pixels
