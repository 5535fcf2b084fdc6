"""Paths of a conditioned process along a line, by regression in numpy: kernels written out anew, no code of the renderer.

With d = x - p, r = |d|, a = -κ'/r and b = -a'/r: Cov(f(x), ∂ⱼf(p)) = a dⱼ and Cov(∂ᵢf(x), ∂ⱼf(p)) = a δᵢⱼ - b dᵢ dⱼ.
"""

from functools import cache

import numpy as np

# Of the variance, on what is known: as little as double precision inverts, and as much as rows that are left out (those
# that the others determine to it) would tell.
NOISE, LEFT_OUT = 1e-13, 1e-10
STEP = 0.02  # in length scales; between two nodes a path is taken for straight


def squared_exponential(r):
    e = np.exp(-0.5 * r * r)
    return e, e, e


def matern52(r):
    e = np.exp(-np.sqrt(5) * r)
    return (1 + np.sqrt(5) * r + 5 / 3 * r * r) * e, 5 / 3 * (1 + np.sqrt(5) * r) * e, 25 / 3 * e


KERNELS = {"squared exponential": squared_exponential, "matern 5/2": matern52}


def covariance(kernel, x, p, gradients_x=False, gradients_p=False):
    """Of f (and then of ∂f by component) at x (N, 3) with that at p (M, 3)."""
    d = x[:, None] - p[None]
    value, a, b = KERNELS[kernel](np.linalg.norm(d, axis=2))
    columns = [value] + ([a * d[..., j] for j in range(3)] if gradients_p else [])
    rows = [np.concatenate(columns, axis=1)]
    for i in range(3 if gradients_x else 0):
        columns = [-a * d[..., i]]
        for j in range(3 if gradients_p else 0):
            columns.append(a * (i == j) - b * d[..., i] * d[..., j])
        rows.append(np.concatenate(columns, axis=1))
    return np.concatenate(rows, axis=0)


@cache
def normals(n, columns):
    return np.random.default_rng(17).normal(size=(n, columns))


def first_hits(kernel, points, values, gradients, origin, direction, length, n, noise=NOISE):
    """Of paths that are outside (f > 0) at the start; inf where there is none. gradients: (M, 3), or None."""
    t = np.linspace(0, length, round(length / STEP) + 1)
    x = np.asarray(origin, float) + t[:, None] * np.asarray(direction, float)
    known = np.concatenate([values, gradients.T.ravel()]) if gradients is not None else np.asarray(values)
    more = gradients is not None
    gram = covariance(kernel, points, points, more, more) + noise * np.eye(len(known))
    cross = covariance(kernel, x, points, False, more)
    factor = np.linalg.cholesky(gram)
    half = np.linalg.solve(factor, cross.T)
    mean = half.T @ np.linalg.solve(factor, known)
    variances, axes = np.linalg.eigh(covariance(kernel, x, x) - half.T @ half)
    kept = variances > 1e-13
    f = mean[:, None] + (axes[:, kept] * np.sqrt(variances[kept])) @ normals(n, len(t))[:, : kept.sum()].T
    f = f[:, f[0] > 0]
    below = f <= 0
    first = np.argmax(below, axis=0)
    path = np.arange(f.shape[1])
    hit = below[first, path]
    a, b = f[first - 1, path], f[first, path]
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.where(hit, t[first - 1] + STEP * a / (a - b), np.inf)
