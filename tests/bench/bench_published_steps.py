"""What the published settings of the dense sampler lose: roots of the standard sphere's rays between values on a grid.

Plain numpy, no code of ours: sample paths of the sphere (length scale .1, deviation .05) on a grid of a hundredth of a length
scale, the squared exponential as white noise under a Gaussian (error of its correlation below 1e-7), and the same paths seen
only at every so many of its points, the root by linear interpolation. The published renderer chooses points so that
neighbours have correlation .9 (.459 length scales; 8 a segment), its 32 points and its default .95 (.32); the measured one 16
of .3125 length scales. Its segments forget what was before them, which is not in these numbers."""

import time

import numpy as np

LENGTH, SIGMA = 0.1, 0.05
FINE, NODES = 0.01, 0.5  # spacings in length scales
STEPS = {"8 points at .9": 46, "32 points at .95": 32, "16 points, as measured": 31}  # in fine ones


def noise(rng, n, points):
    """g at 0, FINE, 2 FINE, ... in n rows, and its slope at 0, per length scale."""
    t = FINE * np.arange(points)
    at = NODES * np.arange(-10, int(t[-1] / NODES) + 12)
    away = t[:, None] - at
    window = (2 / np.pi) ** 0.25 * np.sqrt(NODES) * np.exp(-(away**2))
    xi = rng.normal(size=(n, len(at)))
    return xi @ window.T, xi @ (-2 * away[0] * window[0])


def mean(origins, directions, points):
    t = LENGTH * FINE * np.arange(points)
    along = np.sum(origins * directions, axis=1)[:, None]
    return np.sqrt(np.sum(origins**2, axis=1)[:, None] + t * (t + 2 * along)) - 1


def first_below(f):
    """Index of the first negative value, -1 where there is none."""
    return np.where((f < 0).any(axis=1), np.argmax(f < 0, axis=1), -1)


def lost(f, step):
    """f (N, points), not negative at 0. Per ray with a root: none seen, a later one seen; and the distance of the root seen by
    linear interpolation, in length scales, where it is the right one."""
    true = first_below(f)
    seen = step * first_below(f[:, ::step])
    hit = true > 0
    missed, later = hit & (seen < 0), hit & (seen >= true + step)
    right = hit & (seen >= true) & ~later
    rows, k = np.flatnonzero(right), seen[right]
    low, high = f[rows, k - step], f[rows, k]
    root = k - step + step * low / (low - high)
    m = true[right]
    exact = m - 1 + f[rows, m - 1] / (f[rows, m - 1] - f[rows, m])
    return hit.sum(), missed.sum(), later.sum(), np.sum(np.abs(root - exact)) * FINE


def camera_rays(rng, n):
    """Parallel rays over the disk of the sphere and its rim, from where it is certainly absent."""
    b = 1.2 * np.sqrt(rng.uniform(size=n))
    start = np.sqrt(np.maximum(1.3**2 - b**2, 0))
    return np.column_stack([b, np.zeros(n), start]), np.tile([0.0, 0, -1.0], (n, 1))


def leaving_slopes(rng, m, s):
    """Slopes of rays that leave a surface (definitions B3): density proportional to v₊ N(v; m, s²), by rejection."""
    v, left = np.empty(len(m)), np.arange(len(m))
    while len(left):
        drawn = m[left] + s * rng.normal(size=len(left))
        taken = rng.uniform(size=len(left)) * (m[left] + 6 * s) < drawn
        v[left[taken]] = drawn[taken]
        left = left[~taken]
    return v


def leaving_rays(rng, n):
    """Lambert's directions from a point of the mean surface where f = 0, under what memory Renewal knows."""
    u, angle = rng.uniform(size=n), 2 * np.pi * rng.uniform(size=n)
    directions = np.column_stack([np.sqrt(u) * np.cos(angle), np.sqrt(u) * np.sin(angle), np.sqrt(1 - u)])
    return np.tile([0.0, 0, 1.0], (n, 1)), directions


def paths(kind, rng, n):
    if kind == "camera":
        points = int(2.7 / LENGTH / FINE)
        origins, directions = camera_rays(rng, n)
        return mean(origins, directions, points) + SIGMA * noise(rng, n, points)[0]
    points = int(1.0 / LENGTH / FINE)
    origins, directions = leaving_rays(rng, n)
    t = FINE * np.arange(points)
    g, slope = noise(rng, n, points)
    wanted = (leaving_slopes(rng, directions[:, 2], SIGMA / LENGTH) - directions[:, 2]) * LENGTH / SIGMA
    kappa = np.exp(-(t**2) / 2)
    g = g - kappa * g[:, :1] + t * kappa * (wanted - slope)[:, None]
    f = mean(origins, directions, points) + SIGMA * g
    f[:, 0] = 0
    return f


def bench_published_steps(quick=False):
    """Two rows a setting: camera rays and rays that leave the surface."""
    total = 5_000 if quick else 100_000
    rows = []
    for kind in ("camera", "leaving"):
        sums, start = {name: np.zeros(4) for name in STEPS}, time.process_time()
        rng = np.random.default_rng(1)
        for _ in range(total // 1000):
            f = paths(kind, rng, 1000)
            for name, step in STEPS.items():
                sums[name] += lost(f, step)
        for name, (hits, missed, later, away) in sums.items():
            error = 100 * np.sqrt((missed + later) / hits**2)
            rows.append(
                {"rays": kind, "points": name, "hits": int(hits), "no root seen, %": 100 * missed / hits}
                | {"a later root seen, %": 100 * later / hits, "+-": error}
                | {"root off by, length scales": away / (hits - missed - later), "s": time.process_time() - start}
            )
    return rows
