"""The zip as an artist meets it: installed into an empty Blender, enabled, rendered with, found again, removed."""

RENDER = """
import bpy
scene = bpy.context.scene
scene.render.engine = "GPIS"
scene.render.resolution_x = scene.render.resolution_y = 16
scene.gpis.samples = 4
settings = scene.render.image_settings
if hasattr(settings, "media_type"):
    settings.media_type = "IMAGE"
settings.file_format = "PNG"
scene.render.filepath = path
bpy.ops.mesh.primitive_monkey_add()
bpy.ops.gpis.make(resolution=16)
bpy.ops.render.render(write_still=True)
"""


def check(done, word):
    assert done.returncode == 0 and word in done.stdout, done.stdout


def test_install_render_restart_remove(fresh_blender, extension_zip, tmp_path):
    first, second = tmp_path / "first.png", tmp_path / "second.png"
    install = f"""
import bpy
assert not hasattr(bpy.types.Scene, "gpis")
assert bpy.ops.extensions.package_install_files(
    filepath={str(extension_zip)!r}, repo="user_default", enable_on_install=True) == {{"FINISHED"}}
path = {str(first)!r}
{RENDER}
bpy.ops.wm.save_userpref()
print("installed and rendered")
"""
    check(fresh_blender(install), "installed and rendered")
    assert first.stat().st_size > 100
    again = f"""
import bpy, addon_utils
addon_utils.enable("bl_ext.user_default.gpis", default_set=True)
path = {str(second)!r}
{RENDER}
bpy.ops.extensions.package_uninstall(repo_index=1, pkg_id="gpis")
import pathlib
left = [str(p) for p in pathlib.Path(bpy.utils.user_resource("EXTENSIONS")).rglob("*gpis*") if p.is_file()]
if bpy.app.version < (4, 3):  # 4.2 leaves the wheels of every extension until its next start
    left = [path for path in left if ".local" not in path]
assert not hasattr(bpy.types.Scene, "gpis") and not left, left
print("found again and removed", flush=True)
"""
    check(fresh_blender(again), "found again and removed")
    assert second.stat().st_size > 100
