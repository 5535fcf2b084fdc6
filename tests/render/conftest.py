"""Scenes the tests of this folder share."""

import numpy as np
import pytest

CAMERA = {"type": "orthographic", "matrix": np.eye(4), "width": 2.0}
QUAD = [(0, 1, 2), (0, 2, 3)]


@pytest.fixture(scope="session")
def empty_scene():
    """empty_scene(color, **settings): nothing but a world of one colour, so that every sample is exact."""

    def describe(color=(1.0, 1.0, 1.0), **settings):
        return {"version": 1, "settings": settings, "camera": CAMERA, "world": {"color": color}}

    return describe


@pytest.fixture(scope="session")
def noisy_scene():
    """noisy_scene(**settings): a tilted floor under a lamp and a gradient sky, partly in a plate's shadow: noise of
    several kinds, and cheap."""

    def describe(**settings):
        sky = np.linspace(0.0, 2.0, 16)[:, None, None] * np.ones((16, 32, 3)) * (1.0, 0.8, 0.6)
        floor = [(-3.0, -3.0, -4.0), (3.0, -3.0, -4.0), (3.0, 3.0, -8.0), (-3.0, 3.0, -8.0)]
        plate = [(-0.5, -0.5, -3.0), (0.3, -0.5, -3.0), (0.3, 0.2, -3.0), (-0.5, 0.2, -3.0)]
        lamp = np.eye(4)
        lamp[:3, 3] = 1.0, 1.0, -1.0
        return {
            "version": 1,
            "settings": settings,
            "camera": CAMERA,
            "world": {"image": sky},
            "lights": [{"type": "area", "matrix": lamp, "power": 40.0, "size": (1.0, 0.5)}],
            "materials": {"grey": {"type": "lambert", "color": (0.8, 0.8, 0.8)}},
            "meshes": {
                "floor": {"vertices": floor, "triangles": QUAD},
                "plate": {"vertices": plate, "triangles": QUAD},
            },
            "objects": [
                {"name": "Floor", "type": "mesh", "mesh": "floor", "materials": ["grey"]},
                {"name": "Plate", "type": "mesh", "mesh": "plate", "materials": ["grey"]},
            ],
        }

    return describe


@pytest.fixture(scope="session")
def process_scene():
    """process_scene(**settings): a rough sphere under a white sky."""

    def describe(**settings):
        import gpis_native as gn

        process = gn.GaussianProcess(gn.SphereField((0, 0, -3), 0.7), 0.1, gn.SquaredExponential(0.2))
        return {
            "version": 1,
            "settings": settings,
            "camera": CAMERA,
            "world": {"color": (1, 1, 1)},
            "materials": {"grey": {"type": "lambert", "color": (0.8, 0.8, 0.8)}},
            "objects": [{"name": "Ball", "type": "gpis", "process": process, "materials": ["grey"]}],
        }

    return describe


@pytest.fixture(scope="module")
def noisy(noisy_scene):
    import gpis_native as gn

    return gn.Scene(noisy_scene())
