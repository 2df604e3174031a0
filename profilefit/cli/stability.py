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
            metavar="NAME",
            help="Names of models, inversions or records, or exact, convert, solver, stacks, heart, sea, fur.",
            show_default="all but heart, sea and fur",
            autocompletion=options.tested,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(help="Folder for figures (PNG, SVG), regions (CSV) and stability.json, the output of --json."),
    ] = None,
    quick: Annotated[
        bool, typer.Option("--quick", help="Test the paper's models and one of this project (seconds).")
    ] = False,
    fits: options.Fits = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Find inputs at which methods fail (two minutes).

    Tests range ends, denormals, huge numbers and NaN in float16, float32 and float64. Exit status 1 if a model,
    inversion or solver of this project fails inside its stated range.

    \b
    Example:
      profilefit stability --quick --out atlas
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
    parts = list(tracked(run(todo), "testing", "subjects", len(todo), quiet))
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
