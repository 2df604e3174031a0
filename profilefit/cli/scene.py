"""profilefit scene: draw a scene by a technique, beside its reference, with its error and cost."""

from __future__ import annotations

import re
from importlib import import_module
from pathlib import Path
from typing import Annotated, Any

import typer

from profilefit.cli.options import AsJson, Quiet, refused
from profilefit.errors import InputError, OutputError
from profilefit.recipes.folder import shipped
from profilefit.scenes import SCENES

OUT = Path("scene")
MOST_FRAMES, FPS = 9999, 24.0
MOST_NAMES = 4  # of older files in a note


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
    fps: Annotated[
        float | None, typer.Option(min=1e-3, max=1e3, help="Frames per second of --frames [1/s], 24 by default.")
    ] = None,
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
    if fps is not None and frames is None:
        raise InputError(f"--fps must be left out without --frames, got {fps:g}")
    content = read_toml(file)
    name = content.get("scene")
    if not isinstance(name, str) or name not in SCENES:
        raise InputError(f"{file}: scene must be one of {known}, got {'nothing' if name is None else repr(name)}")
    from profilefit.report import scene_report as report  # late: it loads what draws

    home = import_module(SCENES[name][0])
    request = home.read(file, content)
    if not no_reference:
        request.require_reference()
    moments = [request] if frames is None else [request.after(number / (fps or FPS)) for number in range(frames)]
    stem = out / Path(file).stem
    stems = [f"{stem}"] if frames is None else [f"{stem}-{number:04d}" for number in range(1, frames + 1)]
    numbers = Path(f"{stem}.json")
    pictures = [Path(f"{one}{end}.png") for one in stems for end in report.ENDS]
    for path in (numbers, *pictures):
        require_writable(path)
    if frames is not None:
        _require_no_more(stem, frames)
    body: dict[str, Any] = {"made": {"by": typed(), "version": __version__}, "of": content}
    bodies: list[dict[str, Any]] = []
    written: list[Path] = []
    exposure: float | None = None
    if request.wait:
        notes(quiet).print(request.wait, markup=False)
    sky = request.light_table.sky
    with working(f"drawing the scene{'' if no_reference else ' and its reference'}", quiet), opened() as context:
        device = renderer(context)
        for moment, name in zip(moments, stems, strict=True):
            drawn = (home.picture if no_reference else home.draw)(context, moment, exposure)
            exposure = drawn.exposure  # of all frames, or pictures in a row would flicker
            bodies.append(report.content(drawn, device))
            figures = report.scene_figures(drawn, device.partition(",")[0])
            files: dict[Path, bytes | str] = {Path(f"{name}{end}.png"): png for end, png in figures.items()}
            written += files
            body |= bodies[0] if frames is None else {"frames": bodies}
            body |= {} if sky is None else {"environment": {"harmonics_error": sky.error._asdict()}}
            body["files"] = [path.name for path in (*written, numbers)]
            # With each frame, or a run that is stopped would leave an older run's numbers beside its pictures.
            write_together({**files, numbers: json_text(body)})
            if frames is not None and not as_json:
                screen().print(f"{name}.png:", markup=False, soft_wrap=True)
            for line in () if as_json else report.scene_lines(drawn, device):
                screen().print(line, markup=False, soft_wrap=True)
    if sky is not None and not as_json:
        screen().print(report.sky_line(sky), markup=False, soft_wrap=True)
    if as_json:
        print_json(body)
    if older := [path.name for path in pictures if path not in written and path.exists()]:
        names = ", ".join(older[:MOST_NAMES]) + (f" and {more} more" if (more := len(older) - MOST_NAMES) > 0 else "")
        notes(quiet).print(f"not of this run, and still in {out}: {names}", markup=False)
    last = "" if frames is None else f" to {stems[-1]}.png"
    ends = ", ".join(f"{end}.png" for end in figures if end)
    notes(quiet).print(f"wrote {numbers}, {stems[0]}.png{last}{ends and f', with {ends}'}", markup=False)


def _require_no_more(stem: Path, frames: int) -> None:
    """Raise OutputError where frames of a longer run would follow those of this one in the folder."""
    name = re.compile(rf"{re.escape(stem.name)}-(\d{{4}})\.png")
    numbers = (int(match[1]) for path in stem.parent.iterdir() if (match := name.fullmatch(path.name)))
    if (last := max(numbers, default=0)) > frames:
        raise OutputError(
            f"{stem}-{last:04d}.png would follow the {frames} frames, but is of a longer run: "
            "use --out with another folder, or delete the older pictures"
        )
