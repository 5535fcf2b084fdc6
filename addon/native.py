"""The native module, imported when it is first used and nowhere else.

It shares libraries with Blender (TBB by its soname), and whichever loads first serves both: Blender's must be there
first.
"""

import sys


def native():
    """The module `gpis_native`; RuntimeError with a sentence where it cannot be loaded."""
    try:
        import gpis_native
    except ImportError as error:
        version = f"{sys.version_info.major}.{sys.version_info.minor}"
        raise RuntimeError(
            f"The renderer's native module does not load in this Blender (Python {version}, {sys.platform}): "
            f"{error}. Install the GPIS extension that was built for it."
        ) from error
    return gpis_native
