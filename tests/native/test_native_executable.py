"""Builds and runs native_tests: the C++ tests of what has no Python face (materials, lights, integrator)."""

import os
import subprocess
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def build_directory():
    """Where the module under test was compiled: $GPIS_BUILD_DIRECTORY (./dev sets it), or the module's own folder."""
    given = os.environ.get("GPIS_BUILD_DIRECTORY")
    if not given:
        import gpis_native

        given = Path(gpis_native.__file__).parent
    directory = Path(given)
    assert (directory / "CMakeCache.txt").exists(), (
        f"{directory} is not a CMake build directory; set GPIS_BUILD_DIRECTORY to the one of the module"
    )
    return directory


def test_native_tests_pass(build_directory):
    # What is preloaded is for Python (`./dev build --sanitize`): neither the compiler nor the executable wants it.
    environment = {name: value for name, value in os.environ.items() if name != "LD_PRELOAD"}
    subprocess.run(["cmake", "--build", build_directory, "--target", "native_tests"], check=True, env=environment)
    run = subprocess.run([build_directory / "native_tests"], capture_output=True, text=True, env=environment)
    assert run.returncode == 0, run.stdout + run.stderr
