"""profilefit stability: where laws, maps, samplers, conversions, the exact solution and fits fail, and what helps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from profilefit.cli import options

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
    fits: options.Fits = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Find where everything fails, and why (two minutes).

    Ends, denormals, huge numbers and NaN, in float16, 32 and 64. Exit status 1 if a law, map or solver of this project
    has a red cell inside its stated range.

    \b
    Examples:
      profilefit stability --quick --out atlas
      profilefit stability liang
    """
    from mcml_sim.cli.screen import answer, typed
    from mcml_sim.files.whole_file import write_whole
    from mcml_sim.runs.progress import tracked
    from profilefit.recipes.evidence import measurement_origin, require_apart
    from profilefit.report.tables import stability_tables as tables
    from profilefit.studies.stability.atlas import jobs, run

    folder = options.records_folder(fits, quiet)
    todo = jobs(names or [], folder, quick)
    if out is not None:
        require_apart(out, folder, "stability.json", "stability.csv")
    parts = list(tracked(run(todo), "looking", "subjects", len(todo), quiet))
    origin = {"made": measurement_origin(typed(), folder), "of": names or ("quick" if quick else "all")}
    fitted = [one for part in parts for one in part.fits]
    shown = [tables.region_table(part) for part in parts if part.regions] if names else []
    if any(part.regions for part in parts):
        shown.append(tables.advice_table(parts))
    if fitted:
        shown.append(tables.fit_table(fitted) if names else tables.fit_summary(fitted))
    if out is not None:
        from profilefit.report.figures.stability_figure import stability_figures

        stability_figures([one for part in parts for one in part.cells], out)
        write_whole(out / "stability.csv", tables.regions_csv(parts))
        if fitted:
            write_whole(out / "stability-fits.csv", tables.fits_csv(fitted))
    note = f"{out}: stability*.png, .svg; stability.csv, .json"
    body, lines = {**origin, **tables.content(parts)}, tables.verdict_lines(parts)
    answer(body, shown, lines, as_json, out, "stability.json", note, quiet)
    if any(part.failures for part in parts):
        raise typer.Exit(BROKEN)
