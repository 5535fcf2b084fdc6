"""Camera rays by Blender's conventions."""

import gpis_native as gn
import numpy as np
import pytest


def rays(points, image_width, image_height, **camera):
    camera = {"matrix": np.eye(4), **camera}
    return gn.Scene({"version": 1, "camera": camera}).camera_rays(image_width, image_height, points)


def corners(width, height):
    return [(0, 0), (width, 0), (0, height), (width, height), (width / 2, height / 2)]


@pytest.mark.parametrize(("width", "height"), [(160, 90), (90, 160), (64, 64)])
def test_perspective_spans_fov_x(width, height):
    fov = 0.9
    origins, directions, t_max = rays(corners(width, height), width, height, type="perspective", fov_x=fov)
    slope = np.tan(fov / 2)
    on_plane = directions / -directions[:, 2:]
    assert on_plane[:, 0] == pytest.approx([-slope, slope, -slope, slope, 0])
    assert on_plane[:, 1] == pytest.approx(np.array([-1, -1, 1, 1, 0]) * slope * height / width)
    assert np.linalg.norm(directions, axis=1) == pytest.approx(1)
    assert (origins == 0).all() and np.isposinf(t_max).all()


@pytest.mark.parametrize(("width", "height"), [(160, 90), (90, 160)])
def test_shift_is_in_units_of_the_larger_side(width, height):
    """shift_x = 1 moves the frame right by its larger side: a pixel shows what was that many pixels to its right."""
    larger = max(width, height)
    points = np.array(corners(width, height), dtype=float)
    for kind in ({"type": "perspective", "fov_x": 0.9}, {"type": "orthographic", "width": 3.0}):
        shifted = rays(points, width, height, shift=(0.25, -0.1), **kind)
        plain = rays(points + (0.25 * larger, -0.1 * larger), width, height, **kind)
        for a, b in zip(shifted, plain, strict=True):
            assert np.nan_to_num(a) == pytest.approx(np.nan_to_num(b))


def test_orthographic_spans_width():
    origins, directions, _ = rays(corners(80, 40), 80, 40, type="orthographic", width=4.0)
    assert origins == pytest.approx(np.array([(-2, -1, 0), (2, -1, 0), (-2, 1, 0), (2, 1, 0), (0, 0, 0)]))
    assert (directions == (0, 0, -1)).all()


def test_clip_is_along_the_viewing_axis():
    points = corners(80, 40)
    for kind in ({"type": "perspective", "fov_x": 1.2}, {"type": "orthographic", "width": 4.0}):
        origins, directions, t_max = rays(points, 80, 40, clip=(0.5, 7.0), **kind)
        assert origins[:, 2] == pytest.approx(-0.5)
        assert (origins + directions * t_max[:, None])[:, 2] == pytest.approx(-7.0)
    origins, directions, t_max = rays(points, 80, 40, type="equirectangular", clip=(0.5, 7.0))
    assert np.linalg.norm(origins, axis=1) == pytest.approx(0.5)
    assert np.linalg.norm(origins + directions * t_max[:, None], axis=1) == pytest.approx(7.0)


def test_equirectangular_covers_the_sphere():
    points = [(50, 25), (75, 25), (25, 25), (0, 25), (50, 50), (50, 0)]
    _, directions, _ = rays(points, 100, 50, type="equirectangular")
    expected = [(0, 0, -1), (1, 0, 0), (-1, 0, 0), (0, 0, 1), (0, 1, 0), (0, -1, 0)]
    assert directions == pytest.approx(np.array(expected, dtype=float), abs=1e-12)


def test_the_matrix_places_the_camera_and_its_scale_is_ignored():
    angle = 0.7
    rotation = np.array([(1, 0, 0), (0, np.cos(angle), -np.sin(angle)), (0, np.sin(angle), np.cos(angle))])
    matrix, scaled = np.eye(4), np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, (1, 2, 3)
    scaled[:3, :3], scaled[:3, 3] = rotation * (2.0, 3.0, 0.5), (1, 2, 3)
    camera = {"type": "perspective", "fov_x": 1.0}
    here = rays(corners(20, 10), 20, 10, **camera)
    placed = rays(corners(20, 10), 20, 10, **{**camera, "matrix": matrix})
    assert placed[0] == pytest.approx(here[0] + (1, 2, 3))
    assert placed[1] == pytest.approx(here[1] @ rotation.T)
    assert rays(corners(20, 10), 20, 10, **{**camera, "matrix": scaled})[1] == pytest.approx(placed[1])


def test_depth_is_along_the_viewing_axis_and_clipped():
    """A wall 5 m in front of a wide camera has depth 5 in every pixel; beyond the far distance there is nothing."""
    wall = {
        "vertices": [(-50, -50, -5), (50, -50, -5), (50, 50, -5), (-50, 50, -5)],
        "triangles": [(0, 1, 2), (0, 2, 3)],
    }
    description = {
        "version": 1,
        "camera": {"type": "perspective", "matrix": np.eye(4), "fov_x": 2.0, "clip": (0.3, 100.0)},
        "world": {"color": (1, 1, 1)},
        "materials": {"grey": {"type": "lambert"}},
        "meshes": {"wall": wall},
        "objects": [{"type": "mesh", "mesh": "wall", "materials": ["grey"]}],
    }
    passes = gn.render(gn.Scene(description), 16, 8, samples=16).passes
    assert passes["depth"] == pytest.approx(5.0, abs=1e-4)
    for clip in ((0.3, 4.9), (5.1, 100.0)):
        description["camera"]["clip"] = clip
        passes = gn.render(gn.Scene(description), 16, 8, samples=16).passes
        assert np.isposinf(passes["depth"]).all() and (passes["combined"] == 1).all()


def test_filters_spread_samples_by_their_shape():
    """An edge between black and white on the border of two pixels, seen through the filter: the share that falls
    across it is the filter's own integral (4 standard errors)."""

    def share(kind, width):
        # A dark plate covers x < 0; the pixel right of it sees it by the part of the filter beyond half a pixel.
        plate = {"vertices": [(-9, -9, -1), (0, -9, -1), (0, 9, -1), (-9, 9, -1)], "triangles": [(0, 1, 2), (0, 2, 3)]}
        description = {
            "version": 1,
            "settings": {"filter": {"type": kind, "width": width}},
            "camera": {"type": "orthographic", "matrix": np.eye(4), "width": 2.0},
            "world": {"color": (1, 1, 1)},
            "materials": {"black": {"type": "lambert", "color": (0, 0, 0)}},
            "meshes": {"plate": plate},
            "objects": [{"type": "mesh", "mesh": "plate", "materials": ["black"]}],
        }
        result = gn.render(gn.Scene(description), 2, 1, samples=4096)
        return result.passes["combined"][0, 1, 0], np.sqrt(result.passes["variance"][0, 1, 0])

    def blackman_harris(width):
        x = np.linspace(-0.5, 0.5, 100001)
        window = sum(a * np.cos(2 * np.pi * k * x) for k, a in enumerate((0.35875, 0.48829, 0.14128, 0.01168)))
        return window[x >= -0.5 / width].sum() / window.sum()

    assert share("box", 1.0) == (1.0, 0.0)
    for kind, width, expected in (("box", 2.3, 0.5 + 0.5 / 2.3), ("blackman_harris", 2.0, blackman_harris(2.0)),
                                  ("blackman_harris", 4.0, blackman_harris(4.0))):  # fmt: skip
        value, error = share(kind, width)
        assert 0 < error < 0.01
        assert abs(value - expected) < 4 * error, (kind, width, value, expected)


def test_blocks_place_their_samples_independently():
    """A white pixel with a dark plate on one of the 256 cells that a block's 16 points choose from. A block takes each cell with
    chance 1/16: over 1024 blocks 64 hits, a deviation of 7.7. Were all blocks placed alike it would be 0 or 1024."""
    for i, j in ((3, 12), (0, 0), (15, 8)):
        x, y = i / 16 - 0.5, j / 16 - 0.5
        corners = [(x + a / 16, y + b / 16, -1) for a, b in ((0, 0), (1, 0), (1, 1), (0, 1))]
        description = {
            "version": 1,
            "camera": {"type": "orthographic", "matrix": np.eye(4), "width": 1.0},
            "world": {"color": (1, 1, 1)},
            "materials": {"black": {"type": "lambert", "color": (0, 0, 0)}},
            "meshes": {"plate": {"vertices": corners, "triangles": [(0, 1, 2), (0, 2, 3)]}},
            "objects": [{"type": "mesh", "mesh": "plate", "materials": ["black"]}],
        }
        passes = gn.render(gn.Scene(description), 1, 1, samples=16 * 1024).passes
        hits = 16 * 1024 * (1 - passes["combined"][0, 0, 0])
        assert abs(hits - 64) < 4 * 7.75
