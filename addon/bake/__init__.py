"""Making GPIS objects: signed distances baked from meshes, shapes and fogs into versioned .vdb files."""

from . import add, files, operators

_PARTS = (operators, add, files)


def register():
    for part in _PARTS:
        part.register()


def unregister():
    for part in reversed(_PARTS):
        part.unregister()
