"""Light transport on stochastic surfaces through the whole renderer: furnace, the standard sphere, samplers against each other."""

import json
from pathlib import Path

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import Z_LIMIT, check_z

pytestmark = pytest.mark.stats
DATA = Path(__file__).parents[3] / "shared" / "data"


def scene(process, material, memory, *, world, light_sampling=True, sampler="auto", fov=35.0, lights=()):
    camera = np.eye(4)
    camera[2, 3] = 4
    return gn.Scene(
        {
            "version": 1,
            "settings": {"light_sampling": light_sampling},
            "camera": {"type": "perspective", "matrix": camera, "fov_x": np.radians(fov)},
            "world": world,
            "lights": list(lights),
            "materials": {"surface": material},
            "meshes": {},
            "objects": [
                {
                    "name": "sphere",
                    "type": "gpis",
                    "process": process,
                    "matrix": np.eye(4),
                    "materials": ["surface"],
                    "memory": memory,
                    "sampler": sampler,
                }
            ],
        }
    )


def unit_sphere(sigma, length_scale, bounds=None):
    return gn.GaussianProcess(gn.SphereField([0, 0, 0], 1), sigma, gn.SquaredExponential(length_scale), bounds=bounds)


@pytest.mark.parametrize("light_sampling", [False, True])
@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
@pytest.mark.parametrize("material", ["lambert", "mirror"])
@pytest.mark.parametrize("sigma", [0.1, 0.4])  # half and twice the length scale
def test_white_furnace(sigma, material, memory, light_sampling, seed, full_size):
    """Oracle 13: nothing is lost. Without light sampling every path is exactly 1.

    A constant world is never sampled as a light (a ray that escapes finds it just as well), so light sampling has an image.
    """
    size, samples = (48, 1024) if full_size else (16, 256)
    furnace = scene(
        unit_sphere(sigma, 0.2),
        {"type": material, "color": (1, 1, 1)},
        memory,
        world={"image": np.ones((8, 16, 3), np.float32)} if light_sampling else {"color": (1, 1, 1)},
        light_sampling=light_sampling,
    )
    result = gn.render(furnace, size, size, samples=samples if light_sampling else 32, seed=seed)
    image = result.passes["combined"][..., 0].astype(float)
    if not light_sampling:
        np.testing.assert_allclose(image, 1, rtol=1e-6)
        assert result.stats["shadow_rays"] == 0
        return
    assert result.stats["shadow_rays"] > 0
    variance = result.passes["variance"][..., 0].astype(float)
    mean_error = np.sqrt(variance.sum()) / image.size
    assert mean_error < (5e-4 if full_size else 5e-3)
    assert abs(image.mean() - 1) < 4 * mean_error
    z = (image - 1) / np.sqrt(np.maximum(variance, 1e-12))
    blocks = samples // 16
    # Each variance comes from `blocks` values: Student's t, whose far tail a factor of the normal limit covers.
    assert np.abs(z).max() < Z_LIMIT * (1 + 12 / blocks)


def impact_parameter(size, fov):
    """Distance from the origin at which the ray through each pixel's centre passes."""
    x = ((np.arange(size) + 0.5) / size * 2 - 1) * np.tan(np.radians(fov) / 2)
    direction = np.stack([*np.meshgrid(x, x), -np.ones((size, size))], axis=-1)
    direction /= np.linalg.norm(direction, axis=-1, keepdims=True)
    return np.linalg.norm(np.cross([0, 0, 4.0], direction), axis=-1)


def bin_means(result, fov=35.0):
    image = result.passes["combined"][..., 0].astype(float)
    variance = result.passes["variance"][..., 0].astype(float)
    b = impact_parameter(len(image), fov)
    edges = [0, 0.5, 0.8, 0.95, 1.05, 1.2]
    inside = [(b >= low) & (b < high) for low, high in zip(edges, edges[1:], strict=False)]
    return (
        np.array([image[m].mean() for m in inside]),
        np.array([np.sqrt(variance[m].sum()) / m.sum() for m in inside]),
    )


def standard_sphere(memory, sampler="auto"):
    bounds = ((-1.3, -1.3, -1.3), (1.3, 1.3, 1.3))
    return scene(
        unit_sphere(0.05, 0.1, bounds),
        {"type": "lambert", "color": (0.8, 0.8, 0.8)},
        memory,
        world={"color": (1, 1, 1)},
        light_sampling=False,
        sampler=sampler,
    )


@pytest.mark.parametrize("sampler", ["convolution", "dense"])
def test_standard_sphere(sampler, seed, full_size):
    """The paper's renderer on its own terms (design data, baseline.json): each bin of the impact parameter."""
    path = DATA / "baseline.json"
    if not path.exists():
        pytest.skip("shared/data/baseline.json is not there")
    baseline = json.loads(path.read_text())["standard_sphere"]["mean_radiance"]
    samples = (256 if full_size else 64) // (4 if sampler == "dense" else 1)
    mean, error = bin_means(gn.render(standard_sphere("renewal+", sampler), 128, 128, samples=samples, seed=seed))
    combined = np.hypot(error, baseline["renewal+_standard_error"])
    difference = np.abs(mean - baseline["renewal+"])
    assert np.all(difference < 3 * combined + 0.001), (mean, error)


def gradient_world():
    """Radiance 1 + z: linear in the direction, so that the image depends on where light comes from."""
    height, width = 64, 8
    elevation = (np.arange(height) + 0.5) / height * np.pi - np.pi / 2
    return {"image": np.broadcast_to((1 + np.sin(elevation))[:, None, None], (height, width, 3)).astype(np.float32)}


@pytest.mark.parametrize("material", ["lambert", "mirror", "conductor"])
def test_samplers_render_one_image(material, seed, full_size):
    """Albedo .5 under a gradient: convolution against dense, pixel by pixel. A furnace cannot see a wrong normal, this can."""
    size, samples = (32, 1024) if full_size else (16, 384)
    process = unit_sphere(0.15, 0.2, ((-1.9, -1.9, -1.9), (1.9, 1.9, 1.9)))
    results = [
        gn.render(
            scene(
                process,
                {"type": material, "color": (0.5, 0.5, 0.5)} | ({"roughness": 0.3} if material == "conductor" else {}),
                "renewal+",
                world=gradient_world(),
                sampler=sampler,
            ),
            size,
            size,
            samples=samples // (2 if sampler == "dense" else 1),
            seed=seed + i,
        )
        for i, sampler in enumerate(["convolution", "dense"])
    ]
    a, b = (r.passes["combined"][..., 0].astype(float) for r in results)
    va, vb = (r.passes["variance"][..., 0].astype(float) for r in results)
    blocks = samples // 32
    error = np.sqrt(va + vb) + 1e-4  # the world's own interpolation in single precision
    check_z((a - b) / (1 + 12 / blocks), 0, error, material)
    check_z((a - b).mean(), 0, np.sqrt((va + vb).sum()) / a.size, f"{material}, mean of all pixels")
    assert a.max() - a.min() > 0.2


@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
@pytest.mark.parametrize("material", ["lambert", "mirror"])
def test_light_sampling_changes_no_expectation(material, memory, seed, full_size):
    """Oracle 19, under a lamp of finite size that both strategies find."""
    lamp = np.eye(4)
    lamp[:3, 3] = [1.5, 2, 3]
    light = {"name": "lamp", "type": "point", "matrix": lamp, "power": 300.0, "radius": 0.6}
    size, samples = (16, 4096) if full_size else (12, 1024)
    means = []
    for light_sampling in (True, False):
        result = gn.render(
            scene(
                unit_sphere(0.1, 0.2),
                {"type": material, "color": (0.7, 0.7, 0.7)},
                memory,
                world={"color": (0, 0, 0)},
                light_sampling=light_sampling,
                lights=[light],
            ),
            size,
            size,
            samples=samples,
            seed=seed + light_sampling,
        )
        image, variance = (result.passes[p][..., 0].astype(float) for p in ("combined", "variance"))
        means.append((image.mean(), variance.sum() / image.size**2))
    (on, var_on), (off, var_off) = means
    assert var_on < var_off
    check_z(on - off, 0, np.sqrt(var_on + var_off), f"{material}, {memory}")
