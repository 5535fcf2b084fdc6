"""GPIS: a render engine for stochastic implicit surfaces (Seyb et al. 2024)."""

from . import bake, csg, engine, paint, presets, ui, viewport
from .module_exit import register_at_exit_factory
from .parts import register_parts_factory

_PARTS = (ui, bake, csg, presets, paint, viewport, engine)

register, unregister = register_at_exit_factory(__package__, *register_parts_factory(_PARTS))
