"""How well a fit says what was composed: sentences for the panel, and colours of the surface as it is seen."""

from dataclasses import dataclass

import numpy as np

from ..native import native
from ..viewport import colour

_ERRORS = ("mean_error", "sigma_error")
_SHAPE = ("skewness", "kolmogorov")
# Deviations within which the surface is at a node.
_NEAR = 3.0
# Of the values on a scale of colours; a few extremes would leave all others one colour.
_MOST = 99.0
# Images are linear, the colour map is not.
_DISPLAY = 2.2


def near(fit):
    """Nodes where the surface may be: within three deviations, or next to it."""
    return np.abs(fit["mean"]) < np.maximum(_NEAR * fit["sigma"], fit["voxel_size"])


def lengths(entries):
    """(N, 6) of A -> its three length scales (N, 3), shortest first."""
    return np.sqrt(np.maximum(np.linalg.eigvalsh(entries[:, [[0, 3, 4], [3, 1, 5], [4, 5, 2]]].astype(float)), 0))


def summary(fit, realisations, method):
    """Sentences about the fit of a list."""
    close = near(fit)
    counters = fit["counters"]
    mixed = (fit["kolmogorov"] > 0) & close
    lines = [
        f"{counters['voxels']:,} voxels of {fit['voxel_size']:.3g}, {counters['voxels_drawn']:,} sampled"
        f" ({counters['voxels_drawn'] / counters['voxels']:.0%}), {counters['seconds']:.1f} s."
    ]
    if method == "SAMPLE" and counters["voxels_drawn"]:
        sampled = fit["mean_error"] > 0
        lines.append(
            f"{realisations:,} realisations: standard error of the mean up to {fit['mean_error'].max():.2g}, of σ up to "
            f"{fit['sigma_error'].max():.2g} (σ there {np.median(fit['sigma'][sampled]):.2g})."
        )
    if np.any(mixed):
        distance, skewness = fit["kolmogorov"][mixed], fit["skewness"][mixed]
        low, high = np.percentile(skewness, [100 - _MOST, _MOST])
        lines.append(
            f"Near the surface {np.mean(mixed[close]):.0%} of the voxels mix operands: Kolmogorov distance to a normal "
            f"distribution {np.median(distance):.2g}, in 99 of 100 below {np.percentile(distance, _MOST):.2g}, at most "
            f"{distance.max():.2g}; skewness {low:.2g} to {high:.2g} in 98 of 100."
        )
    else:
        lines.append("Near the surface one operand wins everywhere: mean and σ are exact.")
    if np.any(close):
        scales = lengths(fit["anisotropy"][close])
        lines.append(f"Length scales {scales.min():.2g} to {scales.max():.2g}.")
        if scales.min() < 1.001 * fit["voxel_size"]:
            lines.append("The shortest are those of a voxel: a higher resolution keeps shorter ones.")
    if counters["length_scales_limited"]:
        lines.append(f"At {counters['length_scales_limited']:,} voxels they were brought into one voxel to 4 diagonals.")
    return " ".join(lines)


@dataclass
class Quantity:
    """Numbers 0 to 1 at the nodes of a fit, and what they stand for."""

    parts: np.ndarray
    title: str


def quantities(fit):
    """Six of them for a picture; none where the file no longer holds what a fit has written."""
    if not {*_ERRORS, *_SHAPE} <= fit.keys():
        return []
    close = near(fit)
    if not np.any(close):
        return []
    out = [_linear(fit[key], close, title) for key, title in zip(_ERRORS, ("error of the mean", "error of σ"), strict=True)]
    scales = lengths(fit["anisotropy"][close])
    low, high = colour.log_range(scales)

    def scale(index, title):
        parts = np.ones(close.shape)
        parts[close] = colour.log_parts(scales[:, index], low, high)
        return Quantity(np.clip(parts, 0, 1), f"{title} length scale {low:.2g} to {high:.2g}")

    skewness = fit["skewness"]
    most = max(float(np.percentile(np.abs(skewness[close]), _MOST)), 1e-6)
    return [
        *out,
        scale(0, "shortest"),
        Quantity(np.clip(0.5 + 0.5 * skewness / most, 0, 1), f"skewness ±{most:.2g}"),
        _linear(fit["kolmogorov"], close, "Kolmogorov distance"),
        scale(2, "longest"),
    ]


def _linear(values, close, title):
    most = max(float(np.percentile(values[close], _MOST)), 1e-9)
    return Quantity(np.clip(values / most, 0, 1), f"{title} 0 to {most:.2g}")


def seen(description, entry, fit, size, samples, progress):
    """Colours (H, W, 3) of each quantity where the surface of `entry`, alone in the picture, is seen; black beside it. None if
    it was cancelled. What is seen is an albedo, multiplied by nothing: mean of a pixel's first hits."""
    parts = [quantity.parts for quantity in quantities(fit)]
    gn, out = native(), []
    for k in range(0, len(parts), 2):
        grids = [gn.GridField(one.astype(float), fit["voxel_size"], fit["origin"]) for one in parts[k : k + 2]]
        body = entry | {"albedo": gn.ColorField(*grids, 1.0), "materials": ["White"] * len(entry["materials"])}
        scene = description | {
            "settings": description["settings"] | {"max_bounces": 0},
            "materials": {"White": {"type": "lambert", "color": (1.0, 1.0, 1.0)}},
            "meshes": {},
            "objects": [body],
        }
        # The same seed: the same hits.
        result = gn.render(
            gn.Scene(scene),
            *size,
            samples=samples,
            progress=lambda fraction, stats, k=k: progress((k / 2 + fraction) / (len(parts) / 2)),
        )
        if result.stats["cancelled"]:
            return None
        albedo = np.asarray(result.passes["albedo"], dtype=float)
        cover = albedo[..., 2]
        for channel in range(2):
            values = albedo[..., channel] / np.maximum(cover, 1e-6)
            shown = colour.of(values.reshape(-1)).reshape(*values.shape, 3)
            out.append(shown**_DISPLAY * cover[..., None])
    return out
