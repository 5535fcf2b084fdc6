"""What the overlay shows while a stroke goes on: looked up under the brush alone, and the same as if all were."""


import bpy
import numpy as np
import pytest

CASES = [
    ("MEAN", "INFLATE"),
    ("MEAN", "GRAB"),
    ("DEVIATION", "SET"),
    ("LENGTH_SCALE", "ADD"),
    ("ANISOTROPY", "COMB"),
    ("ALBEDO", "SET"),
]


@pytest.fixture
def sphere(stage):
    bpy.ops.gpis.add(kind="SPHERE", radius=1.0, resolution=40)
    return bpy.context.object


class Counting:
    """Fields that say at how many points they were asked."""

    def __init__(self, fields):
        self.fields, self.asked = fields, 0

    def values(self, channel, points):
        self.asked += len(points)
        return self.fields.values(channel, points)

    def voxel_size(self):
        return self.fields.voxel_size()


class Hand:
    """A stroke of the brush of the header along the sphere, as the modal operator paints it, and its Look."""

    def __init__(self, module, obj, brush):
        bake, stroke, look = module("paint.bake"), module("paint.stroke"), module("viewport.look")
        self.brush, self.look_class = brush, look.Look
        self.surface = module("viewport.surface").of(obj)
        self.painting = bake.Painting(obj, stroke.Brush(**brush.brush(obj)))
        self.spacing = stroke.Spacing(0.15, 1.0, 0.1, drag=brush.operation == "GRAB")
        self.fields = Counting(self.painting.fields)
        self.look = self.whole()

    def whole(self, **given):
        return self.look_class(bpy.context.scene, self.brush, self.fields, self.surface, self.surface, **given)

    def move(self, place):
        """How many vertices were looked at."""
        dabs = self.spacing.add(place)
        self.painting.add(dabs)
        self.fields.asked = 0
        return self.look.follow(self.fields, dabs, self.painting.stroke.brush.symmetry)


def along(count):
    """Over the top of the unit sphere, off the planes of symmetry."""
    angle = np.linspace(0.3, 0.9, count)
    return np.column_stack([np.sin(angle), np.full(count, 0.2), np.cos(angle)])


@pytest.mark.parametrize("symmetry", [(False, False, False), (True, True, False)], ids=["plain", "mirrored"])
@pytest.mark.parametrize(("channel", "operation"), CASES, ids=[f"{channel}-{operation}" for channel, operation in CASES])
def test_a_look_that_follows_is_the_look_of_all(module, sphere, channel, operation, symmetry):
    brush = bpy.context.scene.gpis.paint
    brush.channel, brush.falloff, brush.symmetry, brush.show_shells = channel, "CONSTANT", symmetry, True
    setattr(brush, brush.operation_name, operation)
    hand = Hand(module, sphere, brush)
    moved = module("viewport.channels").moved
    before = moved(hand.fields, hand.surface)
    count, recoloured = len(hand.surface.vertices), 0
    for place in along(8):
        span = hand.look.legend and hand.look.legend.span
        seen = hand.move(place)
        changed = span != (hand.look.legend and hand.look.legend.span)
        recoloured += changed
        assert seen < 0.12 * (4 if any(symmetry) else 1) * count
        # Colours or places, the shells, and the ellipses among them.
        assert hand.fields.asked <= 3 * seen + changed * count
    # Multiplied values leave the legend; its ends jump by twice, so that this is seldom.
    assert recoloured in ({1, 2} if operation == "ADD" else {0})
    if channel == "MEAN":
        after = moved(hand.fields, hand.surface)
        changed = np.any(after != before, axis=1)
        assert 20 < changed.sum() < len(changed) / 3
        assert np.array_equal(hand.look.vertices[changed], after[changed])
        assert np.abs(hand.look.vertices - after).max() < 1e-3, "those that nothing reached lie on the surface as they are"
        return
    all_of_it = hand.whole(legend=hand.look.legend)
    # The last digit of a logarithm depends on where it stands in an array.
    np.testing.assert_allclose(hand.look.colours, all_of_it.colours, rtol=0, atol=1e-12)
    np.testing.assert_allclose(hand.look.ellipses, all_of_it.ellipses, rtol=0, atol=1e-12)
    np.testing.assert_allclose(hand.look.shells, all_of_it.shells, rtol=0, atol=1e-12)
    assert np.any(hand.look.colours != hand.look.colours[0]), "something is painted"
    hand.painting.cancel()


def test_ellipses_appear_where_it_is_combed(module, sphere):
    brush = bpy.context.scene.gpis.paint
    brush.channel = "ANISOTROPY"
    hand = Hand(module, sphere, brush)
    assert len(hand.look.ellipses) == 0
    for place in along(5):
        hand.move(place)
    assert len(hand.look.ellipses) > 0
    np.testing.assert_allclose(hand.look.ellipses, hand.whole().ellipses, rtol=0, atol=1e-12)


def test_ellipses_are_spread_evenly(module, stage):
    """None upon another one, and no bare places."""
    bpy.ops.gpis.add(kind="SPHERE", radius=2.0, resolution=96)
    surface, channels = module("viewport.surface").of(bpy.context.object), module("viewport.channels")
    places = surface.vertices[channels.some_vertices(surface)]
    assert 1000 < len(places) < 1800
    square = np.sqrt(4 * np.pi * 2.0**2 / len(places))
    apart = np.linalg.norm(places[:, None] - places, axis=2)
    assert np.min(apart + 10 * np.eye(len(places))) > 0.25 * square
    bare = np.linalg.norm(surface.vertices[::7, None] - places, axis=2).min(axis=1)
    assert bare.max() < 1.1 * square


def test_a_move_beside_the_surface_asks_nothing(module, sphere):
    brush = bpy.context.scene.gpis.paint
    brush.channel = "DEVIATION"
    hand = Hand(module, sphere, brush)
    hand.spacing = module("paint.stroke").Spacing(0.01, 1.0, 0.0)
    hand.move((0, 0, 0.5))
    assert hand.move((0, 0, 0.4)) == 0 and hand.fields.asked == 0


@pytest.fixture
def drawn(module, monkeypatch):
    """Refresh what is drawn of an object; counts whole looks and steps of them. No GPU."""
    overlay, look = module("viewport.overlay"), module("viewport.look")
    counts = {"looks": 0, "steps": 0}
    made, followed = look.Look.__init__, look.Look.follow

    def make(self, *arguments, **keywords):
        counts["looks"] += 1
        made(self, *arguments, **keywords)

    def follow(self, *arguments):
        counts["steps"] += 1
        return followed(self, *arguments)

    monkeypatch.setattr(look.Look, "__init__", make)
    monkeypatch.setattr(look.Look, "follow", follow)
    monkeypatch.setattr(overlay.draw, "surface_batch", lambda *content: [np.array(part) for part in content])
    monkeypatch.setattr(overlay, "tool_is_active", lambda context: True)
    monkeypatch.setattr(overlay, "_drawn", {})

    def refresh(obj):
        return overlay._refreshed(bpy.context, obj, module("viewport.surface").of(obj)), dict(counts)

    return refresh


def test_a_stroke_is_one_look_and_the_end_of_it_another(module, sphere, drawn):
    overlay = module("viewport.overlay")
    brush = bpy.context.scene.gpis.paint
    brush.channel, brush.sigma, brush.show_shells = "DEVIATION", 0.2, True
    assert drawn(sphere)[1] == {"looks": 1, "steps": 0}
    assert drawn(sphere)[1] == {"looks": 1, "steps": 0}
    hand = Hand(module, sphere, brush)
    hand.look, start = drawn(sphere)[0].look, drawn(sphere)[1]
    symmetry = hand.painting.stroke.brush.symmetry
    for i, place in enumerate(along(12)):
        dabs = hand.spacing.add(place)
        hand.painting.add(dabs)
        overlay.painting(sphere, hand.painting.fields, dabs, symmetry)
        if i % 6 == 5:  # some moves of the mouse to a redraw: none is forgotten
            shown, counts = drawn(sphere)
    assert counts == {"looks": start["looks"], "steps": 2}
    assert drawn(sphere)[1] == counts, "nothing new, nothing done"
    expected = hand.whole(legend=shown.look.legend)
    np.testing.assert_allclose(shown.batch[3], expected.colours, rtol=0, atol=1e-12)
    np.testing.assert_allclose(shown.shells[0][0], expected.shells[0], rtol=0, atol=1e-12)
    hand.painting.finish()
    overlay.painted()
    before = drawn(sphere)[1]["looks"]
    again = drawn(sphere)[0]
    assert again is not shown and drawn(sphere)[1]["looks"] == before
    np.testing.assert_allclose(again.look.colours, shown.look.colours, atol=1e-12)


def test_a_cancelled_stroke_is_shown_no_more(module, sphere, drawn):
    overlay = module("viewport.overlay")
    brush = bpy.context.scene.gpis.paint
    brush.channel, brush.sigma = "DEVIATION", 0.2
    before = np.array(drawn(sphere)[0].look.colours)
    hand = Hand(module, sphere, brush)
    for place in along(3):
        dabs = hand.spacing.add(place)
        hand.painting.add(dabs)
        overlay.painting(sphere, hand.painting.fields, dabs, (False, False, False))
    assert np.any(drawn(sphere)[0].look.colours != before)
    hand.painting.cancel()
    overlay.painted()
    assert np.array_equal(drawn(sphere)[0].look.colours, before)


def test_shells_stand_off_by_the_deviation(module, sphere):
    brush = bpy.context.scene.gpis.paint
    brush.channel, brush.show_shells, brush.sigma = "DEVIATION", True, 0.2
    hand = Hand(module, sphere, brush)
    for place in along(6):
        hand.move(place)
    deviation = hand.painting.fields.values("deviation", hand.surface.vertices)
    assert deviation.max() > 0.15 and deviation.min() == pytest.approx(sphere.gpis.sigma)
    for side, shell in zip((1, -1), hand.look.shells, strict=True):
        way = np.sum((shell - hand.surface.vertices) * hand.surface.normals, axis=1)
        np.testing.assert_allclose(way, side * deviation, atol=1e-12)


def test_a_legend_gets_room_beyond_what_leaves_it(module):
    widened = module("viewport.colour").widened
    low, high = module("viewport.colour").log_range(np.array([0.3, 0.33]))
    assert high == pytest.approx(2 * low) and low < 0.3 and high > 0.33, "noise of equal values is not all colours"
    assert widened((1.0, 4.0), np.array([0.995, 2.0, 4.03])) == (1.0, 4.0), "as good as on it"
    assert widened((1.0, 4.0), np.array([0.8, 2.0])) == (0.4, 4.0)
    assert widened((1.0, 4.0), np.array([2.0, 6.0])) == (1.0, 12.0)
    assert widened((1.0, 4.0), np.array([0.0, np.inf])) == (1.0, 4.0) and widened((1.0, 4.0), np.array([])) == (1.0, 4.0)


def test_a_value_off_the_legend_makes_a_new_one(module, sphere, drawn):
    brush = bpy.context.scene.gpis.paint
    brush.channel, brush.sigma = "DEVIATION", 0.2
    first = drawn(sphere)[0].look.legend
    brush.sigma = 0.1  # between that of the object and the one before
    assert drawn(sphere)[0].look.legend is first
    brush.sigma = 0.9
    assert drawn(sphere)[0].look.legend.span[1] == pytest.approx(0.9)
