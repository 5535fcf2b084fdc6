"""Renders whose hits come out of tables of first passages: the light of marched ones, and where they are taken."""

import threading

import gpis_native as gn
import numpy as np
import pytest
from scene_parts import WHITE_SUNS, ball
from statistics_checks import check_z

LAMBERT = {"type": "lambert", "color": (0.8, 0.8, 0.8)}
MIRROR = {"type": "mirror", "color": (0.9, 0.9, 0.9)}
GLASS = {"type": "dielectric", "color": (1, 1, 1), "ior": 1.5}
SKY = {"image": np.linspace(0.2, 1.6, 16)[:, None, None] * np.ones((16, 4, 3))}
SHEARED = np.array([[1, 0.4, 0, 0], [0, 0.7, 0.2, 0], [0.1, 0, 1.1, 0], [0, 0, 0, 1.0]])


def cloud(level=0.0, length_scale=0.1, size=0.5):
    """A constant mean of so many deviations in a cube."""
    bounds = ((-size,) * 3, (size,) * 3)
    return gn.GaussianProcess(gn.ConstantField(level * 0.01), 0.01, gn.SquaredExponential(length_scale), bounds=bounds)


def scene(process=None, *, sampler="auto", memory="renewal+", material=LAMBERT, matrix=None, world=SKY, others=(), **more):
    eye = np.eye(4)
    eye[2, 3] = 4
    body = {"name": "Cloud", "type": "gpis", "process": process or cloud(), "materials": ["Body"], "sampler": sampler}
    body |= {"memory": memory} | ({} if matrix is None else {"matrix": matrix})
    return {
        "version": 1,
        "camera": {"type": "perspective", "matrix": eye, "fov_x": 0.35},
        "world": world,
        "materials": {"Body": material},
        "objects": [body, *others],
    } | more


def rendered(description, seed, samples=64, size=24):
    return gn.render(gn.Scene(description), size, size, samples=samples, seed=seed)


def brightness(result):
    """Mean over the picture and its standard error."""
    pixels = result.passes["combined"][..., 0].astype(float)
    variance = result.passes["variance"][..., 0].astype(float)
    return pixels.mean(), np.sqrt(variance.sum()) / pixels.size


@pytest.mark.stats
@pytest.mark.parametrize("memory", ["none", "renewal", "renewal+"])
@pytest.mark.parametrize("material", [LAMBERT, MIRROR, GLASS], ids=lambda m: m["type"])
def test_light_is_that_of_marched_rays(material, memory, seed, full_size):
    """The table is off by 7e-4 of a hit, which moves some tenth of the light between surface and sky: 2e-4 beside the noise."""
    for process, matrix in ((cloud(0.0, 0.1), None), (cloud(0.7, 0.3), SHEARED)):
        table, march = (
            rendered(
                scene(process, sampler=sampler, memory=memory, material=material, matrix=matrix), seed + i, 1024 if full_size else 256
            )
            for i, sampler in enumerate(("auto", "convolution"))
        )
        assert table.stats["line_tabulated"] == table.stats["line_segments"] > 0 == march.stats["line_tabulated"]
        assert table.stats["line_evaluations"] == 0 < march.stats["line_evaluations"]
        (a, error_a), (b, error_b) = brightness(table), brightness(march)
        check_z(a, b, np.sqrt(error_a**2 + error_b**2 + 2e-4**2), "brightness")
        vertices = [r.stats["path_vertices"] / r.stats["camera_paths"] for r in (table, march)]
        # A path's number of vertices has about its mean as standard deviation.
        error = vertices[1] * np.sqrt(2 / table.stats["camera_paths"] + 2e-3**2)
        check_z(vertices[0], vertices[1], error, "vertices")


@pytest.mark.parametrize("material", [LAMBERT | {"color": (1, 1, 1)}, MIRROR | {"color": (1, 1, 1)}, GLASS], ids=lambda m: m["type"])
def test_white_furnace(material, seed):
    """Nothing is lost, with lights that are sampled too."""
    for memory in ("none", "renewal", "renewal+"):
        description = scene(material=material, memory=memory, world={"color": (1.0, 1.0, 1.0)})
        assert np.allclose(rendered(description, seed, 16).passes["combined"], 1, atol=1e-6)
    lit = rendered(scene(material=material, world={"color": (0, 0, 0)}, lights=WHITE_SUNS), seed, 256)
    assert lit.stats["line_tabulated"] == lit.stats["line_segments"] > 0
    mean, error = brightness(lit)
    check_z(mean, 1, error + 1e-7, "furnace")


def mesh(at, size=0.2, name="Sheet"):
    vertices = size * np.array([(-1, -1, 0.0), (1, -1, 0), (0, 1, 0)]) + at
    return {"meshes": {name: {"vertices": vertices, "triangles": np.array([(0, 1, 2)])}}}, {
        "name": name, "type": "mesh", "mesh": name, "materials": ["Body"]
    }  # fmt: skip


def room():
    """Walls all around, 6 away, as one mesh whose box holds the cloud."""
    corners = 6.0 * np.array([(x, y, z) for x in (-1, 1) for y in (-1, 1) for z in (-1, 1)])
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = np.array([t for a, b, c, d in sides for t in ((a, b, c), (a, c, d))])
    return {"meshes": {"Room": {"vertices": corners, "triangles": triangles}}}, {
        "name": "Room", "type": "mesh", "mesh": "Room", "materials": ["Body"]
    }  # fmt: skip


def tabulated(description, seed=1):
    planned = gn.Scene(description).plan()["objects[0].sampler of 'Cloud'"]
    stats = gn.render(gn.Scene(description), 8, 8, samples=16, seed=seed).stats
    assert planned.startswith("first_passage: ") == (stats["line_tabulated"] > 0), planned
    return stats["line_tabulated"] > 0


def test_tables_are_for_what_stands_alone():
    """A ray that ends on something else inside the bounds would have to remember the process there."""
    assert tabulated(scene())
    parts, sheet = mesh((0, 0, 0.5))  # touches the face of the bounds
    assert not tabulated(scene(others=[sheet], **parts))
    parts, sheet = mesh((0, 0, 0.51))
    assert tabulated(scene(others=[sheet], **parts))
    # In the world: the mesh moved in, the cloud moved away.
    moved = np.eye(4)
    moved[2, 3] = -0.1
    assert not tabulated(scene(others=[sheet | {"matrix": moved}], **parts))
    assert tabulated(scene(others=[sheet | {"matrix": moved}], matrix=moved @ moved, **parts))
    parts, walls = room()
    assert tabulated(scene(others=[walls], **parts))
    for x, alone in ((2.0, True), (1.8, False)):
        other = {"name": "Ball", "type": "gpis", "process": ball(center=(x, 0, 0)), "materials": ["Body"]}
        assert tabulated(scene(others=[other])) == alone
    # A hidden mesh without triangles is no company.
    assert tabulated(scene(others=[sheet], meshes={"Sheet": {"vertices": np.zeros((0, 3)), "triangles": np.zeros((0, 3), int)}}))


def test_tables_are_for_one_process_of_constant_mean():
    for memory in ("none", "renewal", "renewal+"):
        assert tabulated(scene(memory=memory))
    for memory in ("global-1", "global"):
        assert not tabulated(scene(memory=memory))
    assert not tabulated(scene(ball()))
    assert not tabulated(scene(sampler="convolution"))
    assert not tabulated(scene(cloud(4.5, 0.001)))


def test_a_table_that_is_asked_for_in_company_is_refused():
    parts, sheet = mesh((0, 0, 0))
    with pytest.raises(ValueError, match=r"objects\[0\].sampler of 'Cloud': first_passage .* 'Sheet' reaches into its bounds"):
        gn.Scene(scene(sampler="first_passage", others=[sheet], **parts))
    with pytest.raises(ValueError, match=r"objects\[0\].process of 'Cloud': The sampler first_passage .* the mean varies"):
        gn.Scene(scene(ball(), sampler="first_passage"))
    assert tabulated(scene(sampler="first_passage"))


def test_the_plan_names_the_excursions():
    for missed_root, count in ((1e-3, 2**19), (2e-3, 2**17)):
        plan = gn.Scene(scene(settings={"missed_root": missed_root})).plan()
        assert f"{count} excursions" in plan["objects[0].sampler of 'Cloud'"]


def test_a_render_cancelled_while_a_table_is_drawn_ends_and_the_next_draws_it(seed):
    description = scene(cloud(0.123))
    ended = gn.render(gn.Scene(description), 8, 8, samples=16, seed=seed, progress=lambda fraction, stats: False)
    assert ended is None or (ended.stats["cancelled"] and ended.stats["line_tabulated"] == 0)
    assert tabulated(description)
    twice = [gn.render(gn.Scene(description), 8, 8, samples=16, seed=seed, threads=t).passes["combined"] for t in (1, 2)]
    assert np.array_equal(*twice)


def test_a_render_that_waits_for_the_table_of_another_can_be_cancelled(seed):
    """Tables are drawn one at a time: the second render ends while the first, which goes on till then, is still drawing."""
    first_begun, second_done, results = threading.Event(), threading.Event(), {}

    def run(name, level, going_on):
        process = gn.GaussianProcess(level, 0.01, gn.Matern(1.5, 0.1), bounds=((-0.5,) * 3, (0.5,) * 3))
        description = scene(process, settings={"missed_root": 5e-4})
        results[name] = gn.render(gn.Scene(description), 8, 8, samples=10**6, seed=seed, progress=going_on, threads=1)

    def first(fraction, stats):
        first_begun.set()
        return not second_done.is_set()

    thread = threading.Thread(target=run, args=("first", 0.00111, first))
    thread.start()
    assert first_begun.wait(60)
    run("second", 0.00222, lambda fraction, stats: False)
    second_done.set()
    thread.join(60)
    assert not thread.is_alive()
    for result in results.values():
        assert result is None or result.stats["line_tabulated"] == 0
