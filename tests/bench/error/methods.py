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
    title = f"default ({scene.default})" if scene.default else "default"
    return Method("default", title, "sampler")


def methods_of(scene):
    methods = [default(scene)]
    if scene.methods:
        methods += [Method(s, s, "sampler", sampler=s) for s in SAMPLERS if s != scene.default]
    if scene.name in published.SCENES:
        methods += [Method(key, title, "published") for key, (title, _) in published.SETTINGS.items()]
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
