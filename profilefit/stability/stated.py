"""What a law says of its own error against the half space: whether it is as far off as that, and no farther."""

from __future__ import annotations

import numpy as np

from profilefit.shader.check.bounds import ALBEDOS
from profilefit.stability.cells import Cells
from profilefit.stability.classes import Mask
from profilefit.stability.layout import MODEL, PROFILE

# Printed constants are held to the record of the regenerated ones; grids are coarser than a record's.
FACTOR = 1.5
UNSEEN_FACTOR = 8.0  # at albedos darker or whiter than those that the measures were taken at


def unseen(cells: Cells) -> Mask:
    """Albedos darker or whiter than those that the measures of records were taken at; their ends are the worst."""
    alpha = cells.spread("α", 0.5)
    found: Mask = (alpha < ALBEDOS.min()) | (alpha > 0.999 * ALBEDOS.max())
    return found


def as_stated(cells: Cells) -> Mask:
    """The albedos at which a law is as far off as stated: the mean over r of R_d's relative error, else the largest."""
    if cells.arithmetic != MODEL or not np.isfinite(cells.stated) or len(cells.axes) < 2:
        return np.zeros(cells.shape, bool)
    seen = np.where(cells.inside, cells.error, 0.0)
    counts = np.maximum(np.sum(cells.inside, axis=1, keepdims=True), 1)
    found = (
        np.sum(seen, axis=1, keepdims=True) / counts if cells.quantity == PROFILE else np.max(seen, 1, keepdims=True)
    )
    return np.asarray(found <= np.where(unseen(cells), UNSEEN_FACTOR, FACTOR) * cells.stated)


def near_stated(cells: Cells) -> Mask:
    """The cells of a map that are off by no more than its largest stated error."""
    with np.errstate(invalid="ignore"):
        return np.asarray(np.abs(cells.value - cells.reference) <= FACTOR * cells.stated)
