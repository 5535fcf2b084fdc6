"""Condition points that determine each other: which of them are kept does not depend on the order they are given in."""

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
