"""Rays hit and volumes load whatever Blender has put into the process before.

Blender has an Embree 4 and an OpenVDB of its own. In an executable they stand in the global symbol scope; a module
linked to another Embree then has its calls answered by Blender's, and every ray misses without a word.
"""

import importlib.util
import os
import subprocess
import sys
from pathlib import Path

import pytest

# A quad fills the view of an orthographic camera 3 above it; the depth says what the rays hit. Then a volume, both ways.
SCRIPT = """
import pathlib
import sys
import tempfile
import numpy as np
{before}
import gpis_native as gn

matrix = np.eye(4)
matrix[2, 3] = 3
scene = gn.Scene({{
    "version": 1,
    "camera": {{"type": "orthographic", "matrix": matrix, "width": 2.0}},
    "world": {{"color": [1.0, 1.0, 1.0]}},
    "materials": {{"grey": {{"type": "lambert", "color": [0.5, 0.5, 0.5]}}}},
    "meshes": {{"quad": {{"vertices": np.array([[-9, -9, 0], [9, -9, 0], [9, 9, 0], [-9, 9, 0.0]]),
                          "triangles": np.array([[0, 1, 2], [0, 2, 3]])}}}},
    "objects": [{{"name": "quad", "type": "mesh", "mesh": "quad", "matrix": np.eye(4), "materials": ["grey"]}}],
}})
result = gn.render(scene, 8, 8, samples=16)
assert np.allclose(result.passes["depth"], 3, atol=1e-3), result.passes["depth"]

values = np.random.default_rng(1).normal(size=(9, 8, 7)).astype(np.float32)
with tempfile.TemporaryDirectory() as folder:
    path = str(pathlib.Path(folder) / "field.vdb")
    gn.write_vdb(path, {{"mean": values, "origin": [0.0, 0.0, 0.0], "voxel_size": 0.5}})
    assert np.array_equal(gn.read_vdb(path)["mean"], values)
    assert np.isclose(gn.VdbField(path, "mean")(np.array([[1.0, 0.5, 1.5]]))[0], values[2, 1, 3])
print("both right")
"""


def run(before, **environment):
    # Not what a bpy in this process has put in front: its own Python files, which hide the module from a new process.
    path = [entry for entry in sys.path if entry and "scripts" not in Path(entry).parts]
    result = subprocess.run(
        [sys.executable, "-c", SCRIPT.format(before=before)],
        env={**os.environ, "PYTHONPATH": ":".join(path), **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stdout + result.stderr
    assert "cannot be preloaded" not in result.stderr, result.stderr
    assert "both right" in result.stdout


@pytest.fixture
def bpy_folder():
    spec = importlib.util.find_spec("bpy")
    if spec is None:
        pytest.skip("this Python has no bpy")
    return Path(spec.origin).parent


def test_alone():
    run("")


def test_with_the_embree_of_bpy_preloaded(bpy_folder, tmp_path):
    (tmp_path / "lib").symlink_to(bpy_folder / "lib")  # a path without spaces, where LD_PRELOAD ends a name
    library = tmp_path / "lib/libembree4.so.4"
    before = os.environ.get("LD_PRELOAD", "")  # a sanitizer, which must come first
    run("", LD_PRELOAD=f"{before} {library}".strip())


def test_after_bpy(bpy_folder):
    run("import bpy")


def test_before_bpy(bpy_folder):
    run("import gpis_native, bpy")


def test_with_bpy_in_the_global_scope(bpy_folder):
    run("import os; sys.setdlopenflags(os.RTLD_NOW | os.RTLD_GLOBAL); import bpy")
