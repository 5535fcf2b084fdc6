"""Packages of the add-on register the parts that they consist of."""


def register_parts_factory(parts):
    """(register, unregister) of modules that have both, like bpy.utils.register_classes_factory for classes."""

    def register():
        for part in parts:
            part.register()

    def unregister():
        for part in reversed(parts):
            part.unregister()

    return register, unregister
