"""profilefit check: run the shader sources of laws on this machine's OpenGL, and judge them by their own bounds."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcml_sim.cli.lazy import interruptible
from profilefit.cli import options
from profilefit.cli.options import AsJson, Fits, Quiet, records_folder

if TYPE_CHECKING:
    from profilefit.shader.check.chosen import Checked

BROKEN = 1  # exit status


class FloatFormat(enum.StrEnum):
    """Arithmetic to measure besides float32, in which every bound is judged."""

    SINGLE = "float32"
    HALF = "float16"


def check(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of laws, maps or records; all that were regenerated if none is.",
            autocompletion=options.subjects,
        ),
    ] = None,
    constants: Annotated[
        str | None,
        typer.Option(
            help="regenerated (the default, where there are any) or a printed set (published, diffuse).",
            autocompletion=options.constants,
        ),
    ] = None,
    precision: Annotated[
        FloatFormat, typer.Option(help="float16 measures also what half precision costs, where it is offered.")
    ] = FloatFormat.SINGLE,
    out: Annotated[Path | None, typer.Option(help="Folder for check.json, what --json prints.")] = None,
    fits: Fits = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Judge shader source on this machine's GPU (a minute).

    Every source is evaluated, ends of its range included, and compared with float64 and with the exact half space. Exit
    status 1 if a bound is broken: float32 errors below a tenth of the model's own; no NaN, infinity or negative value.

    \b
    Examples:
      profilefit check hazard albedo-rational
      profilefit check liang --constants published
    """
    with interruptible(__name__):
        from mcml_sim.cli.screen import notes, print_json, typed
        from mcml_sim.files.text_file import as_json as json_text
        from mcml_sim.files.whole_file import write_whole
        from profilefit.recipes.evidence import measurement_origin, require_apart
        from profilefit.report.tables.check_tables import content
        from profilefit.shader.check.chosen import checked, chosen, scope

    folder = records_folder(fits, quiet)
    those = chosen(names or [], constants, folder)
    if out is not None:
        require_apart(out, folder, "check.json")
    found = checked(those, folder, precision is FloatFormat.HALF, quiet)
    if out is not None or as_json:
        whole = content(found.laws, found.maps, found.costs, found.halves, found.device)
        body = {"made": measurement_origin(typed(), folder), "of": scope(names, constants), **whole}
    if out is not None:
        write_whole(out / "check.json", json_text(body))
        notes(quiet).print(f"wrote {out / 'check.json'}", markup=False)
    if as_json:
        print_json(body)
    else:
        _show(found, bool(names), precision is FloatFormat.HALF)
    if found.is_broken:
        raise typer.Exit(BROKEN)


def _show(found: Checked, named: bool, in_half: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import screen, show
        from profilefit.report.tables.check_tables import (
            check_tables,
            cost_table,
            half_table,
            place_tables,
            verdict_lines,
        )

    console = screen()
    parts = check_tables(found.laws, found.maps, found.device)
    parts += place_tables(found.laws) if named else []
    parts += [cost_table(found.costs, found.device)] if found.costs else []
    parts += [half_table(found.halves)] if found.halves else []
    show(parts, console)
    if in_half and found.lacking:
        console.print(found.lacking, markup=False)
    for line in verdict_lines(found.checks):
        console.print(line)
