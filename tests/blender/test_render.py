"""F12: the image, its passes, the border, animation, statistics."""

import json

import bpy
import numpy as np
import pytest

from . import support


@pytest.fixture
def stage(empty_scene):
    support.settings(empty_scene, samples=32)
    support.world(empty_scene, (0.5, 0.6, 0.8))
    support.plane(empty_scene, size=8, material=support.diffuse("Grey", (0.4, 0.3, 0.2)))
    support.cube(empty_scene, "Box", 1, support.diffuse("Red", (0.7, 0.1, 0.1)), location=(0, 0, 0.5))
    support.light(empty_scene, "SUN", 2, rotation=(0.95, 0.2, 0.2, 0.1), angle=0.1)
    support.camera(empty_scene, (1, -6, 3), (0, 0, 0.5))
    return empty_scene


def test_picture_is_that_of_cycles(stage, tmp_path):
    support.same_pictures(stage, tmp_path)


def all_passes(scene, path, engine="GPIS"):
    scene.render.engine = engine
    support.image_settings(scene, multilayer=True)
    layer = scene.view_layers[0]
    layer.use_pass_z = layer.use_pass_normal = True
    layer.gpis.use_pass_albedo = layer.gpis.use_pass_variance = layer.gpis.use_pass_sample_count = True
    scene.render.filepath = str(path / f"{engine}.exr")
    bpy.ops.render.render(write_still=True)
    return support.read_exr(path / f"{engine}.exr")


def test_passes(stage, tmp_path):
    ours, attributes = all_passes(stage, tmp_path)
    cycles, _ = all_passes(stage, tmp_path, "CYCLES")
    prefix = "ViewLayer."
    for name in ("Combined", "Depth", "Normal", "Albedo", "Variance", "Sample Count"):
        assert any(channel.startswith(prefix + name + ".") for channel in ours), f"{name} in {sorted(ours)}"
    assert np.all(ours[prefix + "Sample Count.X"] == 32)
    depth, true = ours[prefix + "Depth.Z"], cycles[prefix + "Depth.Z"]
    assert np.mean((depth >= 1e10) != (true >= 1e10)) < 0.03, "only at edges, where a pixel has both"
    assert np.isfinite(depth).all(), "a miss is a number in Blender's depth"
    inner = (true < 1e10) & (depth < 1e10) & _inner(true)
    assert inner.mean() > 0.3
    assert np.abs(depth / true - 1)[inner].max() < 0.02
    for axis in "XYZ":
        name = f"{prefix}Normal.{axis}"
        assert np.abs(ours[name] - cycles[name])[inner].max() < 1e-3
    albedo = [ours[f"{prefix}Albedo.{channel}"] for channel in "RGB"]
    assert np.allclose(albedo[0][inner] / albedo[2][inner], 2, rtol=1e-3) | np.any(albedo[0] > 0.6)
    assert np.all(ours[prefix + "Variance.R"] >= 0) and ours[prefix + "Variance.R"].max() > 0
    assert attributes["gpis.samples"].decode().rstrip("\0") in {"32", "32.0"}
    history = json.loads(attributes["gpis.history"].decode().rstrip("\0"))
    assert [samples for _, samples, _ in history] == [16, 32]
    assert 0 < history[0][0] <= history[1][0], "seconds since the start"
    error = history[-1][2]
    assert error > 0 and error == float(attributes["gpis.estimated_error"].decode().rstrip("\0"))


def _inner(depth):
    """Pixels whose neighbours lie on the same face: away from edges the mean over a pixel is smooth."""
    flat = np.zeros(depth.shape, bool)
    second = np.abs(depth[1:-1, 2:] - 2 * depth[1:-1, 1:-1] + depth[1:-1, :-2]) + np.abs(
        depth[2:, 1:-1] - 2 * depth[1:-1, 1:-1] + depth[:-2, 1:-1]
    )
    flat[1:-1, 1:-1] = second < 0.02
    return flat


def test_variance_is_that_between_seeds(stage, tmp_path):
    pictures = np.stack([support.picture(stage, tmp_path, seed=seed) for seed in range(1, 9)])
    stage.gpis.seed = 0
    ours, _ = all_passes(stage, tmp_path)
    claimed = np.mean([ours[f"ViewLayer.Variance.{channel}"].mean() for channel in "RGB"])
    measured = pictures.var(axis=0, ddof=1).mean()
    # 8 seeds of 9,216 values; blocks of 16 stand for the variance, two of them in 32 samples.
    assert measured == pytest.approx(claimed, rel=0.15)


def test_same_seed_same_picture_whatever_the_threads(stage, tmp_path):
    one = support.picture(stage, tmp_path, seed=3)
    stage.render.threads = 1
    assert np.array_equal(one, support.picture(stage, tmp_path, seed=3))
    assert not np.array_equal(one, support.picture(stage, tmp_path, seed=4))


def test_border_is_a_part_of_the_whole(stage, tmp_path):
    stage.gpis.samples = 256
    whole = support.picture(stage, tmp_path)
    stage.render.use_border = True
    stage.render.border_min_x, stage.render.border_max_x = 0.25, 0.75
    stage.render.border_min_y, stage.render.border_max_y = 0.5, 1.0
    part = support.picture(stage, tmp_path)
    assert part.shape == whole.shape and np.all(part[:24] == 0) and np.all(part[:, :16] == 0)
    assert abs(part[24:, 16:48].mean() / whole[24:, 16:48].mean() - 1) < 0.01
    stage.render.use_crop_to_border = True
    assert np.array_equal(support.picture(stage, tmp_path), part[24:, 16:48])


def test_animation_writes_every_frame(stage, tmp_path):
    box = bpy.data.objects["Box"]
    box.keyframe_insert("location", frame=1)
    box.location.x = 2
    box.keyframe_insert("location", frame=3)
    stage.frame_start, stage.frame_end = 1, 3
    support.image_settings(stage)
    stage.render.filepath = str(tmp_path / "frame_")
    bpy.ops.render.render(animation=True)
    pictures = [support.read_exr(tmp_path / f"frame_{frame:04d}.exr")[0]["R"] for frame in (1, 2, 3)]
    columns = [np.average(np.arange(64), weights=np.maximum(entry - entry.min(), 0).sum(axis=0)) for entry in pictures]
    assert not np.array_equal(pictures[0], pictures[2]) and columns[0] < columns[2]
    for frame in (1, 2, 3):
        assert json.loads((tmp_path / f"frame_{frame:04d}.json").read_text())["frame"] == frame


def test_statistics_can_be_left_out(stage, tmp_path):
    stage.gpis.write_statistics = False
    support.picture(stage, tmp_path)
    assert not list(tmp_path.glob("*.json")) and list(tmp_path.glob("*.exr"))


def test_no_statistics_without_a_name_for_the_image(stage, tmp_path):
    stage.render.filepath = f"{tmp_path}/"
    bpy.ops.render.render()
    assert not list(tmp_path.iterdir())


def test_statistics_beside_the_image_and_by_operator(stage, tmp_path):
    """Renders in the background write them unasked."""
    support.picture(stage, tmp_path)
    entry = json.loads((tmp_path / "GPIS-0.json").read_text())
    assert entry["stop"] == "samples" and [row["samples"] for row in entry["history"]] == [16, 32]
    assert entry["history"][-1]["estimated_error"] == entry["stats"]["estimated_error"] > 0 and entry["plan"]
    bpy.ops.gpis.save_statistics(filepath=str(tmp_path / "saved.json"))
    assert json.loads((tmp_path / "saved.json").read_text()) == entry


def test_statistics_go_where_the_image_goes(stage, tmp_path):
    """Blender makes the folder, but after the render."""
    stage.gpis.write_statistics = True
    support.picture(stage, tmp_path / "new" / "folder")
    assert (tmp_path / "new" / "folder" / "GPIS-0.json").exists()


def test_statistics_are_strict_json(stage, tmp_path):
    """A single sample has no error estimate: null, for JSON knows no infinity."""
    stage.gpis.write_statistics, stage.gpis.samples = True, 1
    support.picture(stage, tmp_path)

    def refuse(constant):
        raise AssertionError(f"{constant} is no JSON")

    entry = json.loads((tmp_path / "GPIS-0.json").read_text(), parse_constant=refuse)
    assert entry["history"][-1]["estimated_error"] is None and entry["stats"]["estimated_error"] is None


def test_time_limit_and_noise_threshold_end_the_render(stage, tmp_path):
    stage.gpis.use_samples, stage.gpis.write_statistics = False, True
    stage.gpis.time_limit = 0.5
    support.picture(stage, tmp_path)
    assert json.loads((tmp_path / "GPIS-0.json").read_text())["stop"] == "time limit"
    stage.gpis.time_limit = 0
    stage.gpis.use_noise_threshold, stage.gpis.noise_threshold = True, 0.1
    support.picture(stage, tmp_path)
    entry = json.loads((tmp_path / "GPIS-0.json").read_text())
    assert entry["stop"] == "noise threshold"
    assert entry["history"][-1]["estimated_error"] <= 0.1**2


def test_two_view_layers(stage, tmp_path):
    stage.view_layers.new("Second").use = True
    stage.gpis.write_statistics = True
    support.picture(stage, tmp_path)
    assert (tmp_path / "GPIS-0.ViewLayer.json").exists() and (tmp_path / "GPIS-0.Second.json").exists()
