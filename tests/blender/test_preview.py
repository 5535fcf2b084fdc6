"""The viewport's Rendered shading without a window: what it renders, when it starts again, what it says."""

import importlib
from types import SimpleNamespace

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from .painting import arc, paint

SIZE = (24, 18)


@pytest.fixture
def module(extension):
    return importlib.import_module(extension + ".viewport.preview")


@pytest.fixture
def preview(module, stage, painted_sphere):
    stage.gpis.preview_samples, stage.gpis.seed = 32, 3
    preview = module.Preview()
    yield preview
    preview.stop()
    assert not module._running


def view(distance=4.0):
    """A view along −z, perspective."""
    matrix = Matrix.Translation((0, 0, distance))
    window = Matrix(((1.5, 0, 0, 0), (0, 2.0, 0, 0), (0, 0, -1.002, -0.02), (0, 0, -1, 0)))
    return SimpleNamespace(
        view_matrix=matrix.inverted(), window_matrix=window, perspective_matrix=window @ matrix.inverted(), is_perspective=True
    )


def show(preview, region_data=None):
    """As the engine does after a change; waits for the last picture."""
    region_data = region_data or view()
    preview.change(bpy.context.evaluated_depsgraph_get(), region_data, SIZE)
    preview.look(bpy.context.scene, region_data, SIZE)
    return last(preview)


def last(preview):
    assert not preview.failure
    assert preview.session.wait(60)
    return preview.session.latest().passes["combined"]


def covered(preview):
    """Pixels with the sphere in them."""
    return np.isfinite(preview.session.latest().passes["depth"]).sum()


def test_it_converges_to_the_picture_of_its_samples(preview, module, gn, stage):
    picture = show(preview)
    assert preview in module._running and preview.session.progress().rounds > 1, "progressive"
    expected = gn.render(preview.scene, *SIZE, samples=32, seed=3).passes["combined"]
    np.testing.assert_allclose(picture, expected, rtol=1e-5, atol=1e-6)
    assert picture.shape == (*SIZE[::-1], 4)


def test_it_starts_again_after_a_change_and_only_then(preview, stage):
    before, pixels = show(preview), covered(preview)
    session = preview.session
    preview.look(bpy.context.scene, view(), SIZE)
    assert preview.session is session, "the same view"
    preview.look(bpy.context.scene, view(distance=8), SIZE)
    assert preview.session is not session
    last(preview)
    assert 0 < covered(preview) < 0.5 * pixels, "further away"
    session = preview.session
    preview.look(bpy.context.scene, view(distance=8), (12, 9))
    assert preview.session is not session and last(preview).shape == (9, 12, 4)
    paint("ALBEDO", "SET", arc(0), radius=3.0, strength=1.0, color=(1, 0, 0), falloff="CONSTANT")
    red = show(preview)
    middle = np.s_[6:12, 9:15]
    # The mesh that it was made of is white, at the same place, and not in the picture.
    assert red[middle][..., 1].mean() < 0.1 * before[middle][..., 1].mean(), "painted red"


def test_pictures_go_to_the_gpu_once_each(preview, module, monkeypatch):
    """What is drawn is the newest picture, uploaded when there is one."""
    sent = []
    types = SimpleNamespace(
        Buffer=lambda kind, size, data: np.array(data), GPUTexture=lambda size, format, data: sent.append((size, data))
    )
    monkeypatch.setattr(module, "gpu", SimpleNamespace(types=types))
    picture = show(preview)
    assert preview.has_news() and not preview.is_over()
    said = preview.update()
    assert "32" in said and len(sent) == 1 and sent[0][0] == SIZE
    assert np.array_equal(sent[0][1], picture.reshape(-1))
    preview.update()
    assert len(sent) == 1 and not preview.has_news() and preview.is_over()


def test_what_cannot_be_rendered_is_said(preview, module, painted_sphere):
    painted_sphere.gpis.mean_grid = "nothing"
    bpy.context.view_layer.update()
    preview.change(bpy.context.evaluated_depsgraph_get(), view(), SIZE)
    preview.look(bpy.context.scene, view(), SIZE)
    assert preview.session is None and painted_sphere.name in preview.update() and "nothing" in preview.update()
    painted_sphere.gpis.mean_grid = "mean"
    show(preview)
    assert covered(preview) > 20, "and goes on when it is mended"


def test_a_view_that_is_gone_stops_its_render(preview, module):
    show(preview)
    assert module._poll() is None and not module._running  # no window has an area in Rendered shading
    assert preview.session is None
