"""Bad input: a sentence that names the object, what it held and what to do; no crash, no image."""

import importlib
from pathlib import Path

import bpy
import numpy as np
import pytest

from . import support


@pytest.fixture
def stage(empty_scene):
    support.settings(empty_scene, width=16, height=16, samples=16)
    support.world(empty_scene, (1, 1, 1))
    support.camera(empty_scene)
    return empty_scene


@pytest.fixture
def ball(stage):
    bpy.ops.mesh.primitive_uv_sphere_add(segments=16, ring_count=8)
    bpy.ops.gpis.make(resolution=16)
    return bpy.context.object


def write_vdb(path, values, name="mean"):
    importlib.import_module("gpis_native").write_vdb(  # there once the extension is enabled
        str(path), {name: values, "origin": (-1.0, -1.0, -1.0), "voxel_size": 2 / (len(values) - 1)}
    )
    return str(path)


def volume(stage, path):
    data = bpy.data.volumes.new("Cloud")
    data.filepath = path
    obj = support.link(stage, "Cloud", data)
    obj.gpis.enabled, obj.gpis.mean_grid, obj.gpis.sigma, obj.gpis.length_scale = True, "mean", 0.1, 0.3
    return obj


def test_missing_file(stage, ball, tmp_path):
    Path(bpy.path.abspath(ball.data.filepath)).unlink()
    sentence = support.failure(stage, tmp_path)
    assert '"Sphere GPIS"' in sentence and ball.data.filepath in sentence and "not there" in sentence


def test_no_file(stage, tmp_path):
    obj = volume(stage, "")
    sentence = support.failure(stage, tmp_path)
    assert f'"{obj.name}"' in sentence and "has no file" in sentence


def test_not_a_vdb(stage, tmp_path):
    path = tmp_path / "text.vdb"
    path.write_text("not a volume")
    volume(stage, str(path))
    sentence = support.failure(stage, tmp_path)
    assert '"Cloud"' in sentence and "text.vdb" in sentence


def test_wrong_grid_name(stage, ball, tmp_path):
    ball.gpis.mean_grid = "density"
    sentence = support.failure(stage, tmp_path)
    assert '"density"' in sentence and '"mean"' in sentence and '"Sphere GPIS"' in sentence


@pytest.mark.parametrize(
    "name, word", [("sigma", "standard deviation σ is 0"), ("length_scale", "length scale ℓ is 0")]
)
def test_zero_deviation_and_length(stage, ball, tmp_path, name, word):
    setattr(ball.gpis, name, 0.0)
    sentence = support.failure(stage, tmp_path)
    assert word in sentence and '"Sphere GPIS"' in sentence


@pytest.mark.parametrize("name, word", [("sigma", "standard deviation σ"), ("length_scale", "length scale ℓ")])
def test_infinite_deviation_and_length(stage, ball, tmp_path, name, word):
    setattr(ball.gpis, name, float("inf"))
    assert np.isfinite(getattr(ball.gpis, name))  # Blender keeps a number, 3.4e38
    sentence = support.failure(stage, tmp_path)
    assert f"{word} is infinite" in sentence and '"Sphere GPIS"' in sentence


def test_negative_deviation_in_a_grid(stage, tmp_path):
    values = np.full((8, 8, 8), 0.1)
    values[3, 4, 5] = -0.2
    obj = volume(stage, write_vdb(tmp_path / "negative.vdb", values))
    obj.gpis.sigma_source, obj.gpis.sigma_grid, obj.gpis.sigma_meaning = "GRID", "mean", "STANDARD_DEVIATION"
    sentence = support.failure(stage, tmp_path)
    assert '"Cloud"' in sentence and "-0.2" in sentence


def test_nan_voxels(stage, tmp_path):
    values = np.linspace(-1, 1, 8)[:, None, None] * np.ones((8, 8, 8))
    path = tmp_path / "nan.vdb"
    try:
        values[3, 4, 5] = np.nan
        write_vdb(path, values)
    except ValueError as error:
        assert "NaN" in str(error) or "finite" in str(error)  # refused at the first door
        return
    volume(stage, str(path))
    sentence = support.failure(stage, tmp_path)
    assert '"Cloud"' in sentence and ("NaN" in sentence or "finite" in sentence)


def test_vertices_that_are_not_numbers(stage, tmp_path):
    obj = support.cube(stage, "Crooked", material=support.diffuse("Paint", (0.5, 0.5, 0.5)))
    obj.data.name = "Some Data"
    obj.data.vertices[3].co.y = float("nan")
    sentence = support.failure(stage, tmp_path)
    assert 'Object "Crooked": vertex 3 of its mesh' in sentence and "Some Data" not in sentence


@pytest.mark.parametrize(
    "group, entry, member, value, expected",
    [
        ("objects", "Cube.2", "matrix", np.diag((1, 1, 0, 1)), 'Object "Cube.2": matrix flattens'),
        ("objects", "Sphere GPIS", "matrix", np.diag((1, 1, 0, 1)), 'GPIS object "Sphere GPIS": matrix flattens'),
        ("lights", "Point.2", "power", np.inf, 'Light "Point.2": power is inf'),
        ("materials", "Paint", "color", (2.0, 0.0, 0.0), 'Material "Paint": color is (2, 0, 0)'),
        ("camera", None, "clip", (2.0, 1.0), 'Camera "Camera": clip is (2, 1)'),
        ("world", None, "strength", -1.0, 'World "World": strength is -1'),
    ],
)
def test_native_sentences_name_what_the_artist_knows(
    stage, ball, extension, tmp_path, group, entry, member, value, expected
):
    """Whatever the native side refuses: no path of the description is left in the sentence."""
    sync = importlib.import_module(extension + ".sync")
    for name in ("Cube.1", "Cube.2"):
        support.cube(stage, name, material=bpy.data.materials.get("Paint") or support.diffuse("Paint", (0.5, 0.5, 0.5)))
    for name in ("Point.1", "Point.2"):
        support.light(stage, "POINT", 10).name = name
    bpy.context.view_layer.update()
    state = sync.describe(bpy.context.evaluated_depsgraph_get(), 16, 16)
    place = state.description[group]
    if isinstance(place, list):
        place = next(item for item in place if item["name"] == entry)
    elif entry is not None:
        place = place[entry]
    place[member] = value
    with pytest.raises(ValueError) as caught:
        importlib.import_module("gpis_native").Scene(state.description)
    sentence = sync.explain(state, str(caught.value))
    assert sentence.startswith(expected) and f"{group}[" not in sentence and " of '" not in sentence


def test_zero_scale(stage, ball, tmp_path):
    ball.scale.y = 0
    sentence = support.failure(stage, tmp_path)
    assert '"Sphere GPIS" is scaled to zero' in sentence


def test_nothing_ends_the_render(stage, tmp_path):
    stage.gpis.use_samples = False
    assert "Nothing ends this render" in support.failure(stage, tmp_path)


def test_failure_inside_an_animation_stops_it(stage, ball, tmp_path):
    ball.keyframe_insert("scale", frame=1)
    ball.scale.y = 0
    ball.keyframe_insert("scale", frame=2)
    stage.frame_start, stage.frame_end = 1, 3
    support.image_settings(stage)
    stage.render.filepath = str(tmp_path / "frame")
    with pytest.raises(RuntimeError, match="scaled to zero"):
        bpy.ops.render.render(animation=True)
    assert not (tmp_path / "frame0002.exr").exists() and not (tmp_path / "frame0003.exr").exists()


@pytest.mark.parametrize("vertices", [[], [(0, 0, 0)] * 3], ids=["empty", "one point"])
def test_gpis_of_nothing(stage, vertices):
    obj = support.mesh(stage, "Nothing", vertices, [(0, 1, 2)] if vertices else [])
    bpy.context.view_layer.objects.active = obj
    before = set(bpy.data.objects)
    with pytest.raises(RuntimeError, match='"Nothing"'):
        bpy.ops.gpis.make()
    assert set(bpy.data.objects) == before


def test_unexpected_failure_is_an_error_too(stage, tmp_path, extension, monkeypatch):
    """A bug must not leave an image that looks finished."""
    engine = importlib.import_module(extension + ".engine")
    monkeypatch.setattr(engine.sync, "describe", lambda *_: 1 / 0)
    assert "ZeroDivisionError" in support.failure(stage, tmp_path)


def test_something_else_than_a_camera(stage, ball, tmp_path):
    stage.camera = ball
    sentence = support.failure(stage, tmp_path)
    assert '"Sphere GPIS", an object of type VOLUME' in sentence
