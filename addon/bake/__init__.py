"""Making GPIS objects: signed distances baked from meshes into versioned .vdb files."""

from . import files, operators


def register():
    operators.register()
    files.register()


def unregister():
    files.unregister()
    operators.unregister()
