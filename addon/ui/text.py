"""Sentences in panels, whose labels do not wrap by themselves."""

import textwrap

# Pixels of a character of Blender's interface font, on average and a little more.
_CHARACTER = 6.3


def wrapped(column, context, sentence, indent=False, icon="NONE"):
    """A sentence in as many labels as the width of the region asks for; `indent`: below the fields of a split layout."""
    system = context.preferences.system
    width = context.region.width / system.ui_scale * (0.6 if indent else 1.0) - (50 if icon == "NONE" else 70)
    for line in textwrap.wrap(sentence, max(20, int(width / _CHARACTER))):
        target = column
        if indent:
            split = column.split(factor=0.4)
            split.label()
            target = split.column()
            target.active = False
        target.label(text=line, icon=icon)
        icon = "NONE" if icon == "NONE" else "BLANK1"
