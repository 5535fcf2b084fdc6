"""out/bench/results.json: the last rows of every benchmark, whichever call measured them, and how the new ones compare."""

import json

NOTHING = {"benchmarks": {}, "measured": {}}


def load(path):
    """What is there; a file of before `measured` was kept has no conditions to compare under, and one cut short nothing."""
    try:
        known = json.loads(path.read_text())
    except (FileNotFoundError, json.JSONDecodeError):
        return NOTHING
    return NOTHING | known


def kept(known, name, rows, conditions):
    """`known` with the rows of one benchmark replaced, and under which conditions (machine, build, day, quick) they are."""
    return {
        "benchmarks": known["benchmarks"] | {name: rows},
        "measured": known["measured"] | {name: conditions},
    }


def identity(row):
    """What a row is of: its texts and whole numbers; what was measured are its fractions."""
    return tuple((column, value) for column, value in row.items() if not isinstance(value, float))


def ratios(rows, known, name, quick):
    """Rows of the texts and, for every fraction, now / then; only rows that were there, of a call with the same `quick`."""
    if known["measured"].get(name, {}).get("quick") != quick:
        return []
    before = {identity(row): row for row in known["benchmarks"][name]}
    found = []
    for row in rows:
        then = before.get(identity(row), {})
        changed = {column: value / then[column] for column, value in row.items() if isinstance(value, float) and then.get(column)}
        if changed:
            found.append({column: value for column, value in row.items() if isinstance(value, str)} | changed)
    return found
