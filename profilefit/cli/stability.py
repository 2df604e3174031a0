"""profilefit stability: where laws, maps, samplers, conversions, the exact solution and fits fail, why, what helps."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out
from profilefit.cli import words
from profilefit.cli.options import AsJson, Fits, Quiet


@carried_out("profilefit.commands.stability")
def stability(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Laws, maps, records, or exact, convert, solver; all there is if none is named.",
            autocompletion=words.tested,
        ),
    ] = None,
    out: Annotated[
        Path | None,
        typer.Option(
            help="Folder for the atlas: figures (PNG, SVG), every region as CSV, stability.json (as --json prints)."
        ),
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Seconds: what the paper prints and one of ours.")] = False,
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
