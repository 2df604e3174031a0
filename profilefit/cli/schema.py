"""profilefit schema: keys and values of a file, for editors."""

from __future__ import annotations

from typing import Annotated

import typer

FILES = ("scene", "stack", "recipe", "photo")


def schema(kind: Annotated[str, typer.Argument(metavar="KIND", help=f"Kind of file: {', '.join(FILES)}.")]) -> None:
    """Print the JSON Schema of a file.

    Editors use it to complete and check keys. Limits that join several keys are checked by the commands only.

    \b
    Example:
      profilefit schema scene
    """
    from mcml_sim.files.whole_file import as_json
    from profilefit.errors import InputError

    if kind not in FILES:
        raise InputError(f"KIND must be one of {', '.join(FILES)}, got {kind!r}")

    from profilefit.report.tables.keys_table import models, schema_of

    typer.echo(as_json(schema_of(models()[kind])), nl=False)
