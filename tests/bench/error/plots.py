"""The plots of the page, as SVG text; the picture of a scene as PNG."""

import base64
import io

import matplotlib
import numpy as np

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402

COLORS = {
    "default": "#1f5fa8", "convolution": "#1f5fa8", "markov": "#6a51a3", "spectral": "#2a9d6f", "nystrom": "#d1861b",
    "dense": "#444444", "realisation": "#b8336a", "memory_none": "#c0392b", "memory_renewal": "#e08e0b",
    "memory_renewal+": "#1f5fa8", "memory_global-1": "#2a9d6f", "memory_global-3": "#117a65", "memory_global": "#b8336a",
    "microfacet": "#7f8c8d", "published_8": "#c0392b", "published_16": "#000000", "published_32": "#8c6d31",
}  # fmt: skip
STYLE = {
    "font.size": 9, "font.family": "sans-serif", "axes.spines.top": False, "axes.spines.right": False,
    "axes.grid": True, "grid.color": "#e6e6e6", "grid.linewidth": 0.6, "axes.edgecolor": "#888888",
    "svg.fonttype": "none", "legend.frameon": False, "axes.titlesize": 10, "axes.titleweight": "bold",
}  # fmt: skip


def svg(figure, png=None):
    out = io.StringIO()
    if png:
        figure.savefig(png, dpi=110, bbox_inches="tight")
    figure.savefig(out, format="svg", bbox_inches="tight", metadata={"Date": None})
    plt.close(figure)
    return out.getvalue()[out.getvalue().index("<svg") :]


def picture(image):
    """A linear RGB image (H, W, 3), row 0 at the bottom, as a data URI."""
    out = io.BytesIO()
    linear = np.clip(image[::-1], 0, 1)
    encoded = np.where(linear < 0.0031308, 12.92 * linear, 1.055 * linear ** (1 / 2.4) - 0.055)
    plt.imsave(out, encoded, format="png")
    return "data:image/png;base64," + base64.b64encode(out.getvalue()).decode()


def percent(axis):
    axis.set_major_locator(matplotlib.ticker.LogLocator(subs=(1, 2, 5)))
    axis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda v, _: f"{100 * v:g} %"))
    axis.set_minor_formatter(matplotlib.ticker.NullFormatter())


def guide(axes):
    """Slope -1/2 through the middle of what is plotted, drawn faint; at least a factor of ten each way."""
    (x0, x1), (y0, y1) = axes.get_xlim(), axes.get_ylim()
    x0, x1 = min(x0, np.sqrt(x0 * x1 / 10)), max(x1, np.sqrt(x0 * x1 * 10))
    y0, y1 = min(y0, np.sqrt(y0 * y1 / 10)), max(y1, np.sqrt(y0 * y1 * 10))
    middle = np.sqrt(y0 * y1) * np.sqrt(np.sqrt(x0 * x1))
    x = np.array([x0, x1])
    axes.plot(x, middle / np.sqrt(x), color="#bbbbbb", lw=0.8, ls=(0, (5, 4)), zorder=0)
    axes.set_xlim(x0, x1)
    axes.set_ylim(y0, y1)


def error_panel(axes, rows, title):
    """rows: (key, title, evaluation). Seconds are those of set-up and render. Points: error; thin line: the part that is
    variance; dotted: the bias floor; dashed: the paper's method, whose seconds are by the rate of its renderer."""
    for key, label, found in rows:
        color, seconds = COLORS.get(key, "#333333"), found["setup"] + np.array(found["seconds"])
        relmse, spread = np.array(found["relmse"]), np.array(found["relmse_error"])
        shown = relmse > 0
        error = np.sqrt(np.maximum(relmse, 1e-12))
        low = error - np.sqrt(np.maximum(relmse - 2 * spread, relmse * 0.05))
        high = np.sqrt(relmse.clip(0) + 2 * spread) - error
        axes.errorbar(
            seconds[shown], error[shown], yerr=[low[shown], high[shown]], color=color, marker="o", ms=3.5, lw=1.5,
            elinewidth=0.8, label=label, ls="--" if key.startswith("published") else "-",
        )  # fmt: skip
        axes.plot(seconds, np.sqrt(found["variance"]), color=color, lw=0.7, ls="-", alpha=0.5)
        if found["floor"] > 0:
            axes.axhline(np.sqrt(found["floor"]), color=color, lw=0.9, ls=":")
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.set_title(title, loc="left")
    axes.set_xlabel("seconds of one core, set-up and render")
    axes.legend(fontsize=7.5, loc="upper left", bbox_to_anchor=(0, -0.28), ncols=2)
    axes.set_ylabel("relative error, √relMSE")
    percent(axes.yaxis)
    guide(axes)


def bias_panel(axes, rows, title):
    """Bias of the picture's mean with two standard errors, one method a line."""
    for i, (key, _, found) in enumerate(rows):
        b = found["bias"]
        axes.errorbar(
            100 * b["mean"], i, xerr=200 * b["mean_error"], color=COLORS.get(key, "#333333"), marker="o", ms=4, capsize=2
        )
    axes.axvline(0, color="#888888", lw=0.8)
    axes.set_yticks(range(len(rows)), [label for _, label, _ in rows], fontsize=7)
    axes.set_ylim(len(rows) - 0.5, -0.5)
    axes.set_xlabel("bias of the mean, % (± 2 standard errors)")
    axes.set_title(title, loc="left")


def scene_plot(samplers, approximations, png=None):
    """samplers, approximations: lists of (key, title, evaluation); a column for each that is not empty."""
    with plt.rc_context(STYLE):
        panels = 1 + bool(approximations)
        width = 4.4 * panels + 3.3
        figure, axes = plt.subplots(1, panels + 1, figsize=(width, 3.3), width_ratios=[4.4] * panels + [2.4], squeeze=False)
        error_panel(axes[0, 0], samplers, "Error against time")
        if approximations:
            error_panel(axes[0, 1], approximations, "Approximations, against memory global")
        bias_panel(axes[0, -1], samplers + approximations, "Bias")
        figure.tight_layout()
        return svg(figure, png)


def calibration_plot(rows, png=None):
    """rows: (title, samples, ratio, standard error)."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8.2, 3))
        axes.axhspan(0.8, 1.25, color="#dcebdc", lw=0)
        axes.axhline(1, color="#888888", lw=0.8)
        for i, (title, samples, ratio, error) in enumerate(rows):
            shift = 1.025 ** (i - len(rows) / 2)
            axes.errorbar(
                np.array(samples) * shift, ratio, yerr=2 * np.array(error), marker="o", ms=3.5, lw=1, label=title,
                color=f"C{i}" if i < 10 else "black",
            )  # fmt: skip
        axes.set_xscale("log", base=2)
        axes.set_xticks(sorted({n for row in rows for n in row[1]}))
        axes.xaxis.set_major_formatter(matplotlib.ticker.FuncFormatter(lambda v, _: f"{v:g}"))
        axes.set_xlabel("samples per pixel")
        axes.set_ylabel("estimated / true error")
        axes.legend(fontsize=7.5, loc="center left", bbox_to_anchor=(1.01, 0.5))
        return svg(figure, png)


def rates_plot(rows):
    """Bars: the paper's renderer, this one, and what is asked."""
    with plt.rc_context(STYLE):
        figure, axes = plt.subplots(figsize=(8.2, 0.5 * len(rows) + 0.9))
        for i, row in enumerate(rows):
            axes.barh(i - 0.17, row["rate"], 0.32, color="#1f5fa8", label="here" if i == 0 else None)
            if row["paper"]:
                axes.barh(i + 0.17, row["paper"], 0.32, color="#999999", label="paper's renderer" if i == 0 else None)
            axes.plot([row["asked"]] * 2, [i - 0.38, i + 0.38], color="#c0392b", lw=1.5, label="asked" if i == 0 else None)
        axes.set_xscale("log")
        axes.set_yticks(range(len(rows)), [row["name"] for row in rows])
        axes.set_ylim(len(rows) - 0.5, -0.5)
        axes.set_xlabel("samples per second of one core")
        axes.legend(fontsize=7.5, loc="center left", bbox_to_anchor=(1.01, 0.5))
        return svg(figure)
