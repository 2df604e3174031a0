"""Tables on the terminal, and in a file."""

from __future__ import annotations

import sys
from argparse import ArgumentParser, RawDescriptionHelpFormatter
from collections.abc import Callable, Iterable, Mapping, Sequence
from pathlib import Path
from typing import NamedTuple

from rich.console import Console
from rich.table import Table

from mcml_sim.files.whole_file import as_json, write_whole

WIDTH = 160  # of what is not a terminal
Rows = list[tuple[str | float, ...]]


class Listed(NamedTuple):
    """Table: its title, its columns with the form of their numbers, and what makes its rows."""

    title: str
    columns: dict[str, str]
    rows: Callable[[], Rows]


def parser_of(doc: str | None, tables: Mapping[str, Listed]) -> ArgumentParser:
    """Return a parser of --only some of the tables, and --json FILE."""
    parser = ArgumentParser(description=doc, formatter_class=RawDescriptionHelpFormatter)
    parser.add_argument("--only", nargs="+", choices=tables, metavar="TABLE", help=f"some of {', '.join(tables)}")
    parser.add_argument("--json", type=Path, metavar="FILE", help="the same in numbers, too")
    return parser


def show_all(tables: Mapping[str, Listed], file: Path | None) -> None:
    """Print each as soon as it is made, and write all of them into a file if one is named."""
    told = {}
    for name, (title, columns, make) in tables.items():
        rows = make()
        told[name] = [dict(zip(columns, row, strict=True)) for row in rows]
        show(title, tuple(columns), [_cells(row, columns.values()) for row in rows])
    if file is not None:
        write_whole(file, as_json(told))


def _cells(row: Sequence[str | float], forms: Iterable[str]) -> list[str]:
    return [one if isinstance(one, str) else f"{one:{form}}" for one, form in zip(row, forms, strict=True)]


def show(title: str, columns: Sequence[str], rows: Iterable[Sequence[str]]) -> None:
    """Print a table; all columns but the first are numbers."""
    table = Table(box=None, pad_edge=False)
    for i, column in enumerate(columns):
        table.add_column(column, justify="left" if i == 0 else "right")
    for row in rows:
        table.add_row(*row)
    console = Console(width=None if sys.stdout.isatty() else WIDTH)
    console.print(f"[bold]{title}[/bold]", table, "", highlight=False, sep="\n")
