"""Numbers as text, to the digits that their errors leave."""

from __future__ import annotations

import math
from collections.abc import Sequence

# A constant whose error exceeds it still shows these digits: it is what the fit ended at.
LEAST_DIGITS = 3
SMALLEST, LARGEST = 1e-4, 1e6  # beyond these numbers are written with an exponent
ABSENT = "–"


def to_error(value: float | None, error: float | None) -> str:
    """`value` to two digits of `error`, but never to fewer than three of its own."""
    if value is None or not math.isfinite(value):
        return ABSENT
    places = LEAST_DIGITS - 1 - _exponent(value)
    if error is not None and math.isfinite(error) and error > 0:
        places = max(places, 1 - _exponent(error))
    if value != 0 and not SMALLEST <= abs(value) < LARGEST:
        return f"{value:.{max(places + _exponent(value), LEAST_DIGITS - 1)}e}"
    return f"{value:.{max(places, 0)}f}"


def significant(value: float | None, digits: int = 2) -> str:
    """`value` to so many significant digits, zeros kept."""
    if value is None or not math.isfinite(value):
        return ABSENT
    if value == 0:
        return "0"
    if not SMALLEST <= abs(value) < LARGEST:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(digits - 1 - _exponent(value), 0)}f}"


def interval(ends: Sequence[float | None] | None, most: float | None = None) -> str:
    """Both ends, to two digits of half their distance; one that is None leaves a limit.

    That has three digits, or two of its half distance from `most`, the end of what such a number can be.
    """
    if ends is None:
        return ABSENT
    low, high = ends
    if low is not None and high is not None:
        return f"{to_error(low, (high - low) / 2)} … {to_error(high, (high - low) / 2)}"
    limit = high if low is None else low
    room = None if limit is None or most is None else (most - limit) / 2
    return f"{'<' if low is None else '>'} {to_error(limit, room)}"


def on_the_point(texts: Sequence[str]) -> list[str]:
    """The same texts, blanks added on the right so that in a right-aligned column the decimal points stand together."""
    tails = [len(text) - _point(text) for text in texts]
    widest = max(tails, default=0)
    return [text + " " * (widest - tail) for text, tail in zip(texts, tails, strict=True)]


def _point(text: str) -> int:
    """Where the decimal point stands, or would."""
    return text.index(".") if "." in text else len(text)


def _exponent(value: float) -> int:
    """The power of ten of the first digit, after rounding to two of them."""
    return int(f"{value:.1e}".split("e")[1])
