"""Find where laws, maps, samplers, conversions, the exact solution and fits fail, why, and what helps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import typer
from rich.console import RenderableType

from mcml_sim.cli.screen import notes, print_json, screen, show, typed
from mcml_sim.files.plain import as_json as json_text
from mcml_sim.files.whole_file import write_whole
from mcml_sim.runs.progress import tracked
from profilefit.recipes.evidence import made, require_apart
from profilefit.recipes.folder import records_folder
from profilefit.report.figures.stability_figure import stability_figures
from profilefit.report.tables.stability_tables import (
    cause_table,
    content,
    fit_summary,
    fit_table,
    fits_csv,
    region_table,
    regions_csv,
    verdict_lines,
)
from profilefit.studies.stability.atlas import Part, jobs, run

BROKEN = 1


def stability(
    names: list[str] | None, out: Path | None, quick: bool, fits: Path | None, as_json: bool, quiet: bool
) -> None:
    """Look, print or keep, and exit with status 1 if something of this project broke its word."""
    folder = records_folder(fits, quiet)
    todo = jobs(names or [], folder, quick)
    if out is not None:
        require_apart(out, folder)
    parts = list(tracked(run(todo), "looking", "subjects", len(todo), quiet))
    if out is not None or as_json:
        told = {"made": made(typed(), folder), "of": names or ("quick" if quick else "all"), **content(parts)}
    if out is not None:
        _write(parts, out)
        write_whole(out / "stability.json", json_text(told))
        notes(quiet).print(f"{out}: stability*.png, .svg; stability.csv, .json", markup=False)
    if as_json:
        print_json(told)
    else:
        _show(parts, bool(names))
    if any(part.failures for part in parts):
        raise typer.Exit(BROKEN)


def _show(parts: Sequence[Part], named: bool) -> None:
    told: list[RenderableType] = [region_table(part) for part in parts if part.regions] if named else []
    found = [one for part in parts for one in part.fits]
    if any(part.regions for part in parts):
        told.append(cause_table(parts))
    if found:
        told.append(fit_table(found) if named else fit_summary(found))
    console = screen()
    show(told, console)
    for line in verdict_lines(parts):
        console.print(line)


def _write(parts: Sequence[Part], out: Path) -> None:
    stability_figures([one for part in parts for one in part.cells], out)
    write_whole(out / "stability.csv", regions_csv(parts))
    if found := [one for part in parts for one in part.fits]:
        write_whole(out / "stability-fits.csv", fits_csv(found))
