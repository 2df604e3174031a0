"""profilefit export: a law as text for a shader, a program or a reader."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out
from profilefit.cli import words
from profilefit.cli.options import Fits


@carried_out("profilefit.commands.export")
def export(
    what: Annotated[
        str,
        typer.Argument(
            metavar="NAME",
            help="A record (hazard-diffuse), a law (burley) or a map (chiang).",
            autocompletion=words.subjects,
        ),
    ],
    lang: Annotated[
        str, typer.Option(help=f"One of {', '.join(words.LANGUAGES)}.", autocompletion=words.languages)
    ] = "glsl",
    constants: Annotated[
        str | None,
        typer.Option(
            help="Of a law: regenerated, a printed set (published, corrected), or a record's path.",
            autocompletion=words.constants,
        ),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="What its functions begin with instead of the law's name: two media in one shader need two."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File to write; without it the text is printed.")] = None,
    fits: Fits = None,
) -> None:
    """Write a law as one file for a shader or a program.

    Its functions, every constant with its errors, units, light, range and digests. Without --constants a law or map
    that was not regenerated has its printed ones.

    \b
    Example:
      profilefit export hazard-diffuse --lang hlsl --name skin --out skin.hlsl
    """
