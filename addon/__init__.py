"""GPIS: a render engine for stochastic implicit surfaces (Seyb et al. 2024)."""

from . import bake, csg, engine, paint, presets, ui, viewport

_PARTS = (ui, bake, csg, presets, paint, viewport, engine)


def register():
    for part in _PARTS:
        part.register()


def unregister():
    for part in reversed(_PARTS):
        part.unregister()
