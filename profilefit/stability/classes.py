"""What a cell of the atlas can be, from harmless to worst."""

from __future__ import annotations

import enum

import numpy as np
from numpy.typing import NDArray

Codes = NDArray[np.int8]
Mask = NDArray[np.bool_]


class Verdict(enum.IntEnum):
    """The class of a cell; of several that hold, the last one here counts.

    NOT_JUDGED  a number, not negative and in order, of which nothing here tells what is right
    """

    RIGHT = 0
    OUTSIDE = 1
    BEYOND = 2
    NOT_JUDGED = 3
    INACCURATE = 4
    NOT_MONOTONE = 5
    NEGATIVE = 6
    NOT_FINITE = 7
    RAISES = 8

    @property
    def words(self) -> str:
        return WORDS[self]

    @property
    def is_red(self) -> bool:
        return self >= Verdict.INACCURATE


WORDS = {
    Verdict.RIGHT: "right",
    Verdict.OUTSIDE: "outside its range",
    Verdict.BEYOND: "beyond the format",
    Verdict.NOT_JUDGED: "not judged",
    Verdict.INACCURATE: "inaccurate",
    Verdict.NOT_MONOTONE: "not monotone",
    Verdict.NEGATIVE: "negative",
    Verdict.NOT_FINITE: "NaN or Inf",
    Verdict.RAISES: "raises",
}


def red(codes: Codes) -> Mask:
    """Which cells are red."""
    found: Mask = codes >= Verdict.INACCURATE
    return found
