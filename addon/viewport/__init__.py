"""What the 3D viewport shows of GPIS objects: the mean surface, what is painted on it, and the rendered picture."""

from . import overlay, realise

_PARTS = (overlay, realise)


def register():
    for part in _PARTS:
        part.register()


def unregister():
    for part in reversed(_PARTS):
        part.unregister()
