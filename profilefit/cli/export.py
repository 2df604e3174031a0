"""profilefit export: a profile model as source for a shader or a program, or as JSON."""

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
            help="Record (hazard-diffuse), profile model (burley), albedo inversion (chiang), stack (skin), phase "
            "function (petzold), sea's file (SEA.toml), sea-segment or fur.",
            autocompletion=options.exported,
        ),
    ],
    lang: Annotated[
        str, typer.Option(help=f"Language, one of {', '.join(options.LANGUAGES)}.", autocompletion=options.languages)
    ] = "glsl",
    constants: Annotated[
        str | None,
        typer.Option(
            help="Set of constants: regenerated, published, corrected, or a record's path.",
            show_default="regenerated where there are any, else published",
            autocompletion=options.constants,
        ),
    ] = None,
    n: Annotated[
        float | None,
        typer.Option("--n", help="Refractive index, 1 to 1.6 for hazard.", show_default="the record's"),
    ] = None,
    g: Annotated[
        float | None,
        typer.Option("--g", help="Anisotropy, 0 to 0.95 for hazard with n near 1.4.", show_default="the record's"),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="Prefix of the functions, one per medium of a shader.", show_default="the model's name"),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File to write.", show_default="printed to stdout")] = None,
    fits: options.Fits = None,
) -> None:
    """Write a profile model as shader source, or as JSON.

    The file contains the functions, every constant with its errors, units, illumination, range and digests. A stack's
    model takes the first layer's thickness as an argument and includes single scattering. A phase function is written
    as its best sum of terms, with a sampler. The name sea-segment gives the light that a beam adds to a view ray in
    water, SEA.toml the blur on a sea's floor, and fur the coverage of cones.

    \b
    Example:
      profilefit export hazard-diffuse --n 1.4 --g 0.9 --lang hlsl --out skin.hlsl
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
