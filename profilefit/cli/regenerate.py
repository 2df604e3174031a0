"""profilefit regenerate: simulate, fit, and write the records."""

from __future__ import annotations

from enum import StrEnum
from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out
from profilefit.cli import words
from profilefit.cli.options import Quiet
from profilefit.recipes.folder import LOCAL

PRESETS = "quick: 2.1e7 photons, minutes. full: 4.2e8. Fewer in each setting whose surface refracts."


class Preset(StrEnum):
    """How much light: quick is enough for four digits of most constants, full for five."""

    QUICK = "quick"
    FULL = "full"


@carried_out("profilefit.commands.regenerate")
def regenerate(
    recipes: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of recipes, or .toml files; all of them if none is named.", autocompletion=words.recipes
        ),
    ] = None,
    preset: Annotated[Preset, typer.Option(help=PRESETS)] = Preset.QUICK,
    out: Annotated[
        Path, typer.Option(help="Folder for the records, and for the photons that a rerun resumes.")
    ] = LOCAL,
    seed: Annotated[int, typer.Option(help="Seed of the photons and of the chains, 0 to 4294967295.")] = 1,
    photons: Annotated[
        int | None, typer.Option(help="Number of photons in each setting instead of the preset's.")
    ] = None,
    as_json: Annotated[
        bool, typer.Option("--json", help="Print what was written as JSON: constants, errors, quality.")
    ] = False,
    quiet: Quiet = False,
) -> None:
    """Simulate light, refit the laws, write the records.

    One record a recipe, in seconds or minutes each. Ctrl-C loses the batch in flight only: the same command resumes.

    \b
    Examples:
      profilefit regenerate hazard --out mine
      profilefit regenerate albedo-liang --photons 100000 --out mine
    """
