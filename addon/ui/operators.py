"""Operators of the panels."""

import bpy
from bpy.props import StringProperty
from bpy_extras.io_utils import ExportHelper

from .. import statistics


class GPIS_OT_save_statistics(bpy.types.Operator, ExportHelper):
    """Save the statistics of the last render: history of samples, time and error, counters and plan"""

    bl_idname = "gpis.save_statistics"
    bl_label = "Save Statistics"
    filename_ext = ".json"
    filter_glob: StringProperty(default="*.json", options={"HIDDEN"})

    @classmethod
    def poll(cls, context):
        return statistics.last(context.scene.name) is not None

    def execute(self, context):
        try:
            statistics.write(statistics.last(context.scene.name), bpy.path.abspath(self.filepath))
        except OSError as error:
            self.report({"ERROR"}, f"The statistics cannot be written: {error}")
            return {"CANCELLED"}
        return {"FINISHED"}


def register():
    bpy.utils.register_class(GPIS_OT_save_statistics)


def unregister():
    bpy.utils.unregister_class(GPIS_OT_save_statistics)
    statistics.forget()
