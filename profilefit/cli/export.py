"""profilefit export: a law as text for a shader, a program or a reader."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from profilefit import catalogue, record
from profilefit.inventory import find
from profilefit.shader.export import LANGUAGES
from profilefit.shader.export import export as exported

LOCAL = Path("fits")


def export(
    what: Annotated[
        str,
        typer.Argument(metavar="NAME", help="A record (hazard-diffuse), a law (burley) or a map (chiang)."),
    ],
    lang: Annotated[str, typer.Option(help=f"One of {', '.join(LANGUAGES)}.")] = "glsl",
    constants: Annotated[
        str | None,
        typer.Option(help="Of a law: regenerated, a printed set (published, corrected), or a record's path."),
    ] = None,
    name: Annotated[
        str | None,
        typer.Option(help="What its functions begin with instead of the law's name: two media in one shader need two."),
    ] = None,
    out: Annotated[Path | None, typer.Option(help="File to write; without it the text is printed.")] = None,
    fits: Annotated[
        Path | None, typer.Option(help="Folder of the records: ./fits if it has any, else the ones shipped.")
    ] = None,
) -> None:
    """Write a law as one file: its functions, every constant with its errors, units, light, range and digests.

    Without --constants a law or map that was not regenerated has its printed ones.
    Example: profilefit export hazard-diffuse --lang hlsl --name skin --out skin.hlsl
    """
    folder = fits or (LOCAL if record.available(LOCAL) else catalogue.fits_folder())
    text = exported(find(what, folder, constants), folder, lang, name)
    if out is None:
        typer.echo(text, nl=False)
    else:
        record.write_text(out, text)
