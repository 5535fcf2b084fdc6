"""Many objects: a ray enters those that it reaches, the nearest first; the others cost nothing and change nothing."""

import gpis_native as gn
import numpy as np
import pytest
from scene_parts import LAMP, ball, scene

SPACING = 3.0  # the bounds of a ball take 2.8 of it
PIXELS = 4  # across one ball


def crowd(places, side, lights=(), **settings):
    """Balls at places (x, y, z) in units of the spacing, `side` of them across the picture, seen along -z, not in perspective."""
    eye = np.eye(4)
    eye[:3, 3] = (side - 1) * SPACING / 2, (side - 1) * SPACING / 2, 10
    description = scene(lights=list(lights), **settings)
    one = description["objects"][0]
    description["objects"] = [
        one | {"name": f"{at}", "process": ball(center=tuple(SPACING * np.array(at, float)))} for at in places
    ]
    return description | {"camera": {"type": "orthographic", "matrix": eye, "width": side * SPACING}}


def rendered(description, side, seed, samples=16, **options):
    return gn.render(gn.Scene(description), PIXELS * side, PIXELS * side, samples=samples, seed=seed, **options)


def entered(stats):
    return stats["line_segments"] + stats["line_skipped"]


def plane(side):
    return [(x, y, 0) for x in range(side) for y in range(side)]


def test_work_does_not_grow_with_the_number_of_objects(seed):
    """Balls that fill a picture, and a column of them one behind the other: what is entered for a first hit."""
    rates = []
    for side in (1, 4, 16):
        stats = rendered(crowd(plane(side), side, max_bounces=0), side, seed, max(1, 4096 // side**2)).stats
        rates.append(entered(stats) / (stats["camera_paths"] + stats["path_vertices"]))
    # Of one ball alone camera rays and the rays that leave it; of many, also the few that reach a neighbour.
    assert rates[0] > 0.7
    assert rates[2] < 2 * rates[0]
    deep = [rendered(crowd([(0, 0, -z) for z in range(n)], 1, max_bounces=0), 1, seed, 512).stats for n in (10, 100)]
    # Rays that pass a ball pass all of them; the others end at the first.
    through = 1 - np.pi / SPACING**2
    for n, stats in zip((10, 100), deep, strict=True):
        assert entered(stats) / stats["camera_paths"] < 2 + 1.1 * n * through


def test_each_ball_is_seen_as_if_alone(seed):
    """To the bit: the random numbers of a sample go to the bodies that its ray reaches, and to no other."""
    side = 3
    together = rendered(crowd(plane(side), side), side, seed).passes
    for x, y, z in plane(side):
        alone = rendered(crowd([(x, y, z)], side), side, seed).passes
        pixels = np.s_[y * PIXELS : (y + 1) * PIXELS, x * PIXELS : (x + 1) * PIXELS]
        assert np.isfinite(alone["depth"][pixels]).any()
        for name in ("depth", "normal"):
            np.testing.assert_array_equal(together[name][pixels], alone[name][pixels])


@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+", "global-1"])
def test_the_order_of_objects_changes_nothing(memory, seed):
    """Every path with all its bounces and shadow rays, to the bit. Global memory gives each object a realisation by number."""
    places = [(x, y, -z) for x in range(2) for y in range(2) for z in range(3)]
    images, counters = [], []
    for order in (places, places[::-1], places[5:] + places[:5]):
        result = rendered(crowd(order, 2, [LAMP], max_bounces=3), 2, seed, memory=memory)
        images.append(result.passes["combined"])
        counters.append({name: n for name, n in result.stats.items() if isinstance(n, int)})
    assert images[0][..., :3].std() > 0 and counters[0]["shadow_rays"] > 0
    for image, counted in zip(images[1:], counters[1:], strict=True):
        np.testing.assert_array_equal(image, images[0])
        assert counted == counters[0]


@pytest.mark.parametrize("memory", ["renewal+", "global"])
def test_objects_out_of_reach_change_nothing(memory, seed):
    places = plane(2)
    apart = [(x, y, 100_000) for x in range(5) for y in range(5)]
    few, many = (rendered(crowd(at, 2, [LAMP], max_bounces=3), 2, seed, memory=memory) for at in (places, places + apart))
    np.testing.assert_array_equal(few.passes["combined"], many.passes["combined"])
    counters = [{name: n for name, n in r.stats.items() if isinstance(n, int)} for r in (few, many)]
    assert counters[0] == counters[1]


@pytest.mark.parametrize("material", ["lambert", "mirror", "dielectric"])
@pytest.mark.parametrize("memory", ["renewal", "renewal+", "global", "global-1"])
def test_a_path_leaves_nothing_behind_for_the_next(memory, material, seed):
    """To the bit: a pixel whose blocks of samples are drawn one after the other, and each by itself. Bodies overlap, so that
    they remember each other; a haze that the camera does not see stands in the lamp's light."""
    beside = np.eye(4)
    beside[:3, 3] = 6, 0, 0.5
    places = [(0.5 * x, 0.5 * y, 0) for x in range(2) for y in range(2)] + [(1.1, 0, 0)]
    description = crowd(places, 1, [LAMP | {"matrix": beside}], max_bounces=5)
    description["objects"][-1]["process"] = gn.GaussianProcess(
        gn.ConstantField(0.06), 0.05, gn.SquaredExponential(0.5), bounds=((2.2, -2, -2), (5, 2, 2))
    )
    description["materials"]["Body"] = {"type": material} | ({"ior": 1.5} if material == "dielectric" else {})
    planned = gn.Scene(description)

    def drawn(first, count):
        return gn.render(planned, 1, 1, samples=count, first_sample=first, seed=seed, memory=memory, threads=1)

    parts = [drawn(16 * block, 16) for block in range(24)]
    np.testing.assert_array_equal(drawn(0, 16 * 24).passes["combined"], gn.merge(parts).passes["combined"])


def test_each_object_has_a_realisation_of_its_own(seed):
    """Two hazes in one place, memory global: independent, so a ray passes both with the square of the chance."""
    haze = gn.GaussianProcess(gn.ConstantField(0.03), 0.05, gn.SquaredExponential(0.5), bounds=((-1,) * 3, (1,) * 3))
    missed = []
    for n in (1, 2):
        description = scene(haze, max_bounces=0)
        description["camera"] = {"type": "orthographic", "matrix": description["camera"]["matrix"], "width": 1.9}
        description["objects"] = [description["objects"][0] | {"name": str(i)} for i in range(n)]
        stats = gn.render(gn.Scene(description), 16, 16, samples=32, seed=seed, memory="global").stats
        missed.append(1 - stats["path_vertices"] / stats["camera_paths"])
    error = np.sqrt(sum(d**2 * p * (1 - p) / 8192 for p, d in zip(missed, (2 * missed[0], 1), strict=True)))
    assert 0.1 < missed[0] < 0.9
    assert abs(missed[1] - missed[0] ** 2) < 5 * error
