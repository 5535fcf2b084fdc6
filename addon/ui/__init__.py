"""What an artist sees: properties, and panels by tab of the Properties editor."""

from . import builtin_panels, object_panel, operators, properties, render_panels, view_layer_panel

_PARTS = (properties, operators, render_panels, view_layer_panel, object_panel, builtin_panels)


def register():
    for part in _PARTS:
        part.register()


def unregister():
    for part in reversed(_PARTS):
        part.unregister()
