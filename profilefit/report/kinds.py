"""Tables of the records of each kind: of one of them, of all in a folder, and those that fill a page of Markdown."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import NamedTuple

from rich.console import RenderableType
from rich.text import Text

from profilefit.recipes.kinds import Kind, gaussians
from profilefit.recipes.pipelines import read
from profilefit.report.records import Content
from profilefit.report.tables.law_tables import markdown_sections
from profilefit.report.tables.markdown import sections
from profilefit.report.tables.phase_table import phase_sections, phase_table, phase_tables, premise_lines
from profilefit.report.tables.record_tables import record_tables, summary
from profilefit.report.tables.stack_table import stack_sections, stack_table
from profilefit.report.tables.sum_table import sum_sections, sum_tables

Parts = Sequence[RenderableType]
Sections = dict[str, Callable[[], str]]
Paths = Mapping[str, Path]


class KindTables(NamedTuple):
    """Tables of a kind in `report`.

    key       name of its records in the output of --json
    tables    tables of one record, from its content and its path
    summary   table of all its records by name, in a folder of records; None where there are none
    sections  Markdown sections of those records, by the names of their marks
    """

    key: str
    tables: Callable[[Content, Path], Parts]
    summary: Callable[[Paths, Path], RenderableType | None] = lambda paths, folder: None
    sections: Callable[[Paths, Path], Sections] = lambda paths, folder: {}


def _law_sections(paths: Paths, folder: Path) -> Sections:
    filled = sections({name: read(path) for name, path in paths.items()}) if paths else {}
    return {**{name: partial(str, text) for name, text in filled.items()}, **markdown_sections(folder)}


def _phase_parts(content: Content, path: Path) -> Parts:
    tables = [part for table in phase_tables(content) for part in (table, Text())]
    return [*tables, *map(Text, premise_lines(content))]


def _of_records(content: Content, path: Path) -> Parts:
    return record_tables(content)


TABLES: Mapping[str, KindTables] = {
    "law": KindTables(
        "records",
        _of_records,
        lambda paths, folder: summary({name: read(path) for name, path in paths.items()}) if paths else None,
        _law_sections,
    ),
    "stack": KindTables(
        "records", _of_records, lambda _, folder: stack_table(folder), lambda paths, _: stack_sections(paths)
    ),
    "gaussians": KindTables(
        "gaussians", lambda _, path: sum_tables(gaussians.load(path)), sections=lambda paths, _: sum_sections(paths)
    ),
    "phase": KindTables(
        "phases", _phase_parts, lambda _, folder: phase_table(folder), lambda _, folder: phase_sections(folder)
    ),
}


def tables_of(kind: Kind) -> KindTables | None:
    """Return what `report` shows of a kind: by the table above, or by the function `tables` of its own module."""
    own = getattr(kind.module, "tables", None) if kind.key not in TABLES else None
    return TABLES.get(kind.key) or (own and KindTables(kind.plural or kind.key, own))
