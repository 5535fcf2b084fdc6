"""CSG of GPIS objects: the list of operands, and the fit of one GPIS to their composition."""

from ..parts import register_parts_factory
from . import fit, operators, panel, properties

_PARTS = (properties, operators, fit, panel)

register, unregister = register_parts_factory(_PARTS)
