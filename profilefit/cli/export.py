"""profilefit export: a law as source for a shader or a program, or as JSON."""

from __future__ import annotations

import sys
from pathlib import Path
from typing import Annotated

import typer

from profilefit.cli import options


def export(
    what: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A record (hazard-diffuse), law (burley), map (chiang), stack (skin), phase (petzold), sea-segment or "
            "fur.",
            autocompletion=options.exported,
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
    fits: options.Fits = None,
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
    from mcml_sim.files.whole_file import write_whole
    from profilefit.scenes import SOURCES
    from profilefit.shader.law_file import export_subject

    options.records_folder(fits)  # says where those are from that are not the shipped ones
    given = {key: value for key, value in (("constants", constants), ("n", n), ("g", g)) if value is not None}
    text = export_subject(what, lang, name, fits, SOURCES, **given)
    if out is None:
        sys.stdout.write(text)
    else:
        write_whole(out, text)
