"""profilefit tradeoff: speed against accuracy of truths, laws, samplers and fits, measured and charted in one run."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out
from profilefit.cli import words
from profilefit.cli.options import AsJson, Fits, Quiet

OUT = Path("tradeoff")


@carried_out("profilefit.commands.tradeoff")
def tradeoff(
    parts: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="PART", help=f"{', '.join(words.PARTS)}; all of them if none is named.", autocompletion=words.parts
        ),
    ] = None,
    out: Annotated[
        Path,
        typer.Option(help="Folder for the figures (PNG, SVG), their data (CSV), and tradeoff.json."),
    ] = OUT,
    quick: Annotated[bool, typer.Option("--quick", help="Less of everything: under a minute, and noisy.")] = False,
    fits: Fits = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Measure and chart speed against accuracy (5 minutes).

    Truths, laws, samplers and fits, with the spread of both and the front; all on one core, in turns. Times mean
    something on an idle machine only; each CSV says how idle it was. Every part is written as soon as it is measured;
    tradeoff.json keeps those it has of the same records, version and machine. --json prints what was measured now.

    \b
    Example:
      profilefit tradeoff laws --quick --out charts
    """
