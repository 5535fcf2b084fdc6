"""What the add-on adds to Blender, and that nothing of it stays when it is disabled."""

import addon_utils
import bpy
import pytest

from . import support


def footprint():
    """Everything of Blender that the add-on could change."""
    handlers = {
        name: [handler.__module__ for handler in getattr(bpy.app.handlers, name)]
        for name in dir(bpy.app.handlers)
        if isinstance(getattr(bpy.app.handlers, name), list)
    }
    engines = {
        panel.__name__: frozenset(panel.COMPAT_ENGINES)
        for panel in bpy.types.Panel.__subclasses__()
        if panel.is_registered and hasattr(panel, "COMPAT_ENGINES")
    }
    owners = (bpy.types.Scene, bpy.types.ViewLayer, bpy.types.Object, bpy.types.Volume)
    properties = {owner.__name__: set(owner.bl_rna.properties.keys()) for owner in owners}
    classes = {name for name in dir(bpy.types) if "gpis" in name.lower()}
    operators = set(dir(bpy.ops.gpis))
    return handlers, engines, properties, classes, operators


@pytest.fixture
def disabled(extension):
    """The footprint with the add-on, and without it."""
    enabled = footprint()
    addon_utils.disable(extension)
    yield enabled, footprint()
    addon_utils.enable(extension)


def test_disable_leaves_nothing_behind(disabled, extension):
    (with_handlers, with_engines, with_properties, with_classes, with_operators), without = disabled
    handlers, engines, properties, classes, operators = without
    assert with_classes and not classes
    assert with_operators and not operators
    assert any(extension in module for modules in with_handlers.values() for module in modules)
    assert not any(extension in module for modules in handlers.values() for module in modules)
    assert any("GPIS" in names for names in with_engines.values())
    assert not any("GPIS" in names for names in engines.values())
    for owner, names in with_properties.items():
        assert {name for name in names - properties[owner]} in ({"gpis"}, {"gpis", "gpis_csg"}, {"gpis_baked", "gpis_strokes"})


def test_enabled_again_it_works(disabled, extension, tmp_path):
    addon_utils.enable(extension)
    bpy.ops.wm.read_homefile(use_factory_startup=False, use_empty=True)
    scene = bpy.context.scene
    support.settings(scene, 8, 8, samples=1)
    support.camera(scene)
    support.world(scene, (0.25, 0.5, 0.75))
    assert support.picture(scene, tmp_path)[4, 4] == pytest.approx((0.25, 0.5, 0.75), abs=1e-5)


def test_builtin_panels_serve_the_engine(extension):
    panels = {panel.__name__: panel for panel in bpy.types.Panel.__subclasses__()}
    for name in ("RENDER_PT_format", "DATA_PT_lens", "EEVEE_MATERIAL_PT_surface", "EEVEE_WORLD_PT_surface"):
        assert "GPIS" in panels[name].COMPAT_ENGINES, name
    for name in ("VIEWLAYER_PT_layer_passes", "RENDER_PT_freestyle", "VIEWLAYER_PT_freestyle_lineset"):
        assert "GPIS" not in panels[name].COMPAT_ENGINES, name


def test_native_module_is_not_loaded_before_it_is_needed(fresh_blender, extension_zip):
    """Its libraries must come after Blender's own."""
    done = fresh_blender(
        f"""
import sys, bpy
bpy.ops.extensions.package_install_files(filepath={str(extension_zip)!r}, repo="user_default", enable_on_install=True)
assert "bl_ext.user_default.gpis" in bpy.context.preferences.addons
assert "gpis_native" not in sys.modules
print("lazy it is")
"""
    )
    assert done.returncode == 0 and "lazy it is" in done.stdout, done.stdout


def test_every_property_has_a_tooltip(extension):
    groups = [bpy.types.Scene, bpy.types.ViewLayer, bpy.types.Object]
    for owner in groups:
        group = owner.bl_rna.properties["gpis"].fixed_type
        for prop in group.properties:
            if prop.identifier not in {"rna_type", "name"}:
                assert prop.name and len(prop.description) > 5, f"{owner.__name__}.gpis.{prop.identifier}"
