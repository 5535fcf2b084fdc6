"""Tests of hypotheses with a stated significance, shared by the statistical tests.

SIGNIFICANCE is for one comparison: small enough that all comparisons of the suite together raise a false alarm with
probability below FAMILY_WISE. The end of a test run says how many there were, and fails if they were too many for that.
"""

import math

import numpy as np

FAMILY_WISE = 1e-3
SIGNIFICANCE = 1e-9
Z_LIMIT = 6.109  # two-sided normal quantile of SIGNIFICANCE


class Comparisons:
    """How many this process has made."""

    count = 0


def count_comparisons(n):
    Comparisons.count += n


def check_z(value, expected, standard_error, what=""):
    """Two-sided z-test of a mean, element by element."""
    z = (np.asarray(value) - expected) / standard_error
    count_comparisons(np.size(z))
    assert np.all(np.abs(z) < Z_LIMIT), f"{what}: z = {np.round(z, 2)}, {value} against {expected}"


def check_proportion(hits, n, expected, expected_error=0.0, what=""):
    """z-test of a count against a probability that itself has a standard error."""
    expected = np.asarray(expected, dtype=float)
    variance = expected * (1 - expected) / n + np.square(expected_error)
    check_z(np.asarray(hits) / n, expected, np.sqrt(np.maximum(variance, 0.25 / n**2)), what)


def check_same_distribution(a, b, what=""):
    """Two-sample Kolmogorov-Smirnov test; infinite values take part as the largest."""
    count_comparisons(1)
    a, b = np.sort(a), np.sort(b)
    both = np.concatenate([a[np.isfinite(a)], b[np.isfinite(b)]])
    distance = np.max(np.abs(np.searchsorted(a, both, "right") / len(a) - np.searchsorted(b, both, "right") / len(b)))
    n = math.sqrt(len(a) * len(b) / (len(a) + len(b)))
    p = min(1.0, 2 * math.exp(-2 * (n * distance) ** 2))
    assert p > SIGNIFICANCE, f"{what}: KS distance {distance:.5f}, p = {p:.1e}"


def normal_cdf(z):
    """Φ, to rounding in both tails."""
    return 0.5 * np.vectorize(math.erfc, otypes=[float])(-np.asarray(z, dtype=float) / math.sqrt(2))
