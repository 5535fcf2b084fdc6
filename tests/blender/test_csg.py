"""CSG lists of GPIS objects: what they are in the description, and how they are edited."""

import importlib

import bpy
import numpy as np
import pytest
from mathutils import Matrix

from . import support
from .csg_objects import add_gpis, build, entry_of, make_operands


@pytest.fixture
def operands(stage):
    return make_operands(stage)


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
