"""profilefit choose: the cheapest way to render scattering within a scene's tolerance and budget."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

import typer

from profilefit.cli.options import AsJson, Quiet
from profilefit.scenes import SCENES

if TYPE_CHECKING:
    from collections.abc import Sequence

    from rich.console import RenderableType

    from profilefit.recipes.declared import Table

UNSERVED = 1  # exit status


# Answer for a scene as data and as printed, and whether any option is within the scene's limits.
SceneNeed = tuple[dict[str, Any], "Sequence[RenderableType]", bool]


def choose(
    scene: Annotated[
        Path,
        typer.Argument(metavar="SCENE.toml", help="File of a scene, for example skin.toml."),
    ],
    measure: Annotated[
        bool,
        typer.Option("--measure", help="Measure cost ratios on this machine's OpenGL, in place of the shipped ones."),
    ] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Find the cheapest option within a scene's limits.

    The limits are the scene's error tolerance and time budget. Options range from no scattering to sampled profile
    models, each with its predicted error (half a minute). A stack's result states whether one layer is enough and
    whether single scattering needs a pass. A heart's, sea's or ball of fur's result states which atlas, terms or layers
    it needs. Exit status 1 if no option is within the limits.

    \b
    Example, on a file of profilefit examples:
      profilefit choose examples/skin.toml
    """
    from mcml_sim.cli.screen import answer
    from mcml_sim.files.whole_file import read_toml
    from profilefit.errors import InputError

    content = read_toml(scene)
    kind = str(content.get("scene"))
    if kind not in OTHERS:
        body, printed, served = _technique(scene, content, measure, quiet)
    elif measure:
        raise InputError(f"{scene}: --measure must be left out with a {kind}'s file, which has no cost ratios")
    else:
        body, printed, served = OTHERS[kind](import_module(SCENES[kind][0]).read(str(scene), content), quiet)
    answer(body, (), printed, as_json)
    if not served:
        raise typer.Exit(UNSERVED)


def _technique(scene: Path, content: Table, measure: bool, quiet: bool) -> SceneNeed:
    from mcml_sim.runs.progress import tracked, working
    from profilefit.report.tables import choose_table as table
    from profilefit.shader import opened
    from profilefit.studies.choose import cost
    from profilefit.studies.choose.choice import choose, laws
    from profilefit.studies.choose.layers import of_each_colour
    from profilefit.studies.choose.requirements import read

    of = read(scene, content)
    ratios = cost.shipped()
    if measure:
        with working("measuring costs", quiet), opened() as context:
            ratios = cost.measured(context, laws(of.setting))
    choice = choose(of, ratios, lambda options: tracked(options, "predicting", "options", quiet=quiet))
    stack, bar = of.layers, False if quiet else None
    layers = () if stack is None else of_each_colour(stack, of.tolerance, of.within, bar, of.setting.illumination)
    printed = [table.choose_table(choice, ratios, layers)]
    return table.content(choice, ratios, layers), printed, choice.chosen is not None


def _heart(request: Any, quiet: bool) -> SceneNeed:
    from mcml_sim.runs.progress import working
    from profilefit.report.tables.choose_table import atlas_content, atlas_line
    from profilefit.shader import opened
    from profilefit.studies.choose.scenes import atlas_need

    with working("measuring hidden light", quiet), opened() as context:
        need = atlas_need(context, request)
    return atlas_content(need), [atlas_line(need)], True


def _sea(request: Any, quiet: bool) -> SceneNeed:
    from mcml_sim.runs.progress import working
    from profilefit.report.tables.choose_table import sea_content, sea_lines
    from profilefit.studies.choose.scenes import sea_need

    with working("measuring the haze", quiet):
        need = sea_need(request)
    return sea_content(need), sea_lines(need), True


def _fur(request: Any, quiet: bool) -> SceneNeed:
    from mcml_sim.runs.progress import tracked
    from profilefit.report.tables.choose_table import fur_content, fur_lines
    from profilefit.studies.choose.scenes import ANGLES, fur_need

    need = fur_need(request, tracked(ANGLES, "casting rays", "angles", quiet=quiet))
    return fur_content(need), fur_lines(need), need.way is not None


OTHERS = {"heart": _heart, "sea": _sea, "fur": _fur}  # scenes with other results
