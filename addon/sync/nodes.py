"""Reading shader nodes: the few that the engine knows, and a sentence about every other."""

import bpy


def tree_of(owner):
    """The node tree of a material, world or light, None where it has none or (before 5.0) does not use it."""
    # Since 5.0 the switch is always on for materials and worlds, and reading it warns of its removal.
    in_use = isinstance(owner, bpy.types.Light) or bpy.app.version < (5, 0)
    return None if in_use and not owner.use_nodes else owner.node_tree


def shader_of(tree):
    """The node that is linked to the Surface of the active output, or None."""
    output = tree.get_output_node("CYCLES") or tree.get_output_node("ALL")
    return None if output is None else source(output.inputs["Surface"])


def source(socket):
    """The node behind an input, through reroutes; None where nothing is linked."""
    while socket.is_linked:
        link = socket.links[0]
        if link.from_node.type != "REROUTE":
            return None if link.is_muted else link.from_node
        socket = link.from_node.inputs[0]
    return None


def value(sync, owner, socket):
    """A number or colour of an input: its own, or that of an RGB or Value node. Anything else is warned about."""
    node = source(socket)
    if node is None:
        return _plain(socket.default_value)
    if node.type in {"RGB", "VALUE"}:
        return _plain(node.outputs[0].default_value)
    sync.warn(
        f'{owner}: node "{node.name}" on {socket.name} is not converted; the value under the link, '
        f"{_words(_plain(socket.default_value))}, is used."
    )
    return _plain(socket.default_value)


def _plain(entry):
    return float(entry) if isinstance(entry, (int, float)) else tuple(entry)[:3]


def _words(entry):
    return f"{entry:.3g}" if isinstance(entry, float) else "(" + ", ".join(f"{part:.3g}" for part in entry) + ")"
