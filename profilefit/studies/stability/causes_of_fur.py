"""What fails in fur drawn in layers: gaps between shells, strands that are none, a second strand in a slab, acos."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.fur.ways import FITTED, LINEAR, QUADRATIC, SWEPT, SWEPT_TWO, LayerTechnique
from profilefit.studies.stability.cause import Cause
from profilefit.studies.stability.cells import Cells, Mask, Verdict

Floats = NDArray[np.float64]
UNION, HITS, SHADOW = "shadow over the cone's", "rms of hits over L", "shadow of a cone"  # quantities
WAY, ANGLE, LAYERS, ASIDE, ROOT = "way", "θ", "N", "d/r0", "r0"  # axes
SHELLS: tuple[LayerTechnique, ...] = (FITTED, LINEAR, QUADRATIC)  # the way of a cell, by its place
SLABS: tuple[LayerTechnique, ...] = (SWEPT, SWEPT_TWO)
SLENDER, COVER = 20.0, 0.16  # L / r0, r0^2 n of what is looked at
# Fitted shells are held to be right from so many layers on, times L / r0 and times L tan(theta) / r0: fewer need an
# exponent that is far from the cone's, or leave gaps.
FULL, FILLED = 2.5, 1.5
# Swept slabs are held to be right below so much of y = (L tan(theta) / N) sqrt(n), what a ray moves in a slab over the
# strands' mean distance: in fur of r0^2 n from 0.04 to 0.25.
LIMITS = {SWEPT: 0.65, SWEPT_TWO: 1.2}
GAPS = 0.1  # share of a strand whose discs are apart, of which its shadow is told to be thinner
EDGE = 0.1  # of d / r0 - 1, where acos(r0 / d) and the root have lost digits


def filled(way: LayerTechnique, degrees: Floats, layers: Floats) -> NDArray[np.bool_]:
    """Where shells are held to be right."""
    tangent = np.tan(np.radians(degrees))
    return np.asarray((way == FITTED) & (layers >= SLENDER * np.maximum(FULL, FILLED * tangent)))


def moved(degrees: Floats, layers: Floats) -> Floats:
    """y of swept slabs [-]."""
    return np.asarray(SLENDER * np.tan(np.radians(degrees)) / layers * COVER**0.5)


def gap_share(way: LayerTechnique, degrees: float, layers: int) -> float:
    """Of a strand's height, where a ray may pass between a disc and the next one [-]."""
    t = np.arange(layers + 1) / layers
    radius = 1.0 - t ** way.exponent_of(layers, SLENDER)
    return float(np.mean(SLENDER * np.tan(np.radians(degrees)) / layers > radius[:-1] + radius[1:]))


def _of_shells(cells: Cells) -> Mask:
    return np.full(cells.shape, cells.quantity == UNION)


def _wide(cells: Cells) -> Mask:
    return _of_shells(cells) & (cells.value > 1.0)


def _apart(cells: Cells) -> Mask:
    if cells.quantity != UNION:
        return _of_shells(cells)
    each = zip(*(cells.spread(name, 0.0).ravel() for name in (WAY, ANGLE, LAYERS)), strict=True)
    share = [gap_share(SHELLS[int(way)], degrees, int(layers)) for way, degrees, layers in each]
    return np.reshape(np.array(share) > GAPS, cells.shape)


def _second(cells: Cells) -> Mask:
    if cells.quantity != HITS:
        return np.zeros(cells.shape, bool)
    limits = np.array([LIMITS[way] for way in SLABS])[cells.spread(WAY, 0.0).astype(int)]
    return np.asarray(moved(cells.spread(ANGLE, 0.0), cells.spread(LAYERS, 1.0)) >= limits)


def _edge(cells: Cells) -> Mask:
    return np.full(cells.shape, cells.quantity == SHADOW) & (np.abs(cells.spread(ASIDE, 0.0) - 1.0) < EDGE)


FUR = (
    Cause(
        "another strand",
        "discs of radius r0 (1 - t^p), p > 1, are of a thicker strand: many discs of p = 2 hide 1.3 times as much",
        f"p = 1 from {FILLED:g} L tan(theta) / r0 layers on; swept slabs with fewer",
        _wide,
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "gaps",
        "a ray passes between the discs of neighbouring shells: Delta tan(theta) is more than their radii together",
        f"swept slabs; or {FILLED:g} L tan(theta) / r0 layers, and {FULL:g} L / r0 for the fitted p",
        _apart,
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "a second strand within a slab",
        "a ray meets a strand that is not the nearest to the middle of its way through a slab",
        f"L tan(theta) sqrt(n) / {LIMITS[SWEPT]:g} slabs, over {LIMITS[SWEPT_TWO]:g} of two strands",
        _second,
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "acos next to 1",
        "sqrt(d^2 - r0^2) and acos(r0 / d) differ by what is left of their digits where d is near r0",
        "r0^2 (pi + u - atan u): profilefit.scenes.fur.law.shadow; profilefit export fur",
        _edge,
        frozenset({Verdict.INACCURATE, Verdict.NOT_FINITE}),
    ),
)
