"""profilefit check: run the shader texts of laws on this machine's OpenGL, and judge them by their own bounds."""

from __future__ import annotations

import enum
import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from profilefit import catalogue, record
from profilefit.report.check_tables import (
    check_tables,
    content,
    cost_table,
    half_table,
    place_tables,
    verdict_lines,
)
from profilefit.shader.check.chosen import chosen
from profilefit.shader.check.cost import law_costs
from profilefit.shader.check.evaluate import half_extension, no_half
from profilefit.shader.check.half import check_half
from profilefit.shader.check.laws import LawCheck, check_laws
from profilefit.shader.check.maps import MapCheck, check_map
from profilefit.shader.context import opened, renderer

LOCAL = Path("fits")
WIDTH = 100
BROKEN = 1


class Precision(enum.StrEnum):
    """What is measured besides float32, in which every bound is judged."""

    SINGLE = "float32"
    HALF = "float16"


def check(
    names: Annotated[
        list[str] | None, typer.Argument(help="Names of laws, maps or records; all that were regenerated if none is.")
    ] = None,
    constants: Annotated[
        str | None,
        typer.Option(help="regenerated (the default, where there are any) or a printed set (published, diffuse)."),
    ] = None,
    fits: Annotated[
        Path | None, typer.Option(help="Folder of the records: ./fits if it has any, else the ones shipped.")
    ] = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print all that was measured as JSON instead.")] = False,
    precision: Annotated[
        Precision, typer.Option(help="float16 measures also what half precision costs, where it is offered.")
    ] = Precision.SINGLE,
) -> None:
    """Evaluate laws on the GPU, ends included, and compare with float64 and with the exact half space (a minute).

    Exit status 1 if a bound is broken: float32 errors below a tenth of the model's own, and no number that must not be.
    Example: profilefit check liang --constants published
    """
    console = Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH)
    folder = fits or (LOCAL if record.available(LOCAL) else catalogue.fits_folder())
    laws, maps = chosen(names or [], constants, folder)
    with opened() as context:
        device, extension, lacking = renderer(context), half_extension(context), no_half(context)
        of_laws = list(_tracked(check_laws(context, laws, folder), len(laws)))
        of_maps = [check_map(context, one, folder) for one in maps]
        timed = law_costs(context, laws, folder)
        halves = [check_half(context, one) for one in laws] if precision == Precision.HALF else []
    found: list[LawCheck | MapCheck] = [*of_laws, *of_maps]
    if as_json:
        print(json.dumps(content(of_laws, of_maps, timed, halves, device), indent=1, ensure_ascii=False))
    else:
        parts = check_tables(of_laws, of_maps, device)
        parts += place_tables(of_laws) if names else []
        parts += [cost_table(timed, device)] if timed else []
        parts += [half_table(halves)] if halves else []
        for part in parts:
            console.print(part)
            console.print()
        if precision == Precision.HALF and not extension:
            console.print(lacking, markup=False)
        for line in verdict_lines(found):
            console.print(line)
    if any(one.broken for one in found):
        raise typer.Exit(BROKEN)


def _tracked(checks: Iterable[LawCheck], count: int) -> Iterable[LawCheck]:
    """The checks as they come, with a bar that goes when all are done."""
    console = Console(stderr=True)
    return track(checks, "checking", count, console=console, transient=True, disable=not sys.stderr.isatty())
