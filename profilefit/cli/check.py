"""profilefit check: run the shader texts of laws on this machine's OpenGL, and judge them by their own bounds."""

from __future__ import annotations

import enum
from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out
from profilefit.cli import words
from profilefit.cli.options import AsJson, Fits, Quiet


class Precision(enum.StrEnum):
    """What is measured besides float32, in which every bound is judged."""

    SINGLE = "float32"
    HALF = "float16"


@carried_out("profilefit.commands.check")
def check(
    names: Annotated[
        list[str] | None,
        typer.Argument(
            help="Names of laws, maps or records; all that were regenerated if none is.", autocompletion=words.subjects
        ),
    ] = None,
    constants: Annotated[
        str | None,
        typer.Option(
            help="regenerated (the default, where there are any) or a printed set (published, diffuse).",
            autocompletion=words.constants,
        ),
    ] = None,
    precision: Annotated[
        Precision, typer.Option(help="float16 measures also what half precision costs, where it is offered.")
    ] = Precision.SINGLE,
    out: Annotated[Path | None, typer.Option(help="Folder for check.json, what --json prints.")] = None,
    fits: Fits = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Judge shader texts on this machine's GPU (a minute).

    Every text is evaluated, ends included, and compared with float64 and with the exact half space. Exit status 1 if a
    bound is broken: float32 errors below a tenth of the model's own, and no number that must not be.

    \b
    Examples:
      profilefit check hazard albedo-rational
      profilefit check liang --constants published
    """
