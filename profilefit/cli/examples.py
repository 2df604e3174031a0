"""profilefit examples: files to try the commands on."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out


@carried_out("profilefit.commands.examples")
def examples(
    out: Annotated[Path, typer.Option(help="Folder to copy them into; what is there is never replaced.")] = Path(
        "examples"
    ),
) -> None:
    """Copy the files that other commands' examples read.

    A measured profile, a scene, a layered medium, simulated half spaces; the name of each is printed.

    \b
    Examples:
      profilefit examples --out .
      profilefit examples --out trial
    """
