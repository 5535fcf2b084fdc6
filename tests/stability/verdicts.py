"""What a cell of the stability sweep measures and how it is judged.

A cell is (family, row, column, run); run(n) returns an Outcome of about n rays or raises ValueError, which is a refusal
before anything was drawn. Laws are compared by Kolmogorov-Smirnov distances, whose first `stated` part is what the
limit itself leaves open (an asymptotic law at a finite value); the rest must be within the statistics at SIGNIFICANCE.
A cell that allows as large an error as there can be is wrong whatever was drawn: nothing could make it fail.
"""

import math
import re
from dataclasses import dataclass, field, replace
from typing import Any

import gpis_native as gn
import numpy as np

SIGNIFICANCE = 3e-8  # of a cell: of all 2,000 of a sweep, three comparisons each, 2e-4
RIGHT, REFUSED, WRONG, ENDED = "right", "refused", "wrong", "ended"

EVALUATIONS = ("line_evaluations",)
CLAMPS = ("line_slope_floor", "line_entry_inside", "line_split_limit", "states_inside", "realisation_moved")
FALLBACKS = ("line_reach_limit", "pivots_dropped")
CANNOT_FAIL = "cannot fail: as large an error is allowed as there can be"
# A refusal names a quantity of the scene, and the limit or what was found: a number, or what it takes.
QUANTITY = re.compile(
    r"length.scale|sigma|mean\b|anisotropy|points?\b|values?\b|grid|nodes|transform|kernel|bounds|axis|direction|origin|matrix|radius|voxel"
)


@dataclass
class Outcome:
    """error: the largest distance met; allowed: what it may be; against: what it was compared with; most: the largest
    error there can be."""

    error: float
    allowed: float
    against: str
    counters: dict = field(default_factory=dict)
    condition: float = 0.0  # of the matrix that the data ask for, before rows are dropped
    stated: float = 0.0
    note: str = ""
    most: float = math.inf

    @property
    def can_fail(self):
        return self.allowed < self.most

    @property
    def status(self):
        if not self.can_fail:
            return WRONG
        if self.counters.get("line_step_limit", 0) or self.counters.get("nan_samples", 0):
            return WRONG
        return RIGHT if self.error <= self.allowed else WRONG

    def joined(self, other):
        """Both comparisons of one cell: the one that is closer to its limit, the counters of both."""
        worse = self if self.error / self.allowed >= other.error / other.allowed else other
        if not (self.can_fail and other.can_fail):
            worse = other if self.can_fail else self
        counters = {k: self.counters.get(k, 0) + other.counters.get(k, 0) for k in self.counters | other.counters}
        return replace(worse, counters=counters, condition=max(self.condition, other.condition))


@dataclass
class Cell:
    family: str
    row: Any
    column: Any
    run: Any
    refusal: bool | None = None  # must be refused (True), must not (False), may be (None)

    @property
    def key(self):
        return f"{self.family} | {self.row} | {self.column}"


def counted(*hits):
    total = {}
    for h in hits:
        for name, value in h["counters"].items():
            total[name] = total.get(name, 0) + value
    return total


def finite_hits(hits):
    """No NaN, and a place and a gradient wherever there is a hit."""
    t, hit = hits["t"], np.isfinite(hits["t"])
    return not np.isnan(t).any() and np.isfinite(hits["position"][hit]).all() and np.isfinite(hits["gradient"][hit]).all()


def of_cdf(t, cdf, against, hits=None, stated=0.0):
    """t (N,) against P(T <= t), vectorised; inf where nothing was hit."""
    n, t = len(t), np.sort(t)
    ends = t[np.isfinite(t)]
    expected = cdf(ends)
    steps = np.arange(1, len(ends) + 1) / n
    distance = max(np.max(np.abs(steps - expected), initial=0), np.max(np.abs(steps - 1 / n - expected), initial=0))
    distance = max(distance, abs(len(ends) / n - cdf(np.array([np.inf]))[0]))
    return _outcome(distance, n, against, hits, stated, t)


def of_sample(t, reference, against, hits=None, stated=0.0):
    """t (N,) against another sample of the law; NaN in either is an error, infinities count as the largest."""
    a, b = np.sort(t), np.sort(reference)
    both = np.concatenate([a[np.isfinite(a)], b[np.isfinite(b)]])
    below = np.searchsorted(a, both, "right") / len(a) - np.searchsorted(b, both, "right") / len(b)
    n = len(a) * len(b) / (len(a) + len(b))
    return _outcome(np.max(np.abs(below), initial=0), n, against, hits, stated, np.concatenate([a, b]))


def _outcome(distance, n, against, hits, stated, t):
    good = not np.isnan(t).any() and all(finite_hits(h) for h in hits or [])
    return Outcome(
        float(distance) if good else math.inf,
        stated + math.sqrt(math.log(2 / SIGNIFICANCE) / (2 * n)),
        against,
        counted(*(hits or [])),
        stated=stated,
        note="" if good else "not finite",
        most=1.0,
    )


def few_hits(hits, expected, against):
    """The share of rays that hit, where a ray hits with a probability of at most `expected`: so few that their number is
    Poisson's at most."""
    n, good = len(hits["t"]), finite_hits(hits)
    term = math.exp(-n * expected)
    k, beyond = 0, 1 - term
    while beyond > SIGNIFICANCE:
        k += 1
        term *= n * expected / k
        beyond -= term
    share = float(np.isfinite(hits["t"]).mean()) if good else math.inf
    note = "" if good else "not finite"
    return Outcome(share, (k + 0.5) / n, against, counted(hits), note=note, most=1.0)


FOLDS = (0.1, 0.5, 2.0, 10.0)


def of_rate(hits, rate, least, length, against):
    """Rays that hit without memory, at a rate between least * rate and rate, up to a length.

    The error is the evidence for another rate, the logarithm of how much likelier it makes the hits. That likelihood
    ratio has a mean of 1 or less wherever the rays end, so one of the FOLDS exceeds FOLDS / SIGNIFICANCE with a
    probability of SIGNIFICANCE at most: of few rays as of many. most: what the less telling of two failures, all rays
    hit at once and no ray hits, would be.
    """
    t, good = hits["t"], finite_hits(hits)
    n, k, way = len(t), int(np.isfinite(t).sum()), rate * float(np.minimum(t, length).sum())
    evidence = max(k * math.log(q) - (q - 1) * way * (1 if q > 1 else least) for q in FOLDS)
    most = min(n * math.log(FOLDS[-1]), (1 - FOLDS[0]) * least * n * rate * length)
    note = f"{k} hits, {way:.3g} expected" if good else "not finite"
    error = max(evidence, 0.0) if good else math.inf
    return Outcome(error, math.log(len(FOLDS) / SIGNIFICANCE), against, counted(hits), note=note, most=most)


def within(value, expected, allowed, against, hits=None, note="", most=math.inf):
    """Numbers that have an exact answer. most: 1 where the error is a share or relative to the answer."""
    error = np.max(np.abs(np.asarray(value, float) - expected), initial=0)
    good = np.isfinite(error) and all(finite_hits(h) for h in hits or [])
    return Outcome(float(error) if good else math.inf, allowed, against, counted(*(hits or [])), note=note, most=most)


def judge(cell, n):
    """A row of the table: a dict of plain numbers and texts, without times."""
    row = {"family": cell.family, "row": str(cell.row), "column": str(cell.column), "rays": n}
    try:
        outcome = cell.run(n)
    except ValueError as refusal:
        sentence = str(refusal)
        named = QUANTITY.search(sentence) and re.search(r"\d|takes|must|not finite", sentence)
        good = cell.refusal is not False and named
        return row | {"status": REFUSED if good else WRONG, "sentence": sentence}
    counters = outcome.counters
    status = WRONG if cell.refusal else outcome.status
    return row | {
        "status": status,
        "error": outcome.error,
        "allowed": outcome.allowed,
        "stated": outcome.stated,
        "against": outcome.against,
        "condition": outcome.condition,
        "evaluations": sum(counters.get(c, 0) for c in EVALUATIONS),
        "clamps": sum(counters.get(c, 0) for c in CLAMPS),
        "fallbacks": sum(counters.get(c, 0) for c in FALLBACKS),
        "step_limit": counters.get("line_step_limit", 0),
        "note": "must be refused, was not" if cell.refusal else outcome.note if outcome.can_fail else CANNOT_FAIL,
    }


def rays(n, origin, direction):
    direction = np.asarray(direction, float)
    return np.tile(np.asarray(origin, float), (n, 1)), np.tile(direction / np.linalg.norm(direction), (n, 1))


def first_hits(gp, n, origin, direction, t_max, **options):
    return gn.first_hits(gp, *rays(n, origin, direction), t_max, threads=1, **options)
