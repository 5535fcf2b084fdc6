"""Cells of the stability sweep (tests/stability, `./dev stability`) at reduced size: right, or refused by name; bounded."""

import gpis_native as gn
import numpy as np
import pytest
from stability import anisotropy, conditions, fields, lengths, levels, memories, rays, scales, starts, transforms
from stability.verdicts import REFUSED, RIGHT, WRONG, Outcome, few_hits, judge, of_cdf, of_rate, of_sample, within
from statistics_checks import Z_LIMIT

pytestmark = pytest.mark.stats


def some(family, step, first=0):
    return family.cells()[first::step]


CELLS = (
    some(scales, 4)
    + some(levels, 37, 3)
    + some(anisotropy, 23)
    + some(lengths, 17, 5)
    + some(conditions, 7)
    + some(starts, 13)
    + some(memories, 11)
    + some(rays, 9)
    + [c for c in fields.cells() if c.family.startswith("values")]
    + some(transforms, 5)
)


@pytest.mark.parametrize("cell", CELLS, ids=lambda c: c.key)
def test_cell(cell):
    row = judge(cell, 200)
    assert row["status"] in (RIGHT, REFUSED), row
    if row["status"] == RIGHT:
        assert row["step_limit"] == 0


def test_keys_are_unique():
    keys = [
        c.key for f in (scales, levels, anisotropy, lengths, conditions, starts, memories, rays, fields, transforms) for c in f.cells()
    ]
    assert len(set(keys)) == len(keys)


def test_a_cell_that_is_off_is_wrong():
    """The verdicts themselves: a law that is another one, a NaN, an end by the bound on steps, a refusal that names nothing."""
    t = np.random.default_rng(1).exponential(size=1000)

    def exponential(x):
        return 1 - np.exp(-x)

    assert of_cdf(t, exponential, "").status == RIGHT
    assert of_cdf(1.3 * t, exponential, "").status != RIGHT
    assert of_cdf(np.where(t > 2, np.inf, t), exponential, "").status != RIGHT
    assert of_sample(t, np.append(t[1:], np.nan), "").status != RIGHT
    assert within(np.nan, 0, 1, "").status != RIGHT
    assert Outcome(0, 1, "", {"line_step_limit": 1}).status != RIGHT

    def refuse(_):
        raise ValueError("no")

    cell = CELLS[0]
    assert judge(type(cell)("", "", "", refuse), 10)["status"] not in (RIGHT, REFUSED)
    assert judge(type(cell)("", "", "", lambda n: within(0, 0, 1, ""), refusal=True), 10)["status"] != RIGHT


def hits_at(t):
    n = len(t)
    return {"t": np.asarray(t), "position": np.zeros((n, 3)), "gradient": np.ones((n, 3)), "counters": {}}


def test_a_cell_that_cannot_fail_is_wrong():
    t = np.random.default_rng(1).exponential(size=4)
    cell = type(CELLS[0])
    for outcome in (
        of_cdf(t, lambda x: 1 - np.exp(-x), ""),
        within(0.9, 1, 2.0, "", most=1.0),
        of_rate(hits_at(t), 1, 1, 100, ""),
    ):
        row = judge(cell("", "", "", lambda n, outcome=outcome: outcome), 4)
        assert row["status"] == WRONG and row["note"].startswith("cannot fail")
    fails = of_cdf(np.full(1000, np.inf), lambda x: 1 - np.exp(-x), "")
    assert within(0, 0, 2.0, "", most=1.0).joined(fails).status == WRONG
    assert not fails.joined(within(0, 0, 2.0, "", most=1.0)).can_fail


def test_rates_and_rare_hits(seed):
    """As many as Rice says are right. Another rate shows: thrice the rate in 200 rays, a hundred times in 16."""
    rng = np.random.default_rng(seed)
    for n, off in ((16, 100), (200, 3)):
        t = rng.exponential(size=n)
        for fold, right in ((1, True), (0.9, True), (off, False), (1 / off, False)):
            ends = np.where(t / fold < 8, t / fold, np.inf)
            assert (of_rate(hits_at(ends), 1.0, 0.8, 8.0, "").status == RIGHT) == right, (n, fold)
    never = np.full(1000, np.inf)
    assert few_hits(hits_at(never), 1e-20, "").status == RIGHT
    assert few_hits(hits_at(np.append(never, 1.0)), 1e-20, "").status != RIGHT
    assert few_hits(hits_at(np.append(never, [1.0] * 3)), 1e-3, "").status == RIGHT
    assert few_hits(hits_at(np.append(never, [1.0] * 20)), 1e-3, "").status != RIGHT


def test_a_million_steps_are_the_most(seed):
    """Where rays would take more, the process is refused if that can be known; else the counter says it."""
    lengths = 1e6
    bounds, ray = ((-1, -1, -1), (lengths, 1, 1)), ([[0.0, 0, 0]], [[1.0, 0, 0]])

    def hits(mean, length):
        return gn.first_hits(gn.GaussianProcess(mean, 1, gn.Matern(1.5, 1), bounds=bounds), *ray, length, seed=seed)

    with pytest.raises(ValueError, match="5.5.* standard deviations.*1000001 length scales across.*1048576 steps"):
        hits(5.5, lengths)
    assert hits(2.0, lengths)["counters"]["line_step_limit"] == 0
    all_but_constant = gn.PlaneField([0, 0, 0], [1, 0, 0], 1e-12) + 5.5
    counters = hits(all_but_constant, lengths)["counters"]
    assert counters["line_step_limit"] == 1 and 2**20 <= counters["line_evaluations"] <= 1.1 * 2**20


@pytest.mark.parametrize("sampler", ["nystrom", "convolution"])
def test_gradients_across_a_line_of_a_thin_process(sampler):
    """Lengths of 1 : 1000, oblique: an error of the slope along the ray must not show across it, in whitened gradients of
    deviation about 1 (it gave 5.7)."""
    n, direction = 400, anisotropy.DIRECTION
    lengths, q = anisotropy.SHAPES["sheet"](1000), anisotropy.ROTATIONS["oblique"]
    whitening = np.diag(1 / np.array(lengths)) @ anisotropy.rotation_matrix(q).T
    far = anisotropy.LENGTHS / np.linalg.norm(whitening @ direction)
    gp = anisotropy.process(sampler, lengths, q, direction * far)
    hits = gn.first_hits(gp, np.zeros((n, 3)), np.tile(direction, (n, 1)), far, sampler=sampler, seed=5)
    _, _, across = anisotropy.whitened(hits, lengths, q, direction)
    assert len(across) > 100 and abs(np.std(across) - 1) < Z_LIMIT / np.sqrt(2 * len(across))
