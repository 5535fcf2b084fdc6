"""The end of a process that has Blender 4.2 as a Python module.

That module tears itself down when Python frees its dictionary, and ends in a segmentation fault (exit code 139) where something
that Blender never frees still refers to the dictionary: a class that is registered (an operator of three lines is enough), or
an update callback, even of a property that was removed. So the add-on is unregistered first, and its functions lose their
globals. Blender itself and the modules of later versions take care of this.
"""

import atexit
import sys

import bpy

CONCERNED = not bpy.app.binary_path and bpy.app.version < (4, 3)


def register_at_exit_factory(package, register, unregister):
    """(register, unregister) that also see to the end of the process; the functions given where that is not needed."""
    if not CONCERNED:
        return register, unregister
    registered = False

    def register_and_note():
        nonlocal registered
        register()
        registered = True

    def unregister_and_note():
        nonlocal registered, modules
        registered = False
        unregister()
        modules = own_modules()  # gone from sys.modules when the add-on is uninstalled

    def own_modules():
        return [module for name, module in sys.modules.items() if f"{name}.".startswith(f"{package}.")]

    def at_exit():
        if registered:
            unregister_and_note()
        for module in modules:
            module.__dict__.clear()

    modules = []
    atexit.register(at_exit)
    return register_and_note, unregister_and_note
