"""The paper's dense sampler with the paper's settings, on the standard spheres and the dilute medium: a copy of its method in
plain numpy, no code of the renderer's and none of theirs. What [S24]'s public renderer does, and this does:

- a segment of a ray is m values of f drawn jointly, the step the longest at which neighbours have the asked correlation
  (`step_size_cov`) or a given one. The first point lies a tenth of a step from the start, the last at m steps, those between
  are evenly spaced and shifted by one uniform number a segment: they are (m - .1)/(m - 1) steps apart;
- the first segment of a camera ray is drawn given f > 0 at its start; every other given the value and the slope where the last
  one ended. There the slope is drawn given the values of that segment. What else a segment knew is forgotten;
- the first negative value is a hit, its place by linear interpolation, its slope along the ray that of the line between the
  two values; the gradient across the ray is drawn without memory. (Renewal+ as this project and the paper's text have it
  remembers it: `across`.) Roots between two positive values are not seen, and no hit is beyond the bounds;
- light is found by scattering alone.

What differs: factors are made once per shift (16 shifts instead of any), as square roots by the eigensolver, which the public
renderer falls back to where Cholesky fails (a tenth to a half of its factorisations); rays to a sphere begin where the surface is
absent by six deviations; and a last segment keeps its step where theirs shrinks to end at the bounds. That tells in the dilute
medium alone, whose box is not much longer than a segment: with shrunk steps (by sixteenths, 16 pictures) the bias of its mean is
-1.23, -.48, -.78 % (± .04 %) for 8, 32, 16 points where this has -1.34, -.66, -.91 %. They are left out for their time."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from .scenes import LAMBERT, MIRROR, SKY, STANDARD_LENGTH, STANDARD_SIGMA, STANDARD_VIEW, dilute_medium

LUMINANCE = np.array((0.2126, 0.7152, 0.0722))
SHIFTS = 16
BOUNCES = 64  # of the measured render; none of 10⁶ paths gets there
CHUNK = 1 << 14  # rays at a time
FORGOTTEN = 1e6  # a distance: nothing correlates with what is that far


# ---- kernels and settings -------------------------------------------------------------------------------------------


class SquaredExponential:
    """q is in length scales. The slope is in its own deviations, √slope_variance of g a length scale."""

    slope_variance = 1.0

    def covariance(self, q):
        """Of values q apart, of a value with a slope q behind it: κ, -κ'/√slope_variance."""
        return np.exp(-(q**2) / 2), q * np.exp(-(q**2) / 2)

    def across(self, q):
        """Correlation of the derivatives across the line through two points: -κ'(q)/q over slope_variance."""
        return np.exp(-(q**2) / 2)


class Matern52:
    slope_variance = 5 / 3

    def covariance(self, q):
        s = np.sqrt(5) * np.abs(q)
        return (1 + s + s**2 / 3) * np.exp(-s), np.sqrt(5 / 3) * q * (1 + s) * np.exp(-s)

    def across(self, q):
        s = np.sqrt(5) * q
        return (1 + s) * np.exp(-s)


SE, MATERN = SquaredExponential(), Matern52()


@dataclass(frozen=True)
class Setting:
    points: int  # a segment
    step: float  # length scales
    across: bool = False  # remembers the gradient across the ray
    kernel: object = SE


def step_at(correlation, kernel=SE):
    """Where the kernel has that correlation, in length scales: it falls, so by bisection."""
    low, high = 0.0, 10.0
    for _ in range(60):
        middle = (low + high) / 2
        low, high = (middle, high) if kernel.covariance(middle)[0] > correlation else (low, middle)
    return low


SETTINGS = {  # title, points, correlation of neighbours or step
    "published_8": ("dense, paper's 8 points", 8, 0.9, None),
    "published_32": ("dense, paper's 32 points", 32, 0.95, None),
    "published_16": ("dense, paper's 16 points", 16, None, 0.3125),
}


def setting_of(scene_name, key):
    _, points, correlation, step = SETTINGS[key]
    kernel = SCENES[scene_name].body.kernel
    return Setting(points, step or step_at(correlation, kernel), kernel=kernel)


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


# ---- bodies ---------------------------------------------------------------------------------------------------------


class Body:
    """Where f is stochastic. A body says where a line enters and leaves it, and what the mean and its gradient are."""

    def __init__(self, kernel, sigma, length, view):
        self.kernel, self.sigma, self.length, self.view = kernel, sigma, length, view
        self.slope_scale = sigma * np.sqrt(kernel.slope_variance) / length  # one deviation of a slope of f


class Sphere(Body):
    """The mean is the distance from the unit sphere."""

    def crossing(self, at, directions):
        """Distances to where the lines enter and leave; NaN where they pass."""
        along = -dot(at, directions)
        with np.errstate(invalid="ignore"):
            half = np.sqrt(along**2 - dot(at, at) + (1 + 6 * self.sigma) ** 2)
        return along - half, along + half

    def mean(self, at):
        return np.linalg.norm(at, axis=1) - 1

    def mean_along(self, at, directions, t):
        """(n, m), at distances t."""
        return np.sqrt(dot(at, at)[:, None] + t * (t + 2 * dot(at, directions)[:, None])) - 1

    def mean_gradient(self, at):
        return at / np.linalg.norm(at, axis=1, keepdims=True)


class Box(Body):
    """A constant mean between -1 and 1."""

    def __init__(self, level, *rest):
        super().__init__(*rest)
        self.level = level

    def crossing(self, at, directions):
        with np.errstate(divide="ignore", invalid="ignore"):
            sides = np.stack([(-1 - at) / directions, (1 - at) / directions])
        enters, leaves = sides.min(axis=0).max(axis=1), sides.max(axis=0).min(axis=1)
        passes = ~(enters < leaves)
        return np.where(passes, np.nan, enters), np.where(passes, np.nan, leaves)

    def mean(self, at):
        return np.full(len(at), self.level)

    def mean_along(self, at, directions, t):
        return self.level

    def mean_gradient(self, at):
        return np.zeros_like(at)


@dataclass(frozen=True)
class Scene:
    body: Body
    scatter: object
    light: object


STANDARD = Sphere(SE, STANDARD_SIGMA, STANDARD_LENGTH, STANDARD_VIEW)
CRUMBS = Box(1.5, MATERN, 1.0, 0.25, dilute_medium()["camera"])  # as scenes.dilute_medium has them: a test compares
SCENES = {
    "sphere_lambert": Scene(STANDARD, lambert, white),
    "sphere_mirror": Scene(STANDARD, mirror, gradient_sky),
    "dilute": Scene(CRUMBS, lambert, gradient_sky),
}


# ---- a segment's joint Gaussian -------------------------------------------------------------------------------------


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
    m, step, covariance = setting.points, setting.step, setting.kernel.covariance
    at = 0.1 * step + (m - 0.1) * step * np.clip((np.arange(m) - shift) / (m - 1), 0, 1)
    at[-1] = m * step
    gram = covariance(at[:, None] - at)[0]
    value, slope = covariance(at)
    known = np.column_stack([value, slope])  # the start's value and slope are independent and of variance 1
    values, vectors = np.linalg.eigh(gram)
    kept = values > 1e-12 * values[-1]
    end = covariance(at[-1] - at)
    end = -end[1]  # cov(g(s), g'(end)) = κ'(end - s), over the slope's deviation
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


def positive_start(rng, body, at):
    """f given that it is positive, which it seldom is not: by rejection."""
    mean = body.mean(at)
    f = mean + body.sigma * rng.standard_normal(len(mean))
    while np.any(wrong := f <= 0):
        f[wrong] = mean[wrong] + body.sigma * rng.standard_normal(wrong.sum())
    return f


def camera_rays(rng, body, size, pixels):
    """A ray through a uniform point of each of the given pixels (row 0 at the bottom), where it enters the body; those that
    pass it have no start (NaN)."""
    x = (pixels % size + rng.uniform(size=len(pixels))) / size * 2 - 1
    y = (pixels // size + rng.uniform(size=len(pixels))) / size * 2 - 1
    half_width, matrix = np.tan(body.view["fov_x"] / 2), body.view["matrix"]
    directions = np.column_stack([x * half_width, y * half_width, -np.ones(len(pixels))]) @ matrix[:3, :3].T
    directions /= np.linalg.norm(directions, axis=1, keepdims=True)
    eye = np.tile(matrix[:3, 3], (len(pixels), 1))
    return eye + body.crossing(eye, directions)[0][:, None] * directions, directions


def segment(rng, body, rays, pattern, first):
    """f (n, m) at the pattern's points and g, given the start."""
    weights, root = pattern.entering if first else pattern.going_on
    known = [(rays.value - body.mean(rays.at)) / body.sigma]
    if not first:
        known.append((rays.slope - dot(body.mean_gradient(rays.at), rays.direction)) / body.slope_scale)
    g = np.stack(known, axis=1) @ weights.T + rng.standard_normal((len(rays), root.shape[1])) @ root.T
    return body.mean_along(rays.at, rays.direction, body.length * pattern.at) + body.sigma * g, g


def first_hit(f, t, leaves=np.inf):
    """Rays with a negative value after the first point, the first of them at p, hit by the line from p - 1 to p: which rays,
    distance, slope. Beyond where they leave there is nothing to hit."""
    f[:, 0] = np.maximum(f[:, 0], 0)
    below = f[:, 1:] < 0
    p = np.where(below.any(axis=1), below.argmax(axis=1) + 1, 0)
    row = np.flatnonzero(p)
    high, low, start, width = f[row, p[row] - 1], f[row, p[row]], t[p[row] - 1], np.diff(t)[p[row] - 1]
    distance, slope = start + width * high / (high - low), (low - high) / width
    inside = distance < np.broadcast_to(leaves, len(f))[row]
    return row[inside], distance[inside], slope[inside]


def scattered(rng, body, rays, distance, slope, setting, scatter):
    """The rays that leave the hits."""
    at = rays.at + distance[:, None] * rays.direction
    mean_gradient = body.mean_gradient(at)
    across = rng.standard_normal(at.shape)
    if setting.across:
        c = body.kernel.across((rays.travelled + distance) / body.length)[:, None]
        across = c * rays.gradient + np.sqrt(1 - c**2) * across
    gradient = mean_gradient + body.slope_scale * across
    gradient += (slope - dot(gradient, rays.direction))[:, None] * rays.direction
    directions, albedo = scatter(rng, rays.direction, gradient / np.linalg.norm(gradient, axis=1, keepdims=True))
    return Rays(
        at=at, direction=directions, value=np.zeros(len(at)), slope=dot(gradient, directions),
        gradient=(gradient - mean_gradient) / body.slope_scale, travelled=np.zeros(len(at)),
        weight=rays.weight * albedo, pixel=rays.pixel,
    )  # fmt: skip


def gone_on(rng, body, rays, f, g, pattern):
    """The rays at the end of a segment without a hit."""
    t = body.length * pattern.at[-1]
    at = rays.at + t * rays.direction
    weights, left = pattern.slope
    slope = (g @ weights + left * rng.standard_normal(len(at))) * body.slope_scale
    slope += dot(body.mean_gradient(at), rays.direction)
    return Rays(
        at=at, direction=rays.direction, value=f[:, -1], slope=slope, gradient=rays.gradient, travelled=rays.travelled + t,
        weight=rays.weight, pixel=rays.pixel,
    )  # fmt: skip


def trace(rng, size, pixels, setting, scene, counts):
    """Sums of radiance by pixel (size², ) over one path for each entry of `pixels`."""
    body = scene.body
    at, directions = camera_rays(rng, body, size, pixels)
    passing = np.isnan(at[:, 0])
    total = np.bincount(pixels[passing], scene.light(directions[passing]), size**2)
    at, directions, n = at[~passing], directions[~passing], np.count_nonzero(~passing)
    rays = Rays(
        at=at, direction=directions, value=positive_start(rng, body, at), slope=np.zeros(n), gradient=np.zeros((n, 3)),
        travelled=np.full(n, FORGOTTEN), weight=np.ones(n), pixel=pixels[~passing],
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
            f, g = segment(rng, body, some, points, first)
            t, leaves = body.length * points.at, body.crossing(some.at, some.direction)[1]
            on = gone_on(rng, body, some, f, g, points)
            hit, distance, slope = first_hit(f, t, leaves)
            counts["path_vertices"] += len(hit)
            parts.append(scattered(rng, body, some.take(hit), distance, slope, setting, scene.scatter))
            stays = leaves > t[-1]  # not where it is NaN: at the bounds, but for rounding
            stays[hit] = False
            parts.append(on.take(stays))
            gone = ~stays
            gone[hit] = False
            some = some.take(gone)
            total += np.bincount(some.pixel, some.weight * scene.light(some.direction), size**2)
        rays, first = Rays.together(parts), False
        rays = rays.take(rays.weight > LAMBERT["color"][0] ** BOUNCES)
    return total


def picture(scene_name, setting, size, samples, seed, counts):
    """Mean luminance (size, size), row 0 at the bottom, of `samples` paths a pixel."""
    rng, total = np.random.default_rng(seed), np.zeros(size**2)
    pixels = np.tile(np.arange(size**2), samples)
    for start in range(0, len(pixels), CHUNK):
        total += trace(rng, size, pixels[start : start + CHUNK], setting, SCENES[scene_name], counts)
    return total.reshape(size, size) / samples
