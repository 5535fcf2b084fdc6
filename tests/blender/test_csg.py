"""CSG lists of GPIS objects: what they are in the description, how they are edited, and the fit."""

import importlib

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from . import support


def add_gpis(scene, name, location, radius, color=(0.8, 0.8, 0.8), sigma=0.05, **placed):
    """A GPIS of a sphere, without a mesh: a small grid of its distance."""
    gn = importlib.import_module("gpis_native")
    n, side = 25, 1.6 * radius
    x = np.linspace(-side, side, n)
    distance = np.sqrt(x[:, None, None] ** 2 + x[:, None] ** 2 + x**2) - radius
    path = f"{bpy.app.tempdir}/{name}.vdb"
    gn.write_vdb(path, {"mean": distance, "origin": (-side,) * 3, "voxel_size": x[1] - x[0]})
    data = bpy.data.volumes.new(name)
    data.filepath = path
    data.materials.append(support.diffuse(f"{name} Material", color))
    obj = support.link(scene, name, data, location=location, **placed)
    obj.gpis.enabled = True
    obj.gpis.sigma, obj.gpis.length_scale = sigma, 0.4
    return obj


@pytest.fixture
def operands(stage):
    """A base of radius 1 and two smaller ones, b turned and stretched; the base is active, all are selected."""
    a = add_gpis(stage, "A", (0, 0, 0), 1.0, (1, 0, 0))
    b = add_gpis(stage, "B", (0.9, 0, 0), 0.6, (0, 1, 0), rotation=(1, 0.2, 0.4, 0), scale=(1, 1.3, 0.7))
    c = add_gpis(stage, "C", (0, -0.9, 0), 0.5, (0, 0, 1))
    for obj in (a, b, c):
        obj.select_set(True)
    bpy.context.view_layer.objects.active = a
    bpy.context.view_layer.update()
    return a, b, c


def build(a, operations):
    assert bpy.ops.gpis.csg_add() == {"FINISHED"}
    for item, operation in zip(a.gpis_csg.items, operations, strict=True):
        item.operation = operation


def entry_of(describe):
    entries, warnings = describe()
    (entry,) = (entry for entry in entries if not bpy.data.objects[entry["name"]].hide_render)
    return entry, warnings


def test_add_selected(operands, describe):
    a, b, c = operands
    build(a, ["UNION", "DIFFERENCE"])
    assert {item.object for item in a.gpis_csg.items} == {b, c}
    for operand in (b, c):
        assert operand.display_type == "BOUNDS"
    entry, _ = entry_of(describe)  # the operands are no longer objects of their own
    assert entry["name"] == "A"
    order = [item.object.name for item in a.gpis_csg.items]
    assert entry["materials"] == ["A Material", *(f"{name} Material" for name in order)]
    assert repr(entry["process"]) == "<ProcessTree intersection(union(0, 1), complement(2))>"
    bpy.ops.gpis.csg_remove()
    assert len(a.gpis_csg.items) == 1
    freed = b if a.gpis_csg.items[0].object == c else c
    assert sorted(entry["name"] for entry in describe()[0]) == sorted(["A", freed.name])
    bpy.data.objects.remove(a)
    assert len(describe()[0]) == 2  # operands of nobody


def test_operands_move_in_an_animation(operands, tmp_path):
    """Blender does not evaluate for a render what it hides there."""
    a, b, c = operands
    build(a, ["UNION", "UNION"])
    b.location = (0, 0, 0)
    b.keyframe_insert("location", frame=1)
    b.location = (2, 0, 0)
    b.keyframe_insert("location", frame=2)
    scene = bpy.context.scene
    scene.frame_start, scene.frame_end, scene.gpis.samples, scene.render.filepath = 1, 2, 1, str(tmp_path / "frame")
    scene.render.engine = "GPIS"
    support.image_settings(scene)
    bpy.ops.render.render(animation=True)
    inside, outside = (support.read_exr(path)[0]["B"] for path in sorted(tmp_path.glob("*.exr")))
    assert inside.mean() > outside.mean() + 0.01  # b is green, before a white world


def test_operands_keep_their_places(operands, describe):
    """Each leaf at a point of the base's space is the operand at that point of the world, animation and all."""
    a, b, c = operands
    build(a, ["UNION", "UNION"])
    a.matrix_world = Matrix.LocRotScale((0.3, 0.2, 0), None, (1.5, 1, 1))
    c.location = (0, 0, 0)
    c.keyframe_insert("location", frame=1)
    c.location = (0, 0, 2)
    c.keyframe_insert("location", frame=11)
    points = np.random.default_rng(1).uniform(-0.5, 0.5, (20, 3))
    for frame in (1, 11):
        bpy.context.scene.frame_set(frame)
        leaves = entry_of(describe)[0]["process"].leaves
        for leaf, obj in zip(leaves, [a] + [item.object for item in a.gpis_csg.items], strict=True):
            radius = {"A": 1.0, "B": 0.6, "C": 0.5}[obj.name]
            depsgraph = bpy.context.evaluated_depsgraph_get()
            to_operand = np.linalg.inv(np.array(obj.evaluated_get(depsgraph).matrix_world)) @ np.array(a.matrix_world)
            there = points @ to_operand[:3, :3].T + to_operand[:3, 3]
            near = np.abs(there).max(axis=1) < 1.5 * radius
            expected = np.linalg.norm(there, axis=1) - radius
            assert near.any() or (obj == c and frame == 11)
            assert np.allclose(leaf.mean(points)[near], expected[near], atol=0.02), (obj.name, frame)


def test_order_toggle_solo(operands, describe):
    a, b, c = operands
    build(a, ["UNION", "DIFFERENCE"])
    items = a.gpis_csg.items
    a.gpis_csg.active = 1
    second = items[1].object
    assert bpy.ops.gpis.csg_move(direction="UP") == {"FINISHED"}
    assert items[0].object == second and a.gpis_csg.active == 0
    assert repr(entry_of(describe)[0]["process"]) == "<ProcessTree union(intersection(0, complement(1)), 2)>"
    assert bpy.ops.gpis.csg_move(direction="UP") == {"CANCELLED"}
    items[0].enabled = False
    assert repr(entry_of(describe)[0]["process"]) == "<ProcessTree union(0, 1)>"
    items[0].enabled = True
    items[0].solo = True
    assert repr(entry_of(describe)[0]["process"]) == "<ProcessTree intersection(0, complement(1))>"
    items[0].enabled = False
    items[1].enabled = False
    assert "GaussianProcess" in repr(entry_of(describe)[0]["process"])


def test_drag(operands, extension):
    """A row follows the mouse, is put back by Esc, and a drop is what the operator does by itself."""
    a, b, c = operands
    d = a.copy()
    d.gpis_csg.items.clear()
    build(a, ["UNION", "UNION"])
    a.gpis_csg.items.add().object = d
    items = a.gpis_csg.items
    first, second, third = (item.object for item in items)
    items[0].operation = "DIFFERENCE"
    a.gpis_csg.active = 1

    def order():
        return [item.object for item in items]

    drag = importlib.import_module(extension + ".csg.operators").Drag(a, 0, 500, 20)
    assert not drag.follow(492) and drag.follow(485) and order() == [second, first, third]
    assert drag.follow(300) and order() == [second, third, first] and a.gpis_csg.active == 2
    assert items[2].operation == "DIFFERENCE"
    assert drag.follow(900) and order() == [first, second, third]
    drag.follow(460)
    drag.put_back()
    assert order() == [first, second, third] and a.gpis_csg.active == 1
    assert bpy.ops.gpis.csg_drag(index=2, to=0) == {"FINISHED"}
    assert order() == [third, first, second] and a.gpis_csg.active == 0
    assert bpy.ops.gpis.csg_drag(index=1, to=1) == {"CANCELLED"}
    with pytest.raises(RuntimeError, match="The list has no operand 7; it has 3"):
        bpy.ops.gpis.csg_drag(index=7, to=0)


def test_smooth_union_is_live(operands, describe):
    a, b, c = operands
    build(a, ["SMOOTH_UNION", "DIFFERENCE"])
    a.gpis_csg.items[0].blend = 0.25
    process = entry_of(describe)[0]["process"]
    assert repr(process) == "<ProcessTree intersection(smooth_union(0, 1, blend=0.25), complement(2))>"
    assert process.compose([0.1, 0.2, 9.0]) == pytest.approx(0.1 - 0.15**2 / 1.0)


def test_lists_nest(operands, describe):
    a, b, c = operands
    b.gpis_csg.items.add().object = c
    b.gpis_csg.items[0].operation = "INTERSECTION"
    a.gpis_csg.items.add().object = b
    a.gpis_csg.items[0].operation = "DIFFERENCE"
    b.hide_render = c.hide_render = True
    entry, _ = entry_of(describe)
    assert repr(entry["process"]) == "<ProcessTree intersection(0, union(complement(1), complement(2)))>"
    assert entry["materials"] == ["A Material", "B Material", "C Material"]
    bpy.context.view_layer.objects.active = c
    with pytest.raises(RuntimeError, match="cannot be operands of each other"):
        bpy.ops.gpis.csg_add()


def test_shared_noise(operands, describe):
    a, b, c = operands
    a.gpis_csg.items.add().object = c
    a.gpis_csg.correlation = "SHARED"
    b.hide_render = c.hide_render = True
    assert "noise shared by some leaves; leaves marched together" in entry_of(describe)[0]["process"].plan()["composition"]
    c.gpis.length_scale = 0.3
    with pytest.raises(
        ValueError, match='GPIS object "A": operand "C": union with shared_noise=True takes operands of one kernel'
    ):
        describe()


@pytest.mark.parametrize(
    ("change", "sentence"),
    [
        (lambda a, b, c: setattr(a.gpis_csg.items[0], "object", None), "has a line without an operand"),
        (lambda a, b, c: setattr(b.gpis, "enabled", False), 'operand "B" of its CSG list is no GPIS'),
        (lambda a, b, c: setattr(b.gpis_csg.items.add(), "object", a), "leads back to itself"),
        (lambda a, b, c: setattr(b, "scale", (1, 0, 1)), '"B" is scaled to zero along an axis'),
        (
            lambda a, b, c: (setattr(a.gpis_csg.items[0], "operation", "INTERSECTION"), setattr(b, "location", (9, 0, 0))),
            "the intersection is empty",
        ),
    ],
)
def test_sentences(operands, describe, change, sentence):
    a, b, c = operands
    a.gpis_csg.items.add().object = b
    b.hide_render = c.hide_render = True
    change(a, b, c)
    with pytest.raises(ValueError, match=f'GPIS object "A": .*{sentence}'):
        describe()


def test_fit(operands, describe, tmp_path):
    """A new Volume with the moments of the composition, that renders like it."""
    a, b, c = operands
    for obj in operands:  # a fit has one material
        obj.material_slots[0].material = a.material_slots[0].material
    build(a, ["UNION", "UNION"])
    live, _ = entry_of(describe)
    bpy.context.scene.gpis.samples = 16
    live_picture = support.picture(bpy.context.scene, tmp_path)
    assert bpy.ops.gpis.csg_fit(resolution=24, realisations=200, seed=3) == {"FINISHED"}
    fitted = bpy.context.object
    assert fitted.name == "A Fit" and fitted.type == "VOLUME" and fitted.display_type == "BOUNDS"
    assert a.hide_render and not fitted.hide_render
    assert fitted.data.gpis_baked and fitted.material_slots[0].material == a.material_slots[0].material
    assert "realisations: standard error of the mean" in fitted.gpis_csg.quality
    assert "Kolmogorov distance" in fitted.gpis_csg.quality and "not kept" not in fitted.gpis_csg.quality
    entry, warnings = entry_of(describe)
    assert not warnings
    points = np.random.default_rng(1).uniform(-1, 1, (50, 3))
    values = np.stack([leaf.mean(points) for leaf in live["process"].leaves], axis=-1)
    # Where one operand wins the mean is its own, between the voxels to their size.
    other = np.sort(values, axis=1)
    clear = other[:, 1] - other[:, 0] > 0.4
    assert clear.sum() > 10
    assert np.allclose(entry["process"].mean(points)[clear], other[clear, 0], atol=0.05)
    picture = support.picture(bpy.context.scene, tmp_path, seed=1)
    assert np.abs(live_picture - picture).mean() < 0.014  # 0.007 here, 0.024 for the first operand alone
    assert np.allclose(live_picture.mean(axis=(0, 1)), picture.mean(axis=(0, 1)), atol=0.01)


def test_fit_of_a_smooth_union(operands):
    """Both methods, to the same numbers."""
    a, b, c = operands
    build(a, ["SMOOTH_UNION", "UNION"])
    a.gpis_csg.items[0].blend = 0.3
    assert bpy.ops.gpis.csg_fit(resolution=16, method="CLOSED_FORM") == {"FINISHED"}
    assert 'All of it has the material of "A"; those of other operands' in bpy.context.object.gpis_csg.quality
    assert bpy.ops.gpis.csg_fit.poll() is False  # the fit has no list
    closed = bpy.context.object
    bpy.context.view_layer.objects.active = a
    assert bpy.ops.gpis.csg_fit(resolution=16, realisations=1000) == {"FINISHED"}
    gn = importlib.import_module("gpis_native")
    fits = [gn.read_vdb(bpy.path.abspath(obj.data.filepath)) for obj in (closed, bpy.context.object)]
    drawn = fits[1]["mean_error"] > 1e-6
    # The closed form of the third operand takes the first two for a Gaussian. Of another blend more than a quarter are off.
    off = np.abs(fits[0]["mean"] - fits[1]["mean"])[drawn] > 5 * fits[1]["mean_error"][drawn]
    assert drawn.mean() > 0.1 and off.mean() < 0.02


def test_compare(operands):
    """The fit beside the list it was made of: an image of both and of their difference, and a sentence."""
    a, b, c = operands
    for obj in operands:
        obj.material_slots[0].material = a.material_slots[0].material
    build(a, ["UNION", "UNION"])
    assert not bpy.ops.gpis.csg_compare.poll()
    assert bpy.ops.gpis.csg_fit(resolution=24, realisations=200, seed=3) == {"FINISHED"}
    fitted = bpy.context.object
    assert fitted.gpis_csg.fitted_from == a
    hidden = [obj.hide_render for obj in bpy.data.objects]
    assert bpy.ops.gpis.csg_compare(samples=32, width=32) == {"FINISHED"}
    assert [obj.hide_render for obj in bpy.data.objects] == hidden
    image = bpy.data.images["A Fit: Live, Fitted, Difference"]
    assert image == fitted.gpis_csg.comparison_image and image.packed_file is not None

    def pictures():
        """Rows of three pictures, the top row first."""
        width, height = image.size
        assert (width, height) == (96, 72)
        image.pixels.foreach_get(pixels := np.empty(width * height * 4, dtype=np.float32))
        rows = np.split(pixels.reshape(height, width, 4)[..., :3], 3)[::-1]
        return [np.split(row, 3, axis=1) for row in rows]

    (live, fit, difference), errors, shape = pictures()
    text = fitted.gpis_csg.comparison
    gain = float(text.split("difference times ")[1].split(".")[0])
    np.testing.assert_allclose(difference, gain * np.abs(live - fit), atol=1e-4 * gain)
    assert "Live " in text and " s at 32 samples. Pixels differ by " in text
    # Below: black beside the surface, colours on it; those of the shape are not one colour, for there are creases.
    for name, picture in zip(text.split("yellow: ")[1].split("; "), [*errors, *shape], strict=True):
        covered = np.sum(picture, axis=-1) > 0.3
        assert 0.05 < covered.mean() < 0.9, name
        assert picture[covered].std(axis=0).max() > 0.02, name
    # The list, not twice the same: and the fit is near it, where the first operand alone is not.
    assert 0 < np.abs(live - fit).mean() < 0.02
    a.gpis_csg.items[0].enabled = a.gpis_csg.items[1].enabled = False
    assert bpy.ops.gpis.csg_compare(samples=32, width=32) == {"FINISHED"}
    assert image == fitted.gpis_csg.comparison_image
    alone = pictures()[0][0]
    off = [float(np.abs(other - fit).mean()) for other in (alone, live)]
    assert off[0] > 2 * off[1]
    bpy.data.objects.remove(a)
    assert not bpy.ops.gpis.csg_compare.poll()


def test_comparison_of_a_long_name(operands):
    """Blender cuts names to 63 bytes (255 from 5.0 on): the image is found again, and not another fit's."""
    a, b, c = operands
    build(a, ["UNION", "UNION"])
    images = []
    for _ in range(2):
        bpy.context.view_layer.objects.active = a
        assert bpy.ops.gpis.csg_fit(resolution=8, method="CLOSED_FORM") == {"FINISHED"}
        fitted = bpy.context.object
        fitted.name = "ß" * 31
        for _ in range(2):
            assert bpy.ops.gpis.csg_compare(samples=1, width=8) == {"FINISHED"}
        images.append(fitted.gpis_csg.comparison_image)
    assert images[0] != images[1] and len(bpy.data.images) == 2


def test_menu(stage, extension):
    """What the search of the menus (F3) finds: it looks through what the Object menu draws."""
    drawn = [function.__module__ for function in bpy.types.VIEW3D_MT_object._dyn_ui_initialize()]
    assert extension + ".csg.menu" in drawn


def test_linked_operands(stage, describe, tmp_path):
    """An operand out of another file is what it would be in this one; a list out of another file is not changed here."""
    a, b = add_gpis(stage, "A", (0, 0, 0), 1.0), add_gpis(stage, "B", (0.9, 0, 0), 0.6)
    for obj in (a, b):
        obj.gpis_csg.items.clear()
    a.gpis_csg.items.add().object = b
    (local,), _ = describe()
    library = str(tmp_path / "library.blend")
    bpy.data.libraries.write(library, {a, b})
    bpy.data.objects.remove(b)
    a.gpis_csg.items.clear()
    with bpy.data.libraries.load(library, link=True) as (_, linked):
        linked.objects = ["B"]
    (b,) = linked.objects
    stage.collection.objects.link(b)
    a.select_set(True)
    b.select_set(True)
    bpy.context.view_layer.objects.active = a
    bpy.context.view_layer.update()
    assert bpy.ops.gpis.csg_add(operation="UNION") == {"FINISHED"}
    assert a.gpis_csg.items[0].object == b and b.library is not None
    (entry,), warnings = describe()
    assert repr(entry["process"]) == repr(local["process"]) and warnings == []
    points = np.random.default_rng(1).uniform(-0.5, 1, (20, 3))
    for one, other in zip(entry["process"].leaves, local["process"].leaves, strict=True):
        np.testing.assert_array_equal(one.mean(points), other.mean(points))
    assert bpy.ops.gpis.csg_fit(resolution=8, method="CLOSED_FORM") == {"FINISHED"}
    assert bpy.ops.gpis.csg_compare(samples=1, width=8) == {"FINISHED"}
    bpy.context.view_layer.objects.active = b
    assert not bpy.ops.gpis.csg_add.poll() and not bpy.ops.gpis.csg_drag.poll()


def test_progress_and_cancelling(operands, extension):
    """The work that the window's modal operator watches: in a thread, told to stop."""
    a, b, c = operands
    build(a, ["UNION", "UNION"])
    module = importlib.import_module(extension + ".csg.fit")
    query = module._Query(bpy.context, a, resolution=96, realisations=1_000_000, method="SAMPLE")
    plan = query.plan()
    assert plan["seconds"] > 1 and 0 < plan["voxels_drawn"] < plan["voxels"] and plan["memory"] > 0
    work = importlib.import_module(extension + ".csg.work").Work(lambda progress: query.run(1, progress))
    assert work.running()
    work.cancel()
    work.join()
    assert work.result is None and work.error is None and work.fraction < 1


def test_operands_of_an_instanced_collection(stage, operands, describe):
    """A list and its operands in a collection that is in the picture by an instance alone: one object, cut as it was made."""
    a, b, c = operands
    build(a, ["DIFFERENCE", "UNION"])
    (entry,), _ = describe()
    parts = bpy.data.collections.new("Parts")
    for obj in operands:
        for collection in obj.users_collection:
            collection.objects.unlink(obj)
        parts.objects.link(obj)
    empty = support.link(stage, "Placed", None, location=(0, 2, 0))
    empty.instance_type, empty.instance_collection = "COLLECTION", parts
    bpy.context.view_layer.update()
    (placed,), warnings = describe()
    assert placed["name"] == "A" and warnings == []
    assert np.array(placed["matrix"])[:3, 3] == pytest.approx((0, 2, 0))
    gn = importlib.import_module("gpis_native")
    rays = (np.random.default_rng(1).uniform(-1, 1, (200, 3)) + (0, 0, 4), np.tile((0.0, 0.0, -1.0), (200, 1)))
    linked, instanced = (gn.first_hits(one["process"], *rays, 9.0, seed=3)["t"] for one in (entry, placed))
    np.testing.assert_array_equal(linked, instanced)
    assert np.isfinite(linked).mean() > 0.5
