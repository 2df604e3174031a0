"""profilefit tradeoff: speed against accuracy of references, laws, samplers and fits, measured and charted."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated, Any

import typer

from profilefit.cli import options

OUT = Path("tradeoff")
WIDTH = 120  # columns that the tables take


def tradeoff(
    parts: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="PART",
            help="Parts to measure; sea and fur need OpenGL.",
            show_default=" ".join(options.PARTS[:4]),
            autocompletion=options.parts,
        ),
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for figures (PNG, SVG), their data (CSV) and tradeoff.json.")] = OUT,
    quick: Annotated[bool, typer.Option("--quick", help="Measure fewer points (under a minute, noisy).")] = False,
    fits: options.Fits = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Measure and chart speed against accuracy (5 minutes).

    Reports the spread of error and time, and the Pareto front, on one core. Times are valid on an idle machine only,
    and each CSV states the load. tradeoff.json keeps earlier parts of the same records, version and machine.

    \b
    Example:
      profilefit tradeoff laws --quick --out charts
    """
    from mcml_sim.cli.screen import notes, print_json, screen, show, typed
    from mcml_sim.files.whole_file import write_whole
    from mcml_sim.runs.progress import tracked
    from profilefit.recipes.evidence import measurement_origin, require_apart
    from profilefit.report.figures.tradeoff_figure import tradeoff_figure
    from profilefit.report.tables.tradeoff_tables import as_csv, as_numbers, tradeoff_tables
    from profilefit.studies.tradeoff import stopwatch
    from profilefit.studies.tradeoff.parts import chosen, is_comparable, keep, measured, read

    names = chosen(parts or [])
    folder = options.records_folder(fits, quiet)
    require_apart(out, folder, "tradeoff.json", *(f"tradeoff-{name}.csv" for name in names))
    file, said = out / "tradeoff.json", notes(quiet)
    origin = {"made": measurement_origin(typed(), folder)}
    if file.exists() and not is_comparable(read(file), origin):
        said.print(f"{file} of other records, version or machine is replaced", markup=False)

    def track(turns: range, title: str) -> Iterable[int]:
        return tracked(turns, title, "turns", quiet=quiet)

    with stopwatch.on_processor(), stopwatch.on_one_core() as pinned:
        body: dict[str, Any] = {**origin, "machine": (known := stopwatch.facts(pinned))}
        for name in names:
            part = measured(name, quick, folder, track)
            data = out / f"tradeoff-{part.name}.csv"
            write_whole(data, as_csv(part, known))
            files = (*tradeoff_figure(part, stopwatch.caption(known), out), data, file)
            body[name] = {**as_numbers(part), **origin, "machine": known}
            keep(file, body)
            if not as_json:
                show(list(tradeoff_tables(part)), screen(WIDTH))
            said.print(f"wrote {', '.join(map(str, files))}", markup=False)
    if as_json:
        print_json(body)
