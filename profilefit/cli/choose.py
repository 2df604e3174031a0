"""profilefit choose: the least model that a scene needs."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from contextlib import nullcontext
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from profilefit.choose import cost
from profilefit.choose.choice import choose as chosen
from profilefit.choose.choice import laws
from profilefit.choose.layers import one_layer
from profilefit.choose.options import Option
from profilefit.choose.scene import read
from profilefit.report.choose_table import choose_table, content
from profilefit.shader.context import opened

WIDTH = 100
UNSERVED = 1


def choose(
    scene: Annotated[Path, typer.Argument(metavar="SCENE.toml", help="What is drawn, and how well: see examples/.")],
    as_json: Annotated[bool, typer.Option("--json", help="Print every option and its constants as JSON.")] = False,
    measure: Annotated[
        bool, typer.Option("--measure", help="Measure cost ratios on this machine's OpenGL, not those shipped.")
    ] = False,
) -> None:
    """Say which is the least way to scatter light that is within a scene's tolerance and budget (half a minute).

    From nothing at all through filters to samples of a law, each with its predicted error; and whether one layer is
    enough for a stack of layers, by tracing both. Exit status 1 if nothing serves.
    Example: profilefit choose examples/skin.toml
    """
    asked = read(scene)
    console = Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH)
    ratios = cost.shipped()
    if measure:
        shown = Console(stderr=True).status("measuring costs") if sys.stderr.isatty() else nullcontext()
        with shown, opened() as context:
            ratios = cost.measured(context, laws(asked.setting))
    choice = chosen(asked, ratios, _tracked)
    layer = None if asked.layers is None else one_layer(asked.layers, asked.tolerance, asked.within)
    if as_json:
        typer.echo(json.dumps(content(choice, ratios, layer), indent=1, ensure_ascii=False))
    else:
        console.print(choose_table(choice, ratios, layer))
    if choice.chosen is None:
        raise typer.Exit(UNSERVED)


def _tracked(options: list[Option]) -> Iterable[Option]:
    """The options as they come, with a bar that goes when the choice is made."""
    console = Console(stderr=True)
    return track(options, "predicting", console=console, transient=True, disable=not sys.stderr.isatty())
