"""Fields against formulas and finite differences, and their lines against the fields themselves."""

import gpis_native as gn
import numpy as np
import pytest

RNG = np.random.default_rng(5)
VALUES = RNG.normal(size=(9, 17, 12)).astype(np.float32)
VALUES[:, :9] = 1.25  # a part that is stored as constant bricks
VOXEL = np.array([0.4, 0.2, 0.3])
ORIGIN = np.array([-1.6, -1.6, -1.65])
SHEAR = np.array([[0.9, 0.4, 0, 0.3], [-0.3, 1.2, 0.2, 0], [0, 0.1, -0.7, 0.1], [0, 0, 0, 1.0]])


def grid(**options):
    return gn.GridField(VALUES, VOXEL, ORIGIN, **options)


SPHERE = gn.SphereField((0.1, 0.25, 0), 1)
PLANE = gn.PlaneField((0, 0, 0.2), (1, 2, 3), 0.5)
FIELDS = {
    "constant": gn.ConstantField(2),
    "plane": PLANE,
    "sphere": SPHERE,
    "box": gn.BoxField((0, 0, 0), (1, 2, 1.5)),
    "torus": gn.TorusField((0, 0, 0), (0, 0, 1), 1, 0.4),
    "grid": grid(),
    "sum": SPHERE + 0.3 * grid(),
    "negative": -2 * SPHERE,
    "clamped sphere": SPHERE.clamped(-0.3, 0.4),
    "clamped plane": PLANE.clamped(-0.3, 0.4),
    "clamped grid": grid().clamped(-0.5, 0.7),
    "moved sphere": SPHERE.transformed(SHEAR),
    "moved grid": grid(background=5.0).transformed(SHEAR),
}


def trilinear(x):
    """Independent of the implementation: weights of all eight corners, nearest value outside."""
    u = np.clip((x - ORIGIN) / VOXEL, 0, np.array(VALUES.shape) - 1)
    cell = np.minimum(u.astype(int), np.array(VALUES.shape) - 2)
    w = u - cell
    total = np.zeros(len(x))
    for corner in np.ndindex(2, 2, 2):
        weight = np.prod(np.where(corner, w, 1 - w), axis=1)
        total += weight * VALUES[tuple((cell + corner).T)]
    return total


def box_distance(x, half):
    q = np.abs(x) - half
    return np.linalg.norm(np.maximum(q, 0), axis=1) + np.minimum(q.max(axis=1), 0)


def points(n=2000, seed=1):
    return np.random.default_rng(seed).uniform(-2.2, 2.2, (n, 3))


def test_values_are_those_of_the_formulas():
    x = points()
    n = np.array([1, 2, 3]) / np.sqrt(14)
    torus = np.hypot(np.hypot(x[:, 0], x[:, 1]) - 1, x[:, 2]) - 0.4
    sphere = np.linalg.norm(x - [0.1, 0.25, 0], axis=1) - 1
    y = x @ np.linalg.inv(SHEAR)[:3, :3].T + np.linalg.inv(SHEAR)[:3, 3]
    plane = 0.5 * (x - [0, 0, 0.2]) @ n
    expected = {
        "constant": np.full(len(x), 2.0),
        "plane": plane,
        "sphere": sphere,
        "box": box_distance(x, np.array([0.5, 1, 0.75])),
        "torus": torus,
        "grid": trilinear(x),
        "sum": sphere + 0.3 * trilinear(x),
        "negative": -2 * sphere,
        "clamped sphere": np.clip(sphere, -0.3, 0.4),
        "clamped plane": np.clip(plane, -0.3, 0.4),
        "clamped grid": np.clip(trilinear(x), -0.5, 0.7),
        "moved sphere": np.linalg.norm(y - [0.1, 0.25, 0], axis=1) - 1,
        "moved grid": trilinear(y),
    }
    assert expected.keys() == FIELDS.keys()
    for name, values in expected.items():
        np.testing.assert_allclose(FIELDS[name](x), values, atol=1e-12, err_msg=name)


def test_a_grid_is_its_background_outside():
    x = points()
    inside = np.all((x >= ORIGIN) & (x <= ORIGIN + VOXEL * (np.array(VALUES.shape) - 1)), axis=1)
    np.testing.assert_allclose(grid(background=5.0)(x), np.where(inside, trilinear(x), 5.0), atol=1e-12)
    assert grid(background=5.0).range[1] == 5.0


@pytest.mark.parametrize("rounding", [0, 6e-17])
def test_a_grid_that_moves_along_its_axes_is_the_grid_that_stands_there(rounding):
    """Also where products of rotations leave something of the zeros."""
    scale, shift, x = np.array([0.5, 1.25, 2]), np.array([0.3, -0.1, 0.2]), points()
    matrix = np.diag([*scale, 1]) + rounding * np.sign([[0, 1, -1, 0], [1, 0, 1, 0], [-1, 1, 0, 0], [0] * 4])
    matrix[:3, 3] = shift
    process = gn.GaussianProcess(-2 * grid(background=5.0), 0.1, gn.SquaredExponential(0.5)).transformed(matrix)
    there = -2 * gn.GridField(VALUES, VOXEL * scale, ORIGIN * scale + shift, background=5.0)
    assert np.array_equal(process.mean(x), there(x))
    # Turned by right angles it keeps its background too.
    turned = gn.GaussianProcess(grid(background=5.0), 0.1, gn.SquaredExponential(0.5)).transformed(
        [[rounding, -1, 0, 0], [1, rounding, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]]
    )
    np.testing.assert_allclose(turned.mean(x), grid(background=5.0)(x @ [[0, -1, 0], [1, 0, 0], [0, 0, 1]]), atol=1e-12)


@pytest.mark.parametrize("name", FIELDS)
def test_gradients_are_derivatives_and_bounds_hold(name):
    field, x, h = FIELDS[name], points(), 1e-6
    gradient = field.gradient(x)
    difference = np.stack([(field(x + h * e) - field(x - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    wrong = np.abs(gradient - difference).max(axis=1) > 1e-6
    assert wrong.mean() < 0.005  # points within h of a kink
    assert np.linalg.norm(gradient, axis=1).max() <= field.lipschitz * (1 + 1e-9)
    low, high = field.range
    assert np.all((field(x) >= low) & (field(x) <= high))


def rays(seed, n=200):
    """Random rays, and what grids are afraid of: axes, diagonals, through nodes, along faces, nearly parallel."""
    rng = np.random.default_rng(seed)
    for i in range(n):
        p, d = rng.uniform(-2, 2, 3), rng.normal(size=3)
        node = ORIGIN + VOXEL * np.floor(rng.uniform(0, np.array(VALUES.shape)))
        kind = i % 8
        if kind == 1:
            d = np.eye(3)[rng.integers(3)] * rng.choice([-1, 1])
        if kind == 2:
            d, p = np.eye(3)[rng.integers(3)] * rng.choice([-1, 1]), node
        if kind == 3:
            d, p = VOXEL * rng.choice([-1, 1], 3), node
        if kind == 4:
            d[rng.integers(3)] *= 1e-17
        if kind == 5:
            p = node
        if kind == 6:
            d, p = rng.integers(-1, 2, 3).astype(float), np.round(p * 2) / 2
        if not d.any():
            d = np.array([0, 1.0, 0])
        d *= 10.0 ** rng.integers(-2, 3) / np.linalg.norm(d)
        back = rng.choice([0, 3, 1e4]) / np.linalg.norm(d)
        yield p - d * back, d, max(back - 4 / np.linalg.norm(d), 0), back + 4 / np.linalg.norm(d)


def pieces(line, begin, end, limit=4000):
    t = begin
    for _ in range(limit):
        if t >= end:
            return
        stop = line.next_break(t)
        assert stop > t
        line.enter(t, stop)
        yield t, min(stop, end)
        t = stop
    raise AssertionError("too many pieces")


@pytest.mark.parametrize("name", FIELDS)
def test_lines_agree_with_the_field(name):
    field = FIELDS[name]
    for o, d, begin, end in rays(2):
        line, left_off, speed = field.line(o, d), None, np.linalg.norm(d)
        # A point of a far origin is known to about 1e-12; values follow by the Lipschitz bound.
        tolerance = (1e-11 + 1e-15 * np.abs(o).max()) * max(1, field.lipschitz)
        for a, b in pieces(line, begin, end):
            value, _ = line.evaluate(a)
            assert left_off is None or abs(value - left_off) < tolerance  # continuous from piece to piece
            left_off, _ = line.evaluate(b)
            for t in a + (b - a) * np.array([0.1, 0.5, 0.8]):
                value, slope = line.evaluate(t)
                assert abs(value - field(o + t * d[None])[0]) < tolerance
                sampled, gradient = line.sample(t)
                assert sampled == pytest.approx(value, abs=tolerance)
                assert np.dot(gradient, d) == pytest.approx(slope, abs=1e-9 * speed * max(1, field.lipschitz))
            h = min(1e-5 / speed, (b - a) / 8)
            if h * speed > 1e-7 and np.abs(o).max() < 100:
                m = (a + b) / 2
                quotient = (line.evaluate(m + h)[0] - line.evaluate(m - h)[0]) / (2 * h)
                assert quotient == pytest.approx(line.evaluate(m)[1], abs=1e-5 * speed * max(1, field.lipschitz))


@pytest.mark.parametrize("name", FIELDS)
def test_pieces_are_cubic_to_smooth_scale(name):
    """Up to smooth_scale, Hermite's cubic is close between two points; exact where smooth_scale is infinite."""
    field = FIELDS[name]
    size = 1 if np.isinf(field.smooth_scale) else field.smooth_scale
    for o, d, begin, end in rays(3, 64):
        line, speed = field.line(o, d), np.linalg.norm(d)
        for a, b in pieces(line, begin, end):
            h = min(b - a, field.smooth_scale / speed)
            m, (v0, s0), (v1, s1) = a + h / 2, line.evaluate(a), line.evaluate(a + h)
            error = abs((v0 + v1) / 2 + h * (s0 - s1) / 8 - line.evaluate(m)[0])
            assert error <= (
                1e-10 * max(1, field.lipschitz) if np.isinf(field.smooth_scale) else 0.03 * size * max(1, field.lipschitz)
            )


@pytest.mark.parametrize("name", [*FIELDS, "background"])
def test_above_until_is_certain(name):
    field = grid(background=0.4) if name == "background" else FIELDS[name]
    rng = np.random.default_rng(4)
    told = 0
    for o, d, begin, end in rays(5):
        line, threshold = field.line(o, d), rng.uniform(-1.5, 1)
        t = rng.uniform(begin, end)
        until = line.above_until(t, end, threshold)
        assert t <= until <= end
        if until > t:
            told += 1
            inside = rng.uniform(t, until, 100)[:, None]
            assert np.all(field(o + inside * d) > threshold - 1e-9 * max(1, field.lipschitz))
    assert told > 10


def test_above_until_crosses_a_whole_grid_that_is_above():
    field = gn.GridField(1 + np.random.default_rng(0).uniform(size=(40, 40, 40)), 0.1)
    assert field.line((-1, 2, 2), (1, 0.01, 0)).above_until(0.5, 7, 0.9) == 7
    values = np.ones((40, 40, 40))
    values[20, 20, 20] = -1
    line = gn.GridField(values, 0.1).line((-1, 2, 2), (1, 0, 0))
    assert line.above_until(0, 7, 0.5) == pytest.approx(2.9)  # the cell before the node of x = 2


def test_wrong_arguments_get_a_sentence():
    cases = {
        "radius is -1": lambda: gn.SphereField((0, 0, 0), -1),
        "normal is (0, 0, 0)": lambda: gn.PlaneField((0, 0, 0), (0, 0, 0)),
        "size is (0, 1, 1)": lambda: gn.BoxField((0, 0, 0), (0, 1, 1)),
        "must be the greater": lambda: gn.TorusField((0, 0, 0), (0, 0, 1), 1, 2),
        "is nan": lambda: gn.ConstantField(np.nan),
        "at least 2 along": lambda: gn.GridField(np.zeros((1, 3, 3)), 1),
        "27 of the values are not finite": lambda: gn.GridField(np.full((3, 3, 3), np.nan), 1),
        "takes (X, Y, Z)": lambda: gn.GridField(np.zeros((3, 3)), 1),
        "voxel_size is": lambda: gn.GridField(np.zeros((3, 3, 3)), -1),
        "low must not exceed": lambda: SPHERE.clamped(2, 1),
        "must not flatten": lambda: SPHERE.transformed(np.diag([1, 1, 0, 1.0])),
        "(0, 0, 0, 1)": lambda: SPHERE.transformed(np.ones((4, 4))),
        "takes (N, 3)": lambda: SPHERE(np.zeros(3)),
        "non-zero length": lambda: SPHERE.line((0, 0, 0), (0, 0, 0)),
    }
    for text, call in cases.items():
        with pytest.raises(ValueError) as error:
            call()
        assert text in str(error.value)
