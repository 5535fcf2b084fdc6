"""Blender's own panels that fit this engine, taken as Cycles takes them: all that every engine had, minus a list,
plus the material, world and light panels that Blender shows for EEVEE alone.
"""

import bpy

from .render_panels import ENGINE

_EXCLUDED = {
    "DATA_PT_light",
    "DATA_PT_preview",
    "DATA_PT_spot",
    "MATERIAL_PT_preview",
    "RENDER_PT_simplify",
    "RENDER_PT_simplify_viewport",
    "RENDER_PT_simplify_render",
    "VIEWLAYER_PT_filter",
    "VIEWLAYER_PT_layer_passes",
    "WORLD_PT_preview",
}

# Blender has no such panel for every engine. Their lists name EEVEE under several ids over the versions.
_ADDED = {
    "DATA_PT_EEVEE_light",
    "EEVEE_MATERIAL_PT_context_material",
    "EEVEE_MATERIAL_PT_surface",
    "EEVEE_WORLD_PT_surface",
}


def _panels():
    for panel in bpy.types.Panel.__subclasses__():
        engines = getattr(panel, "COMPAT_ENGINES", None)
        if engines is None:
            continue
        name = panel.__name__
        # Freestyle draws its strokes as meshes with nodes that this engine does not read.
        fits = "BLENDER_RENDER" in engines and name not in _EXCLUDED and "freestyle" not in name
        if name in _ADDED or fits:
            yield panel


def register():
    for panel in _panels():
        panel.COMPAT_ENGINES.add(ENGINE)


def unregister():
    for panel in _panels():
        panel.COMPAT_ENGINES.discard(ENGINE)
