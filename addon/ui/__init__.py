"""What an artist sees: properties, and panels by tab of the Properties editor."""

from ..parts import register_parts_factory
from . import builtin_panels, object_panel, operators, properties, render_panels, view_layer_panel

_PARTS = (properties, operators, render_panels, view_layer_panel, object_panel, builtin_panels)

register, unregister = register_parts_factory(_PARTS)
