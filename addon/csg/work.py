"""Work of the native module in a thread of its own, operators that wait for it (a bar, and Esc), and their dialogs."""

import threading

import bpy


class Work:
    """`run(progress)` in a thread; progress(fraction) is False once the work is to stop. The native module lets go of Python."""

    def __init__(self, run):
        self.fraction, self.result, self.error = 0.0, None, None
        self._cancelled = False
        self._thread = threading.Thread(target=self._run, args=(run,), daemon=True)
        self._thread.start()

    def _run(self, run):
        try:
            self.result = run(self._progress)
        except Exception as error:  # told by whoever looks: a thread has nobody to raise to
            self.error = error

    def _progress(self, fraction):
        self.fraction = fraction
        return not self._cancelled

    def running(self):
        return self._thread.is_alive()

    def cancel(self):
        self._cancelled = True

    def join(self):
        self._thread.join()


class Working:
    """An operator whose `prepare(context)` gives the function for Work, whose result `finish(context, result)` takes."""

    doing = ""  # "Fitting a GPIS"
    cancelled = ""  # "The fit was cancelled."

    def execute(self, context):
        if not self._start(context):
            return {"CANCELLED"}
        self._work.join()
        return self._end(context)

    def invoke(self, context, event):
        if not self._start(context):
            return {"CANCELLED"}
        manager = context.window_manager
        self._timer = manager.event_timer_add(0.1, window=context.window)
        manager.progress_begin(0, 100)
        manager.modal_handler_add(self)
        return {"RUNNING_MODAL"}

    def modal(self, context, event):
        work = self._work
        if event.type == "ESC" and event.value == "PRESS":
            work.cancel()
        if event.type != "TIMER":
            # The scene waits: the result is of what it was when the work began.
            return {"RUNNING_MODAL"}
        context.window_manager.progress_update(100 * work.fraction)
        context.workspace.status_text_set(f"{self.doing}: {work.fraction:.0%}  (Esc: cancel)")
        if work.running():
            return {"RUNNING_MODAL"}
        self._stop(context)
        return self._end(context)

    def cancel(self, context):
        self._work.cancel()
        self._work.join()
        self._stop(context)

    def _stop(self, context):
        context.window_manager.event_timer_remove(self._timer)
        context.window_manager.progress_end()
        context.workspace.status_text_set(None)

    def _start(self, context):
        try:
            self._work = Work(self.prepare(context))
        except (ValueError, RuntimeError, OSError) as error:
            self.report({"ERROR"}, str(error))
            return False
        return True

    def _end(self, context):
        if self._work.error is not None:
            self.report({"ERROR"}, str(self._work.error))
            return {"CANCELLED"}
        if self._work.result is None:
            self.report({"INFO"}, self.cancelled)
            return {"CANCELLED"}
        return self.finish(context, self._work.result)


class Asking:
    """An operator with a dialog, whose properties `handed` the operator `runs` (of bpy.ops.gpis) works with."""

    runs = ""
    handed = ()

    def invoke(self, context, event):
        return context.window_manager.invoke_props_dialog(self, width=360)

    def execute(self, context):
        how = "EXEC_DEFAULT" if bpy.app.background else "INVOKE_DEFAULT"
        try:
            result = getattr(bpy.ops.gpis, self.runs)(how, **{name: getattr(self, name) for name in self.handed})
        except RuntimeError as error:  # what the other operator has reported, which Blender raises here
            self.report({"ERROR"}, str(error).removeprefix("Error: ").strip())
            return {"CANCELLED"}
        # This one is done; the other goes on by itself.
        return {"FINISHED"} if "RUNNING_MODAL" in result else result
