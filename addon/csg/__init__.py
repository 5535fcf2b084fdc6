"""CSG of GPIS objects: the list of operands, the fit of one GPIS to their composition, and how good it is."""

from ..parts import register_parts_factory
from . import compare, fit, menu, operators, panel, properties

_PARTS = (properties, operators, fit, compare, menu, panel)

register, unregister = register_parts_factory(_PARTS)
