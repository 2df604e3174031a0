"""What fails in blurs over an atlas."""

from __future__ import annotations

import numpy as np

from profilefit.studies.stability.cause import Cause
from profilefit.studies.stability.cells import Cells, Mask, Verdict

LIGHT = "light, blurred"
WIDTH, LATITUDE, RATIO, IN_ROWS = "σ/R", "latitude", "column / row", "σ"
WITHIN = 2.0  # sigma from a pole
FINE = 1.5  # texels of a sigma


def near_a_pole(width: np.ndarray, latitude: np.ndarray) -> Mask:
    """Of Gaussians [radius], at latitudes [degrees]."""
    return np.asarray(np.radians(90.0 - latitude) < WITHIN * width)


def is_coarse(ratio: np.ndarray, sigma: np.ndarray) -> Mask:
    """Of columns so many rows wide, and Gaussians [rows]."""
    return np.asarray(sigma < FINE * ratio)


def _at_a_pole(cells: Cells) -> Mask:
    return near_a_pole(cells.spread(WIDTH, 0.0), cells.spread(LATITUDE, 0.0)) & (cells.quantity == LIGHT)


def _coarse(cells: Cells) -> Mask:
    return is_coarse(cells.spread(RATIO, 0.0), cells.spread(IN_ROWS, np.inf)) & (cells.quantity == LIGHT)


HEART = (
    Cause(
        "wide blur at a pole",
        "its reach is where an atlas's lines turn: rows and then columns are right to first order in the variance",
        "charts without poles, as the faces of a cube; or the screen",
        _at_a_pole,
        frozenset({Verdict.INACCURATE}),
    ),
    Cause(
        "coarse texels",
        "sigma is less than a texel and a half: the edge that is blurred is as wide as a texel",
        "a finer atlas, or that Gaussian on the screen, as a split has it",
        _coarse,
        frozenset({Verdict.INACCURATE}),
    ),
)
