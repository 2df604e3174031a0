"""A law as text for a shader, a program or a reader."""

from __future__ import annotations

import sys
from pathlib import Path

from mcml_sim.files.whole_file import write_whole
from profilefit.recipes.folder import Records, records_folder
from profilefit.recipes.inventory import find
from profilefit.shader.export import export as exported


def export(what: str, lang: str, constants: str | None, name: str | None, out: Path | None, fits: Path | None) -> None:
    """Print the text, or write it."""
    records = Records(records_folder(fits))
    text = exported(find(what, records, constants), records, lang, name)
    if out is None:
        sys.stdout.write(text)
    else:
        write_whole(out, text)
