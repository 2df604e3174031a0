"""profilefit scene: draw a scene by a technique, beside its reference, with its error and cost."""

from __future__ import annotations

from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from profilefit.cli.options import AsJson, Quiet, refused
from profilefit.errors import InputError
from profilefit.recipes.folder import shipped
from profilefit.scenes import SCENES

OUT = Path("scene")
MOST_FRAMES = 9999


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
    frames: Annotated[
        int | None, typer.Option(min=1, max=MOST_FRAMES, help="Number of pictures of a scene that moves.")
    ] = None,
    fps: Annotated[float, typer.Option(min=1e-3, max=1e3, help="Frames per second [1/s].")] = 24.0,
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
    from mcml_sim.files.whole_file import read_toml, require_writable, write_together, write_whole
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
    moments = [request] if frames is None else [request.after(number / fps) for number in range(frames)]
    stem = out / Path(file).stem
    stems = [f"{stem}"] if frames is None else [f"{stem}-{number:04d}" for number in range(1, frames + 1)]
    for one in (str(stem), *stems):
        for end in (".json", ".png", "-truth.png", "-error.png", "-comparison.png"):
            require_writable(Path(f"{one}{end}"))
    bodies: list[dict[str, Any]] = []
    sky = request.light_table.sky
    with working(f"drawing the scene{'' if no_reference else ' and its reference'}", quiet), opened() as context:
        device = renderer(context)
        for moment, name in zip(moments, stems, strict=True):
            drawn = (home.picture if no_reference else home.draw)(context, moment)
            pictures = report.scene_figures(drawn, device.partition(",")[0])
            write_together({Path(f"{name}{end}.png"): png for end, png in pictures.items()})
            bodies.append(report.content(drawn, device))
            for line in () if as_json else report.scene_lines(drawn, device):
                screen().print(line, markup=False, soft_wrap=True)
    body: dict[str, Any] = {"made": {"by": typed(), "version": __version__}, "of": content}
    body |= bodies[0] if frames is None else {"frames": bodies}
    if sky is not None:
        body["environment"] = {"harmonics_error": sky.error._asdict()}
        if not as_json:
            screen().print(report.sky_line(sky), markup=False, soft_wrap=True)
    write_whole(Path(f"{stem}.json"), json_text(body))
    if as_json:
        print_json(body)
    notes(quiet).print(f"wrote {stem}.json and {', '.join(f'{one}*.png' for one in stems)}", markup=False)
