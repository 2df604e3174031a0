"""A row of numbers as a row of blocks, to see at a glance where an error is large."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from itertools import pairwise

BLOCKS = "▁▂▃▄▅▆▇█"
GAP = " "  # for what is no positive number


def spark(values: Sequence[float | None], ends: tuple[float, float] | None, width: int | None = None) -> str:
    """A block a value, the lowest at the first of `ends`, the highest at the second, logarithmic between.

    width  the most characters; of more values the largest of each stretch is shown, since an error may not be averaged
    """
    if ends is None:
        return GAP * min(len(values), width or len(values))
    return "".join(_block(value, *ends) for value in _at_most(values, width or len(values)))


def span(rows: Iterable[Sequence[float | None]]) -> tuple[float, float] | None:
    """The smallest and the largest positive number of all, so that sparks of one table have one scale; None of none."""
    known = [value for row in rows for value in row if _is_shown(value)]
    return (min(known), max(known)) if known else None  # type: ignore[type-var, return-value]


def _block(value: float | None, low: float, high: float) -> str:
    if value is None or not _is_shown(value):
        return GAP
    share = math.log(value / low) / math.log(high / low) if high > low else 0.0
    return BLOCKS[round(min(max(share, 0.0), 1.0) * (len(BLOCKS) - 1))]


def _is_shown(value: float | None) -> bool:
    return value is not None and math.isfinite(value) and value > 0


def _at_most(values: Sequence[float | None], width: int) -> list[float | None]:
    """The largest of each of `width` stretches of equally many values; all of them if they are no more."""
    count = min(width, len(values))
    ends = [round(i * len(values) / count) for i in range(count + 1)]
    stretches = [values[a:b] for a, b in pairwise(ends)]
    return [max((v for v in stretch if _is_shown(v)), default=None) for stretch in stretches]  # type: ignore[type-var]
