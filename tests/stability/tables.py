"""Makes tables.json, the numbers in many digits that cells are compared with: `python tests/stability/tables.py`, with
mpmath installed (a tool of this script alone). Only definitions are used: Gram matrices, κ and its derivatives, Φ."""

import json
from pathlib import Path

from mpmath import diff, erfc, exp, log, matrix, mp, mpf, pi, sin, sqrt, workdps

mp.dps = 120
GRAM_DIGITS = 2400  # determinants of 30 points at a hundredth of a length scale are below 1e-1700; the pivots of 200 above 1e-500
SPACINGS = ["1", "0.3", "0.1", "0.03", "0.01", "0.001", "0.0001", "1e-06", "0"]
DISTANCES = ["1e-08", "1e-07", "1e-06", "1e-05", "0.0001", "0.001", "0.01", "0.1", "1"]
LEVELS = [-40, -30, -20, -10, -5, -2, 0, 2, 10, 20]


def se(q):
    return exp(-q * q / 2)


def matern32(q):
    return (1 + sqrt(3) * q) * exp(-sqrt(3) * q)


def matern52(q):
    return (1 + sqrt(5) * q + 5 * q * q / 3) * exp(-sqrt(5) * q)


def rational_quadratic(q):
    alpha = mpf("0.7")
    return (1 + q * q / (2 * alpha)) ** -alpha


def wong(q):
    return mpf(3) / 2 * exp(-q / sqrt(3)) - exp(-sqrt(3) * q) / 2


def locally_periodic(q):
    """Along x, as tests/line_samplers.py has it: axis (.6, .8, 0), period 2.5, periodic scale 1.2, length 1.5."""
    return exp(-2 * sin(pi * mpf("0.6") * q / mpf("2.5")) ** 2 / mpf("1.2") ** 2) * se(q / mpf("1.5"))


def rough_sum(q):
    return mpf("0.6") * se(q) + mpf("0.4") * matern32(q)


def rough_terms(q):
    return matern32(q) / 2 + mpf("0.3") * matern52(q / mpf("0.6")) + mpf("0.2") * wong(q / mpf("0.8"))


KERNELS = {
    "squared exponential": se,
    "matern 3/2": matern32,
    "matern 5/2": matern52,
    "rational quadratic": rational_quadratic,
}
LINES = KERNELS | {"wong": wong, "locally periodic": locally_periodic}
LINES |= {"sum with a rough term": rough_sum, "sum of rough terms": rough_terms}
# -κ''(0) where κ is not analytic at 0.
CURVATURES = {
    matern32: mpf(3),
    matern52: mpf(5) / 3,
    wong: mpf(1),
    rough_sum: mpf("0.6") + mpf("0.4") * 3,
    rough_terms: mpf(3) / 2 + mpf("0.3") * 5 / 3 / mpf("0.6") ** 2 + mpf("0.2") / mpf("0.8") ** 2,
}


@workdps(GRAM_DIGITS)
def posterior(kernel, spacing, count):
    """The deviation that exact values leave, and values with a noise of 1e-4 deviations. Points in one place are one."""
    x = [mpf(float(spacing)) * i for i in range(count)]
    if spacing == "0":
        x = x[:1]
    last = x[-1]
    probes = [float(p) for p in (last / 2, last * mpf("0.37"), last + mpf("0.25"), last + 1, mpf("-0.5"))]
    out = {"x": probes}
    for name, noise in (("deviation", mpf(0)), ("deviation_of_noisy", mpf("1e-8"))):
        lags = [kernel(a) for a in x]
        gram = matrix(len(x))
        for i in range(len(x)):
            for j in range(len(x)):
                gram[i, j] = lags[abs(i - j)] + (noise if i == j else 0)
        factors, order = mp.LU_decomp(gram)
        out[name] = []
        for p in probes:
            k = matrix([kernel(abs(mpf(p) - a)) for a in x])
            left = 1 - (k.T * mp.U_solve(factors, mp.L_solve(factors, k, order)))[0]
            out[name].append(float(sqrt(left)) if left > 0 else 0.0)
    return out


def start(kernel, q):
    """Given g = 0, g' = 1 at the start; one-sided derivatives, the kernel's branch for q > 0 is analytic."""
    q = mpf(float(q))
    curvature = CURVATURES.get(kernel) or -diff(kernel, mpf(0), 2, direction=1)
    slope = diff(kernel, q)
    return {
        "mean": float(-slope / curvature),
        "deviation": float(sqrt(1 - kernel(q) ** 2 - slope**2 / curvature)),
    }


def upper(z):
    return erfc(z / sqrt(mpf(2))) / 2


def tail(level):
    """P(f > x | f > 0), f ~ N(level, 1), on points that follow the tail."""
    scale = 1 / mpf(max(1, -level)) if level < 0 else mpf(max(1, level))
    top = 12 if level < 0 else (level + 8) / scale
    x = [scale * top * i / 200 for i in range(201)]
    return {"x": [float(v) for v in x], "above": [float(upper(mpf(float(v)) - level) / upper(mpf(-level))) for v in x]}


def means(a):
    """E[Z - a | Z > a], and of the density ∝ z₊ N(z; -a, 1) the mean."""
    density, above = exp(-a * a / 2) / sqrt(2 * pi), upper(a)
    return density / above - a, ((1 + a * a) * above - a * density) / (density - a * above)


def main():
    out = {
        "posterior": {
            f"{name}, {count}, {spacing}": posterior(kernel, spacing, count)
            for name, kernel in KERNELS.items()
            for count in (2, 12, 30, 200)
            for spacing in (SPACINGS if count < 30 else ["0.01"])
        },
        "start": {f"{name}, {q}": start(kernel, q) for name, kernel in LINES.items() for q in DISTANCES},
        "tail": {str(level): tail(level) for level in LEVELS},
        # In tests/native/test_random.cpp.
        "log_normal_tail": [[a, str(log(upper(mpf(a))))[:22]] for a in (-8.0, 0.0, 8.0, 29.5, 30.0, 35.0, 40.0, 1e4)],
        "means": {str(a): [str(v)[:22] for v in means(mpf(a))] for a in (-8, -1, 0, 1, 8, 40, 1000)},
    }
    (Path(__file__).parent / "tables.json").write_text(json.dumps(out) + "\n")


if __name__ == "__main__":
    main()
