"""Making GPIS objects: signed distances baked from meshes, shapes and fogs into versioned .vdb files."""

from ..parts import register_parts_factory
from . import add, files, operators

_PARTS = (operators, add, files)

register, unregister = register_parts_factory(_PARTS)
