"""What fails in blurs over an atlas and on the screen."""

from __future__ import annotations

import numpy as np

from profilefit.studies.stability.cause import Cause
from profilefit.studies.stability.cells import Cells, Mask

ATLAS_OF_BALL, SEEN_ASLANT, LIGHT = "atlas of a ball", "screen seen aslant", "light"
LATITUDE, ANGLE = "latitude", "angle"
POLAR, GRAZING = 80.0, 85.0  # degrees


def _at_a_pole(cells: Cells) -> Mask:
    return np.asarray((cells.spread(LATITUDE, 0.0) > POLAR) & (cells.subject == ATLAS_OF_BALL))


def _grazing(cells: Cells) -> Mask:
    return np.asarray((cells.spread(ANGLE, 0.0) > GRAZING) & (cells.subject == SEEN_ASLANT))


def _coarse(cells: Cells) -> Mask:
    ratio, sigma = cells.spread("column / row", 0.0), cells.spread("σ", np.inf)
    return np.asarray((ratio > sigma) & (cells.quantity == LIGHT))


HEART = (
    Cause(
        "pole",
        "where the lines of an atlas draw together, texels shorter than a fifth of all are blurred by its margin at most",
        "a chart over the pole, as a cube has",
        _at_a_pole,
    ),
    Cause(
        "grazing view",
        "a pixel counts for no more than twenty times its own area, and stands for a strip wider than the kernel",
        "texture space, which does not know the view, or the split",
        _grazing,
    ),
    Cause(
        "coarse texels",
        "sigma is less than a texel: the edge that is blurred is as wide as the texel is",
        "a finer atlas, or that Gaussian on the screen",
        _coarse,
    ),
)
