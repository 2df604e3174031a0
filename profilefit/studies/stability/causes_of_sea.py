"""What fails in water: searches for where a ray meets the floor, unscattered light for a beam, and plain arithmetic."""

from __future__ import annotations

import numpy as np

from profilefit.studies.stability.cause import Cause
from profilefit.studies.stability.cells import Cells, Mask, Verdict

SHARE, BEAM, SEGMENT = "rays with a wrong hit", "beam, cw 0.1", "segment"  # quantities
WAY, STEEP, NEAR, LENGTH, ALBEDO, DEPTH = "way", "S", "1+m", "c t1", "ω", "ct"  # axes
SLOPE, FLOOR, EYE = "slope", "depth", "eye above the floor"
# Ways to a hit, as `hits.wrong_shares` calls them, 3 iterations each; and S below which each is held to be right.
WAYS: dict[str, int | str] = {
    "16 steps": 16,
    "8 steps": 8,
    "Newton's": "newton",
    "Newton's from 1 m, as published": "newton_1m",
    "Shah et al.'s": "shah",
}
SEVERAL = 1.0  # S from which on a ray may cross the floor more than once
LIMITS = {16: np.inf, 8: 3.0, "newton": SEVERAL, "newton_1m": SEVERAL, "shah": SEVERAL}
SMALL = 0.1  # of x, where 1 - e^-x has lost a digit and 1 + m perhaps all


def holds_to(way: np.ndarray) -> np.ndarray:
    """S below which a way, by its place in `WAYS`, is held to be right."""
    return np.array([LIMITS[one] for one in WAYS.values()])[np.asarray(way, int)]


def _of_hits(cells: Cells) -> tuple[Mask, Mask]:
    """Where ways have no steps, and where rays may cross the floor more than once."""
    has_none = np.isin(cells.spread(WAY, 0.0), [i for i, one in enumerate(WAYS.values()) if isinstance(one, str)])
    is_hit = np.full(cells.shape, cells.quantity == SHARE)
    return is_hit & has_none, is_hit & (cells.spread(STEEP, 0.0) >= SEVERAL)


def _elsewhere(cells: Cells) -> Mask:
    plain, several = _of_hits(cells)
    return plain & several


def _far_off(cells: Cells) -> Mask:
    plain, several = _of_hits(cells)
    return plain & ~several & (cells.spread(WAY, 0.0) > list(WAYS.values()).index("newton"))


def _few(cells: Cells) -> Mask:
    plain, several = _of_hits(cells)
    return ~plain & several


def _scattered(cells: Cells) -> Mask:
    return np.full(cells.shape, cells.quantity == BEAM)


def _along(cells: Cells) -> Mask:
    return np.full(cells.shape, cells.quantity == SEGMENT) & (
        cells.spread(NEAR, 2.0) * cells.spread(LENGTH, np.inf) < SMALL
    )


SEA = (
    Cause(
        "several crossings",
        "a ray may cross the floor more than once: iterations by themselves find another crossing, or none",
        f"equal steps before them: 8 for S < {LIMITS[8]:g}, 16 beyond",
        _elsewhere,
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "a start off the floor, or no slopes",
        "three iterations from 1 m, or as if the floor were level, have not come to the floor yet",
        "Newton's iteration from the floor's mean plane",
        _far_off,
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "few steps",
        "a crossing and the next one are within one step of the search",
        "16 steps in place of 8",
        _few,
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "light that is scattered on",
        "e^-ct leaves out what is turned by small angles, and stays in the beam or the shaft",
        "profilefit.scenes.sea.beam_share, or the Gaussians of profilefit export SEA.toml",
        _scattered,
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "looking along the beam",
        "(1 - e^-x) / x with x = c (1 + m) t1: 1 - e^-x loses its digits where x is small, and is 0 / 0 at m = -1",
        "profilefit.scenes.sea.segment_integral; profilefit export sea-segment",
        _along,
        frozenset({Verdict.INACCURATE, Verdict.NOT_FINITE}),
    ),
)
