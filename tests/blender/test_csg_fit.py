"""Fits of CSG lists, how good they say they are, and their comparison with the list."""

import importlib

import bpy
import numpy as np
import pytest

from . import support
from .csg_objects import build, entry_of, make_operands


@pytest.fixture
def operands(stage):
    return make_operands(stage)


def test_fit(operands, describe, tmp_path):
    """A new Volume with the moments of the composition, that renders like it."""
    a, b, c = operands
    for obj in operands:  # a fit has one material
        obj.material_slots[0].material = a.material_slots[0].material
    build(a, ["UNION", "UNION"])
    live, _ = entry_of(describe)
    bpy.context.scene.gpis.samples = 16
    live_picture = support.picture(bpy.context.scene, tmp_path)
    assert bpy.ops.gpis.csg_fit(resolution=24, realisations=200, seed=3) == {"FINISHED"}
    fitted = bpy.context.object
    assert fitted.name == "A Fit" and fitted.type == "VOLUME" and fitted.display_type == "BOUNDS"
    assert a.hide_render and not fitted.hide_render
    assert fitted.data.gpis_baked and fitted.material_slots[0].material == a.material_slots[0].material
    assert "realisations: standard error of the mean" in fitted.gpis_csg.quality
    assert "Kolmogorov distance" in fitted.gpis_csg.quality and "not kept" not in fitted.gpis_csg.quality
    entry, warnings = entry_of(describe)
    assert not warnings
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    values = np.stack([leaf.mean(points) for leaf in live["process"].leaves], axis=-1)
    # Where one operand wins the mean is its own, between the voxels to their size.
    other = np.sort(values, axis=1)
    clear = other[:, 1] - other[:, 0] > 0.4
    assert clear.sum() > 10
    assert np.allclose(entry["process"].mean(points)[clear], other[clear, 0], atol=0.05)
    picture = support.picture(bpy.context.scene, tmp_path, seed=1)
    assert np.abs(live_picture - picture).mean() < 0.014  # 0.007 here, 0.024 for the first operand alone
    assert np.allclose(live_picture.mean(axis=(0, 1)), picture.mean(axis=(0, 1)), atol=0.01)


def test_fit_of_a_smooth_union(operands):
    """Both methods, to the same numbers."""
    a, b, c = operands
    build(a, ["SMOOTH_UNION", "UNION"])
    a.gpis_csg.items[0].blend = 0.3
    assert bpy.ops.gpis.csg_fit(resolution=16, method="CLOSED_FORM") == {"FINISHED"}
    assert 'All of it has the material of "A"; those of other operands' in bpy.context.object.gpis_csg.quality
    assert bpy.ops.gpis.csg_fit.poll() is False  # the fit has no list
    closed = bpy.context.object
    bpy.context.view_layer.objects.active = a
    assert bpy.ops.gpis.csg_fit(resolution=16, realisations=1000) == {"FINISHED"}
    gn = importlib.import_module("gpis_native")
    fits = [gn.read_vdb(bpy.path.abspath(obj.data.filepath)) for obj in (closed, bpy.context.object)]
    drawn = fits[1]["mean_error"] > 1e-6
    # The closed form of the third operand takes the first two for a Gaussian. Of another blend more than a quarter are off.
    off = np.abs(fits[0]["mean"] - fits[1]["mean"])[drawn] > 5 * fits[1]["mean_error"][drawn]
    assert drawn.mean() > 0.1 and off.mean() < 0.02


def test_compare(operands):
    """The fit beside the list it was made of: an image of both and of their difference, and a sentence."""
    a, b, c = operands
    for obj in operands:
        obj.material_slots[0].material = a.material_slots[0].material
    build(a, ["UNION", "UNION"])
    assert not bpy.ops.gpis.csg_compare.poll()
    assert bpy.ops.gpis.csg_fit(resolution=24, realisations=200, seed=3) == {"FINISHED"}
    fitted = bpy.context.object
    assert fitted.gpis_csg.fitted_from == a
    assert (fitted.gpis.sigma, fitted.gpis.length_scale) == (a.gpis.sigma, a.gpis.length_scale), "what brushes begin with"
    hidden = [obj.hide_render for obj in bpy.data.objects]
    assert bpy.ops.gpis.csg_compare(samples=32, width=32) == {"FINISHED"}
    assert [obj.hide_render for obj in bpy.data.objects] == hidden
    image = bpy.data.images["A Fit: Live, Fitted, Difference"]
    assert image == fitted.gpis_csg.comparison_image and image.packed_file is not None

    def pictures():
        """Rows of three pictures, the top row first."""
        width, height = image.size
        assert (width, height) == (96, 72)
        image.pixels.foreach_get(pixels := np.empty(width * height * 4, dtype=np.float32))
        rows = np.split(pixels.reshape(height, width, 4)[..., :3], 3)[::-1]
        return [np.split(row, 3, axis=1) for row in rows]

    (live, fit, difference), errors, shape = pictures()
    text = fitted.gpis_csg.comparison
    gain = float(text.split("difference times ")[1].split(".")[0])
    np.testing.assert_allclose(difference, gain * np.abs(live - fit), atol=1e-4 * gain)
    assert "Live " in text and " s at 32 samples. Pixels differ by " in text
    # Below: black beside the surface, colours on it; those of the shape are not one colour, for there are creases.
    for name, picture in zip(text.split("yellow: ")[1].split("; "), [*errors, *shape], strict=True):
        covered = np.sum(picture, axis=-1) > 0.1
        assert 0.05 < covered.mean() < 0.9, name
        assert picture[covered].std(axis=0).max() > 0.02, name
    assert len({picture.tobytes() for picture in [*errors, *shape]}) == 6
    # The list, not twice the same: and the fit is near it, where the first operand alone is not.
    assert 0 < np.abs(live - fit).mean() < 0.02
    a.gpis_csg.items[0].enabled = a.gpis_csg.items[1].enabled = False
    assert bpy.ops.gpis.csg_compare(samples=32, width=32) == {"FINISHED"}
    assert image == fitted.gpis_csg.comparison_image
    alone = pictures()[0][0]
    off = [float(np.abs(other - fit).mean()) for other in (alone, live)]
    assert off[0] > 2 * off[1]
    bpy.data.objects.remove(a)
    assert not bpy.ops.gpis.csg_compare.poll()


def test_compare_of_a_copy_and_of_what_is_switched_off(operands):
    """A copy's comparison leaves the picture of the original alone; there is nothing to compare where GPIS is off."""
    build(operands[0], ["UNION", "UNION"])
    assert bpy.ops.gpis.csg_fit(resolution=12, realisations=20) == {"FINISHED"}
    fitted = bpy.context.object
    assert bpy.ops.gpis.csg_compare(samples=2, width=16) == {"FINISHED"}
    image = fitted.gpis_csg.comparison_image
    copy = fitted.copy()
    bpy.context.collection.objects.link(copy)
    bpy.context.view_layer.objects.active = copy
    for width in (16, 24):
        assert bpy.ops.gpis.csg_compare(samples=2, width=width) == {"FINISHED"}
        assert fitted.gpis_csg.comparison_image == image and tuple(image.size) == (48, 36)
        assert copy.gpis_csg.comparison_image != image and copy.gpis_csg.comparison_image.size[0] == 3 * width
    for obj in (copy, operands[0]):
        obj.gpis.enabled = False
        assert not bpy.ops.gpis.csg_compare.poll()
        obj.gpis.enabled = True
    assert bpy.ops.gpis.csg_compare.poll()


def test_comparison_of_a_long_name(operands):
    """Blender cuts names to 63 bytes (255 from 5.0 on): the image is found again, and not another fit's."""
    a, b, c = operands
    build(a, ["UNION", "UNION"])
    images = []
    for _ in range(2):
        bpy.context.view_layer.objects.active = a
        assert bpy.ops.gpis.csg_fit(resolution=8, method="CLOSED_FORM") == {"FINISHED"}
        fitted = bpy.context.object
        fitted.name = "ß" * 127
        for _ in range(2):
            assert bpy.ops.gpis.csg_compare(samples=1, width=8) == {"FINISHED"}
        images.append(fitted.gpis_csg.comparison_image)
    assert images[0] != images[1] and len(bpy.data.images) == 2


def test_progress_and_cancelling(operands, extension):
    """The work that the window's modal operator watches: in a thread, told to stop."""
    a, b, c = operands
    build(a, ["UNION", "UNION"])
    module = importlib.import_module(extension + ".csg.fit")
    query = module._Query(bpy.context, a, resolution=96, realisations=1_000_000, method="SAMPLE")
    plan = query.plan()
    assert plan["seconds"] > 1 and 0 < plan["voxels_drawn"] < plan["voxels"] and plan["memory"] > 0
    work = importlib.import_module(extension + ".csg.work").Work(lambda progress: query.run(1, progress))
    assert work.running()
    work.cancel()
    work.join()
    assert work.result is None and work.error is None and work.fraction < 1
