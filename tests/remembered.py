"""What rays remember: the state of a result of gn.first_hits, as the start of the next rays."""

import numpy as np


def take(state, rows):
    """The state of some rows of a first_hits result, of a process or of a tree."""
    out = {key: value[rows] for key, value in state.items() if key in ("value", "gradient")}
    if "realisation" in state:
        out["realisation"] = {key: value[rows] for key, value in state["realisation"].items()}
    if "segments" in state:
        kept = state["segments"]
        leaves = 1 if state["value"].ndim == 1 else state["value"].shape[1]
        row, leaf = np.divmod(kept["row"], leaves)
        number = np.full(len(state["value"]), -1)
        number[rows] = np.arange(len(np.flatnonzero(rows) if rows.dtype == bool else rows))
        chosen = number[row] >= 0
        out["segments"] = {key: value[chosen] for key, value in kept.items()}
        out["segments"]["row"] = number[row[chosen]] * leaves + leaf[chosen]
    return out
