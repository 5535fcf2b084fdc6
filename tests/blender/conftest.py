"""The Blender tests run twice: in the bpy module, and inside an executable by run_in_blender.py.

Every test file is plain pytest and imports bpy. The add-on is always the installed zip, in a Blender user folder of
its own, so what is tested is what an artist gets.
"""

import importlib
import os
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[2]

if "bpy" not in sys.modules and "BLENDER_USER_RESOURCES" not in os.environ:
    # Blender reads it once, at start.
    os.environ["BLENDER_USER_RESOURCES"] = tempfile.mkdtemp(prefix="gpis-blender-")

import bpy  # noqa: E402

from . import support  # noqa: E402

EXTENSION = "bl_ext.user_default.gpis"


@pytest.fixture(scope="session")
def extension_zip():
    """Path of the zip that `./dev extension` built last."""
    zips = sorted((ROOT / "dist").glob("gpis-*.zip"), key=lambda path: path.stat().st_mtime)
    assert zips, "there is no dist/gpis-*.zip; ./dev extension builds it"
    return zips[-1]


@pytest.fixture(scope="session")
def extension(extension_zip):
    """The zip, installed and enabled; gives the module's name."""
    assert "BLENDER_USER_RESOURCES" in os.environ, "start Blender with a BLENDER_USER_RESOURCES of its own"
    result = bpy.ops.extensions.package_install_files(filepath=str(extension_zip), repo="user_default", enable_on_install=True)
    assert result == {"FINISHED"}
    assert EXTENSION in bpy.context.preferences.addons
    return EXTENSION


@pytest.fixture
def empty_scene(extension):
    """A scene with nothing in it and the GPIS engine chosen; the extension stays enabled."""
    bpy.ops.wm.read_homefile(use_factory_startup=False, use_empty=True)
    bpy.context.scene.render.engine = "GPIS"
    return bpy.context.scene


@pytest.fixture
def stage(empty_scene):
    """A white world, a camera six metres in front of the origin, a small picture."""
    support.settings(empty_scene, width=48, height=36, samples=32)
    support.world(empty_scene, (1, 1, 1))
    support.camera(empty_scene, (0, -6, 0))
    return empty_scene


@pytest.fixture
def describe(extension):
    """The GPIS objects of the description and the warnings, as the scene stands."""
    sync = importlib.import_module(extension + ".sync")

    def describe():
        bpy.context.view_layer.update()
        state = sync.describe(bpy.context.evaluated_depsgraph_get(), 48, 36)
        return [entry for entry in state.description["objects"] if entry["type"] == "gpis"], state.warnings

    return describe


@pytest.fixture
def ball(stage):
    """A GPIS of a black sphere of radius 1, by the operator."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24)
    bpy.context.object.data.materials.append(support.diffuse("Black", (0, 0, 0)))
    assert bpy.ops.gpis.make(resolution=48) == {"FINISHED"}
    return bpy.context.object


@pytest.fixture
def gn(extension):
    return importlib.import_module("gpis_native")


@pytest.fixture
def bake(extension):
    """The add-on's module that bakes strokes."""
    return importlib.import_module(extension + ".paint.bake")


@pytest.fixture
def painted_sphere(stage):
    """A GPIS of a sphere of radius 1 with room around it, to be painted on."""
    bpy.ops.mesh.primitive_uv_sphere_add(segments=48, ring_count=24)
    assert bpy.ops.gpis.make(resolution=32, margin=0.5) == {"FINISHED"}
    return bpy.context.object


@pytest.fixture
def fresh_blender(tmp_path):
    """Runs a script in a new Blender of the same kind with an empty user folder: fresh_blender(script, *arguments).

    Gives the finished process with its output as text; the script sees the arguments in sys.argv after "--".
    """
    resources = tmp_path / "user"
    resources.mkdir()

    def run(script, *arguments, timeout=300):
        path = tmp_path / "script.py"
        path.write_text(script)
        return subprocess.run(
            [*support.command(path), "--", *map(str, arguments)],
            env={**os.environ, "BLENDER_USER_RESOURCES": str(resources)},
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=timeout,
            check=False,
        )

    yield run
    shutil.rmtree(resources, ignore_errors=True)


@pytest.fixture
def module(extension):
    """Modules of the installed extension by their name in it."""
    return lambda name: importlib.import_module(f"{extension}.{name}")
