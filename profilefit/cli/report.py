"""profilefit report: show records as tables, and draw their figures."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from mcml_sim.cli.lazy import carried_out
from profilefit.cli import words
from profilefit.cli.options import AsJson, Fits, Quiet


@carried_out("profilefit.commands.report")
def report(
    names: Annotated[
        list[str] | None,
        typer.Argument(help="Names of records; a summary of all if none is named.", autocompletion=words.records),
    ] = None,
    quality: Annotated[
        bool, typer.Option("--quality", help="Measure every law against the exact half space instead (a minute).")
    ] = False,
    figures_to: Annotated[
        Path | None, typer.Option("--figures", help="Folder for the figures; without it none are drawn.")
    ] = None,
    markdown: Annotated[
        Path | None, typer.Option(help="Fill the tables between the marks <!-- name --> of this file instead.")
    ] = None,
    html: Annotated[
        Path | None,
        typer.Option(help="Write all of it as one HTML page, with figures and an explorer: two minutes."),
    ] = None,
    evidence: Annotated[
        Path | None,
        typer.Option(
            help="Folder that check, stability and tradeoff wrote into with --out, for the page: "
            "./evidence if it is there, else the one beside the records."
        ),
    ] = None,
    fits: Fits = None,
    as_json: AsJson = False,
    quiet: Quiet = False,
) -> None:
    """Show constants, their errors, and how good they are.

    Also quality by albedo, and the state of fits and chains. --quality prints instead how good every law, map and
    sampler is, printed ones too; or those of the records named.

    \b
    Examples:
      profilefit report hazard
      profilefit report liang-whole --figures figures
      profilefit report --html report.html
    """
