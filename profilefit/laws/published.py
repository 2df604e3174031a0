"""Constants as their authors printed them, each with its source. They are never edited: a defended correction is a
set of its own beside them.
"""

from __future__ import annotations

from dataclasses import dataclass

from mcml_sim.setting import Setting

SEARCHLIGHT = Setting()
LIANG = "Liang et al., a subsurface scattering method from an accurate fit of the reflectance profile, J. of Software"


@dataclass(frozen=True)
class Published:
    """One set of constants: whose law, under what light, from where."""

    law: str
    name: str
    setting: Setting
    constants: dict[str, float]
    source: str


_LIANG_PRINTED = {
    **{"a1": -0.0064, "a2": 0.00316, "a3": 30.0},  # (9)-(11)
    **{"b0": 0.461, "b1": 6.7, "b2": 0.45, "b3": 2.6, "b4": 1.3},  # (12)-(13)
    **{"c1": 0.0097, "c2": 4.2, "c3": 0.166},  # (14)-(15)
    **{"g1": 1.504, "g2": 2.175, "g3": 0.7, "g4": 0.19, "h1": 3.993, "h2": 3.268, "h3": 0.2838},  # (20)
}

SETS = (
    Published("liang", "published", SEARCHLIGHT, _LIANG_PRINTED, f"{LIANG}, equations (9)-(15), (20)"),
    Published(
        "liang",
        "corrected",
        SEARCHLIGHT,
        {**_LIANG_PRINTED, "b0": 0.0641},
        "as published, with b0 of (13) read as 0.0641: the printed 0.461 breaks the paper's own energy (17); see the "
        "record `reproduction`",
    ),
    Published(
        "burley",
        "published",
        SEARCHLIGHT,
        {"s0": 1.85, "s1": 1.0, "s2": 7.0, "s3": 0.8},
        "P. Christensen and B. Burley, Approximate reflectance profiles for efficient subsurface scattering, Pixar "
        "Technical Memo 15-04 (2015), searchlight configuration",
    ),
    Published("liang_albedo", "published", SEARCHLIGHT, {"p": 5.67, "q": 3.84, "w": 0.84}, f"{LIANG}, equation (8)"),
)


def constants(law: str, name: str = "published") -> dict[str, float]:
    """The printed constants of a law, in print's order; empty where nothing was printed."""
    return next((dict(s.constants) for s in SETS if s.law == law and s.name == name), {})
