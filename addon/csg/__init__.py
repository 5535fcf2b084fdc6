"""CSG of GPIS objects: the list of operands, and the fit of one GPIS to their composition."""

from . import fit, operators, panel, properties

_PARTS = (properties, operators, fit, panel)


def register():
    for part in _PARTS:
        part.register()


def unregister():
    for part in reversed(_PARTS):
        part.unregister()
