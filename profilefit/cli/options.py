"""Options that several subcommands have."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

Fits = Annotated[
    Path | None, typer.Option(help="Folder of the records: ./fits if it has any, which is said, else the ones shipped.")
]
AsJson = Annotated[bool, typer.Option("--json", help="Print all of it as JSON instead.")]
Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress and no notes: the result only.")]
