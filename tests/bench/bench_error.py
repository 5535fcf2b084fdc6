"""Error against run time; `./dev bench error` (or `--quick`) writes out/bench/index.html. See tests/bench/error."""

from error.report import write
from error.runner import OUT, run


def bench_error(quick=False, again=False):
    """One row a scene and method; all else is on the page."""
    known = run(quick, again)
    page = OUT.parent / "index.html"
    write(known, page)
    print(f"written: {page}")
    rows = []
    for found in known["scenes"]:
        for row in found["rows"]:
            line = {"scene": found["scene"].name, "method": row["title"]}
            if "found" in row:
                b = row["found"]["bias"]
                line |= {"samples": row["cell"]["samples"][-1], "seconds": row["found"]["seconds"][-1]}
                line["set-up s"] = row["cell"]["setup_seconds"]
                line |= {"relmse": row["found"]["relmse"][-1], "slope": row["found"]["slope"]}
                line |= {"bias %": 100 * b["mean"], "+-": 100 * b["mean_error"], "paths/s": row["cell"]["paths_per_second"]}
            else:
                line["samples"] = row["cell"]["refused"].split(": ")[-1][:40]
            rows.append({k: "" if v is None else v for k, v in line.items()})
    return rows
