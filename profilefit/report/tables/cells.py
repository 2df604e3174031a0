"""Cells of tables: digits that errors leave, columns and rows of text, blocks for numbers."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from itertools import pairwise

from rich.cells import cell_len
from rich.console import Group, JustifyMethod
from rich.table import Table
from rich.text import Text

# A constant whose error exceeds it still shows these digits: it is what the fit ended at.
LEAST_DIGITS = 3
SMALLEST, LARGEST = 1e-4, 1e6  # beyond these numbers are written with an exponent
ABSENT = "–"
SEARCHLIGHT = "searchlight: a pencil beam (normal, collimated)"  # for captions


def to_error(value: float | None, error: float | None) -> str:
    """Return `value` to two digits of `error`, but never to fewer than three of its own."""
    if value is None or not math.isfinite(value):
        return ABSENT
    places = LEAST_DIGITS - 1 - _exponent(value)
    if error is not None and math.isfinite(error) and error > 0:
        places = max(places, 1 - _exponent(error))
    if value != 0 and not SMALLEST <= abs(value) < LARGEST:
        return f"{value:.{max(places + _exponent(value), LEAST_DIGITS - 1)}e}"
    return f"{value:.{max(places, 0)}f}"


def significant(value: float | None, digits: int = 2) -> str:
    """Return `value` to so many significant digits, zeros kept."""
    if value is None or not math.isfinite(value):
        return ABSENT
    if value == 0:
        return "0"
    if not SMALLEST <= abs(value) < LARGEST:
        return f"{value:.{digits - 1}e}"
    return f"{value:.{max(digits - 1 - _exponent(value), 0)}f}"


def interval(ends: Sequence[float | None] | None, most: float | None = None) -> str:
    """Return both ends, to two digits of half their distance; one that is None leaves a limit.

    A limit has three digits, or two of its half distance from `most`, the end of what such a number can be.
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
    """Return the texts with blanks on the right, so that a right-aligned column has its decimal points together."""
    tails = [len(text) - text.index(".") if "." in text else 0 for text in texts]
    widest = max(tails, default=0)
    return [text + " " * (widest - tail) for text, tail in zip(texts, tails, strict=True)]


def _exponent(value: float) -> int:
    """Return the power of ten of the first digit, after rounding to two of them."""
    return int(f"{value:.1e}".split("e")[1])


def column_table(
    title: str,
    columns: Mapping[str, Sequence[str]],
    caption: str = "",
    left: Sequence[str] = ("",),
    fold: Sequence[str] = (),
) -> Group:
    """Return columns of equally many texts under their headers, numbers to the right, as wide as the screen.

    left  headers of columns that stand to the left; fold those that may wrap, while all others keep to one line
    """
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0), pad_edge=False)
    for header, cells in columns.items():
        side: JustifyMethod = "left" if header in left or header in fold else "right"
        widths = (cell_len(line) for text in (header, *cells) for line in text.splitlines())
        whole = None if header in fold else max(widths, default=0)  # a number that is cut reads as another one
        table.add_column(Text(header), justify=side, no_wrap=header not in fold, overflow="fold", min_width=whole)
    for row in zip(*columns.values(), strict=True):
        table.add_row(*(Text(cell) for cell in row))
    return Group(Text(title, style="bold"), table, *([Text(caption, style="dim")] if caption else []))


def row_table(
    title: str,
    header: Sequence[str],
    rows: Iterable[Sequence[str]],
    caption: str = "",
    left: Sequence[str] = ("",),
    fold: Sequence[str] = (),
    aligned: Sequence[str] = (),
) -> Group:
    """Return rows under their headers, as `column_table` shows columns; those `aligned` stand on the decimal point."""
    columns: list[Sequence[str]] = list(zip(*rows, strict=True)) or [() for _ in header]
    named = zip(header, columns, strict=True)
    shown = {name: on_the_point(cells) if name in aligned else cells for name, cells in named}
    return column_table(title, shown, caption, left, fold)


BLOCKS = "▁▂▃▄▅▆▇█"
GAP = " "  # for what is no positive number


def spark(values: Sequence[float | None], ends: tuple[float, float] | None, width: int | None = None) -> str:
    """Return a block a value, the lowest at the first of `ends`, the highest at the second, logarithmic between.

    width  the most characters; of more values the largest of each stretch is shown, since an error may not be averaged
    """
    count = min(width or len(values), len(values))
    if ends is None:
        return GAP * count
    low, high = ends
    blocks = ""
    for first, last in pairwise(round(i * len(values) / max(count, 1)) for i in range(count + 1)):
        known = [value for value in values[first:last] if value is not None and 0 < value < math.inf]
        share = math.log(max(known) / low) / math.log(high / low) if known and high > low else 0.0
        blocks += BLOCKS[round(min(max(share, 0.0), 1.0) * (len(BLOCKS) - 1))] if known else GAP
    return blocks


def span(rows: Iterable[Sequence[float | None]]) -> tuple[float, float] | None:
    """Return the smallest and the largest positive number of all, the one scale of a table's sparks; None of none."""
    known = [value for row in rows for value in row if value is not None and 0 < value < math.inf]
    return (min(known), max(known)) if known else None
