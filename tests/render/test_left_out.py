"""Nothing a scene does not need: by counters that live where the work is done. Each row is seen at rest, and moving."""

import subprocess
import sys

import gpis_native as gn
import numpy as np
import pytest
from scene_parts import CONDITIONS, LAMP, TRIANGLE, ball, combed, counted, painted, scene, varying
from statistics_checks import check_same_distribution

ROWS = {
    "mesh_rays": lambda: scene(mesh=True),
    "shadow_rays": lambda: scene(lights=[LAMP]),
    "sigma_lookups": lambda: scene(ball(varying())),
    "condition_rows": lambda: scene(ball(conditions=CONDITIONS)),
    "inside_rays": lambda: scene(material={"type": "dielectric", "ior": 1.5}, max_bounces=8),
    "tensor_lookups": lambda: scene(combed()),
    "albedo_lookups": lambda: painted(scene()),
    "composed_rays": lambda: scene(gn.difference(ball(), ball(center=(0, 0, 1)))),
    "clamped_samples": lambda: scene(clamp=0.1),
}


@pytest.mark.parametrize("counter", ROWS)
def test_what_is_left_out_is_not_entered(counter, seed):
    assert counted(scene(), seed)[counter] == 0
    stats = counted(ROWS[counter](), seed)
    assert stats[counter] > 0
    # What is switched on brings nothing else with it.
    assert {row: stats[row] for row in ROWS if row != counter and stats[row]} == {}


def test_time_is_not_entered_where_nothing_changes_with_it(seed):
    """Paths drawn anew have no use for a time: not one counter moves. A realisation at rest draws a number for every node
    of its noise; one that flows draws those of 16 moments around it (process/lattice_noise.h)."""
    moving = ball(time_scale=1.0, time=0.25)
    assert counted(scene(moving), seed) == counted(scene(), seed)
    rest, flowing = (
        gn.render(gn.Scene(scene(process)), 8, 8, samples=16, seed=seed, memory="global", threads=1).stats
        for process in (ball(), moving)
    )
    ratio = (flowing["line_normals"] / flowing["line_segments"]) / (rest["line_normals"] / rest["line_segments"])
    assert 13 < ratio < 19  # other realisations, other paths: the nodes near a ray are not the same number


def test_embree_is_not_opened_without_meshes():
    """In a process of its own: a library once opened stays."""
    code = (
        "import sys; sys.path.insert(0, sys.argv[1]); import gpis_native as gn; from scene_parts import scene\n"
        "opened = lambda: any('libembree' in line for line in open('/proc/self/maps'))\n"
        "gn.render(gn.Scene(scene()), 4, 4, samples=16); print(opened())\n"
        "gn.render(gn.Scene(scene(mesh=True)), 4, 4, samples=16); print(opened())\n"
    )
    folder = __file__.rsplit("/", 2)[0]
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


def test_certainly_solid_evaluates_no_process(seed):
    """Rays inside a body whose mean is 200 deviations below the surface, as those of a dielectric, and inside a thin one."""
    counters = []
    for mean in (-10, -0.05):
        solid = gn.GaussianProcess(gn.ConstantField(mean), 0.05, gn.SquaredExponential(0.2), bounds=((-1,) * 3, (1,) * 3))
        rays = (np.zeros((64, 3)), np.tile([0.0, 0.0, 1.0], (64, 1)))
        hits = gn.first_hits(solid, *rays, 10, inside=np.ones(64, bool), seed=seed)
        counters.append(hits["counters"])
        assert np.isinf(hits["t"]).all() == (mean == -10)
    certain, drawn = counters
    for name in ("line_segments", "line_evaluations", "line_normals", "truncated_normals"):
        assert certain[name] == 0 < drawn[name], name
    assert certain["line_skipped"] == 64


def room(bounces):
    """Haze of two deviations all over a closed room: every path meets something, with the haze drawn up to there."""
    corners = 2.0 * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    box = {"vertices": corners, "triangles": np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])}
    haze = gn.GaussianProcess(gn.ConstantField(0.1), 0.05, gn.SquaredExponential(0.5), bounds=((-2.5,) * 3, (2.5,) * 3))
    description = scene(haze, mesh=True, max_bounces=bounces)
    description["camera"]["matrix"] = np.eye(4)
    return description | {"meshes": {"Sheet": box}}


def test_the_last_bounce_keeps_no_memory(seed):
    """A path of n bounces meets n + 2 surfaces; the last one only gives its light, and of the processes nothing is kept."""
    paths = 12 * 12 * 16
    for bounces in (0, 1):
        stats = counted(room(bounces), seed)
        assert stats["path_vertices"] == (bounces + 1) * paths
        # Where the haze itself is met its state is that of the hit; on a wall it is what was drawn up to there, save the
        # few rays that start at the surface and are found inside behind a missed root.
        assert stats["states_remembered"] == stats["path_vertices"] - stats["states_inside"]


def unused(folder):
    plain = scene(lights=[LAMP])
    apart = plain | {"objects": plain["objects"] + [plain["objects"][0] | {"name": "Apart", "process": ball(center=(0, 0, -3000))}]}
    axis = np.linspace(-1.5, 1.5, 13)
    mean = np.linalg.norm(np.stack(np.meshgrid(axis, axis, axis, indexing="ij"), -1), axis=-1) - 1
    grids = {"mean": mean, "origin": (-1.5,) * 3, "voxel_size": 0.25}
    gn.write_vdb(str(folder / "lean.vdb"), grids)
    gn.write_vdb(str(folder / "rich.vdb"), grids | {"sigma": 0.1 + 0 * mean, "anisotropy": np.ones((13, 13, 13, 6))})
    of_grid = [
        scene(gn.GaussianProcess(gn.VdbField(str(folder / name), "mean"), 0.05, gn.SquaredExponential(0.2)), lights=[LAMP])
        for name in ("lean.vdb", "rich.vdb")
    ]
    dark = plain | {"lights": [LAMP, LAMP | {"name": "Off", "power": 0.0}]}
    mesh = plain | {"meshes": {"Unused": TRIANGLE}}
    behind = np.eye(4)
    behind[2, 3] = 3000
    sheet = {"name": "Sheet", "type": "mesh", "mesh": "Sheet", "materials": ["Body"], "matrix": behind}
    apart_mesh = plain | {"meshes": {"Sheet": TRIANGLE}, "objects": [*plain["objects"], sheet]}
    cloud = scene(gn.GaussianProcess(0.0, 0.01, gn.SquaredExponential(0.1), bounds=((-0.5,) * 3, (0.5,) * 3)))
    nothing = gn.GaussianProcess(10.0, 0.05, gn.SquaredExponential(0.2), bounds=((-1,) * 3, (1,) * 3))
    over_it = cloud | {"objects": [*cloud["objects"], cloud["objects"][0] | {"name": "Nothing", "process": nothing}]}
    material = plain | {"materials": plain["materials"] | {"Unused": {"type": "mirror", "color": (1, 1, 1)}}}
    return {
        "light": (plain, dark),
        "mesh": (plain, mesh),
        "material": (plain, material),
        "object": (plain, apart),
        "mesh object": (plain, apart_mesh),
        "absent object": (cloud, over_it),
        "grid of one sigma": (scene(ball(0.0625)), scene(ball(gn.GridField(np.full((2, 2, 2), 0.0625), 3.0, (-1.5,) * 3)))),
        "grid": of_grid,
    }


@pytest.mark.parametrize("kind", ["light", "mesh", "material", "object", "mesh object", "absent object", "grid", "grid of one sigma"])
def test_what_is_not_used_changes_no_counter(kind, seed, tmp_path):
    plain, more = unused(tmp_path)[kind]
    stats, others = counted(plain, seed), counted(more, seed)
    assert stats["line_evaluations"] + stats["line_tabulated"] > 0
    if kind == "absent object":  # what tells that rays crossed its bounds, and that nothing was drawn
        assert others.pop("line_skipped") > stats.pop("line_skipped")
    assert stats == others


def test_grids_that_are_the_same_everywhere_are_constants(seed):
    """Length scales .5, 1 and .25 along turned axes, on a grid and in the kernel: one law, and no tensor is looked up."""
    turn = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]])
    a = turn @ np.diag([0.25, 1, 0.0625]) @ turn.T
    entries = np.array([a[0, 0], a[1, 1], a[2, 2], a[0, 1], a[0, 2], a[1, 2]])
    grid = gn.TensorGridField(np.broadcast_to(entries, (3, 3, 3, 6)), 1.5, (-1.5,) * 3)
    half = np.arctan2(0.8, 0.6) / 2
    kernel = gn.SquaredExponential((0.5, 1, 0.25), rotation=(np.cos(half), 0, 0, np.sin(half)))
    origins, directions = np.tile([0.3, -0.2, 3.0], (20_000, 1)), np.tile([0, 0.28, -0.96], (20_000, 1))
    hits = []
    for more in ({"kernel": gn.SquaredExponential(1.0), "anisotropy": grid}, {"kernel": kernel}):
        gp = gn.GaussianProcess(gn.SphereField((0, 0, 0), 1), 0.3, bounds=((-2.5,) * 3, (2.5,) * 3), **more)
        assert gp.plan()["sampler"].startswith("convolution")
        hits.append(gn.first_hits(gp, origins, directions, 10, seed=seed + len(hits)))
        for name in ("tensor_lookups", "factorisations"):
            assert hits[-1]["counters"][name] == 0, name
    for what in (lambda h: h["t"], lambda h: h["gradient"][:, 0], lambda h: h["gradient"][:, 1]):
        check_same_distribution(*(what(h)[np.isfinite(h["t"])] for h in hits))
