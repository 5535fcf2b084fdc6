"""What is compared on a scene: samplers of the same law, memory models, the mean surface with a rough micro-BRDF, and a copy of
the paper's dense sampler with the paper's settings."""

from dataclasses import dataclass

from . import published

SAMPLERS = ("convolution", "markov", "spectral", "nystrom", "dense", "realisation")
MEMORIES = ("none", "renewal", "renewal+", "global-1", "global-3", "global")
DEFAULT_MEMORY = "renewal+"


@dataclass(frozen=True)
class Method:
    key: str
    title: str
    # "sampler": the law of Renewal+; "published": an approximation of it, no render of ours (published.py); "truth": an
    # approximation, measured against memory global.
    group: str
    sampler: str = "auto"
    memory: str = DEFAULT_MEMORY
    microfacet: bool = False

    def describe(self, scene, folder):
        if self.microfacet:
            return scene.microfacet(folder)
        return scene.make(self.sampler, self.memory, folder)


def default(scene):
    return Method("default", "default", "sampler")  # by which samplers, its cell says


def drawn_by(plan):
    """The samplers that the plan of a scene names, each once. Of an object that certain operands cut it is the one of that cut:
    those of its leaves serve only the few rays that see the object twice."""
    names, cut = [], set()
    for row, text in plan.items():
        thing, _, what = row.split(" of ")[0].partition(".")
        if what == "cut":  # stands before the rows of the leaves
            cut.add(thing)
            text = text.split(" by ", 1)[1]
        elif not what.endswith("sampler") or thing in cut:
            continue
        names.append(text.split(":")[0])
    return [name for name in dict.fromkeys(names) if name != "none"]


def published_title(scene, key):
    return published.SETTINGS[key][0] + " (as timed)" * ((scene.name, key) == published.TIMED)


def methods_of(scene):
    methods = [default(scene)]
    if scene.methods:
        methods += [Method(s, s, "sampler", sampler=s) for s in SAMPLERS if s != scene.default]
    if scene.name in published.SCENES:
        methods += [Method(key, published_title(scene, key), "published") for key in published.SETTINGS]
    if scene.memories:
        methods += [Method(f"memory_{m}", f"memory {m}", "truth", memory=m) for m in MEMORIES]
    if scene.microfacet:
        methods.append(Method("microfacet", "mean surface (mirrors: GGX)", "truth", microfacet=True))
    return methods


def reference_of(scene, method):
    """The method that the reference is made with: another sampler of the same law; for approximations the law that they
    approximate, one realisation for the whole path. That one has no other sampler: other seeds."""
    if method.group == "truth":
        return Method("truth", "memory global", "truth", memory="global")
    if method.sampler == scene.other and scene.other:
        return Method(f"by_{scene.default}", scene.default, "sampler", sampler=scene.default)
    return Method(f"by_{scene.other}", scene.other or "the only way", "sampler", sampler=scene.other or "auto")
