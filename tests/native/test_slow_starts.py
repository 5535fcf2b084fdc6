"""Rays that leave a rough surface all but along it: half of them are back at once, on a scale far below the length scale. To
such a start every rough path is an integrated Brownian motion, whose first return is known."""

import gpis_native as gn
import numpy as np
import pytest
from statistics_checks import check_proportion
from tensor_grids import VARYING

pytestmark = pytest.mark.stats
BOUNDS = ((-2, -2, -2), (12, 2, 2))
PLACE = np.array([0.3, -0.2, 0.1])
# P(returned before w), w = t q/v² from slope v, q of Var(g'(t) - g'(0)) = q t (McKean 1963), by quadrature of oracle 5.
SCALED, RETURNED = np.array([1, 4, 16, 100]), [0.0433436, 0.2211788, 0.4268455, 0.6334653]
ROUGHNESS = {"matern 3/2": 12 * np.sqrt(3), "wong": 8 / np.sqrt(3)}
KERNELS = {"matern 3/2": gn.Matern(1.5, 1), "wong": gn.Wong(1)}
# Others that have the roughness of Matérn 3/2, and the sampler that serves them.
MIXED = {
    "product": (gn.Matern(1.5, 1) * gn.SquaredExponential(4), "dense"),
    "sum with a product": (gn.Matern(1.5, 1) * gn.SquaredExponential(4) + gn.SquaredExponential(0.5), "dense"),
    "sum": (gn.Matern(1.5, 1) + gn.SquaredExponential(0.5), "auto"),
}


@pytest.fixture
def n(full_size):
    return 400_000 if full_size else 40_000


def length_along_x(field):
    """The local length scale (dᵀA⁻¹d)^-½ at PLACE."""
    if field == "length e^{x/4}":
        return np.exp(0.25 * PLACE[0])
    if field == "length times 4 within one":
        return 1.0
    angle = PLACE[0] * np.pi / 6
    return 1 / np.sqrt(np.cos(angle) ** 2 / 3 + np.sin(angle) ** 2 * 3)


def returns(gp, slope, sampler, n, seed):
    start = {"value": np.zeros(n), "gradient": np.tile([slope, 0, 0], (n, 1))}
    along = np.tile(PLACE, (n, 1)), np.tile([1.0, 0, 0], (n, 1))
    return gn.first_hits(gp, *along, 6, start=start, sampler=sampler, seed=seed)["t"]


@pytest.mark.parametrize("sampler", ["markov", "dense"])
@pytest.mark.parametrize("slope", [0.1, 0.01, 0.001])
def test_wong(sampler, slope, n, seed):
    """Oracle 5, exact at all times: w = (e^{2t/√3} - 1) 4/v². A step that begins so slowly and ends inside holds many roots
    around that of its cubic."""
    t = np.sqrt(3) / 2 * np.log1p(SCALED * slope**2 / 4)
    back = returns(gn.GaussianProcess(0, 1, gn.Wong(1), bounds=BOUNDS), slope, sampler, n, seed)
    check_proportion(np.sum(back[:, None] < t, axis=0), n, RETURNED, 1e-5)


@pytest.mark.parametrize("slope", [0.01, 0.001])
@pytest.mark.parametrize("kernel", KERNELS)
@pytest.mark.parametrize("field", VARYING)
def test_varying_lengths(field, kernel, slope, n, seed):
    gp = gn.GaussianProcess(0, 1, KERNELS[kernel], anisotropy=VARYING[field], bounds=BOUNDS)
    check_returns(gp, ROUGHNESS[kernel] / length_along_x(field) ** 3, slope, n, seed)


@pytest.mark.parametrize("slope", [0.01, 0.001])
@pytest.mark.parametrize("kernel", [*KERNELS, *MIXED])
def test_mixed(kernel, slope, n, seed):
    """Kernels and conditions that take several parts or joint lines."""
    if kernel in MIXED:
        gp = gn.GaussianProcess(0, 1, MIXED[kernel][0], bounds=BOUNDS)
        return check_returns(gp, ROUGHNESS["matern 3/2"], slope, n, seed, MIXED[kernel][1])
    conditions = {"points": [[3.0, 0.1, 0.1]], "values": [0.0]}
    gp = gn.GaussianProcess(0, 1, KERNELS[kernel], bounds=BOUNDS, conditions=conditions)
    check_returns(gp, ROUGHNESS[kernel], slope, n, seed)


def check_returns(gp, roughness, slope, n, seed, sampler="dense"):
    """What else a path does than Brownian motion is below 1e-3 of the proportion for so short a time."""
    t = SCALED * slope**2 / roughness
    back = returns(gp, slope, sampler, n, seed)
    check_proportion(np.sum(back[:, None] < t, axis=0), n, RETURNED, 1e-3)
