"""profilefit choose: the least model that a scene needs."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out
from profilefit.cli.options import AsJson, Quiet


@carried_out("profilefit.commands.choose")
def choose(
    scene: Annotated[
        Path,
        typer.Argument(
            metavar="SCENE.toml", help="What is drawn, and how well: skin.toml of `profilefit examples` is one."
        ),
    ],
    measure: Annotated[
        bool, typer.Option("--measure", help="Measure cost ratios on this machine's OpenGL, not those shipped.")
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Find the least that a scene needs to scatter light.

    From nothing at all through filters to samples of a law, each with its predicted error against the scene's tolerance
    and budget; and whether one layer is enough for a stack of layers, by tracing both. Half a minute. --json prints
    every option and its constants. Exit status 1 if nothing serves.

    \b
    Example, on a file of profilefit examples:
      profilefit choose examples/skin.toml
    """
