"""profilefit choose: the cheapest way to render scattering within a scene's tolerance and budget."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from mcml_sim.cli.lazy import interruptible
from profilefit.cli.options import AsJson, Quiet

if TYPE_CHECKING:
    from profilefit.recipes.toml_tables import Table
    from profilefit.studies.choose.cost import Ratios
    from profilefit.studies.choose.requirements import Requirements

UNSERVED = 1  # exit status
HEART, SEA, FUR = "heart", "sea", "fur"  # what a scene's file says


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
    """Find the cheapest option within a scene's limits.

    The limits are its error tolerance and its time budget. Options range from no scattering through filters to samples
    of a law, each with its predicted error; and whether one layer is enough for a stack of layers, by exact light
    or traced, in its worst colour, and whether light scattered once needs a pass. Half a minute. --json prints every
    option and its constants. Exit status 1 if no option is within the limits.

    Of a file that `profilefit scene` draws as a heart: whether it needs an atlas, or the screen by itself is enough.
    As a sea: which terms of its water's light, which splat and how many steps to a hit it needs.
    As a ball of fur: how many layers by the angle of the view, and drawn which way.

    \b
    Example, on a file of profilefit examples:
      profilefit choose examples/skin.toml
    """
    with interruptible(__name__):
        from mcml_sim.cli.screen import print_json, screen
        from mcml_sim.files.text_file import read_toml
        from mcml_sim.runs.progress import tracked
        from profilefit.errors import InputError
        from profilefit.report.tables.choose_table import choose_table, content
        from profilefit.studies.choose import cost
        from profilefit.studies.choose.choice import choose as chosen
        from profilefit.studies.choose.layers import of_each_colour
        from profilefit.studies.choose.requirements import read

    told = read_toml(scene)
    if (kind := told.get("scene")) in OF_SCENES:
        if measure:
            raise InputError(f"{scene}: --measure must be left out of a {kind}'s file, of which no cost is asked")
        OF_SCENES[kind](scene, told, as_json, quiet)
        return
    requirements = read(scene)
    ratios = _measured(requirements, quiet) if measure else cost.shipped()
    choice = chosen(requirements, ratios, lambda options: tracked(options, "predicting", "options", quiet=quiet))
    stack, bar = requirements.layers, False if quiet else None
    layers = () if stack is None else of_each_colour(stack, requirements.tolerance, requirements.within, bar)
    if as_json:
        print_json(content(choice, ratios, layers))
    else:
        screen().print(choose_table(choice, ratios, layers))
    if choice.chosen is None:
        raise typer.Exit(UNSERVED)


def _of_heart(file: Path, told: Table, as_json: bool, quiet: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import print_json, screen
        from mcml_sim.runs.progress import working
        from profilefit.report.tables.choose_table import atlas_content, atlas_line
        from profilefit.scenes.heart.scene import read as read_heart
        from profilefit.shader import opened
        from profilefit.studies.choose.atlas import atlas_need

    request = read_heart(str(file), told)
    with working("summing what the screen does not see", quiet), opened() as context:
        need = atlas_need(context, request)
    if as_json:
        print_json(atlas_content(need))
    else:
        screen().print(atlas_line(need), markup=False)


def _of_sea(file: Path, told: Table, as_json: bool, quiet: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import print_json, screen
        from mcml_sim.runs.progress import working
        from profilefit.report.tables.choose_table import sea_content, sea_lines
        from profilefit.scenes.sea.scene import read as read_sea
        from profilefit.studies.choose.sea import sea_need

    request = read_sea(str(file), told)
    with working("summing the haze", quiet):
        need = sea_need(request)
    if as_json:
        print_json(sea_content(need))
    else:
        for line in sea_lines(need):
            screen().print(line, markup=False)


def _of_fur(file: Path, told: Table, as_json: bool, quiet: bool) -> None:
    with interruptible(__name__):
        from mcml_sim.cli.screen import print_json, screen
        from mcml_sim.runs.progress import tracked
        from profilefit.report.tables.choose_table import fur_content, fur_lines
        from profilefit.scenes.fur.request import read as read_fur
        from profilefit.studies.choose.fur import ANGLES, fur_need

    request = read_fur(str(file), told)
    need = fur_need(request, tracked(ANGLES, "casting rays", "angles", quiet=quiet))
    if as_json:
        print_json(fur_content(need))
    else:
        for line in fur_lines(need):
            screen().print(line, markup=False)
    if need.way is None:
        raise typer.Exit(UNSERVED)


OF_SCENES = {HEART: _of_heart, SEA: _of_sea, FUR: _of_fur}


def _measured(requirements: Requirements, quiet: bool) -> Ratios:
    with interruptible(__name__):
        from mcml_sim.runs.progress import working
        from profilefit.shader import opened
        from profilefit.studies.choose import cost
        from profilefit.studies.choose.choice import laws

    with working("measuring costs", quiet), opened() as context:
        return cost.measured(context, laws(requirements.setting))
