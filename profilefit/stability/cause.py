"""One reason for red cells: where it holds, in numbers, and in words what is wrong and what helps."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from profilefit.stability.cells import Cells
from profilefit.stability.classes import Mask, Verdict

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


UNEXPLAINED = Cause("unexplained", "no known cause fits", "find it", nowhere)
