"""The one kind of table that the report prints: a title, columns of text, a caption."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from rich.cells import cell_len
from rich.console import Group, JustifyMethod, RenderableType
from rich.table import Table
from rich.text import Text


def column_table(
    title: str,
    columns: Mapping[str, Sequence[str]],
    caption: str = "",
    left: Sequence[str] = ("",),
    fold: Sequence[str] = (),
) -> Group:
    """Columns of equally many texts under their headers, numbers to the right; title and caption as wide as the screen.

    left  headers of columns that stand to the left; fold those that may wrap, while all others keep to one line
    """
    table = Table(box=None, header_style="dim", padding=(0, 2, 0, 0), pad_edge=False)
    for header, cells in columns.items():
        side: JustifyMethod = "left" if header in left or header in fold else "right"
        whole = None if header in fold else _width([header, *cells])  # a number that is cut reads as another one
        table.add_column(Text(header), justify=side, no_wrap=header not in fold, overflow="fold", min_width=whole)
    for row in zip(*columns.values(), strict=True):
        table.add_row(*(Text(cell) for cell in row))
    parts: list[RenderableType] = [Text(title, style="bold"), table]
    return Group(*parts, Text(caption, style="dim")) if caption else Group(*parts)


def _width(texts: Sequence[str]) -> int:
    """Columns of the screen that the widest line takes."""
    return max(cell_len(line) for text in texts for line in (text.splitlines() or [""]))
