"""profilefit check: run shader sources on this machine's OpenGL, and compare their errors with their bounds."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated, Any

import typer

from profilefit.cli import options

BROKEN = 1  # exit status


class FloatFormat(enum.StrEnum):
    """Arithmetic to measure; bounds are always checked in float32."""

    SINGLE = "float32"
    HALF = "float16"


def check(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="NAME",
            help="Names of profile models, albedo inversions or records.",
            show_default="all with regenerated constants",
            autocompletion=options.subjects,
        ),
    ] = None,
    constants: Annotated[
        str | None,
        typer.Option(
            help="Set of constants: regenerated, published or diffuse.",
            show_default="regenerated where there are any",
            autocompletion=options.constants,
        ),
    ] = None,
    precision: Annotated[
        FloatFormat, typer.Option(help="Arithmetic; float16 is measured beside float32 where the driver offers it.")
    ] = FloatFormat.SINGLE,
    out: Annotated[Path | None, typer.Option(help="Folder for check.json, the output of --json.")] = None,
    fits: options.Fits = None,
    as_json: options.AsJson = False,
    quiet: options.Quiet = False,
) -> None:
    """Check shader source on this machine's GPU (a minute).

    Evaluates every source, ends of its range included, and compares it with float64 and with the exact solution. Exit
    status 1 if a bound is broken. Errors of float32 must be below a tenth of the model's error, and no value may be
    NaN, infinite or negative.

    \b
    Example:
      profilefit check hazard albedo-rational
    """
    from mcml_sim.cli.screen import answer, typed
    from profilefit.recipes.evidence import measurement_origin, require_apart
    from profilefit.report.tables import check_tables as tables
    from profilefit.shader.check.chosen import checked, chosen, scope

    folder, in_half = options.records_folder(fits, quiet), precision is FloatFormat.HALF
    those = chosen(names or [], constants, folder)
    if out is not None:
        require_apart(out, folder, "check.json")
    found = checked(those, folder, in_half, quiet)
    made = {"made": measurement_origin(typed(), folder), "of": scope(names, constants)}
    body, parts = {**made, **tables.content(found)}, tables.check_tables(found, in_detail=bool(names))
    lacking: list[Any] = [found.lacking] if in_half and found.lacking else []
    note = "" if out is None else f"wrote {out / 'check.json'}"
    lines = [*lacking, *tables.verdict_lines(found.checks)]
    answer(body, parts, lines, as_json, out, "check.json", note, quiet)
    if found.is_broken:
        raise typer.Exit(BROKEN)
