"""Operators of the list of operands."""

import bpy
from bpy.props import EnumProperty, IntProperty

from ..sync.csg import reaches
from .properties import OPERATIONS


def lists_with(obj):
    """Objects in whose list `obj` is."""
    return [other for other in bpy.data.objects if any(item.object == obj for item in other.gpis_csg.items)]


def show_as_operand(obj):
    """As bounds, and so the mesh it was made of."""
    obj.display_type = "BOUNDS"
    if obj.gpis.source is not None:
        obj.gpis.source.display_type = "BOUNDS"


def release(obj):
    """An operand of no list any more is rendered by itself again, for it is none; its mesh is seen again."""
    if obj is not None and obj.gpis.source is not None and not lists_with(obj):
        obj.gpis.source.display_type = "WIRE"


class _ListOperator:
    bl_options = {"REGISTER", "UNDO"}

    @classmethod
    def poll(cls, context):
        obj = context.object
        if obj is None or obj.type != "VOLUME" or not obj.gpis.enabled:
            cls.poll_message_set("Make a GPIS the active object first")
            return False
        if obj.library is not None:
            cls.poll_message_set("The active object is linked from another file: make it local first")
            return False
        return True


class GPIS_OT_csg_add(_ListOperator, bpy.types.Operator):
    """Add the selected GPIS objects to the list of the active one. They are drawn as bounds, and no longer rendered by
    themselves"""

    bl_idname = "gpis.csg_add"
    bl_label = "Add Operands"

    operation: EnumProperty(name="Operation", items=OPERATIONS, default="UNION", options={"SKIP_SAVE"})

    def execute(self, context):
        obj = context.object
        settings = obj.gpis_csg
        present = {item.object for item in settings.items}
        operands = [other for other in context.selected_objects if other != obj and other.type == "VOLUME" and other.gpis.enabled]
        for operand in operands:
            if reaches(operand, obj):
                self.report(
                    {"ERROR"}, f'"{operand.name}" has "{obj.name}" in its own list: they cannot be operands of each other.'
                )
                return {"CANCELLED"}
        new = [operand for operand in operands if operand not in present]
        if operands and not new:
            self.report({"ERROR"}, "All selected GPIS objects are in the list already.")
            return {"CANCELLED"}
        for operand in new or [None]:  # an empty line, to choose the operand in
            item = settings.items.add()
            item.operation = self.operation
            if operand is not None:
                item.object = operand
                show_as_operand(operand)
        settings.active = len(settings.items) - 1
        obj.update_tag()
        return {"FINISHED"}


class GPIS_OT_csg_remove(_ListOperator, bpy.types.Operator):
    """Take the active operand off the list. It is rendered by itself again"""

    bl_idname = "gpis.csg_remove"
    bl_label = "Remove Operand"

    @classmethod
    def poll(cls, context):
        return super().poll(context) and len(context.object.gpis_csg.items) > 0

    def execute(self, context):
        settings = context.object.gpis_csg
        index = min(settings.active, len(settings.items) - 1)
        operand = settings.items[index].object
        settings.items.remove(index)
        settings.active = max(0, min(index, len(settings.items) - 1))
        release(operand)
        context.object.update_tag()
        return {"FINISHED"}


class GPIS_OT_csg_move(_ListOperator, bpy.types.Operator):
    """Move the active operand in the list: operations are carried out from top to bottom"""

    bl_idname = "gpis.csg_move"
    bl_label = "Move Operand"

    direction: EnumProperty(
        name="Direction", items=(("UP", "Up", "Earlier"), ("DOWN", "Down", "Later")), default="UP", options={"SKIP_SAVE"}
    )

    @classmethod
    def poll(cls, context):
        return super().poll(context) and len(context.object.gpis_csg.items) > 1

    def execute(self, context):
        settings = context.object.gpis_csg
        to = settings.active + (-1 if self.direction == "UP" else 1)
        if not 0 <= to < len(settings.items):
            return {"CANCELLED"}
        settings.items.move(settings.active, to)
        settings.active = to
        context.object.update_tag()
        return {"FINISHED"}


class Drag:
    """An item of the list that follows the mouse from row to row."""

    def __init__(self, obj, index, y, row_height):
        self._obj, self._from, self._y, self._row_height = obj, index, y, row_height
        self.at = index
        self._active = obj.gpis_csg.active

    def follow(self, y):
        """To the row where the mouse is, y upwards; whether that is another one than before."""
        return self.move(self._from + round((self._y - y) / self._row_height))

    def move(self, to):
        settings = self._obj.gpis_csg
        to = max(0, min(to, len(settings.items) - 1))
        if to == self.at:
            return False
        settings.items.move(self.at, to)
        settings.active = self.at = to
        self._obj.update_tag()
        return True

    def put_back(self):
        self.move(self._from)
        self._obj.gpis_csg.active = self._active


class GPIS_OT_csg_drag(_ListOperator, bpy.types.Operator):
    """Take this operand by the grip, move it to where it belongs in the list, and click. Esc puts it back"""

    bl_idname = "gpis.csg_drag"
    bl_label = "Drag Operand"

    index: IntProperty(name="From", min=0, options={"SKIP_SAVE"})
    to: IntProperty(name="To", min=0, options={"SKIP_SAVE"})

    @classmethod
    def poll(cls, context):
        return super().poll(context) and len(context.object.gpis_csg.items) > 1

    def execute(self, context):
        settings = context.object.gpis_csg
        if self.index >= len(settings.items):
            self.report({"ERROR"}, f"The list has no operand {self.index}; it has {len(settings.items)}, counted from 0.")
            return {"CANCELLED"}
        return {"FINISHED"} if Drag(context.object, self.index, 0, 1).move(self.to) else {"CANCELLED"}

    def invoke(self, context, event):
        settings = context.object.gpis_csg
        if self.index >= len(settings.items):
            return {"CANCELLED"}
        self._drag = Drag(context.object, self.index, event.mouse_y, 20 * context.preferences.system.ui_scale)
        settings.active = self.index  # after the drag has noted which row was
        self._area = context.area
        context.window.cursor_modal_set("SCROLL_Y")
        context.workspace.status_text_set("Move: to another row   Click, Enter: leave it there   Right click, Esc: put it back")
        context.window_manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        if event.type == "MOUSEMOVE":
            if self._drag.follow(event.mouse_y):
                self._area.tag_redraw()
            return {"RUNNING_MODAL"}
        if event.type in {"ESC", "RIGHTMOUSE"}:
            return self._end(context, kept=False)
        if event.type in {"LEFTMOUSE", "RET", "NUMPAD_ENTER"}:
            return self._end(context, kept=True)
        return {"RUNNING_MODAL"}

    def cancel(self, context):
        self._end(context, kept=False)

    def _end(self, context, kept):
        context.window.cursor_modal_restore()
        context.workspace.status_text_set(None)
        if not kept:
            self._drag.put_back()
        self._area.tag_redraw()
        if not kept or self._drag.at == self.index:
            return {"CANCELLED"}
        self.to = self._drag.at
        return {"FINISHED"}


_CLASSES = (GPIS_OT_csg_add, GPIS_OT_csg_remove, GPIS_OT_csg_move, GPIS_OT_csg_drag)


register, unregister = bpy.utils.register_classes_factory(_CLASSES)
