"""Where dabs and extensions of painted fields end: at each node of a leaf, and outside of what there is."""

import gpis_native as gn
import numpy as np

VOXEL = 0.125


def painted(tmp_path, mean):
    """On nodes at multiples of VOXEL from 0."""
    gn.write_vdb(tmp_path / "mean.vdb", {"mean": mean.astype(np.float32), "origin": (0, 0, 0), "voxel_size": VOXEL})
    return gn.PaintedFields(tmp_path / "mean.vdb", sigma=0.05, length_scale=0.2)


def test_a_small_dab_reaches_the_node_that_it_is_on(tmp_path):
    """Also the corners of a leaf, which are furthest from its middle."""
    fields = painted(tmp_path, np.ones((24, 24, 24)))
    for corner in np.ndindex(2, 2, 2):
        node = 8 + 7 * np.array(corner)
        counts = fields.apply("deviation", "set", [node * VOXEL], radius=0.01, value=0.3, falloff="constant")
        assert counts["nodes"] == 1 and counts["leaves"] == 1
    assert fields.apply("deviation", "set", [(1.06, 1.06, 1.06)], radius=0.01, value=0.3)["nodes"] == 0, "between nodes"


def test_what_is_outside_stays_outside_where_the_mean_falls(tmp_path):
    """Beyond the box a mean that falls towards its end would make a surface out of nothing; one that rises goes on."""
    x = np.arange(17) * VOXEL
    falling = painted(tmp_path, np.broadcast_to((2.2 - x)[:, None, None], (17, 17, 17)))
    falling.extend([(0, 0, 0), (5, 2, 2)])
    line = np.column_stack([np.linspace(2, 5, 20), np.ones(20), np.ones(20)])
    np.testing.assert_allclose(falling.values("mean", line), 0.2, atol=1e-5)
    rising = painted(tmp_path, np.broadcast_to((0.5 + x)[:, None, None], (17, 17, 17)))
    rising.extend([(0, 0, 0), (5, 2, 2)])
    np.testing.assert_allclose(rising.values("mean", line), 0.5 + line[:, 0], atol=1e-5)
    inside = painted(tmp_path, np.broadcast_to((x - 3)[:, None, None], (17, 17, 17)))
    inside.extend([(0, 0, 0), (5, 2, 2)])
    np.testing.assert_allclose(inside.values("mean", line), line[:, 0] - 3, atol=1e-5)


def test_the_image_of_a_tensor_is_mirrored(tmp_path):
    """Nodes are images of nodes: exact, with each entry that changes its sign."""
    x, y, z = np.meshgrid(*[np.arange(17) * VOXEL] * 3, indexing="ij")
    for axis in range(3):
        fields = painted(tmp_path, x + 0.5 * y + 0.7 * z - 1)
        fields.apply("anisotropy", "comb", [(1, 1, 1)], radius=0.6, directions=[(1.0, -2.0, 0.4)], ratios=(4, 1, 2))
        fields.mirror("anisotropy", axis, True)
        points = np.array([(1, 1, 1), (1.125, 1, 0.875)])
        sign = np.where(np.arange(3) == axis, -1.0, 1.0)
        before, after = fields.values("anisotropy", points), fields.values("anisotropy", points * sign)
        assert np.abs(before[:, 3:]).min() > 1e-3
        np.testing.assert_allclose(after, before * [1, 1, 1, sign[0] * sign[1], sign[0] * sign[2], sign[1] * sign[2]], rtol=1e-6)


def test_a_ray_meets_the_surface_from_outside_and_says_how_steep_it_is(tmp_path):
    x = np.arange(17) * VOXEL
    fields = painted(tmp_path, np.broadcast_to((2.1 - 2 * x)[:, None, None], (17, 17, 17)))
    t, position, slope = fields.first_surface((-1, 1, 1), (1, 0, 0))
    assert abs(t - 2.05) < 1e-5 and abs(position[0] - 1.05) < 1e-5
    np.testing.assert_allclose(slope, (-2, 0, 0), atol=1e-4)
    assert fields.first_surface((3, 1, 1), (-1, 0, 0)) is None, "it comes from inside"
