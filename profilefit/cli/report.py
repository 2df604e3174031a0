"""profilefit report: show records as tables, and draw their figures."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console

from profilefit import catalogue, record
from profilefit.errors import InputError, RecordError, ShaderError
from profilefit.report import every_law, figures, fill, markdown_sections, sections, tables

LOCAL = Path("fits")
WIDTH = 100


def report(
    names: Annotated[
        list[str] | None, typer.Argument(help="Names of records; a summary of all if none is named.")
    ] = None,
    fits: Annotated[
        Path | None, typer.Option(help="Folder of the records: ./fits if it has any, else the ones shipped.")
    ] = None,
    figures_to: Annotated[
        Path | None, typer.Option("--figures", help="Folder for the figures; without it none are drawn.")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="Fill the tables between the marks <!-- name --> of this file instead.")
    ] = None,
    quality: Annotated[
        bool, typer.Option("--quality", help="Measure every law against the exact half space instead (a minute).")
    ] = False,
) -> None:
    """Print what was fitted: constants with their errors, quality by albedo, the state of fits and chains.

    --quality prints instead how good every law, map and sampler is, printed ones too; or those of the records named.
    Example: profilefit report liang-whole --figures figures
    """
    # Tables are laid out for 100 columns; what is piped into a file has no width of its own.
    console = Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH)
    folder = fits or (LOCAL if record.available(LOCAL) else catalogue.fits_folder())
    contents = _contents(folder, names)
    if markdown is not None:
        _fill(markdown, contents, folder, console)
        return
    if quality:
        for part in every_law(folder, names or None):
            console.print(part)
            console.print()
        return
    if not names:
        console.print(tables.summary(contents))
    for content in contents.values():
        for part in tables.record_tables(content):
            console.print(part)
    if figures_to is not None:
        record.require_writable(figures_to)
        drawn, skipped = figures.draw_all(folder, figures_to, names)
        console.print(f"drew {len(drawn)} figures into {figures_to}", markup=False)
        for line in skipped:
            console.print(f"left out: {line}", markup=False)


def _fill(path: Path, contents: dict[str, dict], folder: Path, console: Console) -> None:
    try:
        text = path.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(f"{path}: cannot be read ({error})") from None
    measured = {}
    for name, make in markdown_sections(folder).items():
        if f"<!-- {name} -->" in text:  # what is measured takes a minute, so only where the file has a place for it
            try:
                measured[name] = make()
            except ShaderError as error:
                console.print(f"{path}: the table {name!r} stays as it was: {error}", markup=False)
    record.write_text(path, fill(text, sections(contents) | measured))


def _contents(folder: Path, names: list[str] | None) -> dict[str, dict]:
    known = record.available(folder)
    if not known:
        raise RecordError(f"{folder} has no records: `profilefit regenerate` makes them")
    for name in names or ():
        if name not in known:
            raise RecordError(f"record must be one of {', '.join(known)} (in {folder}), got {name!r}")
    return {name: record.read(known[name], whole=True) for name in (names or known)}
