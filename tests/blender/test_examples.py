"""Every example renders, small, and what it writes is what it says."""

import json
import runpy
import sys
from pathlib import Path

import bpy
import numpy as np

EXAMPLES = Path(__file__).parents[2] / "examples"


def test_first_light(extension, tmp_path, monkeypatch):
    options = ["--output", tmp_path, "--width", "96", "--seconds", "5", "--resolution", "32"]
    monkeypatch.setattr(sys, "argv", ["first_light.py", "--", *map(str, options)])
    runpy.run_path(str(EXAMPLES / "first_light.py"), run_name="__main__")
    assert extension in bpy.context.preferences.addons, "it must not switch off what the artist has"
    statistics = json.loads((tmp_path / "first_light.json").read_text())
    assert statistics["history"][-1]["samples"] > 0 and statistics["stop"] == "time limit"
    assert (tmp_path / "first_light.exr").stat().st_size > 10_000
    image = bpy.data.images.load(str(tmp_path / "first_light.png"))
    assert tuple(image.size) == (96, 54)
    pixels = np.array(image.pixels[:]).reshape(54, 96, 4)
    assert pixels[-6:, :, 2].mean() > pixels[-6:, :, 0].mean(), "the sky is blue"
    third = 96 // 3
    for figure in range(3):  # clay is red
        column = pixels[20:36, figure * third + 8 : (figure + 1) * third - 8]
        assert (column[..., 0] - column[..., 2]).max() > 0.15


def test_preset_thumbnails(extension, tmp_path, monkeypatch):
    """A ball of the preset's colour in the middle of the picture."""
    options = ["--output", tmp_path, "--size", "24", "--samples", "4", "moss"]
    monkeypatch.setattr(sys, "argv", ["preset_thumbnails.py", "--", *map(str, options)])
    runpy.run_path(str(EXAMPLES / "preset_thumbnails.py"), run_name="__main__")
    image = bpy.data.images.load(str(tmp_path / "moss.png"))
    assert tuple(image.size) == (24, 24)
    pixels = np.array(image.pixels[:]).reshape(24, 24, 4)
    middle = pixels[9:15, 9:15, :3].mean(axis=(0, 1))
    assert middle[1] > 1.3 * max(middle[0], middle[2]), "moss is green"
