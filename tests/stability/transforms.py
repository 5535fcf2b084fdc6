"""Objects that are moved, scaled, sheared and mirrored, by as much as double precision holds, and then refused.

Exact answer: f is transported (f at x is f of the object at M⁻¹x), so a ray that is moved along with its object meets
it at the same place M x: the same law of the object's own points.
"""

from dataclasses import replace

import gpis_native as gn
import numpy as np

from stability.verdicts import Cell, Outcome, of_sample

SIGMAS = [0.0, 1e-3, 0.1, 1.0]


def shear(amount):
    m = np.eye(4)
    m[0, 1], m[1, 2] = amount, -0.5 * amount
    return m


def scaled(*factors, place=(0, 0, 0)):
    m = np.diag([*factors, 1.0])
    m[:3, 3] = place
    return m


TRANSFORMS = {
    "sheared by 1": shear(1),
    "sheared by 100": shear(100),
    "mirrored": scaled(-1, 1, 1),
    "1 : 1000": scaled(1, 1e-3, 1),
    "1 : 1e6": scaled(1, 1e-6, 1),
    "scale 1e-3": scaled(*[1e-3] * 3),
    "scale 1e-6": scaled(*[1e-6] * 3),
    "scale 1e-12": scaled(*[1e-12] * 3),
    "scale 1e6": scaled(*[1e6] * 3),
    "1e4 m away": scaled(1, 1, 1, place=(1e4, 0, 0)),
    "1e6 m away": scaled(1, 1, 1, place=(1e6, 0, 0)),
    "1e12 m away": scaled(1, 1, 1, place=(1e12, 0, 0)),
    "scale 1e-3, 1e3 m away": scaled(*[1e-3] * 3, place=(0, 1e3, 0)),
    "scale 1e-160": scaled(*[1e-160] * 3),
    "a scale of 0": scaled(1, 0, 1),
    "NaN": scaled(1, np.nan, 1),
}
REFUSED = ("scale 1e-160", "a scale of 0", "NaN")


def depths(matrix, sigma, n, seed):
    """The object's own distance along the middle ray of an orthographic camera of one pixel, n samples of it."""
    process = gn.GaussianProcess(gn.SphereField((0, 0, 0), 1), sigma, gn.SquaredExponential(0.5), bounds=((-2,) * 3, (2,) * 3))
    # Camera and ray are moved along with the object.
    origin = matrix @ [0.2, 0.1, 1.9, 1]
    along = matrix[:3, :3] @ [0, 0, -1.0]
    back = -along / np.linalg.norm(along)
    side = np.cross([0.3, 1, 0.2], back)
    side /= np.linalg.norm(side)
    camera = np.eye(4)
    camera[:3, 0], camera[:3, 1], camera[:3, 2], camera[:3, 3] = side, np.cross(back, side), back, origin[:3]
    unit = np.linalg.norm(along)
    scene = {
        "version": 1,
        "settings": {"max_bounces": 0},
        "camera": {
            "type": "orthographic",
            "matrix": camera,
            "width": 1e-9 * unit,
            "clip": (1e-9 * unit, 10 * unit),
        },
        "world": {"color": (1, 1, 1)},
        "materials": {"surface": {"type": "lambert", "color": (1, 1, 1)}},
        "objects": [
            {"name": "Ball", "type": "gpis", "process": process, "matrix": matrix, "materials": ["surface"], "memory": "renewal+"}
        ],
    }
    side_pixels = int(np.sqrt(n))
    result = gn.render(gn.Scene(scene), side_pixels, side_pixels, samples=1, seed=seed, threads=1)
    depth = result.passes["depth"].ravel().astype(float) / unit
    return depth, {name: value for name, value in result.stats.items() if isinstance(value, int)}


def cell(name, sigma):
    def run(n):
        matrix = TRANSFORMS[name]
        moved, stats = depths(matrix, sigma, n, 5)
        still, _ = depths(np.eye(4), sigma, n, 7)
        if sigma == 0:
            error = np.max(np.abs(moved - still))
            # What the scene is checked for: six digits of the object, and floats of the picture.
            return Outcome(float(error) if np.isfinite(error) else np.inf, 1e-4, "the object at rest", stats)
        return replace(of_sample(moved, still, "the object at rest", [], stated=0.002), counters=stats)

    return Cell("objects moved, σ/R", name, f"{sigma:g}", run, refusal=True if name in REFUSED else None)


def cells():
    return [cell(name, sigma) for name in TRANSFORMS for sigma in SIGMAS]
