"""Converged references: renders of another sampler, kept with their exact sums and extended where more samples are asked."""

import gpis_native as gn
import numpy as np

from .measure import LUMINANCE, REFERENCE_FACTOR, REFERENCE_SEED


def path_of(folder, scene, reference, size):
    return folder / f"{scene.name}.{reference.key}.{size}.npz"


def reference_image(folder, scene, reference, size, largest_budget, files, progress=None):
    """Luminance (H, W), the variance of its means, and the samples per pixel: at least 100 times the largest budget."""
    path = path_of(folder, scene, reference, size)
    wanted = REFERENCE_FACTOR * largest_budget
    result = gn.load_result(path) if path.exists() else None
    done = int(result.stats["samples"]) if result else 0
    if done < wanted:
        planned = gn.Scene(reference.describe(scene, files))
        more = gn.render(
            planned, size, size, samples=wanted - done, first_sample=done, seed=REFERENCE_SEED, progress=progress
        )
        result = gn.merge([result, more]) if result else more
        folder.mkdir(parents=True, exist_ok=True)
        result.save(path)
    image = result.passes["combined"][..., :3].astype(float) @ LUMINANCE
    # Variance of luminance: that of grey light, where the channels go up and down together.
    deviation = np.sqrt(result.passes["variance"].astype(float)) @ LUMINANCE
    return image, deviation**2, int(result.stats["samples"])
