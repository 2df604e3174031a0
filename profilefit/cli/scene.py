"""profilefit scene: draw a scene by a technique, beside its reference, with its error and cost."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Annotated

import typer

from profilefit.cli.options import AsJson, Quiet, refused
from profilefit.errors import InputError
from profilefit.recipes.folder import shipped
from profilefit.scenes import SCENES

OUT = Path("scene")


def scene(
    file: Annotated[
        str,
        typer.Argument(
            metavar="FILE.toml",
            help=f"File of a scene, or its name with --example: {', '.join(SCENES)}.",
        ),
    ],
    out: Annotated[Path, typer.Option(help="Folder for pictures (PNG) and numbers (JSON).")] = OUT,
    no_reference: Annotated[bool, typer.Option("--no-reference", help="Draw the picture alone, of any size.")] = False,
    example: Annotated[bool, typer.Option("--example", help="Print an example file of a scene.")] = False,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Draw a scene beside its reference (a minute).

    For a file NAME.toml, the picture by its technique is NAME.png. NAME-comparison.png shows it beside the reference,
    the error of each pixel, and two other techniques. The reference has a picture, too. NAME.json contains error and
    cost, which are also printed. Times belong to this machine's OpenGL, which is a GPU or a software rasteriser.

    \b
    Example, on a file of profilefit examples:
      profilefit scene examples/skin-head.toml --out pictures
    """
    from mcml_sim.cli.screen import notes, print_json, screen, typed
    from mcml_sim.files.version import __version__
    from mcml_sim.files.whole_file import as_json as json_text
    from mcml_sim.files.whole_file import read_toml, require_writable, write_together
    from mcml_sim.runs.progress import working
    from profilefit.shader.context import opened, renderer

    known = ", ".join(SCENES)
    if example:
        if file not in SCENES:
            raise refused("NAME", f"one of {known} with --example", file)
        typer.echo((shipped("examples") / SCENES[file][1]).read_text(encoding="utf-8"), nl=False)
        return
    content = read_toml(file)
    name = content.get("scene")
    if not isinstance(name, str) or name not in SCENES:
        raise InputError(f"{file}: scene must be one of {known}, got {'nothing' if name is None else repr(name)}")
    from profilefit.report import scene_report as report  # late: it loads what draws

    home = import_module(SCENES[name][0])
    request = home.read(file, content)
    if not no_reference:
        request.require_reference()
    stem = out / Path(file).stem
    for end in (".json", ".png", "-truth.png", "-error.png", "-comparison.png"):
        require_writable(Path(f"{stem}{end}"))
    with working(f"drawing the scene{'' if no_reference else ' and its reference'}", quiet), opened() as context:
        drawn, device = (home.picture if no_reference else home.draw)(context, request), renderer(context)
    figures = report.scene_figures(drawn, device.partition(",")[0])
    files: dict[Path, bytes | str] = {Path(f"{stem}{end}.png"): png for end, png in figures.items()}
    body = {"made": {"by": typed(), "version": __version__}, "of": content, **report.content(drawn, device)}
    files[Path(f"{stem}.json")] = json_text(body)
    write_together(files)
    if as_json:
        print_json(body)
    for line in () if as_json else report.scene_lines(drawn, device):
        screen().print(line, markup=False, soft_wrap=True)
    notes(quiet).print(f"wrote {', '.join(map(str, files))}", markup=False)
