"""profilefit examples: copies of the files that examples of commands read."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Annotated

import typer

from profilefit.errors import OutputError
from profilefit.recipes.folder import shipped

OUT = Path("examples")


def examples(
    out: Annotated[Path, typer.Option(help="Folder for the copies; existing files are never replaced.")] = OUT,
) -> None:
    """Copy the example files of other commands.

    Copies a measured profile, scenes, layered media and simulated media, and prints their names.

    \b
    Example:
      profilefit examples --out trial
    """
    from mcml_sim.cli.screen import screen
    from mcml_sim.files.whole_file import require_writable, write_together

    files = sorted(path for path in shipped("examples").iterdir() if path.is_file())
    if taken := [path.name for path in files if os.path.lexists(out / path.name)]:
        mend = "use --out with another folder"
        raise OutputError(f"cannot write into {out}: {', '.join(taken)} would be replaced; {mend}")
    for path in files:
        require_writable(out / path.name)
    write_together({out / path.name: path.read_bytes() for path in files})
    console = screen()
    for path in files:
        console.print(str(out / path.name), markup=False)
