"""The benchmarks: python tests/bench/run.py [NAME...] [--quick] [--again] runs those whose name contains a NAME, or all.

A benchmark is a function bench_*() in a file bench_*.py here; one that has parameters `quick` and `again` gets these options:
less of everything, and nothing taken from an earlier run. It measures and returns one row (a dict of column to
number or text) or a list of rows. The table goes to the screen, with the ratios to its last one; out/bench/results.json keeps
the last rows of every benchmark and is written after each. Times are for people to compare on one machine; no test
depends on them.
"""

import importlib.util
import inspect
import json
import os
import platform
import sys
import time
from pathlib import Path

import gpis_native as gn
import results
from error.runner import processor_seconds

HERE = Path(__file__).parent
OUT = HERE.parents[1] / "out" / "bench"


def discover():
    for path in sorted(HERE.glob("bench_*.py")):
        spec = importlib.util.spec_from_file_location(path.stem, path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        for name, function in vars(module).items():
            if name.startswith("bench_") and callable(function):
                yield f"{path.stem.removeprefix('bench_')}.{name.removeprefix('bench_')}", function


def text(value):
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def print_table(rows):
    columns = list(dict.fromkeys(key for row in rows for key in row))
    cells = [columns] + [[text(row.get(column, "")) for column in columns] for row in rows]
    widths = [max(map(len, column)) for column in zip(*cells, strict=True)]
    for line in cells:
        print("  " + "  ".join(cell.rjust(width) for cell, width in zip(line, widths, strict=True)))


def main(arguments):
    options = {a.removeprefix("--"): True for a in arguments if a.startswith("--")}
    if unknown := set(options) - {"quick", "again"}:
        sys.exit(f"there is no option --{min(unknown)}; there are --quick and --again")
    wanted = [a for a in arguments if not a.startswith("--")]
    conditions = {"processor": platform.processor() or platform.machine(), "threads": os.cpu_count(), "build": gn.build_info()}
    conditions["quick"] = "quick" in options
    OUT.mkdir(parents=True, exist_ok=True)
    known, found = results.load(OUT / "results.json"), False
    for name, function in discover():
        if wanted and not any(part in name for part in wanted):
            continue
        print(f"{name} ...", file=sys.stderr, flush=True)
        start, spent = time.perf_counter(), processor_seconds()
        taken = inspect.signature(function).parameters
        rows = function(**{name: on for name, on in options.items() if name in taken})
        rows = [rows] if isinstance(rows, dict) else rows
        print(f"{name} ({time.perf_counter() - start:.1f} s, {processor_seconds() - spent:.1f} s of the processor)", flush=True)
        print_table(rows)
        if beside := results.ratios(rows, known, name, conditions["quick"]):
            print(f"  now / {known['measured'][name]['day']}:")
            print_table(beside)
        known, found = results.kept(known, name, rows, conditions | {"day": time.strftime("%Y-%m-%d %H:%M")}), True
        (OUT / "results.json").write_text(json.dumps(known, indent=1) + "\n")
    if not found:
        sys.exit("there is no such benchmark" if wanted else "there is no benchmark in tests/bench yet")


if __name__ == "__main__":
    main(sys.argv[1:])
