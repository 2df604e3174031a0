"""Constants as their authors printed them, each with its source.

They are never edited: a defended correction is a set of its own beside them.
"""

from __future__ import annotations

from dataclasses import dataclass

from mcml_sim.media.setting import Setting

SEARCHLIGHT, DIFFUSE = Setting(), Setting("diffuse")
MEMO = (
    "P. Christensen and B. Burley, Approximate reflectance profiles for efficient subsurface scattering, Pixar "
    "Technical Memo 15-04 (2015)"
)
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
        f"{MEMO}, searchlight configuration, equation 5",
    ),
    Published(
        "burley",
        "diffuse",
        DIFFUSE,
        {"s0": 1.9, "s1": 1.0, "s2": 3.5, "s3": 0.8},
        f"{MEMO}, diffuse surface transmission",
    ),
    Published(
        "burley_diffuse_mfp",
        "published",
        SEARCHLIGHT,
        {"s0": 3.5, "s1": 100.0, "s2": 0.33},
        f"{MEMO}, diffuse mean free path, equation 8",
    ),
    Published("liang_albedo", "published", SEARCHLIGHT, {"p": 5.67, "q": 3.84, "w": 0.84}, f"{LIANG}, equation (8)"),
    Published(
        "van_de_hulst_albedo",
        "published",
        DIFFUSE,
        {"p0": 4.09712, "p1": 4.20863, "q0": 9.59217, "q1": 41.6808, "q2": 17.7126},
        "C. Kulla and A. Conty, Revisiting physically based shading at Imageworks, SIGGRAPH 2017 course",
    ),
    Published(
        "chiang_albedo",
        "published",
        DIFFUSE,
        {"e1": -5.09406, "e2": 2.61188, "e3": -4.31805},
        "M. Chiang, P. Kutz and B. Burley, Practical and controllable subsurface scattering for production path "
        "tracing, SIGGRAPH 2016 Talks",
    ),
)


def constants(law: str, name: str = "published") -> dict[str, float]:
    """Return the printed constants of a law, in print's order; empty where nothing was printed."""
    return next((dict(s.constants) for s in SETS if s.law == law and s.name == name), {})
