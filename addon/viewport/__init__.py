"""What the 3D viewport shows of GPIS objects: the mean surface, what is painted on it, and the rendered picture."""

from ..parts import register_parts_factory
from . import overlay, realise

_PARTS = (overlay, realise)

register, unregister = register_parts_factory(_PARTS)
