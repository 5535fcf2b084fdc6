"""The paper's dense sampler with the paper's settings, on the standard sphere: a copy of its method in plain numpy, no code of
the renderer's and none of theirs. What [S24]'s public renderer does, and this does:

- a segment of a ray is m values of f drawn jointly, the step the longest at which neighbours have the asked correlation
  (`step_size_cov`) or a given one. The first point lies a tenth of a step from the start, the last at m steps, those between
  are evenly spaced and shifted by one uniform number a segment: they are (m - .1)/(m - 1) steps apart;
- the first segment of a camera ray is drawn given f > 0 at its start; every other given the value and the slope where the last
  one ended. There the slope is drawn given the values of that segment. What else a segment knew is forgotten;
- the first negative value is a hit, its place by linear interpolation, its slope along the ray that of the line between the
  two values; the gradient across the ray is drawn without memory. (Renewal+ as this project and the paper's text have it
  remembers it: `across`.) Roots between two positive values are not seen;
- light is found by scattering alone.

What differs: factors are made once per shift (16 shifts instead of any), as square roots by the eigensolver, which the public
renderer falls back to where Cholesky fails (a tenth to a half of its factorisations); rays begin where the surface is absent
by six deviations, and a last segment keeps its step where theirs shrinks to end at the bounds."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .scenes import LAMBERT, MIRROR, SKY, STANDARD_LENGTH, STANDARD_SIGMA

LUMINANCE = np.array((0.2126, 0.7152, 0.0722))
OUTSIDE = 1 + 6 * STANDARD_SIGMA  # radius
SHIFTS = 16
BOUNCES = 64  # of the measured render; none of 10⁶ paths gets there
CHUNK = 1 << 14  # rays at a time
EYE, HALF_WIDTH = 4.0, np.tan(np.radians(35) / 2)  # scenes.STANDARD_VIEW


@dataclass(frozen=True)
class Setting:
    points: int  # a segment
    step: float  # length scales
    across: bool = False  # remembers the gradient across the ray


def step_at(correlation):
    """Where the squared exponential has that correlation, in length scales."""
    return float(np.sqrt(-2 * np.log(correlation)))


SETTINGS = {
    "published_8": ("dense, paper's 8 points", Setting(8, step_at(0.9))),
    "published_32": ("dense, paper's 32 points", Setting(32, step_at(0.95))),
    "published_16": ("dense, paper's 16 points", Setting(16, 0.3125)),
}
TIMED = ("sphere_lambert", "published_16")  # the scene and the setting whose rate is known; all others are given that rate


def lambert(rng, directions, normals):
    """Cosine-weighted directions about the normals, and the albedo."""
    on_sphere = rng.standard_normal(normals.shape)
    out = normals + on_sphere / np.linalg.norm(on_sphere, axis=1, keepdims=True)
    return out / np.linalg.norm(out, axis=1, keepdims=True), LAMBERT["color"][0]


def mirror(rng, directions, normals):
    return directions - 2 * np.sum(directions * normals, axis=1, keepdims=True) * normals, MIRROR["color"][0]


def white(directions):
    return np.ones(len(directions))


def gradient_sky(directions):
    """Luminance of scenes.SKY: linear between the centres of its rows, which follow latitude."""
    rows = SKY["image"][:, 0].astype(np.float32) @ LUMINANCE
    latitude = 0.5 + np.arcsin(np.clip(directions[:, 2], -1, 1)) / np.pi
    return np.interp(latitude * len(rows) - 0.5, np.arange(len(rows)), rows)


SCENES = {"sphere_lambert": (lambert, white), "sphere_mirror": (mirror, gradient_sky)}  # scatter, light


# ---- a segment's joint Gaussian -------------------------------------------------------------------------------------


def covariance(q):
    """Of values q apart (length scales), of a value with a slope q behind it: κ, -κ'."""
    return np.exp(-(q**2) / 2), q * np.exp(-(q**2) / 2)


def square_root(matrix):
    """R (m, r) with R Rᵀ = matrix, without the directions that are nothing but rounding."""
    values, vectors = np.linalg.eigh(matrix)
    kept = values > 1e-14 * values[-1]
    return vectors[:, kept] * np.sqrt(values[kept])


@dataclass(frozen=True)
class Pattern:
    """One shift of the points: where they are, what they are given the start, and what the end's slope is given them."""

    at: np.ndarray  # (m,) length scales from the start
    entering: tuple  # weights (m, 1) of the start's value, root (m, r)
    going_on: tuple  # weights (m, 2) of the start's value and slope, root
    slope: tuple  # weights (m,) of the values in the slope at the last point, and what deviation is left


def pattern(setting, shift):
    m, step = setting.points, setting.step
    at = 0.1 * step + (m - 0.1) * step * np.clip((np.arange(m) - shift) / (m - 1), 0, 1)
    at[-1] = m * step
    gram = covariance(at[:, None] - at)[0]
    value, slope = covariance(at)
    known = np.column_stack([value, slope])  # the start's value and slope are independent and of variance 1
    values, vectors = np.linalg.eigh(gram)
    kept = values > 1e-12 * values[-1]
    end = covariance(at[-1] - at)
    end = -end[1]  # cov(g(s), g'(end)) = κ'(end - s)
    projected = vectors[:, kept].T @ end
    weights = vectors[:, kept] @ (projected / values[kept])
    left = np.sqrt(max(0.0, 1 - np.sum(projected**2 / values[kept])))
    entering = known[:, :1], square_root(gram - known[:, :1] @ known[:, :1].T)
    return Pattern(at, entering, (known, square_root(gram - known @ known.T)), (weights, left))


@lru_cache(maxsize=8)
def patterns(setting):
    return [pattern(setting, (k + 0.5) / SHIFTS) for k in range(SHIFTS)]


# ---- paths ----------------------------------------------------------------------------------------------------------


class Rays:
    """Arrays of what a ray carries: where its next segment starts, its direction, f and its slope there, ∇g at its start in
    deviations per length scale, how far that is, throughput, pixel."""

    NAMES = ("at", "direction", "value", "slope", "gradient", "travelled", "weight", "pixel")

    def __init__(self, **arrays):
        for name in self.NAMES:
            setattr(self, name, arrays[name])

    def __len__(self):
        return len(self.at)

    def take(self, which):
        return Rays(**{name: getattr(self, name)[which] for name in self.NAMES})

    @staticmethod
    def together(parts):
        return Rays(**{name: np.concatenate([getattr(p, name) for p in parts]) for name in Rays.NAMES})


def dot(a, b):
    return np.einsum("ij,ij->i", a, b)


def positive_start(rng, mean):
    """f given that it is positive, where it is so but for 10⁻⁹: by rejection."""
    f = mean + STANDARD_SIGMA * rng.standard_normal(len(mean))
    while np.any(wrong := f <= 0):
        f[wrong] = mean[wrong] + STANDARD_SIGMA * rng.standard_normal(wrong.sum())
    return f


def camera_rays(rng, size, pixels):
    """A ray through a uniform point of each of the given pixels (row 0 at the bottom), at the sphere's outside; those that pass
    it have no start (NaN)."""
    x = (pixels % size + rng.uniform(size=len(pixels))) / size * 2 - 1
    y = (pixels // size + rng.uniform(size=len(pixels))) / size * 2 - 1
    directions = np.column_stack([x * HALF_WIDTH, y * HALF_WIDTH, -np.ones(len(pixels))])
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    along = -EYE * directions[:, 2]
    with np.errstate(invalid="ignore"):
        distance = along - np.sqrt(along**2 - EYE**2 + OUTSIDE**2)
    return np.array([0, 0, EYE]) + distance[:, None] * directions, directions


def segment(rng, rays, pattern, first):
    """f (n, m) at the pattern's points and g, given the start."""
    radius = np.linalg.norm(rays.at, axis=1)
    g0 = (rays.value - (radius - 1)) / STANDARD_SIGMA
    weights, root = pattern.entering if first else pattern.going_on
    known = [g0]
    if not first:
        mean_slope = dot(rays.at, rays.direction) / radius
        known.append((rays.slope - mean_slope) * STANDARD_LENGTH / STANDARD_SIGMA)
    g = np.stack(known, axis=1) @ weights.T + rng.standard_normal((len(rays), root.shape[1])) @ root.T
    t = STANDARD_LENGTH * pattern.at
    mean = np.sqrt((radius**2)[:, None] + t * (t + 2 * dot(rays.at, rays.direction)[:, None])) - 1
    return mean + STANDARD_SIGMA * g, g


def first_hit(f, t):
    """Index p of the first negative value after the first point (0: none), distance and slope by the line from p - 1 to p."""
    f[:, 0] = np.maximum(f[:, 0], 0)
    below = f[:, 1:] < 0
    p = np.where(below.any(axis=1), below.argmax(axis=1) + 1, 0)
    row = np.flatnonzero(p)
    high, low, start, width = f[row, p[row] - 1], f[row, p[row]], t[p[row] - 1], np.diff(t)[p[row] - 1]
    return row, start + width * high / (high - low), (low - high) / width


def scattered(rng, rays, distance, slope, setting, scatter):
    """The rays that leave the hits."""
    at = rays.at + distance[:, None] * rays.direction
    mean_gradient = at / np.linalg.norm(at, axis=1, keepdims=True)
    scale = STANDARD_SIGMA / STANDARD_LENGTH
    across = rng.standard_normal(at.shape)
    if setting.across:
        c = np.exp(-(((rays.travelled + distance) / STANDARD_LENGTH) ** 2) / 2)[:, None]
        across = c * rays.gradient + np.sqrt(1 - c**2) * across
    gradient = mean_gradient + scale * across
    gradient += (slope - dot(gradient, rays.direction))[:, None] * rays.direction
    directions, albedo = scatter(rng, rays.direction, gradient / np.linalg.norm(gradient, axis=1, keepdims=True))
    return Rays(
        at=at, direction=directions, value=np.zeros(len(at)), slope=dot(gradient, directions),
        gradient=(gradient - mean_gradient) / scale, travelled=np.zeros(len(at)), weight=rays.weight * albedo, pixel=rays.pixel,
    )  # fmt: skip


def gone_on(rng, rays, f, g, pattern):
    """The rays at the end of a segment without a hit."""
    t = STANDARD_LENGTH * pattern.at[-1]
    at = rays.at + t * rays.direction
    weights, left = pattern.slope
    slope = (g @ weights + left * rng.standard_normal(len(at))) * STANDARD_SIGMA / STANDARD_LENGTH
    slope += dot(at, rays.direction) / np.linalg.norm(at, axis=1)
    return Rays(
        at=at, direction=rays.direction, value=f[:, -1], slope=slope, gradient=rays.gradient, travelled=rays.travelled + t,
        weight=rays.weight, pixel=rays.pixel,
    )  # fmt: skip


def trace(rng, size, pixels, setting, scatter, light, counts):
    """Sums of radiance by pixel (size², ) over one path for each entry of `pixels`."""
    at, directions = camera_rays(rng, size, pixels)
    passing = np.isnan(at[:, 0])
    total = np.bincount(pixels[passing], light(directions[passing]), size**2)
    at, directions, n = at[~passing], directions[~passing], np.count_nonzero(~passing)
    nothing = np.zeros((n, 3))
    rays = Rays(
        at=at, direction=directions, value=positive_start(rng, np.linalg.norm(at, axis=1) - 1), slope=np.zeros(n),
        gradient=nothing, travelled=np.full(n, np.inf), weight=np.ones(n), pixel=pixels[~passing],
    )  # fmt: skip
    first = True
    while len(rays):
        parts, turn = [], rng.integers(SHIFTS)
        counts["line_segments"] += len(rays)
        counts["line_evaluations"] += len(rays) * setting.points
        for k, points in enumerate(patterns(setting)):
            some = rays.take(slice((k + turn) % SHIFTS, None, SHIFTS))
            if not len(some):
                continue
            f, g = segment(rng, some, points, first)
            on = gone_on(rng, some, f, g, points)
            hit, distance, slope = first_hit(f, STANDARD_LENGTH * points.at)
            counts["path_vertices"] += len(hit)
            parts.append(scattered(rng, some.take(hit), distance, slope, setting, scatter))
            parts.append(on.take(np.setdiff1d(np.arange(len(some)), hit, assume_unique=True)))
        rays, first = Rays.together(parts), False
        gone = (np.linalg.norm(rays.at, axis=1) > OUTSIDE) & (dot(rays.at, rays.direction) > 0)
        total += np.bincount(rays.pixel[gone], rays.weight[gone] * light(rays.direction[gone]), size**2)
        rays = rays.take(~gone & (rays.weight > LAMBERT["color"][0] ** BOUNCES))
    return total


def picture(scene_name, setting, size, samples, seed, counts):
    """Mean luminance (size, size), row 0 at the bottom, of `samples` paths a pixel."""
    scatter, light = SCENES[scene_name]
    rng, total = np.random.default_rng(seed), np.zeros(size**2)
    pixels = np.tile(np.arange(size**2), samples)
    for start in range(0, len(pixels), CHUNK):
        total += trace(rng, size, pixels[start : start + CHUNK], setting, scatter, light, counts)
    return total.reshape(size, size) / samples
