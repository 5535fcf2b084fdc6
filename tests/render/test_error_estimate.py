"""The error that a render reports is the error that it has: over 30 seeds, on the scenes of the bench, at reduced size."""

import numpy as np
import pytest

gn = pytest.importorskip("gpis_native")
from bench.error.scenes import DATA, SCENES, height_field  # noqa: E402

LUMINANCE = np.array((0.2126, 0.7152, 0.0722))
SEEDS, BUDGETS = 30, (16, 64)
COSTLY = ("bunny", "everything")  # the latter holds the painted object, too
LEFT_OUT = ("painted",)


def luminance(result):
    return result.passes["combined"][..., :3].astype(float) @ LUMINANCE


@pytest.mark.parametrize("scene", [s for s in SCENES if s.name not in LEFT_OUT and not s.heavy_tails], ids=lambda s: s.name)
def test_the_estimated_error_is_the_true_one(scene, tmp_path):
    """Mean ratio of estimated to true relMSE in [.8, 1.25] (issue 6), from 16 samples on. The reference has 50 times the
    samples and other seeds; its own noise is taken off. The ratio of one seed is spread by a quarter or less, the mean of
    30 by .05. Where the first 16 samples were one net, the ratio was 1.3 to 2.6 there."""
    if scene.needs and not (DATA / scene.needs).exists():
        pytest.skip(f"{scene.needs} of the shared data is not beside this checkout")
    size, budgets = (5, BUDGETS[:1]) if scene.name in COSTLY else (8, BUDGETS)
    planned = gn.Scene(scene.make("auto", "renewal+", tmp_path))
    reference = gn.render(planned, size, size, samples=50 * budgets[-1], seed=10**6)
    truth = luminance(reference)
    noise = (np.sqrt(reference.passes["variance"].astype(float)) @ LUMINANCE) ** 2
    weight = 1 / (truth**2 + 0.01)
    ratios = []
    for seed in range(SEEDS):
        parts, of_seed = [], []
        for first, samples in zip((0, *budgets), budgets, strict=False):
            parts.append(gn.render(planned, size, size, samples=samples - first, first_sample=first, seed=seed))
            result = gn.merge(parts)
            true = np.mean(weight * (luminance(result) - truth) ** 2) - np.mean(weight * noise)
            of_seed.append(result.stats["estimated_error"] / true)
        ratios.append(of_seed)
    mean = np.mean(ratios, axis=0)
    assert np.all((mean > 0.8) & (mean < 1.25)), mean


def test_height_field_normals_vary_across_the_ray(seed=1):
    """A kernel that is constant along an axis has gradients on a line, not a plane: they have no density to light mirrors
    by, but are random all the same. Two samplers that represent them in different ways (the frame of the ray; nodes on
    it) see the same normals and the same picture. Their means differ by 2 % where the spread is left out."""
    images = {}
    for sampler, samples in (("convolution", 256), ("nystrom", 64)):
        result = gn.render(gn.Scene(height_field(sampler)), 12, 12, samples=samples, seed=seed)
        pixels, variance = luminance(result), result.passes["variance"].astype(float) @ LUMINANCE
        images[sampler] = pixels.mean(), np.sqrt(variance.sum()) / pixels.size, result.passes["normal"][..., 2].mean()
    (a, a_error, a_normal), (b, b_error, b_normal) = images.values()
    assert np.hypot(a_error, b_error) < 0.004 * b  # so that 2 % would be seen
    assert abs(a - b) < 4 * np.hypot(a_error, b_error)
    assert abs(a_normal - b_normal) < 0.004
