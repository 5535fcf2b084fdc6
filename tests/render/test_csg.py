"""Light transport on CSG trees: nothing is lost, the operand that is hit gives material and normal, and a union of
independent processes is what they are as separate objects."""

import numpy as np
import pytest
from scene_parts import BLACK, WHITE_SUNS
from statistics_checks import check_z

gn = pytest.importorskip("gpis_native")

MEMORIES = ["none", "renewal", "renewal+"]
BOUNDS = ([-2] * 3, [2] * 3)


def ball(x, radius, sigma, length_scale=0.25, y=0.0, z=0.0):
    return gn.GaussianProcess(gn.SphereField((x, y, z), radius), sigma, gn.SquaredExponential(length_scale), bounds=BOUNDS)


def certain_box(center, size):
    return gn.GaussianProcess(gn.BoxField(center, size), 0, gn.SquaredExponential(1))


a, b, c = ball(-0.2, 0.8, 0.12), ball(0.4, 0.6, 0.1), ball(0.1, 0.5, 0.15, z=0.6)
TREES = {
    "union": gn.union(a, b),
    "intersection": gn.intersection(a, b),
    "difference": gn.difference(a, c),
    "nested": gn.difference(gn.union(a, b), c),
    "cut by a certain box": gn.difference(a, certain_box((0, 0.6, 0.6), (1, 1, 1))),
    "smooth": gn.difference(gn.smooth_union(a, b, blend=0.3), c),
    "smooth, shared": gn.smooth_union(ball(-0.5, 0.5, 0.1), ball(0.4, 0.5, 0.15), blend=0.4, shared_noise=True),
    "shared": gn.union(ball(-0.2, 0.7, 0.1), ball(0.3, 0.7, 0.15), shared_noise=True),
    "inside out": gn.intersection(certain_box((0, 0, 0), (2, 2, 2)), gn.complement(gn.union(a, c))),
}


def seen(process, materials, *, memory="renewal+", world=None, lights=(), settings=None, width=2.4):
    """From z = 4, orthographic."""
    eye = np.eye(4)
    eye[2, 3] = 4
    processes = process if isinstance(process, list) else [process]
    return {
        "version": 1,
        "settings": settings or {},
        "camera": {"type": "orthographic", "matrix": eye, "width": width},
        "world": world or {"color": (1, 1, 1)},
        "lights": list(lights),
        "materials": {
            "white": {"type": "lambert", "color": (1, 1, 1)},
            "mirror": {"type": "mirror", "color": (1, 1, 1)},
            "red": {"type": "lambert", "color": (0.8, 0, 0)},
            "green": {"type": "lambert", "color": (0, 0.7, 0)},
            "grey": {"type": "lambert", "color": (0.5, 0.5, 0.5)},
        },
        "objects": [
            {"name": f"Body {i}", "type": "gpis", "process": p, "materials": materials, "memory": memory}
            for i, p in enumerate(processes)
        ],
    }


@pytest.mark.stats
@pytest.mark.parametrize("memory", MEMORIES)
@pytest.mark.parametrize("material", ["white", "mirror"])
@pytest.mark.parametrize("name", TREES)
def test_furnace(name, material, memory, seed):
    """Every path ends in the white world with throughput 1 (oracle 13)."""
    result = gn.render(gn.Scene(seen(TREES[name], [material], memory=memory)), 16, 16, samples=32, seed=seed)
    assert np.allclose(result.passes["combined"], 1, atol=1e-6)
    stats = result.stats
    assert all(stats[k] == 0 for k in ("path_length_limit", "line_step_limit", "nan_samples", "states_inside"))
    assert stats["line_entry_inside"] < 2e-3 * stats["line_segments"]
    assert stats["path_vertices"] > 16 * 16 * 32 / 8


@pytest.mark.stats
@pytest.mark.parametrize("material", ["white", "mirror"])
@pytest.mark.parametrize("name", ["nested", "shared", "smooth", "smooth, shared"])
def test_furnace_of_global(name, material, seed):
    """One realisation of every operand for the whole path: nothing is lost either, whatever the threads."""
    scene = gn.Scene(seen(TREES[name], [material], memory="global"))
    results = [gn.render(scene, 8, 8, samples=16, seed=seed, threads=t) for t in (1, 2)]
    for result in results:
        assert np.allclose(result.passes["combined"], 1, atol=1e-6)
        assert all(result.stats[k] == 0 for k in ("path_length_limit", "line_step_limit", "nan_samples", "states_inside"))
        assert result.stats["path_vertices"] > 8 * 8 * 16 / 8
    assert np.array_equal(results[0].passes["depth"], results[1].passes["depth"])


@pytest.mark.stats
@pytest.mark.parametrize("memory", MEMORIES)
@pytest.mark.parametrize("material", ["white", "mirror"])
@pytest.mark.parametrize("name", ["nested", "smooth"])
def test_furnace_with_light_sampling(name, material, memory, seed):
    scene = gn.Scene(seen(TREES[name], [material], memory=memory, world=BLACK, lights=WHITE_SUNS))
    result = gn.render(scene, 16, 16, samples=512, seed=seed)
    pixels, variance = (result.passes[p][..., 0].astype(float) for p in ("combined", "variance"))
    assert result.stats["shadow_rays"] > 10_000
    error = np.sqrt(variance.sum()) / variance.size
    assert error < 2e-3
    check_z(pixels.mean(), 1, error)


@pytest.mark.stats
@pytest.mark.parametrize("memory", MEMORIES)
def test_union_is_its_operands_as_objects(memory, seed):
    """Definitions B5: overlapping objects are the union of independent processes, at camera and at every bounce."""
    light = {"world": {"image": np.linspace(0, 1, 16)[:, None, None] * np.ones((16, 8, 3))}, "lights": WHITE_SUNS[:1]}
    means = []
    for i, process in enumerate([gn.union(a, b), [a, b]]):
        result = gn.render(gn.Scene(seen(process, ["grey"], memory=memory, **light)), 12, 12, samples=512, seed=seed + i)
        pixels, variance = (result.passes[p][..., 0].astype(float) for p in ("combined", "variance"))
        means.append((pixels.mean(), variance.sum() / variance.size**2))
    (tree, var_tree), (objects, var_objects) = means
    assert np.sqrt(var_tree) < 0.01 * tree
    check_z(tree - objects, 0, np.sqrt(var_tree + var_objects), memory)


def test_the_operand_that_is_hit_gives_material_and_normal():
    """A certain ball of which a box takes the half towards the camera: its face is the box's, turned inside out."""
    tree = gn.difference(
        gn.GaussianProcess(gn.SphereField((0, 0, 0), 1), 0, gn.SquaredExponential(1)),
        certain_box((0, 1, 1), (4, 2, 2)),
    )
    result = gn.render(gn.Scene(seen(tree, ["red", "green"], width=1.2)), 12, 12, samples=16)
    upper, lower = np.s_[7:, 2:10], np.s_[:5, 2:10]
    assert np.allclose(result.passes["albedo"][upper], (0, 0.7, 0), atol=1e-6)
    assert np.allclose(result.passes["albedo"][lower], (0.8, 0, 0), atol=1e-6)
    assert np.allclose(result.passes["normal"][upper], (0, 0, 1), atol=1e-6)
    assert np.allclose(result.passes["depth"][upper], 4, atol=1e-6)
    assert np.all(result.passes["depth"][lower] < 3.5)


@pytest.mark.stats
def test_materials_of_uncertain_operands(seed):
    """The share of each operand in the albedo is its share of the first hits."""
    tree = gn.union(a, b)
    scene = gn.Scene(seen(tree, ["red", "green"]))
    result = gn.render(scene, 16, 16, samples=256, seed=seed)
    albedo = result.passes["albedo"].reshape(-1, 3).mean(axis=0) / (0.8, 0.7, 1)
    n = 60_000
    rng = np.random.default_rng(seed)
    origins = np.column_stack([rng.uniform(-1.2, 1.2, (n, 2)), np.full(n, 4.0)])
    hits = gn.first_hits(tree, origins, np.tile([0.0, 0, -1], (n, 1)), 10, seed=seed)
    for k in range(2):
        p = np.mean(hits["part"] == k)
        check_z(albedo[k], p, np.sqrt(p * (1 - p) * (1 / n + 1 / (256 * 256))), f"operand {k}")


def test_descriptions_of_trees():
    three = ["red", "green", "grey"]
    with pytest.raises(ValueError, match=r"has 2 entries; .* or one for each of its 3 operands"):
        gn.Scene(seen(TREES["nested"], three[:2]))
    plan = gn.Scene(seen(TREES["nested"], three)).plan()
    assert "intersection(union(0, 1), complement(2))" in plan["objects[0].composition of 'Body 0'"]
    assert "convolution" in plan["objects[0].leaf[2].sampler of 'Body 0'"]
    bad = gn.union(a, gn.GaussianProcess(0, 0, gn.SquaredExponential(1)))
    with pytest.raises(ValueError, match=r"objects\[0\].process of 'Body 0': Operand 1: mean and sigma are both 0"):
        gn.Scene(seen(bad, ["red"]))
