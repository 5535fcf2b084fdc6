"""Tensor fields: interpolation, derivatives, transforms and what they refuse."""

import gpis_native as gn
import numpy as np
import pytest
from tensor_grids import GRID, ORIGIN, VALUES, VOXEL, entries, matrices, points, random_tensors, trilinear

SHEAR = np.array([[0.9, 0.4, 0, 0.3], [-0.3, 1.2, 0.2, 0], [0, 0.1, -0.7, 0.1], [0, 0, 0, 1.0]])


def moved(x):
    back = np.linalg.inv(SHEAR)
    return entries(SHEAR[:3, :3] @ matrices(trilinear(x @ back[:3, :3].T + back[:3, 3])) @ SHEAR[:3, :3].T)


FIELDS = {"grid": (GRID, trilinear), "moved grid": (GRID.transformed(SHEAR), moved)}


@pytest.mark.parametrize("name", FIELDS)
def test_every_entry_is_trilinear_and_positive_definite(name):
    field, formula = FIELDS[name]
    x = points()
    got = field(x)
    np.testing.assert_allclose(got, formula(x), rtol=1e-12, atol=1e-12)
    eigenvalues = np.linalg.eigvalsh(matrices(got))
    low, high = field.eigenvalues
    assert low > 0 and eigenvalues.min() >= low * (1 - 1e-12) and eigenvalues.max() <= high * (1 + 1e-12)


def test_range_of_eigenvalues_is_that_of_the_nodes():
    nodes = np.linalg.eigvalsh(matrices(VALUES))
    np.testing.assert_allclose(GRID.eigenvalues, (nodes.min(), nodes.max()), rtol=1e-9)


@pytest.mark.parametrize("name", FIELDS)
def test_derivatives_are_those_of_the_interpolant(name):
    field, _ = FIELDS[name]
    x, h = points(), 1e-6
    differences = np.stack([(field(x + h * e) - field(x - h * e)) / (2 * h) for e in np.eye(3)], axis=1)
    off = np.abs(field.gradient(x) - differences).max(axis=(1, 2))
    assert np.median(off) < 1e-7 and np.mean(off > 1e-6) < 1e-3  # a few differences straddle the face of a cell


def test_vdb(tmp_path):
    path = tmp_path / "a.vdb"
    gn.write_vdb(path, {"anisotropy": VALUES, "mean": np.ones(VALUES.shape[:3]), "voxel_size": VOXEL, "origin": ORIGIN})
    field = gn.VdbTensorField(path)
    x = points()
    np.testing.assert_allclose(field(x), trilinear(x), rtol=1e-6, atol=1e-6)
    np.testing.assert_allclose(field.eigenvalues, GRID.eigenvalues, rtol=1e-6)


def test_extreme_ratios():
    """Length scales 1 : 1000 in any rotation keep their short axis as well as single precision holds it."""
    values = random_tensors((3, 3, 3), ratio=1000.0)
    field = gn.TensorGridField(values, 1, [0, 0, 0])
    np.testing.assert_allclose(field([[1, 1, 2]])[0], values[1, 1, 2], rtol=1e-12)


def bad(at, value):
    values = VALUES.copy()
    values[at] = value
    return values


@pytest.mark.parametrize(
    ("values", "sentence"),
    [
        (bad((2, 3, 4), [1, 1, 1, 2, 0, 0]), r"values\[2, 3, 4\] is a matrix with the eigenvalue -1 \(the largest is 3\)"),
        (bad((5, 10, 11), [1, 1, 0, 0, 0, 0]), r"values\[5, 10, 11\] is a matrix with the eigenvalue 0"),
        (bad((0, 0, 0), [np.nan, 1, 1, 0, 0, 0]), r"values\[0, 0, 0\] is a matrix with the eigenvalue"),
        (bad((0, 0, 1), [1e300, 1, 1, 0, 0, 0]), r"values\[0, 0, 1\] is a matrix"),
        (VALUES[..., :3], r"\(X, Y, Z, 6\)"),
        (VALUES[:1], "at least 2 along each axis"),
    ],
)
def test_bad_grids_get_a_sentence(values, sentence):
    with pytest.raises(ValueError, match=sentence):
        gn.TensorGridField(values, VOXEL, ORIGIN)


def test_bad_files_and_transforms_get_a_sentence(tmp_path):
    path = tmp_path / "a.vdb"
    nodes = {"voxel_size": 0.5, "origin": [2, 1, -1]}
    gn.write_vdb(path, {"mean": np.ones((3, 3, 3)), **nodes})
    with pytest.raises(ValueError, match="has no grid 'anisotropy_diagonal'"):
        gn.VdbTensorField(path)
    gn.write_vdb(path, {"anisotropy_diagonal": np.ones((3, 3, 3)), "anisotropy_offdiagonal": np.ones((3, 3, 3, 3)), **nodes})
    with pytest.raises(ValueError, match="holds float values; half of a tensor field takes vectors"):
        gn.VdbTensorField(path)
    gn.write_vdb(path, {"anisotropy": bad((1, 2, 1), [1, 1, 1, 0, 0, 1.5])[:3, :3, :3], **nodes})
    with pytest.raises(ValueError, match=r"The voxel \(\d+, \d+, -?\d+\) of the anisotropy of .* eigenvalue -0.5"):
        gn.VdbTensorField(path)
    with pytest.raises(FileNotFoundError):
        gn.VdbTensorField(tmp_path / "none.vdb")
    with pytest.raises(ValueError, match="must not flatten space"):
        GRID.transformed(np.diag([1.0, 0, 1, 1]))
