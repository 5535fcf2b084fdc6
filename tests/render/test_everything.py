"""A scene that uses everything at once: it renders, its plan leaves nothing out, and in a white furnace it is white."""

import gpis_native as gn
import numpy as np
from scene_parts import ball, combed, counted, scene, varying

GREY = (0.8, 0.8, 0.8)
AXIS = np.linspace(-1.5, 1.5, 17)


def at(x, y, scale=0.8):
    matrix = np.diag([scale, scale, scale, 1.0])
    matrix[:2, 3] = x, y
    return matrix


def everything(folder, *, furnace=False):
    """Six stochastic objects and a sheet of triangles under a sky image, a sun, a lamp and an area light; `furnace`: all
    surfaces white under a white sky alone. A rough conductor scatters once and loses light, so there it is smooth."""
    radius = np.linalg.norm(np.stack(np.meshgrid(AXIS, AXIS, AXIS, indexing="ij"), -1), axis=-1)
    grids = {"mean": radius - 1, "sigma": 0.03 + 0.02 * radius, "origin": (-1.5,) * 3, "voxel_size": AXIS[1] - AXIS[0]}
    path = str(folder / "body.vdb")
    gn.write_vdb(path, grids)
    of_vdb = gn.GaussianProcess(gn.VdbField(path, "mean"), gn.VdbField(path, "sigma"), gn.SquaredExponential(0.2))
    conditions = {"points": [(0, 0, 1.0), (0.6, 0, 0.8)], "values": [0.05, np.nan], "normals": [(np.nan,) * 3, (0.6, 0, 0.8)]}
    bodies = {
        "Vdb": (of_vdb, ["Lambert"], at(-2, 1)),
        "Mirror": (ball(time_scale=1.0, time=0.3), ["Mirror"], at(0, 1)),
        "Glass": (ball(), ["Glass"], at(2, 1)),
        "Combed": (combed(), ["Conductor"], at(-2, -1)),
        "Conditions": (ball(conditions=conditions), ["Lambert"], at(0, -1)),
        "Cut": (gn.difference(ball(), ball(varying(), center=(0.4, 0.3, 0.9))), ["Lambert", "Mirror"], at(2, -1)),
    }
    white = {"color": (1, 1, 1)}
    paint = white if furnace else {"color": GREY}
    described = scene(mesh=True, max_bounces=None if furnace else 6)
    described["camera"] = {"type": "orthographic", "matrix": described["camera"]["matrix"], "width": 6.0}
    described["materials"] = {
        "Body": {"type": "lambert"} | paint,
        "Lambert": {"type": "lambert"} | paint,
        "Mirror": {"type": "mirror"} | paint,
        "Conductor": {"type": "conductor", "roughness": 0.0 if furnace else 0.4} | paint,
        "Glass": {"type": "dielectric", "ior": 1.5} | white,
    }
    tint = 1.0 if furnace else gn.GridField(np.linspace(0.2, 1, 8).reshape(2, 2, 2), 3.0, (-1.5, -1.5, -1.5)).clamped(0, 1)
    described["objects"] = [described["objects"][-1]] + [
        {"name": name, "type": "gpis", "process": process, "materials": materials, "matrix": matrix}
        for name, (process, materials, matrix) in bodies.items()
    ]
    described["objects"][1]["albedo"] = gn.ColorField(tint, tint, tint)
    described["world"] = white
    if not furnace:
        above = np.eye(4)
        above[:3, 3] = 1, 0, 5
        sky = np.linspace(0.1, 1.0, 8)[:, None, None] * np.ones((8, 16, 3))
        described["world"] = {"image": sky}
        described["lights"] = [
            {"type": "sun", "name": "Sun", "matrix": np.eye(4), "color": (1, 0.9, 0.8), "power": 1.0, "angle": 0.01},
            {"type": "point", "name": "Lamp", "matrix": above, "color": (1, 1, 1), "power": 50.0},
            {"type": "area", "name": "Panel", "matrix": above, "color": (1, 1, 1), "power": 50.0, "size": (1, 1)},
        ]
    return described


def left_out(plan):
    return {key for key, sentence in plan.items() if key.startswith("scene.") and sentence.startswith("left out: ")}


def test_everything_renders_and_every_part_of_it_is_entered(tmp_path, seed):
    stats = counted(everything(tmp_path), seed)
    for name in (
        "mesh_rays", "shadow_rays", "inside_rays", "line_evaluations", "mean_lookups", "sigma_lookups", "tensor_lookups",
        "condition_rows", "composed_rays", "albedo_lookups", "states_remembered", "factorisations",
    ):  # fmt: skip
        assert stats[name] > 0, name
    assert stats["nan_samples"] == 0


def test_everything_in_a_white_furnace_is_white(tmp_path, seed):
    result = gn.render(gn.Scene(everything(tmp_path, furnace=True)), 24, 16, samples=16, seed=seed)
    np.testing.assert_allclose(result.passes["combined"][..., :3], 1, atol=1e-5)
    # Not the sky alone; that each part of the renderer was entered is told by its counters.
    assert (result.passes["depth"] < np.inf).mean() > 0.3
    assert result.stats["nan_samples"] == result.stats["path_length_limit"] == 0
    for name in ("mesh_rays", "inside_rays", "tensor_lookups", "condition_rows", "composed_rays", "albedo_lookups"):
        assert result.stats[name] > 0, name


def test_the_plan_names_what_is_left_out_and_what_is_not(tmp_path):
    """Rows of the scene, and rows of each object."""
    plan = gn.Scene(everything(tmp_path)).plan()
    assert left_out(plan) == {"scene.motion"}
    assert plan["scene.embree"] == "1 mesh objects" and plan["scene.processes"] == "7 stochastic surfaces"
    assert plan["scene.csg"].startswith("1 objects") and plan["scene.tensors"].startswith("1 surfaces")
    assert plan["scene.sigma_lookups"].startswith("2 surfaces") and plan["scene.conditions"].startswith("1 surfaces")
    assert plan["scene.textures"].startswith("1 objects") and plan["scene.time"].startswith("1 surfaces change")
    assert plan["objects[0].mesh of 'Sheet'"] == "1 triangles" and plan["objects[0].materials of 'Sheet'"] == "Body"
    assert plan["objects[1].mean of 'Vdb'"].startswith("varies") and plan["objects[1].sigma of 'Vdb'"].startswith("varies")
    assert plan["objects[2].sigma of 'Mirror'"] == "constant 0.05" and "length_scales" in str(plan)
    assert plan["objects[4].length_scales of 'Combed'"].startswith("A(x) varies, lengths within 0.1 and 0.2")
    assert plan["objects[2].length_scales of 'Mirror'"].startswith("the same everywhere")
    assert plan["objects[5].conditions of 'Conditions'"].startswith("2 points")
    assert plan["objects[2].conditions of 'Mirror'"] == "left out: no condition points"
    assert "intersection(0, complement(1))" in plan["objects[6].composition of 'Cut'"]
    assert plan["objects[6].materials of 'Cut'"] == "Lambert, Mirror"
    assert plan["objects[3].memory of 'Glass'"] == "renewal+"

    bare = gn.Scene(scene() | {"objects": []}).plan()
    assert left_out(bare) == {
        f"scene.{part}"
        for part in (
            "embree", "processes", "light_sampling", "inside", "textures", "motion", "time", "tensors",
            "sigma_lookups", "conditions", "csg",
        )
    }  # fmt: skip
