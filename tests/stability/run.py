"""The stability sweep: python tests/stability/run.py [--quick] [--again] [NAME...], or `./dev stability`.

Every cell of every family (or those whose key contains a NAME) runs in a process of its own under a limit on its CPU
seconds and memory, so that one that hangs or grows is a cell that was ended, by name. Results go to
out/stability/results.json cell by cell; cells that are there for the same build are not run again (--again: all are).
At the end the table and the heat maps are written: docs/stability for the whole sweep, out/stability for --quick or a
choice of cells.
"""

import argparse
import hashlib
import json
import os
import resource
import signal
import sys
import time
import traceback
from pathlib import Path

TESTS = Path(__file__).resolve().parents[1]
ROOT = TESTS.parent
sys.path.insert(0, str(TESTS))

import gpis_native as gn  # noqa: E402

from stability import anisotropy, conditions, fields, lengths, levels, memories, rays, scales, starts, transforms  # noqa: E402
from stability.verdicts import ENDED, WRONG, judge  # noqa: E402

FAMILIES = [scales, levels, anisotropy, lengths, conditions, starts, memories, rays, fields, transforms]
CPU_SECONDS, MEMORY = 60, 4 << 30
OUT = ROOT / "out" / "stability"


def all_cells():
    return [cell for family in FAMILIES for cell in family.cells()]


def in_a_process(cell, n):
    """judge() in a child, with what it cost."""
    read, write = os.pipe()
    child = os.fork()
    if child == 0:
        os.close(read)
        resource.setrlimit(resource.RLIMIT_CPU, (CPU_SECONDS, CPU_SECONDS + 1))
        resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
        try:
            row = judge(cell, n)
        except BaseException:
            row = {"status": WRONG, "note": traceback.format_exc(limit=-1).strip().splitlines()[-1]}
        with os.fdopen(write, "w") as out:
            json.dump(row, out)
        os._exit(0)
    os.close(write)
    with os.fdopen(read) as pipe:
        text = pipe.read()
    _, status, used = os.wait4(child, 0)
    row = {"family": cell.family, "row": str(cell.row), "column": str(cell.column)}
    if text:
        row |= json.loads(text)
    else:
        name = signal.Signals(os.WTERMSIG(status)).name if os.WIFSIGNALED(status) else f"exit {os.WEXITSTATUS(status)}"
        limit = f"its limit of {CPU_SECONDS} CPU seconds" if name == "SIGXCPU" else name
        row |= {"status": ENDED, "note": f"ended by {limit}"}
    return row | {"seconds": used.ru_utime + used.ru_stime, "megabytes": used.ru_maxrss / 1024}


def of_this_build():
    """What results depend on: the module and the cells."""
    parts = [Path(gn.__file__)] + sorted(Path(__file__).parent.glob("*.py")) + sorted(TESTS.glob("*.py"))
    digest = hashlib.sha256()
    for part in parts:
        if part.name not in ("run.py", "picture.py", "report.py"):
            digest.update(part.read_bytes())
    return digest.hexdigest()[:16]


def sweep(cells, n, path, again):
    build = of_this_build()
    kept = json.loads(path.read_text()) if path.exists() and not again else {}
    if kept.get("build") != build or kept.get("rays") != n:
        kept = {"build": build, "rays": n, "cells": {}}
    path.parent.mkdir(parents=True, exist_ok=True)
    start = time.monotonic()
    for i, cell in enumerate(cells):
        if cell.key not in kept["cells"]:
            row = kept["cells"][cell.key] = in_a_process(cell, n)
            # A file that is whole or the old one, whenever the sweep is ended.
            fresh = path.with_suffix(".new")
            fresh.write_text(json.dumps(kept, indent=0))
            fresh.replace(path)
            if row["status"] in (WRONG, ENDED):
                print(f"\r{cell.key}: {row['status']}, {detail(row)}" + " " * 20)
        if sys.stdout.isatty():
            print(f"\r{i + 1}/{len(cells)} cells, {time.monotonic() - start:.0f} s ", end="", flush=True)
    return [kept["cells"][cell.key] for cell in cells]


def detail(row):
    if "error" in row:
        limit = f", {row['step_limit']} lines ended by the bound on steps" if row["step_limit"] else ""
        return f"{row['error']:.3g} against {row['against']}, allowed {row['allowed']:.3g}{limit} {row['note']}"
    return row.get("note") or row.get("sentence", "")


def main():
    parser = argparse.ArgumentParser(description="stiff and extreme processes against exact answers")
    parser.add_argument("--quick", action="store_true", help="fewer rays; into out/stability")
    parser.add_argument("--again", action="store_true", help="run cells whose results are there")
    parser.add_argument("--rays", type=int, help="rays of a cell (1000; 200 with --quick)")
    parser.add_argument("names", nargs="*", help="only cells whose key contains one of these")
    asked = parser.parse_args()
    n = asked.rays or (200 if asked.quick else 1000)
    cells = [c for c in all_cells() if not asked.names or any(name in c.key for name in asked.names)]
    if not cells:
        sys.exit(f"no cell's key contains {' or '.join(asked.names)}")
    rows = sweep(cells, n, OUT / ("quick.json" if asked.quick else "results.json"), asked.again)
    whole = not asked.quick and not asked.names
    try:
        from stability.report import write
    except ImportError as missing:
        print(f"no table and no pictures: {missing}")
    else:
        write(rows, n, ROOT / "docs" / "stability" if whole else OUT)
    counts = {}
    for row in rows:
        counts[row["status"]] = counts.get(row["status"], 0) + 1
    print(f"\r{len(rows)} cells: " + ", ".join(f"{v} {k}" for k, v in sorted(counts.items())))
    sys.exit(1 if counts.get(WRONG, 0) + counts.get(ENDED, 0) else 0)


if __name__ == "__main__":
    main()
