"""Stochastic leaves whose realisations numpy can draw on the x axis, and trees of them, for the tests of CSG."""

import gpis_native as gn
import numpy as np
from tensor_grids import along_x, isotropic

BOUNDS = ((-1, -3, -3), (5, 3, 3))  # rays run along the x axis from 0 to 4: no end of bounds has a part in it
X = np.linspace(0, 4, 321)


def rays(n):
    return np.zeros((n, 3)), np.tile([1.0, 0.0, 0.0], (n, 1))


def normals(covariance, n, rng):
    values, vectors = np.linalg.eigh(covariance)
    return rng.normal(size=(n, len(covariance))) @ (vectors * np.sqrt(np.maximum(values, 0))).T


class Leaf:
    """A process with a mean that numpy knows, and realisations of it on the x axis."""

    def __init__(self, mean, sigma, kernel, bounds=BOUNDS, anisotropy=None):
        self.kernel = gn.SquaredExponential(kernel) if isinstance(kernel, float) else kernel
        self.sigma = sigma
        # Slopes across the line are independent of the line for one radial correlation (math.md §4).
        self.radial = anisotropy is None and not isinstance(self.kernel, gn.PlaneWave)
        self.across = sigma * np.sqrt(self.kernel.derivative_variance([0, 1, 0]))
        self.process = gn.GaussianProcess(mean, sigma, self.kernel, bounds=bounds, anisotropy=anisotropy)
        points = np.column_stack([X, np.zeros((len(X), 2))])
        self.covariance = self.process.covariance(points, points) / sigma**2 if sigma > 0 else np.eye(len(X))
        self.mean = self.process.mean(points)
        self.mean_gradient = mean.gradient(points)

    def noise(self, n, rng):
        return normals(self.covariance, n, rng)

    def values(self, g):
        return self.mean + self.sigma * g


def draw(leaves, shared, n, rng):
    """g of each leaf (n, points)."""
    groups = shared if isinstance(shared, tuple) else [0] * len(leaves) if shared else range(len(leaves))
    drawn = {}
    return [drawn[k] if k in drawn else drawn.setdefault(k, leaf.noise(n, rng)) for k, leaf in zip(groups, leaves, strict=True)]


def conditioned(leaf, length_scale, n, rng, value, slope):
    """g on the axis given value and, unless None, slope (n,) at x = 0; squared exponential."""
    d = X / length_scale
    k = np.exp(-(d**2) / 2)
    covariance = leaf.covariance - np.outer(k, k) * (1 + np.outer(d, d) * (slope is not None))
    g = normals(covariance, n, rng) + np.multiply.outer(value, k)
    if slope is not None:
        g += np.multiply.outer(slope * length_scale, d * k)
    return g


def sphere(x, y, radius, sigma, length_scale):
    return Leaf(gn.SphereField([x, y, 0], radius), sigma, length_scale)


A = sphere(1.6, 0.3, 0.8, 0.2, 0.5)
B = sphere(2.4, -0.2, 0.9, 0.15, 0.35)
C = sphere(1.9, 0.1, 0.6, 0.25, 0.4)
SAME = [sphere(1.6, 0.3, 0.8, 0.2, 0.5), sphere(2.3, 0, 0.7, 0.3, 0.5)]
WAVE = Leaf(gn.PlaneField([1, 0, 0], [1, 0, 0], 0.1), 0.4, 0.5)
a, b, c = A.process, B.process, C.process
MARKOV = Leaf(gn.SphereField([1.6, 0.3, 0], 0.8), 0.2, gn.Matern(1.5, 0.5))
SPECTRAL = Leaf(gn.SphereField([1.9, 0, 0], 0.6), 0.2, gn.RationalQuadratic(1.0, 0.4))
VARYING = Leaf(
    gn.SphereField([1.8, 0.2, 0], 0.9),
    0.25,
    gn.SquaredExponential(1),
    anisotropy=along_x(lambda x: isotropic(0.3 * np.exp(x / 6)), 6),
)
RIPPLE = Leaf(gn.PlaneField([1.5, 0, 0], [1, 0, 0], 0.2), 0.4, gn.PlaneWave([5.0, 2.0, 1.0]))
# Faces that a ray meets within one step: which one is first follows from all of them.
FACES = [Leaf(gn.PlaneField([2, 0, 0], [-1, 0, 0], 1), s, length) for s, length in ((0.15, 1.0), (0.2, 1.1), (0.1, 0.9))]


def ramp(x, slope, low, high):
    """A mean along the x axis: slope from x on (or up to it), between two levels."""
    return gn.PlaneField([x, 0, 0], [np.sign(slope), 0, 0], abs(slope)).clamped(low, high)


# One that is drawn, clear for certain and there again; the other has become uncertain by then.
AGAIN = Leaf(ramp(0.3, 6, 0, 1.2) + ramp(1.3, -1, -1.6, 0) + gn.ConstantField(0.1), 0.15, 1.0)
LATER = Leaf(ramp(1.95, 4, -0.8, 0) + gn.ConstantField(-0.1), 0.2, 1.0)
BOX = Leaf(gn.BoxField([1.7, 0, 0], [1.2, 2, 2]), 0.0, 1.0)

TREES = {
    "union": (gn.union(a, b), [A, B], False),
    "intersection": (gn.intersection(a, b), [A, B], False),
    "difference": (gn.difference(a, c), [A, C], False),
    "three": (gn.union(a, b, c), [A, B, C], False),
    "nested": (gn.difference(gn.union(a, b), c), [A, B, C], False),
    "complements": (gn.intersection(b, gn.complement(gn.intersection(a, gn.complement(c)))), [B, A, C], False),
    "cut by a certain box": (gn.intersection(BOX.process, b), [BOX, B], False),
    "waves": (gn.intersection(gn.union(a, WAVE.process), gn.complement(c)), [A, WAVE, C], False),
    "Markov less spectral": (gn.difference(MARKOV.process, SPECTRAL.process), [MARKOV, SPECTRAL], False),
    "deep, one process twice": (
        gn.union(gn.difference(a, gn.intersection(b, c)), gn.intersection(WAVE.process, gn.complement(a))),
        [A, B, C, WAVE, A],
        False,
    ),
    "varying lengths less a plane wave": (gn.difference(VARYING.process, RIPPLE.process), [VARYING, RIPPLE], False),
    "faces in one place": (gn.union(*[x.process for x in FACES]), FACES, False),
    "faces in one place, nested": (
        gn.intersection(FACES[0].process, gn.union(FACES[1].process, FACES[2].process)),
        FACES,
        False,
    ),
    "left behind": (gn.intersection(LATER.process, AGAIN.process), [LATER, AGAIN], False),
    "shared union": (gn.union(*[s.process for s in SAME], shared_noise=True), SAME, True),
    "shared difference": (gn.difference(*[s.process for s in SAME], shared_noise=True), SAME, True),
    "shared inside": (
        gn.difference(gn.intersection(SAME[0].process, WAVE.process, shared_noise=True), c),
        [SAME[0], WAVE, C],
        (0, 0, 1),
    ),
}
