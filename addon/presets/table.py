"""What the presets hold: settings of a GPIS object whose surface is 1 m long, and a micro-BRDF.

Names are those of the properties; what is not given stands at its default.
"""

from dataclasses import dataclass

# Settings that grow with the object.
LENGTHS = ("sigma", "length_scale", "period")


@dataclass(frozen=True)
class Preset:
    label: str
    description: str
    settings: dict
    color: tuple
    metallic: float = 0.0
    roughness: float = 1.0  # of the micro-BRDF; 1 without metallic is Lambert
    ior: float | None = None  # of glass


def _settings(sigma, length_scale, kernel="SQUARED_EXPONENTIAL", **others):
    return {"sigma": sigma, "length_scale": length_scale, "kernel": kernel, **others}


PRESETS = {
    "BRUSHED_METAL": Preset(
        "Brushed Metal",
        "Fine grooves along x: highlights spread across them",
        _settings(0.0006, 0.003, anisotropy="AXES", ratios=(40.0, 1.0, 1.0)),
        (0.78, 0.77, 0.75),
        1.0,
        0.12,
    ),
    "ROUGH_GOLD": Preset(
        "Rough Gold", "Dents in a mirror: a wide, warm highlight", _settings(0.008, 0.06), (0.95, 0.62, 0.22), 1.0, 0.08
    ),
    "SATIN_STEEL": Preset(
        "Satin Steel",
        "Dents too fine to see: a soft, wide highlight",
        _settings(0.0012, 0.006),
        (0.62, 0.64, 0.67),
        1.0,
        0.1,
    ),
    "GROOVED_COPPER": Preset(
        "Grooved Copper",
        "Rings around z, as from a lathe: highlights spread along z",
        _settings(0.006, 0.25, "LOCALLY_PERIODIC", period=0.085, periodic_scale=1.2),
        (0.93, 0.45, 0.28),
        1.0,
        0.12,
    ),
    "FROSTED_GLASS": Preset(
        "Frosted Glass",
        "Etched all over: light passes and blurs",
        _settings(0.002, 0.012),
        (0.95, 0.98, 0.97),
        roughness=0.0,
        ior=1.5,
    ),
    "CHALK": Preset("Chalk", "Dry and powdery", _settings(0.003, 0.008, "MATERN_3_2"), (0.86, 0.85, 0.82)),
    "STONE": Preset("Stone", "Worn and pitted", _settings(0.014, 0.06, "MATERN_3_2"), (0.36, 0.33, 0.29)),
    "RUST": Preset(
        "Rust",
        "Blisters and flakes of many sizes",
        _settings(0.012, 0.03, "RATIONAL_QUADRATIC", alpha=0.4),
        (0.36, 0.11, 0.035),
    ),
    "MOSS": Preset("Moss", "A soft rough cushion", _settings(0.03, 0.022, "MATERN_5_2"), (0.15, 0.30, 0.045)),
    "FUR": Preset(
        "Fur",
        "Strands that stand along z",
        _settings(0.03, 0.007, anisotropy="AXES", ratios=(1.0, 1.0, 12.0)),
        (0.34, 0.19, 0.085),
    ),
    "FELT": Preset("Felt", "A dense fuzz of short fibres", _settings(0.012, 0.006, "WONG"), (0.48, 0.035, 0.05)),
    "FOAM": Preset(
        "Foam",
        "Bubbles, holes and droplets of many sizes",
        _settings(0.05, 0.03, "RATIONAL_QUADRATIC", alpha=0.6),
        (0.9, 0.9, 0.88),
    ),
    "CORAL": Preset("Coral", "Branches and caves", _settings(0.045, 0.03), (0.82, 0.28, 0.2)),
    "MIST": Preset(
        "Mist", "Nearly a volume: light enters it deeply", _settings(0.06, 0.008, memory="RENEWAL"), (0.92, 0.93, 0.95)
    ),
}
