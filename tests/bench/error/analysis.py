"""Numbers of a cell against its reference. Errors are relMSE as the film defines it: mean over pixels of squared
difference / (mean² + .01), on luminance."""

import numpy as np

PAPER_SECONDS = (1, 10, 100, 1000, 10000)  # of one core, at which the paper's method is compared


def weights(reference):
    return 1 / (reference**2 + 0.01)


def errors(images, reference, reference_variance):
    """relMSE (repeats, budgets), the reference's own noise taken off."""
    w = weights(reference)
    return np.mean(w * (images - reference) ** 2, axis=(2, 3)) - np.mean(w * reference_variance)


def variance(images, reference):
    """The part of relMSE that is variance, by the spread of the repeats: (budgets,)."""
    return np.mean(weights(reference) * images.var(axis=0, ddof=1), axis=(1, 2))


def bias(images, reference, reference_variance):
    """Squared bias in relMSE and its standard error (unbiased: may be negative), and the bias of the mean over the
    picture, relative to it, with its standard error; from the largest budget."""
    last = images[:, -1]
    difference = last.mean(axis=0) - reference
    noise = last.var(axis=0, ddof=1) / len(last) + reference_variance
    w, pixels = weights(reference), reference.size
    squared = difference**2 - noise
    # The noise is itself estimated, from len(last) - 1 degrees of freedom.
    spread = 2 * noise**2 * (1 + 1 / (len(last) - 1)) + 4 * noise * np.maximum(squared, 0)
    mean = reference.mean()
    return {
        "squared": float(np.mean(w * squared)),
        "squared_error": float(np.sqrt(np.sum(w**2 * spread)) / pixels),
        "mean": float(difference.mean() / mean),
        "mean_error": float(np.sqrt(noise.sum()) / pixels / mean),
    }


def slope(seconds, relmse):
    """Slope of log √relMSE over log seconds, and its standard error by leaving out one repeat at a time."""

    def fit(rows):
        e = relmse[rows].mean(axis=0)
        if np.any(e <= 0):
            return np.nan
        return np.polyfit(np.log(seconds[rows].mean(axis=0)), 0.5 * np.log(e), 1)[0]

    n = len(relmse)
    if relmse.shape[1] < 2:
        return None, None
    parts = [fit(np.arange(n) != k) for k in range(n)]
    return float(fit(np.arange(n))), float(np.sqrt((n - 1) / n * np.sum((parts - np.mean(parts)) ** 2)))


def evaluate(cell, images, reference, reference_variance):
    """All numbers of one cell that the report shows."""
    seconds = np.array(cell["seconds"])
    relmse = errors(images, reference, reference_variance)
    found = {
        "seconds": seconds.mean(axis=0).tolist(),  # of rendering alone: slope and cost are of these
        "setup": cell["setup_seconds"] or 0.0,  # unknown for the paper's renderer: none is counted
        "relmse": relmse.mean(axis=0).tolist(),
        "relmse_error": (relmse.std(axis=0, ddof=1) / np.sqrt(len(relmse))).tolist(),
        "variance": variance(images, reference).tolist(),
        "bias": bias(images, reference, reference_variance),
    }
    found["slope"], found["slope_error"] = slope(seconds, relmse)
    # Variance times seconds: with the bias, the whole curve.
    found["cost"] = float(np.exp(np.mean(np.log(np.maximum(found["variance"], 1e-300)) + np.log(found["seconds"]))))
    b = found["bias"]
    found["floor"] = max(b["squared"], 0.0) if b["squared"] > 3 * b["squared_error"] else 0.0
    return found


def error_after(found, seconds):
    """relMSE after so many seconds of the processor, set-up among them; None while that goes on: there is no pixel yet."""
    rendering = seconds - found.get("setup", 0.0)
    return found["floor"] + found["cost"] / rendering if rendering > 0 else None


def ratio_at_equal_time(method, default, seconds):
    """relMSE of the method over that of the default after the same seconds; None where one of them has no pixel yet."""
    theirs, ours = error_after(method, seconds), error_after(default, seconds)
    return None if theirs is None or ours is None else theirs / ours


def equal_time(found):
    """Of each of the paper's settings: title, and at PAPER_SECONDS its relMSE over the default's, the standard error that its
    squared bias gives that (both None where there is no pixel yet), and whether it is measured: where the default's variance is
    below the error of its own squared bias, the ratio rests on its having none. The paper's squared bias is taken as measured,
    not only where it is certain."""
    base = next((r["found"] for r in found["rows"] if r["key"] == "default" and "found" in r), None)
    rows = []
    for row in found["rows"]:
        if row["group"] != "published" or "found" not in row or base is None:
            continue
        b = row["found"]["bias"]
        taken = row["found"] | {"floor": max(b["squared"], 0.0)}
        points = []
        for seconds in PAPER_SECONDS:
            ours, ratio = error_after(base, seconds), ratio_at_equal_time(taken, base, seconds)
            if ratio is None:
                points.append((None, None, False))
            else:
                points.append((ratio, b["squared_error"] / ours, ours >= base["bias"]["squared_error"]))
        rows.append((row["title"], points))
    return rows


def seconds_to(found, relmse):
    """Seconds to reach an error, set-up among them; infinite below the floor of the bias."""
    return found.get("setup", 0.0) + found["cost"] / (relmse - found["floor"]) if relmse > found["floor"] else np.inf


def ratio_at_equal_error(method, default, relmse):
    """Seconds to reach an error, over those of the default; None where the default never does."""
    ours = seconds_to(default, relmse)
    return seconds_to(method, relmse) / ours if np.isfinite(ours) else None


def calibration(cell, images, reference, reference_variance):
    """Mean over the repeats of estimated over true error, with its standard error, per budget."""
    ratio = np.array(cell["estimated_error"]) / errors(images, reference, reference_variance)
    return ratio.mean(axis=0), ratio.std(axis=0, ddof=1) / np.sqrt(len(ratio))
