"""Copy the example files that came with this installation."""

from __future__ import annotations

import os
from pathlib import Path

from mcml_sim.cli.screen import screen
from mcml_sim.files.whole_file import require_writable, write_together
from profilefit.errors import OutputError
from profilefit.recipes.folder import shipped


def examples(out: Path) -> None:
    """Copy all of them, or none where one is there already, and print their paths."""
    files = sorted(path for path in shipped("examples").iterdir() if path.is_file())
    if taken := [path.name for path in files if os.path.lexists(out / path.name)]:
        raise OutputError(
            f"cannot write into {out}: {', '.join(taken)} would be replaced; use --out with another folder"
        )
    for path in files:
        require_writable(out / path.name)
    write_together({out / path.name: path.read_bytes() for path in files})
    console = screen()
    for path in files:
        console.print(str(out / path.name), markup=False)
