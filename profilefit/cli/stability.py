"""profilefit stability: where laws, maps, samplers, conversions, the exact solution and fits fail, why, what helps."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from profilefit import catalogue, record
from profilefit.report.stability_figure import stability_figures
from profilefit.report.stability_tables import (
    cause_table,
    content,
    fit_summary,
    fit_table,
    fits_csv,
    region_table,
    regions_csv,
    verdict_lines,
)
from profilefit.stability.atlas import Job, Part, jobs, run

LOCAL = Path("fits")
WIDTH = 100
BROKEN = 1


def stability(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Laws, maps, records, or exact, convert, solver; all there is if none is named."),
    ] = None,
    out: Annotated[
        Path | None, typer.Option(help="Folder for the atlas: figures (PNG, SVG) and every region as CSV.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Seconds: what the paper prints and one of ours.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print all that was found as JSON instead.")] = False,
    fits: Annotated[
        Path | None, typer.Option(help="Folder of the records: ./fits if it has any, else the ones shipped.")
    ] = None,
) -> None:
    """Look where everything fails: ends, denormals, huge numbers, NaN, in float16, 32 and 64 (two minutes).

    Exit status 1 if a law, map or solver of this project has a red cell inside its stated range.
    Example: profilefit stability liang --out atlas
    """
    console = Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH)
    folder = fits or (LOCAL if record.available(LOCAL) else catalogue.fits_folder())
    todo = jobs(names or [], folder, quick)
    if out is not None:
        record.require_writable(out)
    parts = list(_tracked(todo))
    if out is not None:
        _write(parts, out)
    if as_json:
        print(json.dumps(content(parts), indent=1, ensure_ascii=False))
    else:
        _show(console, parts, bool(names), out)
    if any(part.failures for part in parts):
        raise typer.Exit(BROKEN)


def _show(console: Console, parts: Sequence[Part], named: bool, out: Path | None) -> None:
    told = [region_table(part) for part in parts if part.regions] if named else []
    found = [one for part in parts for one in part.fits]
    if any(part.regions for part in parts):
        told.append(cause_table(parts))
    if found:
        told.append(fit_table(found) if named else fit_summary(found))
    for each in told:
        console.print(each)
        console.print()
    for line in verdict_lines(parts):
        console.print(line)
    if out is not None:
        console.print(f"{out}: stability*.png, .svg; stability.csv")


def _write(parts: Sequence[Part], out: Path) -> None:
    stability_figures([one for part in parts for one in part.cells], out)
    record.write_text(out / "stability.csv", regions_csv(parts))
    if found := [one for part in parts for one in part.fits]:
        record.write_text(out / "stability-fits.csv", fits_csv(found))


def _tracked(todo: list[Job]) -> Iterator[Part]:
    """The parts as they come, with a bar that goes when all are done."""
    console = Console(stderr=True)
    yield from track(run(todo), "looking", len(todo), console=console, transient=True, disable=not sys.stderr.isatty())
