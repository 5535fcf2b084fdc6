"""Glass: stochastic bodies with rays inside of them, by every memory and sampler, and as CSG trees."""

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_z

LENGTH_SCALE = 0.2
GLASS = {"type": "dielectric", "ior": 1.5}


def ball(center=(0, 0, 0), radius=1.0, sigma=0.1, kernel=None):
    reach = radius + 6 * sigma
    return gn.GaussianProcess(
        gn.SphereField(center, radius),
        sigma,
        kernel or gn.SquaredExponential(LENGTH_SCALE),
        bounds=(np.subtract(center, reach), np.add(center, reach)),
    )


def scene(process, materials=None, world=None, **settings):
    """A body seen from (0, 0, 4), its operands of these materials (glass)."""
    eye = np.eye(4)
    eye[2, 3] = 4
    materials = materials or [GLASS]
    return {
        "version": 1,
        "settings": {k: settings.pop(k) for k in ("light_sampling",) if k in settings},
        "camera": {"type": "perspective", "matrix": eye, "fov_x": 0.6},
        "world": world or {"color": (1, 1, 1)},
        "materials": {str(i): material for i, material in enumerate(materials)},
        "objects": [
            {"name": "Body", "type": "gpis", "process": process, "materials": [str(i) for i in range(len(materials))]} | settings
        ],
    }


def furnace(description, seed, size=16, samples=32):
    """The counters of a render in which every pixel must be 1, without noise."""
    result = gn.render(gn.Scene(description), size, size, samples=samples, seed=seed)
    assert np.allclose(result.passes["combined"], 1, atol=1e-6)
    for name in ("path_length_limit", "line_step_limit", "nan_samples"):
        assert result.stats[name] == 0
    assert result.stats["states_inside"] <= result.stats["path_vertices"] / 1000
    assert result.stats["inside_rays"] > result.stats["camera_paths"] / 4
    return result.stats


@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+", "global-1", "global"])
def test_furnace_of_every_memory(memory, seed):
    costly = memory.startswith("global")
    stats = furnace(scene(ball(), memory=memory), seed, 8 if costly else 24, 16 if costly else 64)
    if memory != "global-1":
        assert stats["bounds_exits"] == 0


@pytest.mark.parametrize(
    "kernel",
    [gn.Matern(1.5, 0.2), gn.Matern(2.5, 0.2), gn.RationalQuadratic(1.0, 0.2), gn.LocallyPeriodic(0.2, 0.1, (0, 0, 1), 1.0)],
    ids=["matern 3/2", "matern 5/2", "rational quadratic", "locally periodic"],
)
def test_furnace_of_every_kind_of_kernel(kernel, seed):
    furnace(scene(ball(sigma=0.05, kernel=kernel)), seed, 8)


TREES = {
    "union": lambda a, b: gn.union(a, b),
    "intersection": lambda a, b: gn.intersection(a, b),
    "difference": lambda a, b: gn.difference(a, b),
}


@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
@pytest.mark.parametrize("operation", TREES)
def test_furnace_of_trees(operation, memory, seed):
    tree = TREES[operation](ball(sigma=0.05), ball((0.7, 0.2, 0.3), 0.8, 0.05))
    furnace(scene(tree, memory=memory), seed)
    tinted = GLASS | {"color": (0.5, 1, 1)}  # a tint of each operand
    result = gn.render(gn.Scene(scene(tree, [GLASS, tinted], memory=memory)), 8, 8, samples=16, seed=seed)
    assert np.allclose(result.passes["combined"][..., 1:], 1, atol=1e-6)
    assert 0.1 < result.passes["combined"][..., 0].min() < 0.9


@pytest.mark.parametrize("other", [GLASS | {"ior": 1.3}, {"type": "lambert", "color": (1, 1, 1)}])
def test_operands_are_one_medium(other):
    tree = gn.union(ball(), ball((1, 0, 0)))
    with pytest.raises(ValueError, match=r"objects\[0\]\.materials of 'Body' mixes '0' and '1'; the operands of one object"):
        gn.Scene(scene(tree, [GLASS, other]))
    with pytest.raises(ValueError, match=r"objects\[0\]\.materials of 'Body' mixes '0' and '1'"):
        gn.Scene(scene(tree, [other, GLASS]))


@pytest.mark.stats
@pytest.mark.parametrize("roughness", [0.0, 0.5])
def test_samplers_agree_on_glass(roughness, seed, full_size):
    """Pixel by pixel, under a world that is a linear gradient."""
    world = {"image": np.linspace(0, 1, 32)[:, None, None] * np.ones((32, 8, 3))}
    glass = GLASS | {"color": (0.8, 0.8, 0.8), "roughness": roughness}
    a, b = (
        gn.render(
            gn.Scene(scene(ball(sigma=0.05), [glass], world, sampler=sampler)),
            12,
            12,
            samples=1024 if full_size else 256,
            seed=seed + i,
        )
        for i, sampler in enumerate(("convolution", "dense"))
    )
    difference = a.passes["combined"][..., 0].astype(float) - b.passes["combined"][..., 0]
    variance = a.passes["variance"][..., 0].astype(float) + b.passes["variance"][..., 0]
    body = variance > 1e-12
    assert body.sum() > 60
    scores = difference[body] / np.sqrt(variance[body])
    # The variance comes from 16 blocks a side: Student's t with about 30 degrees of freedom; 1e-6 two-sided is 6.1.
    assert np.abs(scores).max() < 6.1
    assert abs(np.mean(scores**2) - 1.07) < 4 * np.sqrt(2.3 / scores.size)
    check_z(difference.mean(), 0, np.sqrt(variance.sum()) / variance.size, "mean of all pixels")


def test_nothing_is_paid_without_glass(seed):
    opaque = scene(ball(), [{"type": "mirror"}])
    opaque["materials"]["unused"] = GLASS
    plan = gn.Scene(opaque).plan()
    assert plan["scene.inside"] == "left out: no body is a dielectric"
    assert gn.render(gn.Scene(opaque), 16, 16, samples=16, seed=seed).stats["inside_rays"] == 0
    plan = gn.Scene(scene(ball())).plan()
    assert plan["scene.inside"] == "rays travel inside of 1 dielectric bodies, each a medium in air"
    assert plan["materials[0].model"] == "smooth dielectric: exact Fresnel"


def test_bodies_end_where_their_bounds_do(seed):
    """Glass of index 1 is nothing; a body that is cut by its bounds is left there without being bent."""
    gradient = {"image": np.linspace(0, 1, 32)[:, None, None] * np.ones((32, 8, 3))}
    cut = gn.GaussianProcess(
        gn.SphereField((0, 0, 0), 1), 0.05, gn.SquaredExponential(LENGTH_SCALE), bounds=([-2] * 3, [2, 2, 0.0])
    )
    seen = gn.render(gn.Scene(scene(cut, [GLASS | {"ior": 1}], gradient)), 16, 16, samples=16, seed=seed)
    empty = scene(cut, world=gradient) | {"objects": []}
    alone = gn.render(gn.Scene(empty), 16, 16, samples=16, seed=seed)
    assert np.allclose(seen.passes["combined"], alone.passes["combined"], atol=1e-6)
    assert furnace(scene(cut) | {"camera": {"type": "orthographic", "matrix": TURNED, "width": 3.0}}, seed)["bounds_exits"] > 100


TURNED = np.diag([1.0, -1.0, -1.0, 1.0])  # from below, where the body has a surface
TURNED[2, 3] = -4
