"""The scene description: what it takes, and the sentence it has for everything else."""

import copy

import gpis_native as gn
import numpy as np
import pytest

TRIANGLE = {"vertices": [(0, 0, 0), (1, 0, 0), (0, 1, 0)], "triangles": [(0, 1, 2)]}


def full():
    """Every key there is."""
    process = gn.GaussianProcess(gn.SphereField((0, 0, 0), 1.0), 0.1, gn.SquaredExponential(0.2))
    return {
        "version": 1,
        "settings": {
            "max_bounces": None,
            "missed_root": 1e-3,
            "filter": {"type": "blackman_harris", "width": 1.5},
            "clamp": 0,
            "light_sampling": True,
        },
        "camera": {
            "type": "perspective",
            "matrix": np.eye(4),
            "fov_x": 0.8,
            "shift": (0.1, 0),
            "clip": (0.1, np.inf),
            "lens": None,
        },
        "world": {"image": np.ones((4, 8, 3)), "matrix": np.eye(3), "strength": 2},
        "lights": [
            {"name": "P", "type": "point", "matrix": np.eye(4), "color": (1, 1, 1), "power": 10, "radius": 0.1},
            {"name": "S", "type": "sun", "matrix": np.eye(4).tolist(), "power": 3, "angle": 0.01},
            {"name": "A", "type": "area", "power": 3, "size": (1, 2), "shape": "ellipse", "visible_to_camera": True},
            {"name": "R", "type": "area", "radiance": (1, 2, 3), "size": [1, 2], "shape": "rectangle"},
            {"name": "T", "type": "spot", "power": 3, "radius": 0.1, "angle": 0.5, "blend": 0.2},
        ],
        "materials": {
            "wood": {"type": "lambert", "color": (0.5, 0.4, 0.3)},
            "glass": {"type": "mirror", "color": np.ones(3)},
            "gold": {"type": "conductor", "color": (1, 0.8, 0.3), "roughness": 0.2},
            "paint": {"type": "principled", "color": (1, 0, 0), "roughness": 0.5, "metallic": 0.1},
            "water": {
                "type": "dielectric", "color": (0.9, 1, 1), "reflection": (1, 1, 1), "ior": 1.33, "roughness": 0.1
            },
        },
        "meshes": {
            "flat": TRIANGLE | {"material_index": [1]},
            "smooth": TRIANGLE | {"normals": np.tile((0, 0, 1), (3, 1))},
            "corners": TRIANGLE | {"normals": np.tile((0, 0, 1), (1, 3, 1))},
        },
        "objects": [
            {"name": "One", "type": "mesh", "mesh": "flat", "matrix": np.eye(4), "materials": ["wood", "gold"]},
            {"name": "Two", "type": "mesh", "mesh": "smooth", "materials": ("paint",)},
            {"type": "mesh", "mesh": "corners", "materials": ["glass"]},
            {
                "name": "Body", "type": "gpis", "process": process, "matrix": np.eye(4), "materials": ["wood"],
                "memory": "renewal", "sampler": "convolution",
            },
        ],
    }  # fmt: skip


def test_everything_there_is_is_taken():
    plan = gn.Scene(full()).plan()
    assert plan and all(isinstance(k, str) and isinstance(v, str) for k, v in plan.items())


def test_the_least_there_must_be():
    gn.Scene({"version": 1, "camera": {"type": "equirectangular", "matrix": np.eye(4)}})


def nan(shape):
    array = np.ones(shape)
    array.flat[-1] = np.nan
    return array


DROP = object()
WRONG = [
    # Keys: unknown, missing
    ("wrold", {}, "description: unknown key 'wrold' (a description takes version, settings, camera, world"),
    ("version", DROP, "description: key 'version' is missing"),
    ("version", 2, "version: takes 1, got 2"),
    ("version", "1", "version: takes integers"),
    ("camera", DROP, "description: key 'camera' is missing"),
    ("settings.samples", 3, "settings: unknown key 'samples'"),
    ("settings.filter.radius", 3, "settings.filter: unknown key 'radius' (a filter takes type, width)"),
    ("camera.width", 3, "camera: unknown key 'width' (a perspective camera takes type, matrix, fov_x"),
    ("camera.matrix", DROP, "camera: key 'matrix' is missing"),
    ("camera.fov_x", DROP, "camera: key 'fov_x' is missing"),
    ("world.colour", (1, 1, 1), "world: unknown key 'colour'"),
    ("lights.0.size", (1, 1), "lights[0]: unknown key 'size' (a point light takes type, name, matrix, color, power"),
    ("lights.0.power", DROP, "lights[0]: key 'power' is missing"),
    ("materials.gold.rougness", 0.1, "materials['gold']: unknown key 'rougness' (a conductor material takes"),
    ("materials.wood.roughness", 0.1, "materials['wood']: unknown key 'roughness'"),
    ("meshes.flat.verts", 3, "meshes['flat']: unknown key 'verts'"),
    ("meshes.flat.triangles", DROP, "meshes['flat']: key 'triangles' is missing"),
    ("objects.0.process", 3, "objects[0]: unknown key 'process' (a mesh object takes"),
    ("objects.3.mesh", "flat", "objects[3]: unknown key 'mesh' (a gpis object takes"),
    ("objects.3.process", DROP, "objects[3]: key 'process' is missing (got name, type, matrix, materials"),
    ("objects.0.materials", DROP, "objects[0]: key 'materials' is missing"),
    # Types, shapes, numbers
    ("settings", [1], "settings: takes a dict, got"),
    ("settings.max_bounces", 1.5, "settings.max_bounces: takes integers"),
    ("settings.max_bounces", -1, "settings.max_bounces"),
    ("settings.missed_root", 0, "settings.missed_root"),
    ("settings.missed_root", "small", "settings.missed_root: takes a number, got 'small'"),
    ("settings.filter.type", "gauss", "settings.filter.type: takes box, blackman_harris, got 'gauss'"),
    ("settings.filter.width", 0, "settings.filter.width"),
    ("settings.clamp", -1, "settings.clamp"),
    ("settings.clamp", np.nan, "settings.clamp: is NaN"),
    ("settings.light_sampling", 1, "settings.light_sampling: takes True or False, got 1"),
    ("camera.type", "fisheye", "camera.type: takes perspective, orthographic, equirectangular, got 'fisheye'"),
    ("camera.matrix", np.eye(3), "camera.matrix: takes numbers of shape (4, 4), got shape (3, 3)"),
    ("camera.matrix", np.zeros((4, 4)), "camera.matrix: must be affine: its last row must be 0 0 0 1"),
    ("camera.matrix", np.diag([1, 0, 1, 1.0]), "camera.matrix has an axis of length zero"),
    ("camera.matrix", nan((4, 4)), "camera.matrix: number 15 (counted from 0, in order) is NaN"),
    ("camera.matrix", [[1, 2], [3]], "camera.matrix: takes numbers of shape (4, 4), got [[1, 2], [3]]"),
    ("camera.matrix", np.eye(4).astype(str), "camera.matrix: takes numbers"),
    ("camera.fov_x", 4, "camera.fov_x is 4"),
    ("camera.fov_x", (1, 2), "camera.fov_x: takes a number"),
    ("camera.fov_x", None, "camera.fov_x: takes a number, got None"),
    ("camera.shift", 0.1, "camera.shift: takes numbers of shape (2,)"),
    ("camera.clip", (1, 0.5), "camera.clip is (1, 0.5)"),
    ("camera.clip", (-1, 5), "camera.clip"),
    ("camera.clip", 5, "camera.clip: takes a list, got 5"),
    ("camera.clip", (1, 2, 3), "camera.clip: takes two distances (near, far), got 3"),
    ("world.image", np.ones((4, 8)), "world.image: takes numbers of shape (N, M, 3), got shape (4, 8)"),
    ("world.image", nan((4, 8, 3)), "world.image"),
    ("world.image", np.ones((0, 8, 3)), "world.image: has no pixel"),
    ("world.matrix", 2 * np.eye(3), "world.matrix is not a rotation"),
    ("world.color", (1, 1, 1), "world: takes either color or image, got both"),
    ("world.strength", -1, "world.strength"),
    ("world.strength", 1.7e308, "world.image and strength make more light than a number holds (1 times 1.7e+308)"),
    ("lights", {}, "lights: takes a list, got a value of type dict"),
    ("lights.1", "sun", "lights[1]: takes a dict, got 'sun'"),
    ("lights.1.type", "sky", "lights[1].type: takes point, spot, sun, area, got 'sky'"),
    ("lights.1.power", -3, "lights[1].power"),
    ("lights.1.power", 1.7e308, "lights[1]: color and power of 'S' make more light than a number holds"),
    ("lights.1.angle", 9, "lights[1].angle"),
    ("lights.2.size", (0, 1), "lights[2].size"),
    ("lights.3.power", 5, "lights[3]: takes either power or radiance, got both"),
    ("lights.0.color", (1, 1), "lights[0].color: takes numbers of shape (3,), got shape (2,)"),
    ("lights.0.color", (1, 1, -1), "lights[0].color"),
    ("lights.0.matrix", np.diag([1, 1, 0, 1.0]), "lights[0].matrix"),
    ("lights.0.name", 3, "lights[0].name: takes a text, got 3"),
    ("materials", [], "materials: takes a dict"),
    ("materials.wood.color", (0.5, 0.5, 1.5), "materials['wood'].color"),
    ("materials.wood.type", "velvet", "materials['wood'].type: takes lambert, mirror, conductor, principled"),
    ("materials.gold.roughness", 2, "materials['gold'].roughness"),
    ("meshes.flat.vertices", np.ones((3, 2)), "meshes['flat'].vertices: takes numbers of shape (N, 3), got"),
    ("meshes.flat.vertices", nan((3, 3)), "meshes['flat'].vertices: number 8"),
    ("meshes.flat.triangles", [(0, 1, 3)], "meshes['flat'].triangles"),
    ("meshes.flat.triangles", [(0, 1, -1)], "meshes['flat'].triangles: names vertex -1"),
    ("meshes.flat.triangles", [(0, 1, 0.5)], "meshes['flat'].triangles: takes integers"),
    ("meshes.smooth.normals", np.ones((2, 3)), "meshes['smooth'].normals: takes numbers of shape (3, 3), got"),
    ("meshes.flat.material_index", [0, 1], "meshes['flat'].material_index: takes integers of shape (1,), got"),
    ("meshes.flat.material_index", [2], "objects[0].materials"),
    ("meshes.flat.material_index", [-1], "objects[0].materials"),
    # Numbers that Embree, or double precision, cannot take
    ("camera.matrix", 1e20 * np.diag([1, 1, 1, 1e-20]), "camera.matrix holds 1e+20; give places and scales of at most"),
    ("camera.matrix", np.array([[1, 0, 0, 1e19], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]), "camera.matrix holds 1e+19"),
    ("camera.matrix", np.array([[1, 0, 1, 0], [0, 1, 0, 0], [1, 0, 1, 0], [0, 0, 0, 1]]), "camera.matrix flattens space"),
    ("camera.shift", (1e300, 0), "camera.shift[0] is 1e+300"),
    ("camera.clip", (1e16, np.inf), "camera.clip[0] is 1e+16"),
    ("lights.0.radius", 1e-160, "lights[0].radius of 'P' is 1e-160; give a number from 1e-30 to 1e+30"),
    ("lights.1.angle", 1e-160, "lights[1].angle of 'S' is 1e-160"),
    ("lights.2.size", (1, 1e160), "lights[2].size[1] of 'A' is 1e+160"),
    ("objects.0.matrix", np.diag([1e14, 1, 1, 1]) @ np.array([[1, 0, 0, 20], *np.eye(4)[1:]]), "objects[0].matrix"),
    ("meshes.flat.vertices", [(0, 0, 0), (1e20, 0, 0), (0, 1, 0)], "objects[0].matrix of 'One' takes vertices of the mesh"),
    ("objects.3.matrix", np.diag([1, 1, 1e-13, 1.0]), "objects[3].matrix of 'Body' makes the object"),
    # Names that lead nowhere
    ("objects.0.mesh", "cube", "objects[0].mesh: there is no mesh 'cube' (the description has 'corners', 'flat',"),
    ("objects.1.materials", ["steel"], "objects[1].materials[0]: there is no material 'steel'"),
    ("objects.1.materials", "wood", "objects[1].materials: takes a list, got 'wood'"),
    ("objects.1.materials", [], "objects[1].materials"),
    ("objects.1.matrix", np.diag([1, 1, 0, 1.0]), "objects[1].matrix"),
    ("objects.3.materials", ["wood", "gold"], "objects[3].materials"),
    ("objects.3.memory", "eternal", "objects[3].memory"),
    ("objects.3.sampler", "magic", "objects[3].sampler: takes auto, convolution, markov, spectral, nystrom, dense"),
    ("objects.3.process", {"mean": 1}, "objects[3].process: takes a GaussianProcess or a CSG tree of them, got"),
    # What the format has and this version does not
    ("camera.lens", {"radius": 0.1}, "camera.lens: depth of field is not supported"),
    ("materials.wood.ior", 1.5, "materials['wood']: unknown key 'ior' (a lambert material takes"),
    ("materials.water.ior", 0, "materials['water'].ior is 0; give a number from 0.001 to 1000"),
    ("materials.water.ior", np.nan, "materials['water'].ior"),
    ("materials.water.roughness", 1.5, "materials['water'].roughness is 1.5; give a number from 0 to 1"),
    ("materials.water.reflection", (2, 1, 1), "materials['water'].reflection is (2, 1, 1); each entry must be"),
    ("materials.water.metallic", 1, "materials['water']: unknown key 'metallic' (a dielectric material takes"),
    ("materials.wood.type", "mix", "materials['wood'].type: 'mix' is not supported"),
    ("objects.0.matrix", [(0.0, np.eye(4)), (1.0, np.eye(4))], "objects[0].matrix: motion"),
    ("meshes.flat.uvs", np.ones((3, 2)), "meshes['flat'].uvs: textured meshes are not supported"),
]  # fmt: skip


@pytest.mark.parametrize(("path", "value", "words"), WRONG, ids=[f"{p}-{i}" for i, (p, _, _) in enumerate(WRONG)])
def test_wrong_input_gets_a_sentence(path, value, words):
    description = full()
    target, (*parents, last) = description, path.split(".")
    for key in parents:
        target = target[int(key) if isinstance(target, list) else key]
    last = int(last) if isinstance(target, list) else last
    if value is DROP:
        del target[last]
    else:
        target[last] = value
    with pytest.raises(ValueError) as error:
        gn.Scene(description)
    assert words in str(error.value)
    assert str(error.value).startswith(words.split(" ")[0].split(":")[0])


def test_bounds_end_where_single_precision_does():
    description = full()
    process = gn.GaussianProcess(gn.ConstantField(0), 1, gn.SquaredExponential(1), bounds=((-2,) * 3, (2,) * 3))
    description["objects"][3] |= {"process": process, "matrix": np.diag([9e14, 9e14, 9e14, 1.0])}
    with pytest.raises(ValueError, match=r"objects\[3\].matrix of 'Body' takes the bounds of the process as far as 1.8e\+15"):
        gn.Scene(description)


def test_a_description_is_a_dict():
    with pytest.raises(ValueError, match="description: takes a dict, got None"):
        gn.Scene(None)


def test_a_material_colour_takes_no_field():
    description = full()
    description["materials"]["wood"]["color"] = gn.SphereField((0, 0, 0), 1.0)
    with pytest.raises(ValueError, match=r"materials\['wood'\]\.color: takes numbers of shape \(3,\), got a value of type"):
        gn.Scene(description)


def test_the_description_is_copied():
    """Changing arrays afterwards changes nothing: a render never reads Python's memory."""
    description = full()
    description["world"] = {"color": (1, 1, 1)}
    kept = copy.copy(description["meshes"]["flat"])
    vertices = np.array(kept["vertices"], dtype=np.float64)
    description["meshes"]["flat"]["vertices"] = vertices
    scene = gn.Scene(description)
    before = gn.render(scene, 8, 8, samples=16).passes["combined"].tobytes()
    vertices[:] = 1e6
    assert gn.render(scene, 8, 8, samples=16).passes["combined"].tobytes() == before


@pytest.mark.parametrize("kind", [np.float32, np.float64, np.int64, list])
def test_numbers_of_any_kind(kind):
    description = full()
    vertices = np.array(TRIANGLE["vertices"])
    triangles = np.array(TRIANGLE["triangles"])
    description["meshes"]["flat"] = {
        "vertices": vertices.tolist() if kind is list else vertices.astype(kind),
        "triangles": triangles.tolist() if kind is list else triangles.astype(np.uint32),
    }
    gn.Scene(description)
