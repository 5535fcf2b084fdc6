"""Material slots -> `materials` of the description: Diffuse, Glossy, Glass and Principled nodes. On a GPIS object this is
the micro-BRDF, what happens to light at the surface of one realisation."""

from . import nodes

# A slot without a material, as Cycles shades it.
DEFAULT_NAME = "Default Surface"
DEFAULT = {"type": "lambert", "color": (0.8, 0.8, 0.8)}

# Inputs of Principled that change the picture when they are not zero, by their names in 4.2 to 5.x.
_IGNORED_INPUTS = (
    "Subsurface Weight",
    "Transmission Weight",
    "Coat Weight",
    "Sheen Weight",
    "Emission Strength",
    "Anisotropic",
    "Thin Film Thickness",
)


def of_object(sync, obj):
    """Names of the materials of an object's slots, in their order; one default where there is none."""
    data_materials = list(obj.data.materials)
    slots = obj.material_slots
    # Instances made by geometry nodes carry the materials of their data; their slots are those of the instancer.
    if len(slots) == len(data_materials):
        data_materials = [
            slot.material if slot.link == "OBJECT" else material
            for slot, material in zip(slots, data_materials, strict=True)
        ]
    override = sync.depsgraph.view_layer.material_override
    if override is not None:
        data_materials = [override.evaluated_get(sync.depsgraph)] * len(data_materials or [None])
    return [_name(sync, material) for material in data_materials] or [_name(sync, None)]


def _name(sync, material):
    name = DEFAULT_NAME if material is None else material.name_full
    if name not in sync.description["materials"]:
        sync.description["materials"][name] = dict(DEFAULT) if material is None else describe(sync, material)
    return name


def describe(sync, material):
    owner = f'Material "{material.name}"'
    tree = nodes.tree_of(material)
    if tree is None:
        return {"type": "lambert", "color": tuple(material.diffuse_color[:3])}  # as Cycles shades it
    node = nodes.shader_of(tree)
    if node is None:
        sync.warn(f"{owner} has nothing on its Surface: it is rendered black.")
        return {"type": "lambert", "color": (0.0, 0.0, 0.0)}
    convert = _CONVERTERS.get(node.type)
    if convert is None:
        sync.warn(
            f'{owner}: node "{node.name}" is not converted, {DEFAULT["color"][0]} grey is used. The GPIS engine reads '
            "Diffuse BSDF, Glossy BSDF, Glass BSDF and Principled BSDF."
        )
        return dict(DEFAULT)
    for socket in node.inputs:
        if socket.name in {"Normal", "Tangent", "Coat Normal"} and socket.is_linked:
            sync.warn(f'{owner}: the link on {socket.name} of node "{node.name}" is not converted.')
    result = convert(sync, owner, node)
    tints = [key for key in ("color", "reflection") if key in result]
    if not all(0 <= part <= 1 for key in tints for part in result[key]):
        sync.warn(
            f'{owner}: the colour of node "{node.name}" is cut to 0..1, no surface reflects more than it receives.'
        )
        for key in tints:
            result[key] = tuple(min(max(part, 0.0), 1.0) for part in result[key])
    return result


def _diffuse(sync, owner, node):
    if nodes.value(sync, owner, node.inputs["Roughness"]) > 0:
        sync.warn(f'{owner}: node "{node.name}" is rendered without its roughness (Lambert instead of Oren-Nayar).')
    return {"type": "lambert", "color": nodes.value(sync, owner, node.inputs["Color"])}


def _glossy(sync, owner, node):
    color = nodes.value(sync, owner, node.inputs["Color"])
    roughness = nodes.value(sync, owner, node.inputs["Roughness"])
    if abs(nodes.value(sync, owner, node.inputs["Anisotropy"])) > 0:
        sync.warn(f'{owner}: node "{node.name}" is rendered without its anisotropy.')
    if roughness == 0:
        return {"type": "mirror", "color": color}
    return {"type": "conductor", "color": color, "roughness": roughness}


def _glass(sync, owner, node):
    color = nodes.value(sync, owner, node.inputs["Color"])
    _ignored(sync, owner, node, ("Thin Film Thickness",))
    return _dielectric(sync, owner, node) | {"color": color, "reflection": color}


def _dielectric(sync, owner, node):
    ior = nodes.value(sync, owner, node.inputs["IOR"])
    return {
        "type": "dielectric",
        "ior": max(ior, 1e-3),
        "roughness": nodes.value(sync, owner, node.inputs["Roughness"]),
    }


def _principled_node(sync, owner, node):
    color = nodes.value(sync, owner, node.inputs["Base Color"])
    metallic = nodes.value(sync, owner, node.inputs["Metallic"])
    transmission = node.inputs["Transmission Weight"]
    glass = not transmission.is_linked and transmission.default_value == 1 and metallic == 0
    _ignored(sync, owner, node, [name for name in _IGNORED_INPUTS if not (glass and name == transmission.name)])
    if nodes.value(sync, owner, node.inputs["Alpha"]) < 1:
        sync.warn(f'{owner}: Alpha of node "{node.name}" is not converted, the surface is opaque.')
    if glass:
        # Light that enters and leaves is tinted twice, hence the root.
        return _dielectric(sync, owner, node) | {"color": tuple(max(part, 0.0) ** 0.5 for part in color)}
    return {
        "type": "principled",
        "color": color,
        "roughness": nodes.value(sync, owner, node.inputs["Roughness"]),
        "metallic": metallic,
    }


def _ignored(sync, owner, node, names):
    for name in names:
        socket = node.inputs.get(name)
        if socket is not None and (socket.is_linked or socket.default_value != 0):
            sync.warn(f'{owner}: {name} of node "{node.name}" is not converted.')


_CONVERTERS = {
    "BSDF_DIFFUSE": _diffuse,
    "BSDF_GLOSSY": _glossy,
    "BSDF_GLASS": _glass,
    "BSDF_PRINCIPLED": _principled_node,
}
