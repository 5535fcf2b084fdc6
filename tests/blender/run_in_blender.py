"""Runs pytest inside a Blender executable.

blender -b --factory-startup --python tests/blender/run_in_blender.py -- FOLDER_WITH_PYTEST [PYTEST ARGUMENT...]
"""

import os
import sys

folder, *arguments = sys.argv[sys.argv.index("--") + 1 :]
sys.path.append(os.path.abspath(folder))

import pytest  # noqa: E402

status = pytest.main(arguments)
sys.stdout.flush()
sys.stderr.flush()
# sys.exit is an exception to Blender, which would print it and leave with its own code.
os._exit(int(status))
