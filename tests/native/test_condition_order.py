"""Conditions that others, or the kernel, determine: points whose order does not matter, and slopes where nothing varies."""

import gpis_native as gn
import numpy as np
import pytest


@pytest.mark.parametrize("kernel", [gn.SquaredExponential(1.0), gn.RationalQuadratic(1, 1.0)], ids=repr)
@pytest.mark.parametrize("spacing", [0.01, 0.1])
def test_points_that_determine_each_other(kernel, spacing):
    """200 points in a row, of which some ten to forty tell all: values that a function of the kernel's own space has, κ(x - c),
    contradict nothing, and what is kept of them spans the row. Kept in the order given they extrapolated: a deviation of 0 a
    quarter of a length scale beside them, where the mean was off by 1e-4 deviations."""

    def truth(x):
        return kernel(x, np.array([[spacing * 100.0, 0, 0]])).reshape(len(x))

    points = np.zeros((200, 3))
    points[:, 0] = spacing * np.arange(200)
    gp = gn.GaussianProcess(0.0, 1.0, kernel, conditions={"points": points, "values": truth(points)})
    beside = np.array([[-1, 0, 0], [-0.25, 0, 0], [spacing * 60.5, 0, 0], [spacing * 199 + 0.25, 0, 0], [spacing * 199 + 1, 0, 0]])
    mean, variance = gp.posterior(np.concatenate([points, beside]))
    off, deviation = np.abs(mean - truth(np.concatenate([points, beside]))), np.sqrt(np.maximum(variance, 0))
    assert np.max(off[:200]) < 1e-4 and np.max(deviation[:200]) < 1e-4
    assert np.all(off[200:] < 5 * deviation[200:] + 2e-5)


INFINITE = {
    "height field": gn.SquaredExponential([0.3, 0.3, np.inf]),
    "turned": gn.SquaredExponential([0.3, 0.3, np.inf], rotation=(0.8, 0.6, 0, 0)),
    "plane wave": gn.PlaneWave([1, 0, 0]),
    "constant": gn.SquaredExponential([np.inf] * 3),
}


@pytest.mark.parametrize("kernel", INFINITE)
def test_slopes_where_nothing_varies_are_those_of_the_mean(kernel):
    """Others are refused by name, which were left out before without a word; those that agree are kept."""
    axis = np.array([0, -0.96, 0.28]) if kernel == "turned" else np.array([0, 0, 1.0])
    mean = gn.PlaneField([0, 0, 0], axis)

    def conditioned(normal, slope):
        conditions = {"points": [[0, 0, 0.05]], "normals": [normal / np.linalg.norm(normal)], "slopes": [slope]}
        return gn.GaussianProcess(mean, 0.1, INFINITE[kernel], bounds=((-1,) * 3, (1,) * 3), conditions=conditions)

    across = np.array([0.3, 0, 0])
    for normal, slope in ((-axis, 1.0), (axis, 2.0), (axis + across, 1.0)):
        with pytest.raises(ValueError, match=r"conditions.points\[0\].*slope of .* is constant and the mean has"):
            conditioned(normal, slope)
    h = 1e-4
    tilted = np.zeros(3) if kernel == "constant" else across  # of which no tilt is possible
    gp = conditioned(axis + tilted, np.linalg.norm(axis + tilted))
    at = gp.posterior(np.array([[0, 0, 0.05], [h, 0, 0.05], [0, 0, 0.05] + h * axis]))[0]
    assert np.allclose((at[1:] - at[0]) / h, [tilted[0], 1], atol=1e-3)
