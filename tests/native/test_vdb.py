"""Grids of .vdb files: our own, Blender's OpenVDB's, and published ones."""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import gpis_native as gn
import numpy as np
import pytest

DATA = Path(__file__).resolve().parents[3] / "shared" / "data" / "gpis-light-transport"
published = pytest.mark.skipif(not DATA.exists(), reason="the shared data files are not there")

# Written by the OpenVDB of Blender (another version, in a process of its own).
WRITER = """
import glob, os, sys
import bpy
sys.path += glob.glob(os.path.join(bpy.utils.resource_path("LOCAL"), "python", "lib", "python*", "site-packages"))
import numpy as np
import openvdb

def grid(name, kind=openvdb.FloatGrid, background=0, values=None, origin=(0, 0, 0)):
    g = kind(background)
    g.name = name
    g.copyFromArray(np.arange(2 * 3 * 4).reshape(2, 3, 4).astype(float) + 1 if values is None else values, origin)
    return g

sphere = openvdb.createLevelSetSphere(radius=1.0, center=(0.5, 0, 0), voxelSize=0.05, halfWidth=3.0)
sphere.name = "sphere"
unfilled = openvdb.FloatGrid(0.15)  # the same band, inside and outside not told apart
unfilled.name, unfilled.gridClass, unfilled.transform = "unfilled", sphere.gridClass, sphere.transform
writer = unfilled.getAccessor()
for voxel in sphere.citerOnValues():
    writer.setValueOn(voxel.min, voxel.value)
rotated = grid("rotated")
rotated.transform = openvdb.createLinearTransform(0.5)
rotated.transform.postRotate(0.4, openvdb.Axis.Z)
rotated.transform.postTranslate((1, 2, 3))
slab = grid("slab", origin=(-5, 7, 100))
slab.transform = openvdb.createLinearTransform([[2, 0, 0, 0], [0, .5, 0, 0], [0, 0, .25, 0], [10, 20, 30, 1]])
tiles = openvdb.FloatGrid(-1.5)
tiles.name = "tiles"
tiles.fill((0, 0, 0), (63, 63, 63), 2.0)
nan = grid("nan")
for at, value in (((1, 2, 0), np.nan), ((1, 2, 3), np.inf)):
    nan.getAccessor().setValueOn(at, value)
half = grid("half"); half.saveFloatAsHalf = True
frustum = grid("frustum")
frustum.transform = openvdb.createFrustumTransform((0, 0, 0), (1, 1, 1), 0.5, 1.0)
empty = openvdb.FloatGrid(3.0); empty.name = "empty"
grids = [sphere, unfilled, rotated, slab, tiles, half, frustum, empty, grid("double", openvdb.DoubleGrid, 7.0),
         nan, grid("count", openvdb.Int32Grid),
         grid("negative", values=1 - np.arange(24.0).reshape(2, 3, 4)), grid("thin", values=np.ones((3, 1, 3)))]
openvdb.write(sys.argv[1], grids=grids)
"""


@pytest.fixture(scope="module")
def blender_file(tmp_path_factory):
    if importlib.util.find_spec("bpy") is None:
        pytest.skip("this Python has no bpy")
    path = tmp_path_factory.mktemp("vdb") / "many grids ü.vdb"
    subprocess.run([sys.executable, "-c", WRITER, path], check=True, capture_output=True)
    return path


@pytest.mark.parametrize("name", ["sphere", "unfilled"])
def test_a_level_set_has_its_inside_and_outside(blender_file, name):
    f = gn.VdbField(blender_file, name)
    x = np.random.default_rng(1).uniform(-2, 2, (4000, 3))
    exact = np.clip(np.linalg.norm(x - [0.5, 0, 0], axis=1) - 1, -0.15, 0.15)
    assert np.abs(f(x) - exact).max() < 0.05  # the steps at the ends of the band are one voxel wide
    band = np.abs(exact) < 0.08
    assert np.abs(f(x) - exact)[band].max() < 2e-3
    assert f([[0.5, 0, 0]])[0] == pytest.approx(-0.15) and f([[9, 9, 9]])[0] == pytest.approx(0.15)


def test_transforms(blender_file):
    index = np.stack(np.meshgrid(*map(np.arange, (2, 3, 4)), indexing="ij"), axis=-1).reshape(-1, 3)
    values = np.arange(24.0) + 1
    slab = gn.VdbField(blender_file, "slab")
    np.testing.assert_allclose(slab((index + [-5, 7, 100]) * [2, 0.5, 0.25] + [10, 20, 30]), values, rtol=1e-12)
    assert isinstance(slab, gn.GridField)
    np.testing.assert_allclose(slab.support, ([0, 23.5, 55], [2, 24.5, 55.75]))
    c, s = np.cos(0.4), np.sin(0.4)
    turned = 0.5 * index @ np.array([[c, s, 0], [-s, c, 0], [0, 0, 1]]) + [1, 2, 3]
    rotated = gn.VdbField(blender_file, "rotated")
    np.testing.assert_allclose(rotated(turned), values, rtol=1e-9)
    assert rotated([[1 - 100, 2, 3 - 100]])[0] == pytest.approx(9)  # its nearest value, not the background 0


def test_tiles_halves_and_doubles(blender_file):
    tiles = gn.VdbField(blender_file, "tiles")
    np.testing.assert_array_equal(tiles([[31.5, 2, 63], [64, 2, 2], [-0.1, 2, 2]]), [2, -1.5, -1.5])
    assert tiles.line((-5, 30, 30.3), (1, 0, 0)).above_until(5, 68, 1.9) == 68
    assert tiles.line((-5, 30, 30.3), (1, 0, 0)).above_until(4, 68, 1.9) == 4
    for name in ("half", "double"):
        assert gn.VdbField(blender_file, name)([[1, 2, 3]])[0] == 24
    assert gn.VdbField(blender_file, "double")([[1, 2, 4]])[0] == 7


def test_what_a_file_holds(blender_file):
    grids = {g["name"]: g for g in gn.vdb_grids(blender_file)}
    slab = grids["slab"]
    assert slab["type"] == "float" and slab["resolution"] == [2, 3, 4] and slab["value_range"] == (1, 24)
    np.testing.assert_allclose((slab["min"], slab["max"]), ([0, 23.5, 55], [2, 24.5, 55.75]))
    assert slab["voxel_size"] == [2, 0.5, 0.25] and slab["background"] == 0
    assert grids["double"]["type"] == "double" and grids["count"]["value_range"] is None
    assert grids["empty"]["min"] is None and grids["empty"]["resolution"] == [0, 0, 0]
    assert grids["frustum"]["min"] is None and grids["frustum"]["resolution"] == [2, 3, 4]


def test_bad_grids_get_a_sentence(blender_file, tmp_path):
    no_vdb = tmp_path / "text.vdb"
    no_vdb.write_text("hello, hello, hello, hello, hello, hello")
    cases = {
        "no grid 'density'; it holds: ": (blender_file, "density", "value"),
        "2 voxels that are NaN or infinite, the first at index (1, 2, 0)": (blender_file, "nan", "value"),
        "holds int32 values": (blender_file, "count", "value"),
        "no voxel is active": (blender_file, "empty", "value"),
        "perspective frustum": (blender_file, "frustum", "value"),
        "at least 2 along each axis": (blender_file, "thin", "value"),
        "holds 22 negative voxels": (blender_file, "negative", "variance"),
        "meaning is 'deviation'": (blender_file, "half", "deviation"),
        "could not be read": (no_vdb, "mean", "value"),
        "is not a file": (tmp_path, "mean", "value"),
    }
    for text, arguments in cases.items():
        with pytest.raises(ValueError) as error:
            gn.VdbField(*arguments)
        assert text in str(error.value)
    with pytest.raises(FileNotFoundError, match="missing.vdb"):
        gn.VdbField(tmp_path / "missing.vdb", "mean")
    with pytest.raises(FileNotFoundError, match="nowhere"):
        gn.write_vdb(tmp_path / "nowhere" / "x.vdb", {"mean": np.ones((3, 3, 3)), "origin": (0, 0, 0), "voxel_size": 1})


def test_written_grids_come_back(tmp_path):
    rng = np.random.default_rng(3)
    grids = {
        "mean": rng.normal(size=(5, 20, 9)).astype(np.float32),
        "sigma": rng.uniform(size=(5, 20, 9)).astype(np.float32),
        "albedo": rng.uniform(size=(5, 20, 9, 3)).astype(np.float32),
        "anisotropy": rng.normal(size=(5, 20, 9, 6)).astype(np.float32),
        "origin": (0.1, -2, 3),
        "voxel_size": 0.25,
    }
    path = tmp_path / "own.vdb"
    gn.write_vdb(path, grids)
    again = gn.read_vdb(path)
    assert again.keys() == grids.keys() and [p.name for p in tmp_path.iterdir()] == ["own.vdb"]
    for name, value in grids.items():
        np.testing.assert_array_equal(again[name], value, err_msg=name)
    assert gn.read_vdb(path, names=["sigma"]).keys() == {"sigma", "origin", "voxel_size"}
    assert {g["name"] for g in gn.vdb_grids(path)} >= {"anisotropy_diagonal", "anisotropy_offdiagonal"}

    x = np.random.default_rng(4).uniform((0.1, -2, 3), (1.1, 2.75, 5), (500, 3))
    field = gn.GridField(grids["sigma"] ** 0.5, 0.25, (0.1, -2, 3))
    np.testing.assert_allclose(gn.VdbField(path, "sigma", meaning="variance")(x), field(x), rtol=1e-5)
    flat, scalar, nan = np.ones((3, 3)), np.ones((3, 3, 3)), np.full((3, 3, 3), np.nan)
    for bad in ({"mean": flat}, {"anisotropy": scalar}, {"mean": nan}, {}):
        with pytest.raises(ValueError):
            gn.write_vdb(path, bad | {"origin": (0, 0, 0), "voxel_size": 1})


@published
def test_the_published_bunny():
    path = DATA / "bunny.vdb"
    grids = {g["name"]: g for g in gn.vdb_grids(path)}
    assert grids["mean"]["background"] == 100 and grids["variance"]["background"] == 1
    np.testing.assert_allclose(grids["mean"]["voxel_size"], 0.0488636, rtol=1e-5)
    np.testing.assert_allclose(grids["mean"]["min"], -1.1)
    np.testing.assert_allclose(grids["mean"]["value_range"], (-0.397, 0.509), atol=1e-3)
    np.testing.assert_allclose(grids["variance"]["value_range"], (0.001, 0.1516), atol=1e-4)
    whole = gn.read_vdb(path)
    assert np.all(whole["mean"][43] == 100)  # the plane its writer left out
    field = gn.VdbField(path, "mean")
    index = np.random.default_rng(0).integers(0, 43, (500, 3))
    at = np.array(whole["origin"]) + index * whole["voxel_size"]
    np.testing.assert_allclose(field(at), whole["mean"][tuple(index.T)], atol=1e-6)


@published
@pytest.mark.parametrize("n", [32, 64])
def test_the_published_spheres_hold_a_variance(n):
    path = DATA / f"csg-two-spheres-eval-avg-{n}.vdb"
    whole = gn.read_vdb(path)
    assert whole["mean"].shape == (n, n, n)
    np.testing.assert_allclose(whole["origin"], (-1.5, -0.499, -1.5), atol=1e-6)
    sigma = gn.VdbField(path, "variance", meaning="variance")
    # Left of the first sphere only σ = .1 counts, and the jitter within a voxel.
    assert sigma([[-1.2, 0.8, 0]])[0] ** 2 == pytest.approx(0.1**2 + (3 / n) ** 2 / 12, rel=0.15)


@pytest.mark.parametrize(
    ("path", "words"), [(None, "it is None"), ("", "is empty"), ("folder", "is not a file"), ("pipe", "is not a file")]
)
def test_only_files_are_replaced(tmp_path, path, words):
    """A file is renamed to its place when it is complete: a folder or device there must not be lost."""
    (tmp_path / "folder").mkdir()
    os.mkfifo(tmp_path / "pipe")
    before = sorted(tmp_path.iterdir())
    with pytest.raises(ValueError, match=words):
        gn.write_vdb(
            str(tmp_path / path) if path else path,
            {"mean": np.zeros((3, 3, 3)), "origin": (0, 0, 0), "voxel_size": 1.0},
        )
    assert sorted(tmp_path.iterdir()) == before and (tmp_path / "pipe").is_fifo()


@pytest.mark.parametrize("grids", [{1: np.zeros((3, 3, 3))}, {"mean": "x"}])
def test_a_grid_is_a_named_array(tmp_path, grids):
    with pytest.raises(ValueError, match="write_vdb: "):
        gn.write_vdb(tmp_path / "x.vdb", {**grids, "origin": (0, 0, 0), "voxel_size": 1.0})


def damaged(tmp_path, change):
    """A written grid, changed where it says what it holds."""
    good, bad = tmp_path / "good.vdb", tmp_path / "bad.vdb"
    mean = np.linspace(-1, 1, 27).reshape(3, 3, 3)
    gn.write_vdb(good, {"mean": mean, "origin": (0, 0, 0), "voxel_size": 0.1})
    bad.write_bytes(change(good.read_bytes()))
    return bad


@pytest.mark.parametrize("key", [b"name", b"Tree_float_5_4_3"])
def test_a_length_that_is_damaged(tmp_path, key):
    """OpenVDB alone fills four gigabytes, and reads on where the file has ended."""

    def change(data):
        at = data.index(key) - 4
        assert int.from_bytes(data[at : at + 4], "little") == len(key)
        return data[:at] + b"\x00\xff\xff\xff" + data[at + 4 :]

    path = damaged(tmp_path, change)
    with pytest.raises(ValueError, match="bad.vdb.*damaged"):
        gn.VdbField(path, "mean")


def test_every_cut_gets_a_sentence(tmp_path):
    path = damaged(tmp_path, lambda data: data)
    data = path.read_bytes()
    for length in range(0, len(data) - 8, len(data) // 97):
        path.write_bytes(data[:length])
        with pytest.raises(ValueError, match="bad.vdb"):
            gn.VdbField(path, "mean")


def test_a_name_that_is_no_text(tmp_path):
    path = damaged(tmp_path, lambda data: data.replace(b"mean", b"me\xffn"))
    with pytest.raises(ValueError, match="has no grid 'mean'; it holds: me[?]n"):
        gn.VdbField(path, "mean")
    assert [grid["name"] for grid in gn.vdb_grids(path)] == ["me?n"]
    path = damaged(tmp_path, lambda data: data.replace(b"Tree_float", b"Tree_fl\xffat"))
    with pytest.raises(ValueError, match="Tree_fl[?]at"):
        gn.VdbField(path, "mean")


def test_a_grid_that_ends_before_it_begins(tmp_path):
    """A damaged end sends the reader back, as often as a damaged count says."""

    def change(data):
        at = data.index(b"Tree_float_5_4_3") + len(b"Tree_float_5_4_3") + 4 + 16  # no parent; two positions
        first = data.index(b"\x04\x00\x00\x00mean")
        count = data[first - 4 : first]
        assert int.from_bytes(count, "little") == 1 and int.from_bytes(data[at : at + 8], "little") == len(data)
        whole = data[:at] + first.to_bytes(8, "little") + data[at + 8 :]
        return whole[: first - 4] + (2**31 - 1).to_bytes(4, "little") + whole[first:]

    with pytest.raises(ValueError, match="bad.vdb.*damaged"):
        gn.VdbField(damaged(tmp_path, change), "mean")
