"""Brushes on tensors that are nearly degenerate, as a file may hold them: no digits are lost, and none stops being positive
definite where it is rounded. Exact in rational numbers."""

from fractions import Fraction

import gpis_native as gn
import numpy as np
import pytest

COUNT, VOXEL = 10, 0.1
ORIGIN = np.full(3, -VOXEL * (COUNT - 1) / 2)


def minors(entries):
    """The leading minors of (N, 6) entries xx,yy,zz,xy,xz,yz, exactly."""
    xx, yy, zz, xy, xz, yz = np.array([[Fraction(float(v)) for v in row] for row in entries], dtype=object).T
    return xx, xx * yy - xy * xy, xx * (yy * zz - yz * yz) - xy * (xy * zz - yz * xz) + xz * (xy * yz - yy * xz)


def is_positive(entries):
    return np.all([minor > 0 for minor in minors(entries)], axis=0)


def needles(condition):
    """(COUNT³, 6) in single precision: long along random directions; the squared lengths differ by `condition`."""
    rng = np.random.default_rng(11)
    along = rng.normal(size=(COUNT**3, 3))
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    a = 0.01 * (np.eye(3) + (condition - 1) * along[:, :, None] * along[:, None, :]) / condition ** (1 / 3)
    entries = a[:, [0, 1, 2, 0, 0, 1], [0, 1, 2, 1, 2, 2]].astype(np.float32)
    entries[~is_positive(entries)] = (0.01, 0.01, 0.01, 0, 0, 0)  # rounding has ended it
    return entries


@pytest.fixture
def painted(tmp_path):
    def open_with(entries):
        grid = entries.reshape(COUNT, COUNT, COUNT, 6)
        mean = np.ones((COUNT,) * 3, np.float32)
        content = {"mean": mean, "anisotropy": grid, "origin": tuple(ORIGIN), "voxel_size": VOXEL}
        gn.write_vdb(tmp_path / "needles.vdb", content)
        return gn.PaintedFields(tmp_path / "needles.vdb", anisotropy=True)

    return open_with


def tensors(fields, path):
    fields.write(path)
    return gn.read_vdb(path, names=["mean", "anisotropy_diagonal", "anisotropy_offdiagonal"])["anisotropy"].reshape(-1, 6)


@pytest.mark.parametrize("condition", [1e2, 1e4, 1e7])
def test_a_length_scale_is_set_to_the_last_digit(painted, tmp_path, condition):
    """ℓ = |A|^(1/6) of needles whose determinant is 10⁻¹² of the product of the diagonal."""
    before = needles(condition)
    fields, value = painted(before), 0.3
    counts = fields.apply("length_scale", "set", [(0, 0, 0)], radius=5, value=value, falloff="constant")
    after = tensors(fields, tmp_path / "set.vdb")
    length = np.array([float(det) for det in minors(before)[2]]) ** (1 / 6)
    changed = np.any(after != before, axis=1)
    largest = np.argmax(np.abs(before), axis=1)[:, None]
    factor = np.take_along_axis(after.astype(float), largest, 1) / np.take_along_axis(before.astype(float), largest, 1)
    np.testing.assert_allclose(factor[changed, 0], (value / length[changed]) ** 2, rtol=3e-7)
    # All are, but those that rounding would have made indefinite.
    assert changed.sum() + counts["rejected"] == COUNT**3 and changed.sum() > COUNT**3 / 4
    assert is_positive(after).all()


@pytest.mark.parametrize(
    ("channel", "operation", "brush"),
    [
        ("length_scale", "add", {"value": 1.37}),
        ("length_scale", "smooth", {}),
        ("anisotropy", "smooth", {}),
        ("anisotropy", "comb", {"ratios": (100, 1, 1), "directions": [(1, 2, 3)]}),
    ],
)
def test_rounding_never_ends_positive_definiteness(painted, tmp_path, channel, operation, brush):
    before = needles(3e7)
    fields = painted(before)
    if operation == "comb":  # along the mean, which has to rise
        fields.apply("mean", "inflate", [(0.2, 0.1, 0)], radius=3, value=0.05)
    rejected = 0
    for strength in (0.02, 0.3):
        counts = fields.apply(channel, operation, [(0, 0, 0)], radius=3, strength=strength, **brush)
        rejected += counts["rejected"]
        assert counts["nodes"] > 0
    after = tensors(fields, tmp_path / "painted.vdb")
    assert is_positive(after).all()
    if (channel, operation) == ("length_scale", "add"):
        assert rejected > 0, "the case is one"
