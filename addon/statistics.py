"""What the last render did, kept for the panel, the operator and the file beside the image."""

import json
import math
from pathlib import Path

# The first line of what this extension writes, after the brace: by it a file is known again.
_MARK = {"written_by": "GPIS"}

# Name of scene -> record of its last render. Plain values, never Blender's.
_last = {}


def record(scene_name, view_layer_name, frame, session, result, plan, warnings):
    """Keep and return the record of a render that is over."""
    height, width = result.passes["combined"].shape[:2]
    entry = _MARK | {
        "scene": scene_name,
        "view_layer": view_layer_name,
        "frame": frame,
        "width": width,
        "height": height,
        "stop": session.stop,
        "history": list(session.history),
        "stats": plain(result.stats),
        "plan": plain(plan),
        "warnings": list(warnings),
    }
    _last[scene_name] = entry
    return entry


def lost(stats):
    """Sentences for what the light of a render lacks: paths and rays that were ended by a limit, samples that were no number."""
    sentences = []
    if count := stats.get("path_length_limit", 0):
        sentences.append(
            f"{count:,} of {stats['camera_paths']:,} paths were ended after 100,000 bounces: their light is missing. "
            "They are caught where no light is lost; set Bounces, or give the material a darker colour"
        )
    if count := stats.get("line_step_limit", 0):
        sentences.append(
            f"{count:,} rays were ended on their way through a stochastic surface, after a million steps: they met nothing. "
            "Give it a longer length scale, or smaller bounds"
        )
    if count := stats.get("nan_samples", 0):
        sentences.append(f"{count:,} samples were no numbers and are left out. Please report the scene")
    return sentences


def last(scene_name):
    return _last.get(scene_name)


def plan_by_owner(scene_name):
    """The plan of the last render, a dict for each object: owner -> name -> sentence. "Scene" owns what has no object."""
    owners = {}
    for key, sentence in (last(scene_name) or {"plan": {}})["plan"].items():
        owner, _, name = key.rpartition(": ")
        owners.setdefault(owner or "Scene", {})[name.removeprefix("scene.")] = str(sentence)
    return owners


def sampler_of(scene_name, object_name):
    """Which sampler the last render took for a GPIS object, and why; empty where it has not met the object."""
    return plan_by_owner(scene_name).get(f'GPIS object "{object_name}"', {}).get("sampler", "")


def forget():
    _last.clear()


def write(entry, path):
    """JSON as strict readers take it, which knows no infinity: what is not known (yet) is null.

    So `estimated_error`, which takes two samples a pixel, is null after one.
    """
    Path(path).parent.mkdir(parents=True, exist_ok=True)  # as Blender does for the image, after the render
    with open(path, "w", encoding="utf-8") as file:
        json.dump(entry, file, indent=1, allow_nan=False)
        file.write("\n")


def free_place(path):
    """Where the statistics of a render go that nobody named a file for: `path`, or beside it what has .gpis in its name
    where `path` is somebody else's file; None where both are."""
    path = Path(path)
    for place in (path, path.with_suffix(".gpis.json")):
        if not place.exists() or _is_ours(place):
            return place
    return None


def _is_ours(path):
    if not path.is_file():
        return False
    beginning = json.dumps(_MARK, indent=1)[:-2].encode()
    with open(path, "rb") as file:
        return file.read(len(beginning)) == beginning


def history_text(history):
    """Error against run time on one line of JSON, for the image's metadata: a row [seconds, samples, estimated_error] each
    round; the error, a relMSE, is null where it is unknown."""
    rows = [[round(row["seconds"], 3), row["samples"], row["estimated_error"]] for row in history]
    return json.dumps(plain(rows), allow_nan=False)


def plain(value):
    """Only what JSON knows: numpy scalars and arrays, tuples and objects' dicts are turned into it, inf and NaN to None."""
    if isinstance(value, dict):
        return {str(key): plain(entry) for key, entry in value.items()}
    if isinstance(value, (list, tuple)):
        return [plain(entry) for entry in value]
    if hasattr(value, "tolist"):
        return plain(value.tolist())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, (str, int, float, bool)) or value is None:
        return value
    return str(value)
