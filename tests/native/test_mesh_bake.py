"""Baked distances against exact ones: closed, open, overlapping and unusable meshes."""

import gpis_native as gn
import numpy as np
import pytest


def box_mesh(low, high):
    low, high = np.array(low, float), np.array(high, float)
    vertices = np.array([[x, y, z] for x in (0, 1) for y in (0, 1) for z in (0, 1)]) * (high - low) + low
    quads = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    return vertices, np.array([t for a, b, c, d in quads for t in ((a, b, c), (a, c, d))])


def sphere_mesh(rings=48, segments=96, last_ring=None):
    """A unit sphere about the origin; open below `last_ring`."""
    last = rings if last_ring is None else last_ring
    theta, phi = np.pi * np.arange(last + 1) / rings, 2 * np.pi * np.arange(segments) / segments
    t, p = np.meshgrid(theta, phi, indexing="ij")
    vertices = np.stack([np.sin(t) * np.cos(p), np.sin(t) * np.sin(p), np.cos(t)], axis=-1)
    vertices[0] = (0, 0, 1)
    if last == rings:
        vertices[-1] = (0, 0, -1)
    i, j = np.meshgrid(np.arange(last), np.arange(segments), indexing="ij")
    k = (j + 1) % segments
    corners = i * segments + j, (i + 1) * segments + j, (i + 1) * segments + k, i * segments + k
    a, b, c, d = (n.ravel() for n in corners)
    return vertices.reshape(-1, 3), np.concatenate([np.stack([a, b, c], 1), np.stack([a, c, d], 1)])


def box_distance(x, low, high):
    q = np.maximum(low - x, x - high)
    return np.linalg.norm(np.maximum(q, 0), axis=-1) + np.minimum(q.max(axis=-1), 0)


def nodes(report):
    index = np.stack(np.meshgrid(*map(np.arange, report["resolution"]), indexing="ij"), axis=-1)
    return np.array(report["origin"]) + index * report["voxel_size"]


def bake(path, mesh, **options):
    report = gn.bake_mesh_distance(*mesh, path, **options)
    return report, gn.read_vdb(path)["mean"]


@pytest.mark.parametrize("inside_out", [False, True])
def test_a_box_is_exact(tmp_path, inside_out):
    low, high = np.array([-1, 0, 2.0]), np.array([1, 1.3, 2.7])
    vertices, triangles = box_mesh(low, high)
    mesh = vertices, triangles[:, ::-1] if inside_out else triangles
    report, f = bake(tmp_path / "b.vdb", mesh, resolution=40, margin=0.2)
    assert report["closed"] and report["open_edges"] == 0 and not report["meets_itself"]
    assert report["resolution"][0] == 40 and report["voxel_size"] == pytest.approx(2.4 / 39)
    np.testing.assert_allclose(f, box_distance(nodes(report), low, high), atol=1e-6)
    # It covers the bounds with the margin, the longest side exactly.
    assert np.all(nodes(report)[0, 0, 0] <= low - 0.2 + 1e-9) and np.all(nodes(report)[-1, -1, -1] >= high + 0.2 - 1e-9)
    assert nodes(report)[0, 0, 0, 0] == pytest.approx(-1.2) and nodes(report)[-1, 0, 0, 0] == pytest.approx(1.2)


def test_a_sphere_of_triangles(tmp_path):
    report, f = bake(tmp_path / "s.vdb", sphere_mesh(), resolution=48, margin=0.3)
    exact = np.linalg.norm(nodes(report), axis=-1) - 1
    sagitta = 1 - np.cos(np.pi / 48) ** 2  # how far the flat triangles lie inside the sphere, at most
    assert report["closed"]
    assert np.all(f - exact > -1e-6) and np.all(f - exact < sagitta + 1e-6)


def test_vertices_at_one_place_are_one(tmp_path):
    vertices, triangles = box_mesh((0, 0, 0), (1, 1, 1))
    soup = vertices[triangles].reshape(-1, 3), np.arange(36).reshape(12, 3)
    report, f = bake(tmp_path / "v.vdb", soup, resolution=16)
    assert report["closed"]
    np.testing.assert_allclose(f, box_distance(nodes(report), 0, 1), atol=1e-6)


def test_an_open_bowl_is_closed_by_a_flat_sheet(tmp_path):
    """A hemisphere covers half of all directions exactly from the disc over its opening: that is where it is closed."""
    report, f = bake(tmp_path / "h.vdb", sphere_mesh(last_ring=24), resolution=64, margin=0.3)
    x, h = nodes(report), report["voxel_size"]
    assert not report["closed"] and report["open_edges"] == 96
    r, z = np.hypot(x[..., 0], x[..., 1]), x[..., 2]
    outside = np.where(z >= 0, np.hypot(r, z) - 1, np.hypot(np.maximum(r - 1, 0), z))
    exact = np.where((z > 0) & (np.hypot(r, z) < 1), np.maximum(np.hypot(r, z) - 1, -z), outside)
    near = np.abs(exact) < 1.5 * h
    assert np.abs(f - exact)[near].max() < 0.25 * h
    assert np.abs(f - exact).max() < 0.4 * h
    clear = np.abs(exact) > 0.1 * h
    assert np.all(np.sign(f)[clear] == np.sign(exact)[clear])
    # Continuous: no neighbours differ by more than a distance may, least of all across the sheet.
    for axis in range(3):
        assert np.abs(np.diff(f, axis=axis)).max() < 1.15 * h


def test_boxes_that_overlap_have_one_surface(tmp_path):
    a, b = (np.array([-1, -1, -1.0]), np.array([0.35, 0.5, 0.5])), (np.array([-0.3, -0.4, -0.5]), np.array([1, 1, 1.0]))
    meshes = [box_mesh(*a), box_mesh(*b)]
    mesh = np.concatenate([m[0] for m in meshes]), np.concatenate([meshes[0][1], meshes[1][1] + 8])
    report, f = bake(tmp_path / "o.vdb", mesh, resolution=49, margin=0.1)
    x, h = nodes(report), report["voxel_size"]
    assert not report["closed"] and report["open_edges"] == 0 and report["meets_itself"]
    exact = np.minimum(box_distance(x, *a), box_distance(x, *b))
    np.testing.assert_allclose(f[exact > 0], exact[exact > 0], atol=1e-6)
    assert np.all(f[exact < -1e-6] < 0)
    # Deep inside no wall is left where the boxes meet: one box's own distance is a lower bound of the depth.
    deep = exact < -2 * h
    assert np.all(f[deep] < exact[deep] + h) and np.mean(f[deep] < exact[deep] + 0.5 * h) > 0.95
    assert max(np.abs(np.diff(f, axis=axis)).max() for axis in range(3)) < 2 * h


def test_progress_and_cancel(tmp_path):
    seen = []
    gn.bake_mesh_distance(*box_mesh((0, 0, 0), (1, 1, 1)), tmp_path / "p.vdb", resolution=16, progress=seen.append)
    assert seen == sorted(seen) and seen[-1] == 1 and len(seen) > 10
    path = tmp_path / "cancelled.vdb"
    cube = box_mesh((0, 0, 0), (1, 1, 1))
    assert gn.bake_mesh_distance(*cube, path, progress=lambda fraction: fraction < 0.2) is None
    assert not path.exists()

    def fail(fraction):
        raise RuntimeError("from the callback")

    with pytest.raises(RuntimeError, match="from the callback"):
        gn.bake_mesh_distance(*cube, path, progress=fail)


def test_a_narrow_band_cuts_distances_off(tmp_path):
    mesh, options = sphere_mesh(), {"resolution": 96, "margin": 1.0}
    _, whole = bake(tmp_path / "whole.vdb", mesh, **options)
    report, band = bake(tmp_path / "band.vdb", mesh, narrow_band=0.2, **options)
    np.testing.assert_array_equal(band, np.clip(whole, np.float32(-0.2), np.float32(0.2)))
    assert (np.abs(whole) > 0.2).mean() > 0.5
    # The space is the same, and blocks beyond take no memory.
    (a,), (b,) = gn.vdb_grids(tmp_path / "whole.vdb"), gn.vdb_grids(tmp_path / "band.vdb")
    assert (a["min"], a["max"], a["resolution"]) == (b["min"], b["max"], b["resolution"])
    assert (tmp_path / "band.vdb").stat().st_size < 0.5 * (tmp_path / "whole.vdb").stat().st_size
    x = nodes(report).reshape(-1, 3)
    np.testing.assert_allclose(gn.VdbField(tmp_path / "band.vdb", "mean")(x), band.ravel(), atol=1e-9)
    with pytest.raises(ValueError, match=r"narrow_band is 0.05; with voxels of .* at least three of them"):
        bake(tmp_path / "thin.vdb", mesh, narrow_band=0.05, **options)
    assert not (tmp_path / "thin.vdb").exists()


def test_unusable_meshes_get_a_sentence(tmp_path):
    vertices, triangles = box_mesh((0, 0, 0), (1, 1, 1))
    path = tmp_path / "x.vdb"
    cases = {
        "encloses nothing": (vertices, triangles[:2], {}),
        "thinner than a voxel": (*box_mesh((0, 0, 0.013), (1, 1, 0.0135)), {"resolution": 10, "margin": 0.02}),
        "none of them has an area": (np.zeros((8, 3)), triangles, {}),
        "names vertex 8": (vertices, triangles + 1, {}),
        "finite": (np.where(vertices > 0, np.nan, vertices), triangles, {}),
        "resolution is 3": (vertices, triangles, {"resolution": 3}),
        "margin is -1": (vertices, triangles, {"margin": -1.0}),
        "narrow_band is -1": (vertices, triangles, {"narrow_band": -1.0}),
        "narrow_band is nan": (vertices, triangles, {"narrow_band": np.nan}),
    }
    for text, (v, t, options) in cases.items():
        with pytest.raises(ValueError) as error:
            gn.bake_mesh_distance(v, t, path, **options)
        assert text in str(error.value)
    assert not path.exists()


def test_a_mesh_too_small_for_openvdb_gets_a_sentence(tmp_path):
    vertices, triangles = box_mesh((0, 0, 0), (1e-6, 1e-6, 1e-6))
    with pytest.raises(ValueError, match="OpenVDB takes none below 1.5e-05. Make the object larger"):
        gn.bake_mesh_distance(vertices, triangles, tmp_path / "tiny.vdb", resolution=16, margin=1e-7)
    gn.bake_mesh_distance(vertices * 1e3, triangles, tmp_path / "small.vdb", resolution=16, margin=1e-4)
    assert gn.VdbField(tmp_path / "small.vdb", "mean")([(5e-4, 5e-4, 5e-4)]) < 0
