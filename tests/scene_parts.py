"""A small scene with parts to be added one by one, and the counters of its render."""

import gpis_native as gn
import numpy as np

CONDITIONS = {"points": [(0, 0, 1)], "values": [0.0]}
LAMP = {"type": "point", "name": "Lamp", "color": (1, 1, 1), "power": 100.0, "matrix": np.eye(4) + 3 * np.eye(4, k=1)}
# Radiance 1 from everywhere, as two suns of half of the sky each: a white world that is sampled as lights.
WHITE_SUNS = [
    {"type": "sun", "name": name, "matrix": np.diag([1.0, side, side, 1.0]), "power": np.pi, "angle": np.pi, "visible_to_camera": True}
    for name, side in (("Upper", 1.0), ("Lower", -1.0))
]
BLACK = {"color": (0, 0, 0)}
TRIANGLE = {"vertices": np.array([(-1, -1, 2.0), (1, -1, 2), (0, 1, 2)]), "triangles": np.array([(0, 1, 2)])}


def ball(sigma=0.05, center=(0, 0, 0), **more):
    reach = 1.4
    bounds = (np.subtract(center, reach), np.add(center, reach))
    return gn.GaussianProcess(gn.SphereField(center, 1), sigma, gn.SquaredExponential(0.2), bounds=bounds, **more)


def scene(process=None, *, lights=(), mesh=False, material=None, **settings):
    """A random ball, and a triangle in front of it where `mesh` says so, seen from (0, 0, 4) under a grey sky."""
    eye = np.eye(4)
    eye[2, 3] = 4
    objects = [{"name": "Ball", "type": "gpis", "process": process or ball(), "materials": ["Body"]}]
    if mesh:
        objects.append({"name": "Sheet", "type": "mesh", "mesh": "Sheet", "materials": ["Body"]})
    return {
        "version": 1,
        "settings": settings,
        "camera": {"type": "perspective", "matrix": eye, "fov_x": 0.6},
        "world": {"color": (0.5, 0.5, 0.5)},
        "lights": list(lights),
        "materials": {"Body": material or {"type": "lambert", "color": (0.8, 0.8, 0.8)}},
        "meshes": {"Sheet": TRIANGLE} if mesh else {},
        "objects": objects,
    }


def counted(description, seed):
    stats = gn.render(gn.Scene(description), 12, 12, samples=16, seed=seed, threads=1).stats
    return {name: count for name, count in stats.items() if isinstance(count, int)}


def varying():
    return gn.GridField(np.linspace(0.04, 0.06, 8).reshape(2, 2, 2), 3.0, (-1.5, -1.5, -1.5))


def turned(n=3):
    """Length scales .2 and .1 on a grid, that change over space."""
    tensors = np.zeros((n, n, n, 6))
    tensors[..., 0] = np.linspace(0.01, 0.04, n)[:, None, None]
    tensors[..., 1] = tensors[..., 2] = 0.02
    return gn.TensorGridField(tensors, 3.0 / (n - 1), (-1.5, -1.5, -1.5))


def combed(**more):
    bounds = ((-1.4,) * 3, (1.4,) * 3)
    return gn.GaussianProcess(
        gn.SphereField((0, 0, 0), 1), 0.05, gn.SquaredExponential(1.0), anisotropy=turned(), bounds=bounds, **more
    )


def painted(description, albedo=0.5):
    description["objects"][0]["albedo"] = gn.ColorField(albedo, albedo, albedo)
    return description
