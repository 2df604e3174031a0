"""profilefit export: a law as source for a shader or a program, or as JSON."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import interruptible
from profilefit.cli import options
from profilefit.cli.folders import known_phases, records_folder
from profilefit.cli.options import Fits
from profilefit.errors import InputError

SEGMENT, FUR, SCENE = "sea-segment", "fur", ".toml"  # names, and how that of a file ends


def export(
    what: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A record (hazard-diffuse), law (burley), map (chiang), stack (skin), phase (petzold), sea-segment or "
            "fur.",
            autocompletion=options.subjects,
        ),
    ],
    lang: Annotated[
        str, typer.Option(help=f"One of {', '.join(options.LANGUAGES)}.", autocompletion=options.languages)
    ] = "glsl",
    constants: Annotated[
        str | None,
        typer.Option(
            help="Of a law: regenerated, a printed set (published, corrected), or a record's path.",
            autocompletion=options.constants,
        ),
    ] = None,
    n: Annotated[
        float | None,
        typer.Option("--n", help="Refractive index of the surface, if not that of the record: 1 to 1.6 for hazard."),
    ] = None,
    g: Annotated[
        float | None, typer.Option("--g", help="Mean cosine of the scattering angle: 0 to 0.95 for hazard, n near 1.4.")
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="What its functions begin with instead of the law's name: two media in one shader need two."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File to write; without it the source is printed.")] = None,
    fits: Fits = None,
) -> None:
    """Write a law as one file for a shader or a program.

    Its functions, every constant with its errors, units, illumination, range and digests. Without --constants a law or
    map that was not regenerated has its printed ones. Of a stack: the law of its three colours with the first layer's
    thickness as an argument, and light scattered once. Of a phase function: its best sum of terms, with its sampler.
    sea-segment: what a beam brings to a view ray in water. Of a sea's file, SEA.toml: the blur of light on its floor.
    fur: what cones of fur hide, their discs on shells, and where a ray comes into one.

    \b
    Examples:
      profilefit export hazard-diffuse --n 1.4 --g 0.9 --lang hlsl --out skin.hlsl
      profilefit export hazard-diffuse --n 1.37
    """
    with interruptible(__name__):
        from mcml_sim.files.whole_file import write_whole
        from profilefit.recipes.folder import LOCAL, fits_folder
        from profilefit.recipes.inventory import find
        from profilefit.recipes.phases.record import load
        from profilefit.recipes.stack import record as stack_record
        from profilefit.shader import export as exported
        from profilefit.shader.phase_text import export_phase
        from profilefit.shader.stack_file import export_stack

    folder = records_folder(fits)
    path = stack_record.find(what, folder)
    if path is None and fits is None:  # beside one's own records of other laws, or where there are none of these
        path = stack_record.find(what, LOCAL) or stack_record.find(what, fits_folder())
    if path is not None:
        _require_none("a stack", what, constants, n, g)
        text = export_stack(stack_record.load(path), lang, name)
    elif what in (phases := known_phases(fits)):
        _require_none("a phase function", what, constants, n, g)
        text = export_phase(load(phases[what]), lang, name)
    elif what == SEGMENT or what.endswith(SCENE):
        _require_none("of light in water", what, constants, n, g)
        text = _of_sea(what, lang, name)
    elif what == FUR:
        _require_none("of fur", what, constants, n, g)
        text = _of_fur(lang, name)
    else:
        text = exported(find(what, folder, constants, n, g), folder, lang, name)
    if out is None:
        sys.stdout.write(text)
    else:
        write_whole(out, text)


def _require_none(kind: str, what: str, constants: str | None, n: float | None, g: float | None) -> None:
    """Options that only laws have."""
    options = (("--constants", constants), ("--n", n), ("--g", g))
    if given := [option for option, value in options if value is not None]:
        raise InputError(f"{given[0]} must be left out where NAME is {kind}, got {what!r}")


def _of_sea(what: str, lang: str, name: str | None) -> str:
    with interruptible(__name__):
        from mcml_sim.files.text_file import read_toml
        from profilefit.scenes.sea import law
        from profilefit.scenes.sea.passes import GAUSSIANS
        from profilefit.scenes.sea.scene import read
        from profilefit.shader.emit import text_beside
        from profilefit.shader.sea_file import export_blur, export_segment

    if what == SEGMENT:
        return export_segment(text_beside(law.__name__, "glsl/segment.glsl"), lang, name)
    told = read_toml(Path(what))
    if (kind := told.get("scene")) != "sea":
        raise InputError(f"{what}: scene must be sea, whose water has a text, got {kind!r}")
    world = read(what, told).world
    depth, rates = world.depth * world.slant, world.c.tolist()
    blurs = [
        law.water_gaussians(omega, c * depth, world.lobes, GAUSSIANS)
        for omega, c in zip(world.omega.tolist(), rates, strict=True)
    ]
    return export_blur(blurs, rates, depth, lang, name)


def _of_fur(lang: str, name: str | None) -> str:
    with interruptible(__name__):
        from profilefit.scenes.fur import law
        from profilefit.shader.emit import text_beside
        from profilefit.shader.fur_file import export_strand

    return export_strand(text_beside(law.__name__, "glsl/strand.glsl"), lang, name)
