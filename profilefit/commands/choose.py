"""The least way to scatter light that is within a scene's tolerance and budget."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import typer

from mcml_sim.progress import tracked, working
from mcml_sim.screen import print_json, screen
from profilefit.choose import cost
from profilefit.choose.choice import choose as chosen
from profilefit.choose.choice import laws
from profilefit.choose.layers import one_layer
from profilefit.choose.options import Option
from profilefit.choose.scene import Scene, read
from profilefit.report.choose_table import choose_table, content
from profilefit.shader.context import opened

UNSERVED = 1


def choose(scene: Path, measure: bool, as_json: bool, quiet: bool) -> None:
    """Predict every option, print the choice, and exit with status 1 if nothing serves."""
    asked = read(scene)
    ratios = _measured(asked, quiet) if measure else cost.shipped()

    def track(options: list[Option]) -> Iterable[Option]:
        return tracked(options, "predicting", "options", quiet=quiet)

    choice = chosen(asked, ratios, track)
    layer = None
    if asked.layers is not None:
        layer = one_layer(asked.layers, asked.tolerance, asked.within, progress=False if quiet else None)
    if as_json:
        print_json(content(choice, ratios, layer))
    else:
        screen().print(choose_table(choice, ratios, layer))
    if choice.chosen is None:
        raise typer.Exit(UNSERVED)


def _measured(asked: Scene, quiet: bool) -> cost.Ratios:
    with working("measuring costs", quiet), opened() as context:
        return cost.measured(context, laws(asked.setting))
