"""The passes of a render: one table, read by `update_render_passes`, `add_pass`, the writer and the panel."""

from dataclasses import dataclass

import numpy as np

# What a miss is in Blender's depth pass (Cycles writes the same); the film says infinity.
DEPTH_OF_MISS = 1e10


@dataclass(frozen=True)
class Pass:
    name: str  # in Blender and in the EXR
    key: str  # in the native result
    channels: int
    chan_id: str
    kind: str  # register_pass's word for it
    group: str  # "" where the switch is the view layer's own property, "gpis" where it is ours
    switch: str

    def enabled(self, view_layer):
        owner = getattr(view_layer, self.group) if self.group else view_layer
        return not self.switch or getattr(owner, self.switch)


PASSES = (
    Pass("Combined", "combined", 4, "RGBA", "COLOR", "", ""),
    Pass("Depth", "depth", 1, "Z", "VALUE", "", "use_pass_z"),
    Pass("Normal", "normal", 3, "XYZ", "VECTOR", "", "use_pass_normal"),
    Pass("Albedo", "albedo", 3, "RGB", "COLOR", "gpis", "use_pass_albedo"),
    Pass("Variance", "variance", 3, "RGB", "COLOR", "gpis", "use_pass_variance"),
    Pass("Sample Count", "sample_count", 1, "X", "VALUE", "gpis", "use_pass_sample_count"),
)


def enabled(view_layer):
    return [entry for entry in PASSES if entry.enabled(view_layer)]


def add(engine, view_layer):
    for entry in enabled(view_layer)[1:]:  # Combined is always there
        engine.add_pass(entry.name, entry.channels, entry.chan_id, layer=view_layer.name)


def write(layer, result):
    """Every pass of a render layer from the native result; both have their first row at the bottom."""
    for entry in PASSES:
        target = layer.passes.find_by_name(entry.name, "")
        if target is None:
            continue
        pixels = np.ascontiguousarray(result.passes[entry.key], dtype=np.float32).reshape(-1)
        if entry.key == "depth":
            pixels = np.where(np.isfinite(pixels), pixels, np.float32(DEPTH_OF_MISS))
        target.rect.foreach_set(pixels)
