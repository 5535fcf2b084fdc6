"""Wrong arguments of every public function and method raise ValueError, with a sentence that names the argument.

What is public is read off the module, and the parameters off the signatures. Whoever adds a function tells `values` here
what its parameters take.
"""

import re

import gpis_native as gn
import numpy as np
import pytest

# An operator that does not know its operand answers NotImplemented, of which Python makes its usual TypeError.
OPERATORS = {"__repr__", "__add__", "__radd__", "__sub__", "__rsub__", "__mul__", "__rmul__", "__truediv__", "__neg__"}


# Operands without names, any number of them: tests/native/test_csg.py has their sentences.
VARIADIC = {"union", "smooth_union", "intersection"}


class Odd:
    """What nothing takes: no number, no text, no sequence."""

    def __repr__(self):
        return "Odd()"


WRONG = [
    Odd(),
    None,
    "wrong",
    b"wrong",
    0.25,
    2**80,
    -(2**40),
    1j,
    [],
    ["wrong", None],
    [[1.0], [1.0, 2.0]],
    (1.0, float("nan"), 1.0),
    {"wrong": 1.0},
    np.array(["wrong"]),
    np.zeros(5),
    np.zeros((2, 2, 2, 2)),
]


def signatures():
    """Every public callable as (name, its parameters without self)."""
    found = []

    def add(name, function):
        (line,) = re.findall(rf"^{function.__name__}\((.*)\) -> ", function.__doc__, re.MULTILINE)
        found.append((name, [p for p in re.findall(r"(?:^|, )(\w+): ", line) if p != "self"]))

    for name, value in sorted(vars(gn).items()):
        if name.startswith("_") or name in VARIADIC:
            continue
        if not isinstance(value, type):
            add(name, value)
            continue
        for method, function in sorted(vars(value).items()):
            bound = type(function).__name__ == "instancemethod" and not method.startswith("_pybind11")
            if bound and method not in OPERATORS:
                add(f"{name}.{method}", function)
    return found


SIGNATURES = signatures()
PARAMETERS = [(name, parameter) for name, parameters in SIGNATURES for parameter in parameters]


@pytest.fixture(scope="module")
def values(tmp_path_factory):
    """What each class's `self` is, and what each parameter takes: by its name, or by that of the function and its own."""
    folder = tmp_path_factory.mktemp("arguments")
    points = np.array([[0.0, 0.0, 2.0], [0.5, 0.0, 1.0]])
    sphere = gn.SphereField((0, 0, 0), 0.5)
    kernel = gn.SquaredExponential(0.3)
    process = gn.GaussianProcess(sphere, 0.1, kernel)
    description = {"version": 1, "camera": {"type": "orthographic", "matrix": np.eye(4), "width": 2.0}}
    scene = gn.Scene(description)
    result = gn.render(scene, 2, 2, samples=16)
    result.save(folder / "result.npz")
    tensors = np.broadcast_to((1.0, 1.0, 1.0, 0.0, 0.0, 0.0), (3, 3, 3, 6))
    grids = {"mean": np.zeros((3, 3, 3)), "anisotropy": tensors, "origin": (0, 0, 0), "voxel_size": 0.5}
    gn.write_vdb(folder / "field.vdb", grids)
    colors = {"albedo": np.full((3, 3, 3, 3), 0.5), "origin": (0, 0, 0), "voxel_size": 0.5}
    gn.write_vdb(folder / "color.vdb", colors)
    return {
        "Field": sphere,
        "FieldLine": sphere.line((0, 0, 2), (0, 0, -1)),
        "Film": gn.Film(2, 2),
        "GaussianProcess": process,
        "GaussianProcess.realisation.bounds": [(-1, -1, -1), (1, 1, 1)],
        "Kernel": kernel,
        "RenderResult": result,
        "Scene": scene,
        "TensorField": gn.TensorGridField(tensors, 0.5),
        "a": 0.1,
        "GaussianProcess.anisotropy": None,
        "GaussianProcess.conditions": {"points": [(0, 0, 1)], "values": [0.0]},
        "inside": None,
        "ColorField": gn.ColorField(0.5, sphere.clamped(0, 1), 1),
        "ColorField.red": 0.5,
        "VdbColorField.grid": "albedo",
        "VdbColorField.path": folder / "color.vdb",
        "PaintedFields": gn.PaintedFields(folder / "field.vdb"),
        "PaintedFields.apply.channel": "albedo",
        "PaintedFields.apply.operation": "set",
        "PaintedFields.apply.radius": 0.3,
        "PaintedFields.copy.other": gn.PaintedFields(folder / "field.vdb"),
        "PaintedFields.extend.bounds": [(-1, -1, -1), (2, 2, 2)],
        "PaintedFields.mean": "mean",
        "PaintedFields.mirror.axis": 0,
        "PaintedFields.write.path": folder / "painted.vdb",
        "albedo": False,
        "alpha": 2.0,
        "anisotropy": False,
        "centers": points,
        "channel": "mean",
        "curve": None,
        "falloff": "smooth",
        "from_positive": True,
        "ratios": (1, 1, 1),
        "sigma_factor": 1.0,
        "sigma_grid": "",
        "sigma_meaning": "value",
        "strength": 1.0,
        "strokes": b"",
        "symmetry": (False, False, False),
        "axis": (0, 0, 1),
        "b": 0.2,
        "blue": 1.0,
        "background": None,
        "bake_mesh_distance.path": folder / "baked.vdb",
        "blend": 0.0,
        "bounds": None,
        "certainty": 5.0,
        "compose_and_fit.bounds": [(-1, -1, -1), (1, 1, 1)],
        "compose_and_fit_plan.bounds": [(-1, -1, -1), (1, 1, 1)],
        "correlation": 0.0,
        "center": (0, 0, 0),
        "description": description,
        "direction": (0, 0, -1),
        "directions": np.array([[0.0, 0.0, -1.0]] * 2),
        "first_index": 0,
        "first_sample": 0,
        "Film.add.x": 0,
        "Film.add.y": 0,
        "Film.merge.other": gn.Film(2, 2),
        "gp": process,
        "green": sphere.clamped(0, 1),
        "grid": "mean",
        "grids": grids,
        "height": 2,
        "high": 1.0,
        "kernel": kernel,
        "length_scale": 0.3,
        "line_values.t": [0.1, 0.2],
        "load_result.path": folder / "result.npz",
        "level": 0.0,
        "low": -1.0,
        "major_radius": 1.0,
        "margin": 0.0,
        "narrow_band": 5.0,
        "matrix": np.eye(4),
        "mean": sphere,
        "meaning": "value",
        "memory": "none",
        "method": "sample",
        "minor_radius": 0.2,
        "n": 2,
        "names": ["mean"],
        "noise_threshold": None,
        "normal": (0, 0, 1),
        "nu": 1.5,
        "op": "union",
        "operands": [process, process],
        "origin": (0, 0, 0),
        "origins": points,
        "path": folder / "field.vdb",
        "ProcessTree": gn.union(process, process),
        "ProcessTree.compose.values": np.zeros((4, 2)),
        "complement.a": process,
        "difference.a": process,
        "difference.b": process,
        "period": 0.5,
        "periodic_scale": 1.0,
        "point": (0, 0, 0),
        "points": points,
        "progress": None,
        "radiance": np.ones((16, 3)),
        "radius": 0.5,
        "realisations": 4,
        "RenderResult.save.path": folder / "saved.npz",
        "resolution": 8,
        "results": [result],
        "rotation": (1, 0, 0, 0),
        "sampler": "auto",
        "samples": 16,
        "scene": scene,
        "Scene.camera_rays.points": points[:, :2],
        "seed": 1,
        "shared_noise": False,
        "sigma": 0.1,
        "size": (1, 1, 1),
        "slope": 1.0,
        "start": None,
        "t": 0.1,
        "t_end": 0.2,
        "t_max": 4.0,
        "TensorGridField.values": tensors,
        "threads": 1,
        "threshold": 0.0,
        "time": 0.0,
        "time_limit": None,
        "time_scale": None,
        "tolerance": 1e-3,
        "triangles": np.array([(0, 2, 1), (0, 1, 3), (1, 2, 3), (0, 3, 2)]),
        "value": 1.0,
        "values": np.zeros((3, 3, 3)),
        "vertices": np.array([(0, 0, 0), (1, 0, 0), (0, 1, 0), (0, 0, 1)], float),
        "voxel_size": 0.5,
        "wave_vector": (1, 0, 0),
        "width": 2,
        "write_vdb.path": folder / "written.vdb",
        "x": points,
        "y": points,
    }


@pytest.fixture
def call(values, tmp_path, monkeypatch):
    """call(name, **changed): the function with arguments it takes, but for those that are given."""
    monkeypatch.chdir(tmp_path)  # "wrong" is a good path to write to

    def call(name, *positional, without=(), **changed):
        owner, _, method = name.partition(".")
        function = getattr(gn, owner)
        if method and method != "__init__":
            assert owner in values, f"tell this test what the self of {name} is: values['{owner}']"
            function = getattr(values[owner], method)
        given = {}
        for parameter in dict(SIGNATURES)[name]:
            own = f"{name.removesuffix('.__init__')}.{parameter}"
            key = own if own in values else parameter
            assert key in values, f"tell this test what {name} takes: values['{own}']"
            given[parameter] = values[key]
        return function(*positional, **{k: v for k, v in (given | changed).items() if k not in without})

    return call


@pytest.mark.parametrize("name", [name for name, _ in SIGNATURES])
def test_right_arguments(call, name):
    call(name)


@pytest.mark.parametrize(("name", "parameter"), PARAMETERS)
def test_wrong_values(call, name, parameter):
    """Whatever is given: it is taken, or a sentence names the argument. A file may also not be there."""
    for wrong in WRONG:
        try:
            call(name, **{parameter: wrong})
        except FileNotFoundError:
            assert "path" in parameter
        except ValueError as error:
            text = str(error)
            assert "typing." not in text and len(text) < 500, text
            # A number or a name of the right type may be wrong for what it leads to.
            assert isinstance(wrong, int) or "'wrong'" in text or re.search(rf"\b{parameter}\b", text), text
        else:
            assert not isinstance(wrong, Odd), "nothing is to take this"


@pytest.mark.parametrize(("name", "parameters"), SIGNATURES)
def test_wrong_calls(call, name, parameters):
    with pytest.raises(ValueError, match=r"there is no argument 'wrong'; it takes \w+"):
        call(name, wrong=1)
    with pytest.raises(ValueError, match="arguments without a name are given; it takes"):
        call(name, *range(20), without=parameters)
    if parameters:
        with pytest.raises(ValueError, match=rf"^(\w+): {parameters[0]} is missing; it takes "):
            call(name, without=parameters)
        with pytest.raises(ValueError, match=f"{parameters[0]} is given twice"):
            call(name, 1)


def test_sentences(values):
    rays = [(0.0, 0.0, 2.0)], [(0.0, 0.0, -1.0)]
    for call, sentence in [
        (lambda: gn.SphereField(None, 1), "SphereField: center takes 3 numbers, got None."),
        (lambda: gn.SphereField((0, 0), 1), "SphereField: center takes 3 numbers, got (0, 0)."),
        (lambda: gn.SphereField((0, 0, 0), "x"), "SphereField: radius takes a number, got 'x'."),
        (lambda: gn.first_hits(values["gp"], *rays, "x"), "first_hits: t_max takes a number, got 'x'."),
        (lambda: gn.first_hits(values["gp"], *rays, 1, seed=1.5), "first_hits: seed takes an integer, got 1.5."),
        (
            lambda: gn.first_hits(values["gp"], *rays, 1, seed=-1),
            "first_hits: seed takes an integer that is not negative, got -1.",
        ),
        (lambda: gn.first_hits(values["gp"], *rays, 1, memory=5), "first_hits: memory takes a text, got 5."),
        (lambda: gn.render(values["scene"], 1, 1, samples="x"), "samples: takes an integer from 1 to 2^30, got 'x'"),
        (lambda: gn.Field.gradient(3, [(0, 0, 0)]), "gradient: self takes a Field, got 3."),
        (
            lambda: gn.GridField(np.zeros((3, 3, 3)), 1, background="x"),
            "GridField: background takes a number or None, got 'x'.",
        ),
    ]:
        with pytest.raises(ValueError) as caught:
            call()
        assert str(caught.value) == sentence


def test_a_type_error_of_the_callers_own_function_passes(values):
    def progress(*_):
        raise TypeError("mine")

    with pytest.raises(TypeError, match="^mine$"):
        gn.render(values["scene"], 2, 2, samples=16, progress=progress)
