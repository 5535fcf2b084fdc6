"""The page: one .html file that holds all it shows. Every number and every verdict on it is computed from the run."""

import html
import math

from . import plots
from .analysis import PAPER_SECONDS, equal_time, error_after, ratio_at_equal_error, ratio_at_equal_time
from .published import TIMED
from .runner import yardstick

EQUAL_SECONDS, EQUAL_ERROR = (1.0, 10.0), 0.05  # the ratios are those after these seconds, and at 5 % of noise
ASKED_AT_EQUAL_TIME = 300
CALIBRATED = (0.8, 1.25)
STYLE = """
body{font:15px/1.5 system-ui,sans-serif;color:#222;max-width:1160px;margin:2rem auto;padding:0 1.2rem}
h1{font-size:1.7rem;margin-bottom:.2rem}h2{font-size:1.2rem;margin-top:2.4rem;border-bottom:1px solid #ddd;padding-bottom:.2rem}
table{border-collapse:collapse;font-size:13px;margin:.6rem 0}td,th{padding:.2rem .5rem;text-align:right;white-space:nowrap}
th{font-weight:600;border-bottom:1px solid #999;vertical-align:bottom}td:first-child,th:first-child{text-align:left;padding-left:0}
tr:nth-child(even) td{background:#f7f7f7}.note{color:#666;font-size:13px}.bad{color:#b3261e;font-weight:600}.good{color:#1d7a3a}
.head{display:flex;gap:1rem;align-items:center}.head img{width:96px;height:96px;image-rendering:auto;border-radius:4px}
.wide{overflow-x:auto}svg{max-width:100%;height:auto}details{margin:.4rem 0}summary{cursor:pointer;color:#1f5fa8;font-size:13px}
"""

HOW_TO_READ = """<h2>How to read the plots</h2><p>Points are the error with two standard errors over the repeats; the thin line is
the part of it that is variance, a dotted line the floor that the bias leaves. Dashed grey: slope −1/2. An approximation's
reference is memory <i>global</i>, one realisation for the whole path; no other sampler draws that, so it has other seeds only.
A bias floor is named where the squared bias is more than three standard errors from 0. The paper's dense sampler is drawn
dashed: <b>rate measured, picture by our copy of its method</b>. The pictures, hence variance and bias, are those of a small
numpy path tracer that does what the paper's does (tests/bench/error/published.py); the seconds are its paths divided by the
rate at which the paper's renderer was measured on the Lambert sphere, with 16 points a segment every .3125 length scales. That row
is called <i>as timed</i>. The other settings there and all of them on mirrors and in the dilute medium are given the same rate, for
none was measured, though a path costs them more values or fewer, as is said beside the comparison. In the dilute medium the
original sets its points closer where a ray is about to leave the box, which the copy does not: that errs in our favour, by a tenth to
a quarter of the bias.</p>
<p><b>Set-up</b> is seconds of the processor, those of all its threads, until a render can begin: the scene itself, and what its
first render takes beyond the second, which is its tables. (A table of first passages is drawn once for a process, by several
threads; later renders find it.) It is counted wherever methods are compared at equal time or equal error, and in the seconds of the
plots, and weighs more in these small pictures than in one of usual size; <i>none yet</i> is said of a method whose set-up alone
is longer than the seconds asked about. Slopes, paths per second and the seconds of the tables are those of rendering alone. The
set-up of the paper's renderer was not measured: none is counted.</p>"""


def number(value, digits=3):
    if value is None:
        return "–"
    if isinstance(value, float) and math.isinf(value):
        return "never"
    if value != 0 and (abs(value) >= 1e5 or abs(value) < 1e-3):
        return f"{value:.{digits - 1}e}".replace("e-0", "e-").replace("e+0", "e")
    return f"{value:,.{max(0, digits - 1 - int(math.floor(math.log10(abs(value)))))}f}" if value else "0"


def whole(value):
    return "–" if value is None else f"{value:,.0f}"


def table(columns, rows):
    """Rows of text that is already HTML."""
    head = "".join(f"<th>{c}</th>" for c in columns)
    body = "".join("<tr>" + "".join(f"<td>{c}</td>" for c in row) + "</tr>" for row in rows)
    return f'<div class="wide"><table><tr>{head}</tr>{body}</table></div>'


def mark(good, text):
    return f'<span class="{"good" if good else "bad"}">{text}</span>'


def with_error(value, error, scale=1.0, unit=""):
    if value is None:
        return "–"
    digits = max(0, 1 - int(math.floor(math.log10(max(abs(error * scale), 1e-12)))))
    return f"{value * scale:+.{digits}f} ± {error * scale:.{digits}f}{unit}"


# ---- verdicts -------------------------------------------------------------------------------------------------------


def unbiased(row):
    return row["group"] == "sampler"


def slope_verdict(row):
    """True: -1/2 or steeper within two standard errors; None: too few budgets or repeats to tell, or biased."""
    found = row["found"]
    if found["slope"] is None or row["cell"]["repeats"] < 6 or not unbiased(row):
        return None
    return found["slope"] - 2 * found["slope_error"] <= -0.5


def measured(known):
    return [(f["scene"], row) for f in known["scenes"] for row in f["rows"] if "found" in row]


def yardsticks(known):
    begun, ended = number(known["yardstick"]), number(known["yardstick_end"])
    return f"{begun} exponentials per second at the beginning and {ended} at the end"


def not_corrected(known):
    return f"(Not corrected for this machine's speed, yardstick {number(yardstick(known))}.)"


def findings(known):
    lines = []
    verdicts = [(s, r, slope_verdict(r)) for s, r in measured(known)]
    told = [v for v in verdicts if v[2] is not None]
    flat = [f"{s.title} / {r['title']}" for s, r, v in told if not v]
    text = "Error falls with slope −1/2 or steeper (within two standard errors) in "
    text += f"{len(told) - len(flat)} of {len(told)} unbiased cells"
    lines.append(mark(not flat, text + (": not in " + ", ".join(flat) if flat else "") + "."))
    cells = [(s, r, r["found"]["bias"]) for s, r in measured(known) if unbiased(r)]
    # Two-sided at 1 % over all of them.
    limit = math.sqrt(2 * math.log(len(cells) / 0.01)) if cells else 0
    off = [
        f"{s.title} / {r['title']} ({with_error(b['mean'], b['mean_error'], 100, ' %')})"
        for s, r, b in cells
        if abs(b["mean"]) > limit * b["mean_error"]
    ]
    text = f"{len(cells) - len(off)} of {len(cells)} cells that should be unbiased are, to {limit:.1f} standard errors of "
    text += "the picture's mean"
    lines.append(mark(not off, text + (": not " + ", ".join(off) if off else "") + "."))
    wrong, count = [], 0
    for found in known["scenes"]:
        if found["calibration"] and not found["scene"].heavy_tails:
            for samples, ratio, error in zip(*(found["calibration"][k] for k in ("samples", "ratio", "error")), strict=True):
                count += 1
                slack = 2 * error if known["effort"] == "quick" else 0  # of few seeds and pixels
                if not CALIBRATED[0] - slack <= ratio <= CALIBRATED[1] + slack:
                    wrong.append(f"{found['scene'].title} at {samples} samples ({ratio:.2f})")
    within = " (within two standard errors)" if known["effort"] == "quick" else ""
    text = f"Estimated over true error lies in [{CALIBRATED[0]}, {CALIBRATED[1]}]{within} in {count - len(wrong)} of {count} cases"
    lines.append(mark(not wrong, text + (": not for " + ", ".join(wrong) if wrong else "") + "."))
    short = [f"{r['name']} ({r['rate'] / r['asked']:.2f} of it)" for r in known["rates"] if r["rate"] < r["asked"]]
    text = f"The rate that is asked for is reached in {len(known['rates']) - len(short)} of {len(known['rates'])} scenes"
    lines.append(mark(not short, text + (": missed for " + ", ".join(short) if short else "") + "."))
    for found in known["scenes"]:
        for title, points in equal_time(found):
            ratio, seconds = max(((p[0], s) for p, s in zip(points, PAPER_SECONDS, strict=True) if p[2]), default=(0, 0))
            if not seconds:
                lines.append(mark(False, f"{found['scene'].title}: this run measures nothing at equal time with {title}."))
                continue
            text = f"{found['scene'].title}: at equal time relMSE is up to {ratio:,.0f} times lower than {title}, after {seconds:,} s; "
            text += f"{ASKED_AT_EQUAL_TIME} times is asked. {not_corrected(known)}"
            lines.append(mark(ratio >= ASKED_AT_EQUAL_TIME, text))
    if known["missing"]:
        lines.append(mark(False, "Left out, for their files are not beside this checkout: " + ", ".join(known["missing"]) + "."))
    return "<ul>" + "".join(f"<li>{line}</li>" for line in lines) + "</ul>"


# ---- parts of the page ----------------------------------------------------------------------------------------------


def after(found, base, seconds):
    if error_after(found, seconds) is None:
        return "none yet"
    ratio = ratio_at_equal_time(found, base, seconds)
    return "default: none yet" if ratio is None else number(ratio)


def ratios(row, base):
    """At equal time and at equal error; a scene without its default has nothing to compare with."""
    if base is None:
        return ["–"] * (len(EQUAL_SECONDS) + 1)
    at_error = ratio_at_equal_error(row["found"], base, EQUAL_ERROR**2)
    return [after(row["found"], base, s) for s in EQUAL_SECONDS] + [number(at_error)]


def main_table(found):
    base = next((r["found"] for r in found["rows"] if r["key"] == "default" and "found" in r), None)
    columns = ["method", "samples", "paths / s", "set-up, s", "√relMSE", "after s<br>of render", "slope", "bias of<br>mean, %"]
    columns += ["bias floor, √relMSE<br>(bias² × 10⁴)", *(f"relMSE at<br>{s:g} s ÷ default" for s in EQUAL_SECONDS)]
    columns += [f"time to {100 * EQUAL_ERROR:g} %<br>÷ default"]
    refused = [(r["title"], r["cell"]["refused"]) for r in found["rows"] if "found" not in r]
    rows = []
    for row in found["rows"]:
        if "found" not in row:
            continue
        f, cell, verdict = row["found"], row["cell"], slope_verdict(row)
        slope = "–" if f["slope"] is None else f"{f['slope']:.3f} ± {f['slope_error']:.3f}"
        b, squared = f["bias"], f["bias"]["squared"]
        floor = f"{100 * math.sqrt(f['floor']):.2f} %" if f["floor"] else "none seen"
        floor += f' <span class="note">({1e4 * squared:.2f} ± {1e4 * b["squared_error"]:.2f})</span>'
        rows.append(
            [html.escape(row["title"]), f"{cell['samples'][-1]} × {cell['repeats']}", whole(cell["paths_per_second"])]
            + [number(cell["setup_seconds"], 2), f"{100 * math.sqrt(max(f['relmse'][-1], 0)):.2f} %", number(f["seconds"][-1])]
            + [slope if verdict is None else mark(verdict, slope), with_error(b["mean"], b["mean_error"], 100), floor]
            + ratios(row, base)
        )
    references = {}
    for row in found["rows"]:
        if "found" in row:
            what = f"{row['reference']['title']}, {whole(row['reference']['samples'])} samples a pixel"
            references.setdefault(what, []).append(row["title"])
    text = "; ".join(f"{html.escape(what)} (for {html.escape(', '.join(of))})" for what, of in references.items())
    text = f"References: {text}.{''.join(f'<br>{html.escape(t)}: {html.escape(why)}' for t, why in refused)}"
    return f'{table(columns, rows)}<p class="note">{text}</p>'


def counts_table(found):
    rows = [r for r in found["rows"] if "found" in r]
    names = [n for n in rows[0]["cell"]["per_path"] if any(r["cell"]["per_path"][n] for r in rows)] if rows else []
    columns = ["per camera path", *(n.replace("_", " ") for n in names), "memory, MB"]
    body = [
        [html.escape(r["title"]), *(number(r["cell"]["per_path"][n]) for n in names), number(r["cell"]["memory_mb"])] for r in rows
    ]
    return table(columns, body)


def equal_time_text(ratio, error, is_measured):
    if ratio is None:
        return "none yet"
    text = f"{ratio:,.0f} ± {error:,.0f}"
    return mark(ratio >= ASKED_AT_EQUAL_TIME, text) if is_measured else f'<span class="note">({text})</span>'


def values_drawn(row):
    return row["cell"]["per_path"]["line_evaluations"]


def values_text(known, found):
    """What a path costs each of the paper's settings beside what was timed, for all are given that rate."""
    rows = [r for r in found["rows"] if "found" in r and r["group"] == "published"]
    timed = next((values_drawn(r) for s, r in measured(known) if (s.name, r["key"]) == TIMED), None)
    text = "All settings are given the rate of 16 points on the Lambert sphere, the only one that was timed"
    text += ". " if found["scene"].name == TIMED[0] else "; on this scene none was. "
    for row in rows:
        count = values_drawn(row)
        text += f"{html.escape(row['title'])}: {count:.1f} values drawn a path"
        if timed is not None and count != timed:
            less, whose = ("fewer", "our") if count < timed else ("more", "the paper's")
            text += f", {less} than the {timed:.1f} that were timed, so that its rate errs in {whose} favour"
        text += ". "
    return text


def equal_time_table(known, found):
    rows = equal_time(found)
    if not rows:
        return ""
    pixels = next(r["cell"]["size"] for r in found["rows"] if r["key"] == "default") ** 2
    text = "<p>relMSE of the paper's method over that of the default, after the same seconds of one core for this picture of "
    text += f"{pixels} pixels ({ASKED_AT_EQUAL_TIME} is asked); ± what the error of its bias gives. In brackets: extrapolated, for "
    text += "the default's variance is then below what this run can see of its bias, which is taken as none where none is seen. "
    text += "Rate measured, picture by our copy of its method. <b>The paper's rate is that of another machine and day, and no "
    text += f"yardstick was taken there: these ratios follow the speed of this machine (yardstick {yardsticks(known)}) and are not "
    text += f"corrected for it.</b> {values_text(known, found)}</p>"
    body = [[html.escape(title), *(equal_time_text(*point) for point in points)] for title, points in rows]
    return text + table(["after", *(f"{s:,} s" for s in PAPER_SECONDS)], body)


def scene_section(known, found, pictures):
    scene = found["scene"]
    there = [r for r in found["rows"] if "found" in r]
    groups = [[(r["key"], r["title"], r["found"]) for r in there if (r["group"] == "truth") == truth] for truth in (False, True)]
    plot = plots.scene_plot(*groups, pictures / f"{scene.name}.png") if there else ""
    head = f'<div class="head"><img src="{plots.picture(found["picture"])}" alt=""><div><h2>{html.escape(scene.title)}</h2>'
    head += f"<div>{html.escape(scene.what)}</div></div></div>"
    details = f"<details><summary>Operations, memory</summary>{counts_table(found)}</details>"
    return f"{head}{plot}{main_table(found)}{equal_time_table(known, found)}{details}"


def rates_section(known):
    if not known["rates"]:
        return ""
    rows = [
        [html.escape(r["name"]), whole(r["rate"]), whole(r["paper"]), number(r["rate"] / r["paper"]) if r["paper"] else "–"]
        + [whole(r["asked"]), mark(r["rate"] >= r["asked"], f"{r['rate'] / r['asked']:.2f}")]
        for r in known["rates"]
    ]
    text = "<h2>Rates beside the paper's renderer</h2><p class=note>Camera paths over the full frame of 128 × 128 pixels, per second "
    text += "of one core, misses included; best of several. The paper's renderer was measured on another day (baseline.json).</p>"
    text += plots.rates_plot(known["rates"])
    text += table(["scene", "here", "paper's", "ratio", "asked", "of what is asked"], rows)
    profile = known["profile"]
    if profile:
        full = profile["known"]["full_realisation_extrapolated_to_step_0"]
        body = []
        for i, (name, (mean, error)) in enumerate(zip(profile["bins"], profile["ours"], strict=True)):
            paper, paper_error = profile["known"]["renewal+"][i], profile["known"]["renewal+_standard_error"][i]
            z = (mean - paper) / math.hypot(error, paper_error)
            pair = [f"{mean:.4f} ± {error:.4f}", f"{paper:.4f} ± {paper_error:.4f}"]
            body.append([html.escape(name), *pair, f"{z:+.1f}", number(full[i], 4)])
        text += "<p>Mean radiance of the standard sphere (Lambert .8, white sky) by impact parameter.</p>"
        text += table(["b", "here, Renewal+", "paper's Renewal+", "z", "whole realisations, step → 0"], body)
    return text


def calibration_section(known, pictures):
    rows = [
        (f["scene"].title + ", not judged" * f["scene"].heavy_tails, *(f["calibration"][k] for k in ("samples", "ratio", "error")))
        for f in known["scenes"]
        if f["calibration"]
    ]
    if not rows:
        return ""
    repeats = max(r["cell"]["repeats"] for f in known["scenes"] for r in f["rows"] if r["key"] == "default" and "found" in r)
    text = f"<h2>Is the estimated error the error?</h2><p class=note>Mean over {repeats} seeds of the film's estimated relMSE, divided "
    text += "by the true one against the reference, with two standard errors. Green: what is asked, where a "
    text += "sample has a finite kurtosis.</p>" + plots.calibration_plot(rows, pictures / "calibration.png")
    columns = sorted({n for row in rows for n in row[1]})
    body = []
    for title, samples, ratio, error in rows:
        at = {n: f"{r:.2f} ± {e:.2f}" for n, r, e in zip(samples, ratio, error, strict=True)}
        body.append([html.escape(title), *(at.get(n, "") for n in columns)])
    return text + table(["scene", *(f"{n} samples" for n in columns)], body)


def comparison_section(known):
    last = known["previous"]
    if not last:
        return "<h2>Beside the last run</h2><p class=note>There is no earlier run to compare with.</p>"
    machine = yardstick(known) / last["yardstick"]
    rows = []
    for scene, row in measured(known):
        before = last["cells"].get(f"{scene.name}.{row['key']}")
        if before:
            faster = row["cell"]["paths_per_second"] / before["rate"] / machine
            better = before["cost"] / row["found"]["cost"] / machine
            rows.append([f"{html.escape(scene.title)} / {html.escape(row['title'])}", f"{faster:.2f}", f"{better:.2f}"])
    text = f"<h2>Beside the last run</h2><p class=note>{last['begun']}, module {last['module']}; yardstick now / then: "
    text += f"{machine:.2f}, taken out of the ratios. More than 1 is better.</p>"
    return text + table(["cell", "paths per second", "1 / (variance × seconds)"], rows)


def left_out_section(known):
    if known["effort"] != "quick":
        return ""
    return (
        "<p><b>A quick run leaves out</b> the memory models, whole paths on one realisation and the mean surfaces (their "
        "references are slow), and has pictures of 16 × 16 pixels (4 × 4 of slow scenes), at most 32 samples a pixel, 12 seeds for "
        "the default and 3 for others, where a full run has 24 × 24, 128, 30 and 6. Every reference still has 100 times the "
        "samples. It tells a sampler that has become slow or wrong by several per cent, not a bias of some thousandths.</p>"
    )


def write(known, path):
    """The page, and beside it `pictures`: its plots as .png, for the docs."""
    pictures = path.parent / "pictures"
    pictures.mkdir(parents=True, exist_ok=True)
    style = f"<style>{STYLE}</style>"
    text = f'<!doctype html><html lang="en"><meta charset="utf-8"><title>GPIS: error against run time</title>{style}'
    text += "<h1>Error against run time</h1>"
    text += f"<p class=note>{known['effort']} run of {known['begun']}, module {known['module']}; {html.escape(known['processor'])}, "
    text += f"{known['threads']} threads, yardstick {yardsticks(known)}. Seconds are those of "
    text += "one core. Error is relMSE, mean of (pixel − reference)² / (reference² + .01) on luminance, the reference's own "
    least = min(r["reference"]["samples"] / r["cell"]["samples"][-1] for _, r in measured(known)) if measured(known) else 0
    text += f"noise taken off. References have at least {least:.0f} times the samples, of another sampler where there is one.</p>"
    text += left_out_section(known) + "<h2>What is found</h2>" + findings(known)
    text += rates_section(known) + calibration_section(known, pictures)
    text += "".join(scene_section(known, found, pictures) for found in known["scenes"])
    text += HOW_TO_READ
    text += comparison_section(known) + "</html>\n"
    path.write_text(text)
