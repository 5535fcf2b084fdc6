"""The table and the heat maps of a sweep. matplotlib is a tool of `./dev stability` alone."""

import math
from pathlib import Path

import matplotlib

matplotlib.use("Agg")
import matplotlib.pyplot as plt  # noqa: E402
from matplotlib.colors import LinearSegmentedColormap, Normalize  # noqa: E402
from PIL import Image  # noqa: E402

from stability.verdicts import ENDED, REFUSED, RIGHT, WRONG  # noqa: E402

# How much of what is allowed the error takes: from none to all of it.
COLORS = LinearSegmentedColormap.from_list("share", ["#f3f7f4", "#8fc3a4", "#2c7a5a"])
REFUSAL, FAILURE = "#b9bdc9", "#c8372d"
ROWS_A_PICTURE = 46


def write(rows, rays, directory):
    directory = Path(directory)
    directory.mkdir(parents=True, exist_ok=True)
    families = {}
    for row in rows:
        families.setdefault(row["family"], []).append(row)
    for old in directory.glob("*.png"):
        old.unlink()
    for number, (family, cells) in enumerate(families.items(), 1):
        picture(family, cells, directory / f"{number:02}.png")
    table(families, rays, directory / "table.md")


def order(values):
    return list(dict.fromkeys(values))


def short(number):
    if number == 0:
        return "0"
    return f"{number:.1e}".replace("e-0", "e-").replace("e+0", "e") if number < 1e-3 or number >= 1e4 else f"{number:.2g}"


def picture(family, cells, path):
    rows, columns = order(c["row"] for c in cells), order(c["column"] for c in cells)
    if len(rows) > ROWS_A_PICTURE:  # wrapped into two pictures side by side
        half = (len(rows) + 1) // 2
        parts = [rows[:half], rows[half:]]
    else:
        parts = [rows]
    height = max(len(p) for p in parts)
    label = max(len(r) for r in rows)
    width = len(parts) * (0.075 * label + 0.62 * len(columns) + 0.3)
    figure, axes = plt.subplots(
        1, len(parts), figsize=(max(width, 6.4), 0.26 * height + 1.25), squeeze=False, layout="constrained"
    )
    at = {(c["row"], c["column"]): c for c in cells}
    for axis, part in zip(axes[0], parts, strict=True):
        for y, row in enumerate(part):
            for x, column in enumerate(columns):
                if (row, column) in at:
                    square(axis, x, y, at[row, column])
        axis.set_xlim(-0.5, len(columns) - 0.5)
        axis.set_ylim(len(part) - 0.5, -0.5)
        slanted = max(len(c) for c in columns) > 7
        axis.set_xticks(
            range(len(columns)), columns, fontsize=8, rotation=40 if slanted else 0, ha="right" if slanted else "center"
        )
        axis.set_yticks(range(len(part)), part, fontsize=8)
        axis.tick_params(length=0)
        for side in axis.spines.values():
            side.set_visible(False)
    worst = max((c["error"] / c["allowed"] for c in cells if c.get("error") is not None and c.get("allowed")), default=0)
    counts = {s: sum(c["status"] == s for c in cells) for s in (RIGHT, REFUSED, WRONG, ENDED)}
    said = ", ".join(f"{n} {s}" for s, n in counts.items() if n)
    figure.suptitle(f"{family}\n{said}; largest error {worst:.2f} of what is allowed", fontsize=10)
    figure.savefig(path, dpi=90)
    plt.close(figure)
    with Image.open(path) as drawn:  # a third of the size, for the repository
        drawn.convert("RGB").quantize(48).save(path, optimize=True)


def square(axis, x, y, cell):
    status = cell["status"]
    if status in (RIGHT, WRONG) and cell.get("allowed"):
        share = cell["error"] / cell["allowed"]
        color = COLORS(Normalize(0, 1, clip=True)(share)) if status == RIGHT else FAILURE
        text, ink = short(cell["error"]) if math.isfinite(cell["error"]) else "∞", "white" if share > 0.6 else "#24443a"
    else:
        color, text, ink = (REFUSAL, "refused", "#333") if status == REFUSED else (FAILURE, status, "white")
    axis.add_patch(plt.Rectangle((x - 0.48, y - 0.45), 0.96, 0.9, color=color, lw=0))
    axis.text(x, y, text, ha="center", va="center", fontsize=6.5, color=ink)


COLUMNS = ["error", "allowed", "condition", "clamps", "fallbacks", "evaluations", "CPU s", "against"]


def table(families, rays, path):
    lines = [
        "# The cells of the stability sweep",
        "",
        f"Written by `./dev stability`; {rays} rays a cell, fewer of slow samplers. What the columns mean: `../stability.md`.",
    ]
    for number, (family, cells) in enumerate(families.items(), 1):
        lines += ["", f"## {number:02}. {family}", "", "| cell | verdict | " + " | ".join(COLUMNS) + " |"]
        lines += ["|---" * (len(COLUMNS) + 2) + "|"]
        for c in cells:
            name = f"{c['row']}; {c['column']}"
            if c.get("error") is None:
                text = (c.get("sentence") or c.get("note", "")).replace("|", "\\|").replace("\n", " ")
                lines.append(f"| {name} | {c['status']} |  |  |  |  |  |  | {c['seconds']:.2f} | {text} |")
                continue
            condition = f"{c['condition']:.0e}" if c["condition"] else ""
            numbers = [short(c["error"]) if math.isfinite(c["error"]) else "∞", short(c["allowed"]), condition]
            numbers += [str(c[k]) for k in ("clamps", "fallbacks", "evaluations")] + [f"{c['seconds']:.2f}"]
            lines.append(f"| {name} | {c['status']} | " + " | ".join(numbers) + f" | {c['against']} {c['note']} |")
    path.write_text("\n".join(lines) + "\n")
