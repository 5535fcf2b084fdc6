"""GPIS: a render engine for stochastic implicit surfaces (Seyb et al. 2024)."""

from . import bake, engine, paint, presets, ui

_PARTS = (ui, bake, paint, presets, engine)


def register():
    for part in _PARTS:
        part.register()


def unregister():
    for part in reversed(_PARTS):
        part.unregister()
