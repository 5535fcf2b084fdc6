"""Kernel, anisotropy, memory and sampler of GPIS objects: from the panel to the process, and refused with a sentence."""

import importlib
import math

import bpy
import numpy as np
import pytest
from mathutils import Euler

from . import support

SIGMA, LENGTH, PERIOD = 0.05, 0.2, 0.25
# Memories and samplers as files have them: Blender stores the numbers.
NUMBERS = {
    "kernel": ("SQUARED_EXPONENTIAL", "MATERN_3_2", "MATERN_5_2", "RATIONAL_QUADRATIC", "LOCALLY_PERIODIC", "WONG"),
    "anisotropy": ("UNIFORM", "AXES", "GRID"),
    "memory": ("NONE", "RENEWAL", "RENEWAL_PLUS", "GLOBAL"),
    "sampler": ("AUTO", "CONVOLUTION", "MARKOV", "SPECTRAL", "NYSTROM", "DENSE", "REALISATION"),
}
POINTS = np.random.default_rng(4).uniform(-0.3, 0.3, (12, 3))


@pytest.fixture
def gn():
    return importlib.import_module("gpis_native")


@pytest.fixture
def body(ball):
    ball.gpis.sigma, ball.gpis.length_scale, ball.gpis.period = SIGMA, LENGTH, PERIOD
    return ball


def kernel(gn, name, length_scale, rotation=None):
    turned = {} if rotation is None else {"rotation": rotation}
    return {
        "SQUARED_EXPONENTIAL": lambda: gn.SquaredExponential(length_scale, **turned),
        "MATERN_3_2": lambda: gn.Matern(1.5, length_scale, **turned),
        "MATERN_5_2": lambda: gn.Matern(2.5, length_scale, **turned),
        "RATIONAL_QUADRATIC": lambda: gn.RationalQuadratic(0.7, length_scale, **turned),
        "LOCALLY_PERIODIC": lambda: gn.LocallyPeriodic(length_scale, PERIOD, (0.6, 0, 0.8), 0.5, **turned),
        "WONG": lambda: gn.Wong(length_scale, **turned),
    }[name]()


def choose(settings, name):
    settings.kernel = name
    settings.alpha, settings.periodic_scale, settings.axis = 0.7, 0.5, (3, 0, 4)


def covariance(entry):
    return entry["process"].covariance(POINTS, POINTS) / SIGMA**2


@pytest.mark.parametrize("name", NUMBERS["kernel"])
def test_kernels_reach_the_renderer(gn, body, describe, name):
    choose(body.gpis, name)
    (entry,), _ = describe()
    assert covariance(entry) == pytest.approx(kernel(gn, name, LENGTH)(POINTS, POINTS), abs=1e-6)


@pytest.mark.parametrize("name", NUMBERS["kernel"])
def test_length_scales_along_axes(gn, body, describe, name):
    choose(body.gpis, name)
    settings, turn = body.gpis, (0.3, -0.2, 0.9)
    settings.anisotropy, settings.ratios, settings.rotation = "AXES", (4, 0.5, 7), turn
    settings.infinite = (False, False, True)
    (entry,), _ = describe()
    expected = kernel(gn, name, (4 * LENGTH, 0.5 * LENGTH, math.inf), tuple(Euler(turn).to_quaternion()))
    assert covariance(entry) == pytest.approx(expected(POINTS, POINTS), abs=1e-6)


@pytest.mark.parametrize("name", NUMBERS["kernel"])
def test_every_kernel_renders(stage, body, tmp_path, name):
    """A body with a rough silhouette, in front of nothing."""
    choose(body.gpis, name)
    support.settings(stage, width=24, height=18, samples=16)
    picture = support.coverage(stage, tmp_path)
    assert picture[8:10, 11:13].min() > 0.99 and picture[0, 0] == 0
    assert np.mean((picture > 0.02) & (picture < 0.98)) > 0.03


def with_anisotropy(body, gn, path):
    """The body's file with A(x): 3:1 along x, and its mean as it was."""
    grids = gn.read_vdb(bpy.path.abspath(body.data.filepath))
    tensor = np.zeros((*grids["mean"].shape, 6))
    tensor[..., :3] = (0.3**2, 0.1**2, 0.1**2)
    gn.write_vdb(str(path), {**grids, "anisotropy": tensor})
    body.data.filepath = str(path)
    body.gpis.anisotropy = "GRID"


def test_anisotropy_from_grids(gn, stage, body, describe, tmp_path):
    with_anisotropy(body, gn, tmp_path / "long.vdb")
    body.gpis.anisotropy_factor = 2.0
    (entry,), _ = describe()
    near = 0.1 * POINTS  # inside of the bounds; the grid is constant
    expected = gn.SquaredExponential((0.6, 0.2, 0.2))(near, near)
    assert entry["process"].covariance(near, near) / SIGMA**2 == pytest.approx(expected, abs=1e-5)
    support.settings(stage, width=24, height=18, samples=16)
    assert support.coverage(stage, tmp_path)[8:10, 11:13].min() > 0.99


@pytest.mark.parametrize("memory", NUMBERS["memory"])
def test_memories_reach_the_renderer(body, describe, memory):
    body.gpis.memory = memory
    (entry,), _ = describe()
    assert entry["memory"] == memory.lower().replace("_plus", "+")


@pytest.mark.parametrize("sampler", NUMBERS["sampler"])
def test_samplers_reach_the_plan(gn, stage, body, describe, extension, tmp_path, sampler):
    """The panel says of the last render which sampler it took, and why."""
    if sampler == "MARKOV":
        body.gpis.kernel = "WONG"
    body.gpis.sampler = sampler
    (entry,), _ = describe()
    assert entry["sampler"] == sampler.lower()
    support.settings(stage, width=8, height=6, samples=1)
    support.picture(stage, tmp_path)
    statistics = importlib.import_module(extension + ".statistics")
    said = statistics.sampler_of(stage.name, body.name)
    assert said.startswith("convolution: stationary" if sampler == "AUTO" else sampler.lower()), said


@pytest.mark.parametrize(
    ("settings", "sentence"),
    [
        ({"length_scale": 0.0}, "length scale ℓ is 0"),
        ({"anisotropy": "AXES", "ratios": (1, 0, 1)}, "ratio of the length scale along Y is 0"),
        ({"anisotropy": "AXES", "infinite": (True, True, True)}, "infinite along all three axes"),
        ({"anisotropy": "GRID"}, "holds no anisotropy_diagonal and no anisotropy_offdiagonal"),
        ({"kernel": "LOCALLY_PERIODIC", "axis": (0, 0, 0)}, "must point somewhere"),
        ({"kernel": "LOCALLY_PERIODIC", "period": 0.0}, "period is 0"),
        ({"kernel": "LOCALLY_PERIODIC", "anisotropy": "GRID"}, "takes no anisotropy from grids"),
        ({"kernel": "WONG", "sampler": "CONVOLUTION"}, "serves the squared exponential"),
        ({"sampler": "MARKOV"}, "serves Matern 3/2, Matern 5/2 and Wong"),
        ({"kernel": "MATERN_3_2", "sampler": "SPECTRAL"}, "a part of it is rough"),
    ],
)
def test_what_cannot_be_rendered_is_said(stage, body, tmp_path, settings, sentence):
    for name, value in settings.items():
        setattr(body.gpis, name, value)
    said = support.failure(stage, tmp_path)
    assert f'GPIS object "{body.name}"' in said and sentence in said
    assert "objects[" not in said


def test_defaults_are_what_files_without_the_settings_were_rendered_with(gn, body, describe):
    """An object of an older version holds σ and ℓ and nothing else."""
    for name in set(body.gpis.keys()) & {"kernel", "anisotropy", "memory", "sampler"}:
        body.gpis.property_unset(name)
    (entry,), _ = describe()
    assert (entry["memory"], entry["sampler"]) == ("renewal+", "auto")
    assert covariance(entry) == pytest.approx(gn.SquaredExponential(LENGTH)(POINTS, POINTS), abs=1e-6)


@pytest.mark.parametrize("name", NUMBERS)
def test_items_keep_the_numbers_that_files_have(body, name):
    items = body.gpis.bl_rna.properties[name].enum_items
    assert [(item.identifier, item.value) for item in items] == [(item, i) for i, item in enumerate(NUMBERS[name])]
