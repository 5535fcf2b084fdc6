"""The scenes of the bench, as descriptions for gn.Scene: published ones with their published settings (the README of the
shared data), the others small examples of a kind."""

from dataclasses import dataclass
from pathlib import Path

import gpis_native as gn
import numpy as np

SHARED = Path(__file__).parents[4] / "shared" / "data"
DATA = SHARED / "gpis-light-transport"
WHITE = {"color": (1.0, 1.0, 1.0)}
SKY = {"image": np.linspace(0.2, 1.6, 32)[:, None, None] * np.ones((32, 8, 3)) * (0.8, 0.9, 1.0)}
COPPER = {"type": "conductor", "color": (0.95, 0.64, 0.54), "roughness": 0.1**0.5}  # roughness² = .1
QUAD = [(0, 1, 2), (0, 2, 3)]


@dataclass(frozen=True)
class BenchScene:
    name: str
    title: str
    what: str
    make: object  # (sampler, memory, folder for files it needs) -> description
    default: str  # the sampler that `auto` takes, of CSG for its leaves
    other: str  # another one, for the references
    methods: bool = False  # all methods, or the default one
    memories: bool = False  # all memory models too
    microfacet: object = None  # folder -> description of the mean surface with a rough micro-BRDF
    heavy_tails: bool = False  # the law of a sample has no finite fourth moment to speak of
    needs: str = ""  # a file of the shared data


def look_at(eye, target, up=(0.0, 1.0, 0.0)):
    back = np.subtract(eye, target) / np.linalg.norm(np.subtract(eye, target))
    right = np.cross(up, back) / np.linalg.norm(np.cross(up, back))
    matrix = np.eye(4)
    matrix[:3, :4] = np.column_stack([right, np.cross(back, right), back, eye])
    return matrix


def camera(eye, target, degrees):
    return {"type": "perspective", "matrix": look_at(eye, target), "fov_x": np.radians(degrees)}


def describe(view, world, materials, objects, **more):
    return {"version": 1, "camera": view, "world": world, "materials": materials, "objects": objects} | more


def stochastic(name, process, materials, sampler="auto", memory="renewal+", **more):
    kind = {"name": name, "type": "gpis", "process": process, "materials": materials}
    return kind | {"sampler": sampler, "memory": memory} | more


# ---- the standard sphere of baseline.json ---------------------------------------------------------------------------

STANDARD_SIGMA, STANDARD_LENGTH = 0.05, 0.1
STANDARD_VIEW = camera((0, 0, 4), (0, 0, 0), 35)


def standard_sphere(material, world, sigma=STANDARD_SIGMA):
    def make(sampler="auto", memory="renewal+", folder=None):
        process = gn.GaussianProcess(
            gn.SphereField((0, 0, 0), 1), sigma, gn.SquaredExponential(STANDARD_LENGTH), bounds=([-1.3] * 3, [1.3] * 3)
        )
        return describe(STANDARD_VIEW, world, {"m": material}, [stochastic("Sphere", process, ["m"], sampler, memory)])

    return make


def smooth_sphere(material, world):
    """The mean surface alone."""
    return lambda folder: standard_sphere(material, world, sigma=0.0)()


def under_a_small_sun(sampler="auto", memory="renewal+", folder=None):
    """Mirrors and a light of half a degree in a dark sky: most samples see nothing, few see much."""
    sun = {"name": "Sun", "type": "sun", "matrix": look_at((2, 3, 3), (0, 0, 0)), "color": (1, 1, 1), "power": 3.0, "angle": 0.0093}
    return standard_sphere(MIRROR, {"color": (0, 0, 0)})(sampler, memory, folder) | {"lights": [sun]}


LAMBERT = {"type": "lambert", "color": (0.8, 0.8, 0.8)}
MIRROR = {"type": "mirror", "color": (0.9, 0.9, 0.9)}


def beckmann_like(sigma, length_scale):
    """A conductor of the roughness that [S24] eq. 20 gives a mean of unit slope: alpha = √2 σ/ℓ; roughness² = alpha."""
    return {"type": "conductor", "color": MIRROR["color"], "roughness": (2**0.5 * sigma / length_scale) ** 0.5}


# ---- the published example scenes -----------------------------------------------------------------------------------

EXAMPLE_VIEW = camera((2, 3, 7), (0, 0.6, 0), 20)
EXAMPLE_BOUNDS = ((-1.5, -0.499, -1.5), (1.5, 2.501, 1.5))
GREEN_MIRROR = {"type": "mirror", "color": (0.35, 0.9, 0.3)}


def bunny(sampler="auto", memory="renewal+", folder=None):
    path, place = str(DATA / "bunny.vdb"), np.eye(4)
    place[1, 3] = 0.8
    process = gn.GaussianProcess(
        gn.VdbField(path, "mean").transformed(place),
        (0.5 * gn.VdbField(path, "variance", meaning="value")).transformed(place),  # its grid holds the deviation
        gn.SquaredExponential(0.5),
        bounds=EXAMPLE_BOUNDS,
    )
    return describe(EXAMPLE_VIEW, WHITE, {"m": GREEN_MIRROR}, [stochastic("Bunny", process, ["m"], sampler, memory)])


def two_spheres():
    bumpy = gn.GaussianProcess(gn.SphereField((-0.4, 0.8, 0), 0.8), 0.1, gn.SquaredExponential(0.5), bounds=EXAMPLE_BOUNDS)
    crisp = gn.GaussianProcess(gn.SphereField((0.4, 0.8, 0), 0.5), 0.001, gn.SquaredExponential(0.5), bounds=EXAMPLE_BOUNDS)
    return gn.union(bumpy, crisp)


def csg(sampler="auto", memory="renewal+", folder=None):
    objects = [stochastic("Spheres", two_spheres(), ["m", "m"], sampler, memory)]
    return describe(EXAMPLE_VIEW, WHITE, {"m": GREEN_MIRROR}, objects)


def wedge(sampler="auto", memory="renewal+", folder=None, length_scale=0.1):
    """The prism of wedge.obj is half of a cube, below the plane x + z = 0: constant mean 0 in the cube, cut by that plane."""
    place = np.diag([0.5, 0.5, 0.5, 1.0])
    place[:3, 3] = 0, 1, -0.49
    vertices = [[float(x) for x in line.split()[1:4]] for line in (DATA / "wedge.obj").read_text().splitlines() if line[:2] == "v "]
    corners = np.array(vertices) @ place[:3, :3] + place[:3, 3]
    cube = (corners.min(axis=0), corners.max(axis=0))
    filling = gn.GaussianProcess(gn.ConstantField(0), 0.01, gn.SquaredExponential(length_scale), bounds=cube)
    slope = gn.PlaneField(place[:3, 3], np.array([1, 0, 1]) / 2**0.5)
    half = gn.GaussianProcess(slope, 0.0, gn.SquaredExponential(1), bounds=cube)
    objects = [stochastic("Wedge", gn.intersection(filling, half), ["m", "m"], sampler, memory)]
    return describe(camera((2, 3, 7), (0, 1, -0.49), 12), WHITE, {"m": COPPER}, objects)


# ---- one scene of each kind -----------------------------------------------------------------------------------------


def painted_file(folder):
    """A sphere on which the deviation, the length scales, their directions, the mean and the colour were painted."""
    path = Path(folder) / "painted.vdb"
    if path.exists():
        return str(path)
    folder.mkdir(parents=True, exist_ok=True)
    x = -1.6 + 0.1 * np.arange(33)
    distance = np.sqrt(sum(c**2 for c in np.meshgrid(x, x, x, indexing="ij"))) - 1
    gn.write_vdb(folder / "sphere.vdb", {"mean": distance.astype(np.float32), "origin": (-1.6,) * 3, "voxel_size": 0.1})
    fields = gn.PaintedFields(folder / "sphere.vdb", sigma=0.03, length_scale=0.3)
    front = [(0.0, 0.0, 1.0)]
    fields.apply("mean", "inflate", [(0.5, 0.5, 0.7)], radius=0.6, value=0.25)
    fields.apply("deviation", "set", [(-0.5, 0.4, 0.75)], radius=0.8, value=0.1)
    fields.apply("length_scale", "set", [(0.5, -0.4, 0.75)], radius=0.8, value=0.2)
    fields.apply("anisotropy", "comb", front, radius=1.0, directions=[(1, 0.3, 0)], ratios=(2, 1, 1))
    fields.apply("albedo", "set", [(0.4, 0.4, 0.8)], radius=0.7, value=(0.9, 0.3, 0.1))
    fields.write(path)
    return str(path)


def painted_process(folder):
    path = painted_file(folder)
    return gn.GaussianProcess(
        gn.VdbField(path, "mean"),
        gn.VdbField(path, "sigma"),
        gn.SquaredExponential(1),
        anisotropy=gn.VdbTensorField(path),
        bounds=([-1.5] * 3, [1.5] * 3),
    )


def painted(sampler="auto", memory="renewal+", folder=None):
    thing = stochastic("Painted", painted_process(folder), ["m"], sampler, memory)
    thing["albedo"] = gn.VdbColorField(painted_file(folder))
    return describe(STANDARD_VIEW, SKY, {"m": LAMBERT}, [thing])


FIELD_SIGMA, FIELD_LENGTH = 0.05, 0.2
FIELD_VIEW = camera((0, -4, 3), (0, 0, 0), 30)


def height_field(sampler="auto", memory="renewal+", folder=None, sigma=FIELD_SIGMA, material=MIRROR):
    kernel = gn.SquaredExponential((FIELD_LENGTH, FIELD_LENGTH, np.inf))  # g does not change along z
    bounds = ((-1, -1, -0.4), (1, 1, 0.4))
    process = gn.GaussianProcess(gn.PlaneField((0, 0, 0), (0, 0, 1)), sigma, kernel, bounds=bounds)
    return describe(FIELD_VIEW, SKY, {"m": material}, [stochastic("Field", process, ["m"], sampler, memory)])


def dilute_medium(sampler="auto", memory="renewal+", folder=None):
    """Crumbs of matter, some 6 % of the volume: what a fuzzy object is far from its mean surface."""
    process = gn.GaussianProcess(gn.ConstantField(1.5), 1.0, gn.Matern(2.5, 0.25), bounds=([-1] * 3, [1] * 3))
    return describe(camera((2, 1.5, 5), (0, 0, 0), 30), SKY, {"m": LAMBERT}, [stochastic("Crumbs", process, ["m"], sampler, memory)])


def cornell_meshes():
    def quad(*corners):
        return {"vertices": corners, "triangles": QUAD}

    a, b, c, d = (-1, -1, -1), (1, -1, -1), (1, 1, -1), (-1, 1, -1)
    e, f, g, h = (-1, -1, 1), (1, -1, 1), (1, 1, 1), (-1, 1, 1)
    meshes = {"floor": quad(a, b, f, e), "ceiling": quad(d, h, g, c), "back": quad(a, d, c, b)}
    meshes |= {"left": quad(a, e, h, d), "right": quad(b, c, g, f)}
    x = np.array([[i, j, k] for i in (-1, 1) for j in (-1, 1) for k in (-1, 1)])
    faces = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [t for p, q, r, s in faces for t in ((p, q, r), (p, r, s))]
    meshes["block"] = {"vertices": x * (0.3, 0.55, 0.3), "triangles": triangles}
    return meshes


ROOM = {"white": (0.75,) * 3, "red": (0.6, 0.06, 0.05), "green": (0.1, 0.45, 0.08)}
PAINT = {"floor": "white", "ceiling": "white", "back": "white", "left": "red", "right": "green"}


def lamp():
    matrix = np.eye(4)  # shines along -z of its own: turned to shine along -y
    matrix[:3, :3] = [[1, 0, 0], [0, 0, 1], [0, -1, 0]]
    matrix[:3, 3] = 0, 0.99, 0
    return {"name": "lamp", "type": "area", "matrix": matrix, "size": (0.6, 0.6), "radiance": (12.0, 11.0, 9.0)}


def walls():
    return [{"name": n, "type": "mesh", "mesh": n, "materials": [m]} for n, m in PAINT.items()]


def room_description(objects, **more):
    materials = {name: {"type": "lambert", "color": color} for name, color in ROOM.items()}
    description = describe(camera((0, 0, 4.2), (0, 0, 0), 36), {"color": (0, 0, 0)}, materials | more, walls() + objects)
    return description | {"meshes": cornell_meshes(), "lights": [lamp()]}


def cornell(sampler="auto", memory="renewal+", folder=None):
    place = np.eye(4)
    place[:3, :3] = [[0.95, 0, 0.3], [0, 1, 0], [-0.3, 0, 0.95]]
    place[:3, 3] = -0.3, -0.45, -0.3
    return room_description([{"name": "Block", "type": "mesh", "mesh": "block", "matrix": place, "materials": ["white"]}])


def everything(sampler="auto", memory="renewal+", folder=None):
    """Meshes, a lamp, a sky that comes in by the open side, a painted object, CSG under its own transform, a medium."""
    left, right, above = np.diag([0.35, 0.35, 0.35, 1]), np.diag([0.35, 0.35, 0.35, 1]), np.diag([0.25, 0.25, 0.25, 1])
    left[:3, 3], right[:3, 3], above[:3, 3] = (-0.45, -0.6, 0), (0.45, -0.95, 0.2), (0.0, 0.35, -0.2)
    crumbs = gn.GaussianProcess(gn.ConstantField(1.5), 1.0, gn.Matern(2.5, 0.25), bounds=([-1] * 3, [1] * 3))
    objects = [
        stochastic("Painted", painted_process(folder), ["m"], sampler, memory, matrix=left)
        | {"albedo": gn.VdbColorField(painted_file(folder))},
        stochastic("Spheres", two_spheres(), ["copper", "copper"], sampler, memory, matrix=right),
        stochastic("Crumbs", crumbs, ["m"], sampler, memory, matrix=above),
    ]
    return room_description(objects, m=LAMBERT, copper=COPPER) | {"world": SKY}


SCENES = [
    BenchScene(
        "sphere_lambert", "Standard sphere, Lambert", "SE ℓ .1, σ .05, albedo .8, white sky, as in baseline.json",
        standard_sphere(LAMBERT, WHITE), "convolution", "dense", methods=True, memories=True,
        microfacet=smooth_sphere(LAMBERT, WHITE),
    ),
    BenchScene(
        "sphere_mirror", "Standard sphere, mirror", "the same with mirrors of albedo .9 under a gradient sky",
        standard_sphere(MIRROR, SKY), "convolution", "dense", methods=True, memories=True,
        microfacet=smooth_sphere(beckmann_like(STANDARD_SIGMA, STANDARD_LENGTH), SKY),
    ),
    BenchScene(
        "small_sun", "Mirrors under a small sun", "the mirror sphere in a dark sky with a sun of half a degree",
        under_a_small_sun, "convolution", "dense", heavy_tails=True,
    ),
    BenchScene(
        "bunny", "bunny.vdb", "mean and σ on a grid, SE ℓ .5, green mirror, white sky, as published",
        bunny, "convolution", "dense", needs="bunny.vdb",
    ),
    BenchScene("csg", "Two spheres, CSG", "union of σ .1 and σ .001, SE ℓ .5, green mirror, as published", csg, "convolution", "dense"),
    BenchScene(
        "wedge", "wedge.obj, constant mean", "mean 0, SE ℓ .1, σ .01, rough copper .1, cut out of a cube by a plane (CSG)",
        wedge, "convolution", "dense", needs="wedge.obj",
    ),
    BenchScene("painted", "Painted, non-stationary", "mean, σ, length scales, directions, albedo painted", painted, "nystrom", "dense"),
    BenchScene(
        "height_field", "Height field", "SE ℓ .2, constant along the normal, σ .05, mirror, gradient sky",
        height_field, "convolution", "dense",
        microfacet=lambda folder: height_field(sigma=0.0, material=beckmann_like(FIELD_SIGMA, FIELD_LENGTH)),
    ),
    BenchScene(
        "dilute", "Dilute medium", "constant mean 1.5 σ, Matérn 5/2 of ℓ .25, Lambert, gradient sky",
        dilute_medium, "first_passage", "dense", methods=True,
    ),
    BenchScene("cornell", "Cornell box", "meshes and an area lamp alone: nothing stochastic", cornell, "", ""),
    BenchScene("everything", "All at once", "room, lamp, sky, painted object, CSG, medium", everything, "", "dense"),
]  # fmt: skip


def available():
    """The scenes whose files are there, and the names of those whose are not."""
    there = [s for s in SCENES if not s.needs or (DATA / s.needs).exists()]
    return there, [s.name for s in SCENES if s not in there]
