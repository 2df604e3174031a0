"""One reason for red cells: where it holds, in numbers, and in words what is wrong and what helps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from profilefit.shader.check.bounds import ALBEDOS
from profilefit.studies.stability.cells import Cells, Mask, Verdict
from profilefit.studies.stability.layout import MODEL, PROFILE

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


REDS = frozenset(one for one in Verdict if one.is_red)


@dataclass(frozen=True)
class Cause:
    """A cause.

    key, words, remedy  a short name, what is wrong, what helps
    holds               the cells of a tensor where its condition is met, whatever their class
    verdicts            the classes that it explains
    """

    key: str
    words: str
    remedy: str
    holds: Callable[[Cells], Mask]
    verdicts: frozenset[Verdict] = REDS


def nowhere(cells: Cells) -> Mask:
    """No cell."""
    return np.zeros(cells.shape, bool)


UNEXPLAINED = Cause("unexplained", "no known cause", "find it", nowhere)
