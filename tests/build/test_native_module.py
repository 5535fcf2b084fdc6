"""The traps of a native module inside a host that has its own Embree, OpenVDB and TBB."""

import os
import re
import subprocess
import sys
import tomllib
from pathlib import Path

import gpis_native as gn
import pytest

ROOT = Path(__file__).parents[2]
MODULE = Path(gn.__file__)
SANITIZED = "GPIS_SANITIZE" in os.environ


def run(script, **environment):
    kept = {name: os.environ[name] for name in ("LD_PRELOAD", "ASAN_OPTIONS", "TSAN_OPTIONS") if name in os.environ}
    result = subprocess.run(
        [sys.executable, "-c", script],
        env={"PYTHONPATH": ":".join(filter(None, sys.path)), **kept, **environment},
        capture_output=True,
        text=True,
        check=False,
    )
    assert result.returncode == 0, result.stderr
    return result.stdout


@pytest.mark.skipif(SANITIZED, reason="a module built with a sanitizer shares its symbols with it")
def test_exports_only_its_init_function():
    lines = subprocess.run(
        ["nm", "-D", "--defined-only", MODULE], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    assert [line.split()[-1] for line in lines] == ["PyInit_gpis_native"]


def test_is_not_linked_to_embree():
    dynamic = subprocess.run(["readelf", "-d", MODULE], capture_output=True, text=True, check=True).stdout
    assert "NEEDED" in dynamic
    assert "embree" not in dynamic


def test_import_opens_no_embree():
    loaded = run("import gpis_native; print(open('/proc/self/maps').read())")
    assert "gpis_native" in loaded
    assert "libembree" not in loaded


def test_the_wheel_carries_its_libraries():
    """An official Blender has no system OpenVDB; and TBB is known by its soname, so ours needs a name of its own."""
    bundle = MODULE.parent / "gpis_native.libs"
    if not bundle.exists():
        pytest.skip(f"a module {'built with a sanitizer' if SANITIZED else 'under test'} that is no installed wheel")
    loaded = run("import gpis_native as gn; gn.build_info(); print(open('/proc/self/maps').read())")
    for name in ("openvdb", "tbb", "embree"):
        paths = {line[line.index("/") :] for line in loaded.splitlines() if f"/lib{name}" in line}
        assert paths, name
        assert all(Path(path).parent == bundle for path in paths), paths


def test_versions_are_supported():
    info = gn.build_info()
    assert re.match(r"(3\.13|4\.)", info["embree"])
    assert re.match(r"1[0-3]\.", info["openvdb"])


def test_one_version_number():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["version"]
    manifest = tomllib.loads((ROOT / "blender_manifest.toml").read_text())["version"]
    assert project == manifest
