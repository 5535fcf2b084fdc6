"""Nothing a scene does not need: by counters that live where the work is done. Each row is seen at rest, and moving."""

import subprocess
import sys

import gpis_native as gn
import numpy as np
import pytest

CONDITIONS = {"points": [(0, 0, 1)], "values": [0.0]}
LAMP = {"type": "point", "name": "Lamp", "color": (1, 1, 1), "power": 100.0, "matrix": np.eye(4) + 3 * np.eye(4, k=1)}
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


ROWS = {
    "mesh_rays": lambda: scene(mesh=True),
    "shadow_rays": lambda: scene(lights=[LAMP]),
    "sigma_lookups": lambda: scene(ball(varying())),
    "condition_rows": lambda: scene(ball(conditions=CONDITIONS)),
    "inside_rays": lambda: scene(material={"type": "dielectric", "ior": 1.5}, max_bounces=8),
    "clamped_samples": lambda: scene(clamp=0.1),
}


@pytest.mark.parametrize("counter", ROWS)
def test_what_is_left_out_is_not_entered(counter, seed):
    assert counted(scene(), seed)[counter] == 0
    assert counted(ROWS[counter](), seed)[counter] > 0


def test_embree_is_not_opened_without_meshes():
    """In a process of its own: a library once opened stays."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import gpis_native as gn; from test_left_out import scene\n"
        "opened = lambda: any('libembree' in line for line in open('/proc/self/maps'))\n"
        "gn.render(gn.Scene(scene()), 4, 4, samples=16); print(opened())\n"
        "gn.render(gn.Scene(scene(mesh=True)), 4, 4, samples=16); print(opened())\n"
    )
    folder = __file__.rsplit("/", 1)[0]
    run = subprocess.run([sys.executable, "-c", code, folder], capture_output=True, text=True, check=True)
    assert run.stdout.split() == ["False", "True"]


def test_certainly_absent_evaluates_no_process(seed):
    """A mean of 200 deviations all over the bounds that rays cross, and a ball beside them."""
    empty = gn.GaussianProcess(gn.ConstantField(10), 0.05, gn.SquaredExponential(0.2), bounds=((-1,) * 3, (1,) * 3))
    for absent in (empty, ball(center=(50, 0, 0))):
        stats = counted(scene(absent), seed)
        for name in ("line_segments", "line_evaluations", "line_normals", "path_vertices"):
            assert stats[name] == 0, name
    assert counted(scene(), seed)["line_evaluations"] > 0


def unused():
    plain = scene(lights=[LAMP])
    dark = plain | {"lights": [LAMP, LAMP | {"name": "Off", "power": 0.0}]}
    mesh = plain | {"meshes": {"Unused": TRIANGLE}}
    material = plain | {"materials": plain["materials"] | {"Unused": {"type": "mirror", "color": (1, 1, 1)}}}
    return {"light": (plain, dark), "mesh": (plain, mesh), "material": (plain, material)}


@pytest.mark.parametrize("kind", ["light", "mesh", "material"])
def test_what_is_not_used_changes_no_counter(kind, seed):
    plain, more = unused()[kind]
    assert counted(plain, seed) == counted(more, seed)
