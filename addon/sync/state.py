"""What the files of this folder share while they describe one frame."""

import numpy as np


class SyncError(ValueError):
    """The scene cannot be rendered; the text is a sentence for the artist."""


class Sync:
    """The description as it grows, and the sentences about what it leaves out."""

    def __init__(self, depsgraph):
        self.depsgraph = depsgraph
        self.scene = depsgraph.scene
        self.description = {"version": 1, "lights": [], "materials": {}, "meshes": {}, "objects": []}
        self.mesh_owners = {}  # key of `meshes` -> name of the first object that has it
        self.warnings = []

    def warn(self, sentence):
        if sentence not in self.warnings:  # instances would repeat it
            self.warnings.append(sentence)


def array(matrix):
    """A Blender matrix, copied at once: Blender reuses the memory behind it."""
    return np.array(matrix, dtype=np.float64)
