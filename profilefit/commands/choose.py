"""The least way to scatter light that is within a scene's tolerance and budget."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

import typer

from mcml_sim.cli.screen import print_json, screen
from mcml_sim.runs.progress import tracked, working
from profilefit.report.tables.choose_table import choose_table, content
from profilefit.shader.context import opened
from profilefit.studies.choose import cost
from profilefit.studies.choose.choice import choose as chosen
from profilefit.studies.choose.choice import laws
from profilefit.studies.choose.layers import one_layer
from profilefit.studies.choose.options import Option
from profilefit.studies.choose.scene import Scene, read

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
