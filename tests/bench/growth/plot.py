"""The figure: a panel an axis, CPU seconds and evaluations a sample against size, all logarithmic."""

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from error.plots import STYLE  # noqa: E402
from matplotlib.ticker import FixedLocator, FuncFormatter, LogLocator, NullFormatter, NullLocator  # noqa: E402

BLUE, ORANGE = "#1f5fa8", "#d1861b"
PLAIN = FuncFormatter(lambda x, _: f"{x:g}")


def plain_numbers(axis, places=None):
    """1, 2, 5 of every decade, or at these places; no powers."""
    axis.set_major_locator(FixedLocator(places) if places else LogLocator(subs=(1, 2, 5), numticks=30))
    axis.set_minor_locator(NullLocator())
    axis.set_major_formatter(PLAIN)
    axis.set_minor_formatter(NullFormatter())


def at_least_a_decade(axes):
    """So that a constant is seen as one."""
    low, high = axes.get_ylim()
    if high < 10 * low:
        middle = (low * high) ** 0.5
        axes.set_ylim(middle / 10**0.5, middle * 10**0.5)
    plain_numbers(axes.yaxis)


def figure(found, path):
    """found: axis -> (title of the axis, rows, exponent)."""
    with plt.rc_context(STYLE):
        shape, panels = plt.subplots(2, 3, figsize=(12, 6.8), layout="constrained")
        for axes, (name, (title, rows, exponent)) in zip(panels.flat, found.items(), strict=True):
            x = [row["size"] for row in rows]
            axes.loglog(x, [1e6 * row["cpu_s/sample"] for row in rows], "o-", color=BLUE, ms=4)
            axes.set_xlabel(title)
            axes.set_title(f"{name}: exponent {exponent:.2f}")
            if name == "threads":
                axes.loglog(x, [1e6 * row["wall_s/sample"] for row in rows], "^:", color="#444444", ms=4, lw=1)
                axes.annotate(
                    "wall clock", (x[-1], 1e6 * rows[-1]["wall_s/sample"]), (0, -12), textcoords="offset points", ha="right"
                )
            others = axes.twinx()
            others.loglog(x, [row["evaluations/sample"] for row in rows], "s--", color=ORANGE, ms=3, lw=1)
            others.grid(False)
            others.tick_params(axis="y", colors=ORANGE)
            axes.tick_params(axis="y", colors=BLUE)
            plain_numbers(axes.xaxis, x)
            at_least_a_decade(axes)
            at_least_a_decade(others)
        for row in panels:
            row[0].set_ylabel("CPU microseconds a sample", color=BLUE)
            row[-1].annotate(
                "evaluations of a process a sample", (1.16, 0.5), xycoords="axes fraction", rotation=90, va="center", color=ORANGE
            )
        shape.savefig(path, dpi=110)
        plt.close(shape)
