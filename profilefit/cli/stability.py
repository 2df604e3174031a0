"""profilefit stability: where laws, maps, samplers, conversions, the exact solution and fits fail, and what helps."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcml_sim.cli.lazy import interruptible
from profilefit.cli import options
from profilefit.cli.options import AsJson, Fits, Quiet, records_folder

if TYPE_CHECKING:
    from profilefit.studies.stability.atlas import Findings

BROKEN = 1  # exit status


def stability(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Laws, maps, records, or exact, convert, solver, stacks, heart, sea, fur; none: all but heart "
            "(OpenGL), sea and fur.",
            autocompletion=options.tested,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the atlas: figures (PNG, SVG), every region as CSV, stability.json (as --json prints)."
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Seconds: the paper's laws and one of this project.")] = False,
    fits: Fits = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Find where everything fails, and why (two minutes).

    Ends, denormals, huge numbers and NaN, in float16, 32 and 64. Exit status 1 if a law, map or solver of this project
    has a red cell inside its stated range.

    \b
    Examples:
      profilefit stability --quick --out atlas
      profilefit stability liang
    """
    with interruptible(__name__):
        from mcml_sim.cli.screen import notes, print_json, typed
        from mcml_sim.files.text_file import as_json as json_text
        from mcml_sim.files.whole_file import write_whole
        from mcml_sim.runs.progress import tracked
        from profilefit.recipes.evidence import measurement_origin, require_apart
        from profilefit.report.tables.stability_tables import content
        from profilefit.studies.stability.atlas import jobs, run

    folder = records_folder(fits, quiet)
    todo = jobs(names or [], folder, quick)
    if out is not None:
        require_apart(out, folder, "stability.json", "stability.csv")
    parts = list(tracked(run(todo), "looking", "subjects", len(todo), quiet))
    if out is not None or as_json:
        body = {
            "made": measurement_origin(typed(), folder),
            "of": names or ("quick" if quick else "all"),
            **content(parts),
        }
    if out is not None:
        _write(parts, out)
        write_whole(out / "stability.json", json_text(body))
        notes(quiet).print(f"{out}: stability*.png, .svg; stability.csv, .json", markup=False)
    if as_json:
        print_json(body)
    else:
        _show(parts, bool(names))
    if any(part.failures for part in parts):
        raise typer.Exit(BROKEN)


def _show(parts: Sequence[Findings], named: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import screen, show
        from profilefit.report.tables.stability_tables import (
            advice_table,
            fit_summary,
            fit_table,
            region_table,
            verdict_lines,
        )

    tables = [region_table(part) for part in parts if part.regions] if named else []
    fits = [one for part in parts for one in part.fits]
    if any(part.regions for part in parts):
        tables.append(advice_table(parts))
    if fits:
        tables.append(fit_table(fits) if named else fit_summary(fits))
    console = screen()
    show(tables, console)
    for line in verdict_lines(parts):
        console.print(line)


def _write(parts: Sequence[Findings], out: Path) -> None:
    with interruptible(__name__):
        from mcml_sim.files.whole_file import write_whole
        from profilefit.report.figures.stability_figure import stability_figures
        from profilefit.report.tables.stability_tables import fits_csv, regions_csv

    stability_figures([one for part in parts for one in part.cells], out)
    write_whole(out / "stability.csv", regions_csv(parts))
    if fits := [one for part in parts for one in part.fits]:
        write_whole(out / "stability-fits.csv", fits_csv(fits))
