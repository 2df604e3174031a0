"""Output of a command: results to stdout and nothing else there; notes and progress to stderr."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from rich.console import Console, RenderableType
from rich.measure import Measurement

from mcml_sim.files.whole_file import as_json as json_text
from mcml_sim.files.whole_file import write_whole

WIDEST = 1000  # columns that any table fits
WIDTH = 100  # columns of what goes into a file or a pipe, which have no width of their own; COLUMNS sets another


def screen(width: int = WIDTH) -> Console:
    """Open stdout with the width of the terminal, of COLUMNS, or `width` [characters]; rich respects NO_COLOR."""
    return Console(highlight=False, width=None if sys.stdout.isatty() or "COLUMNS" in os.environ else width)


def notes(quiet: bool) -> Console:
    """Open stderr for notes and progress."""
    return Console(stderr=True, quiet=quiet, highlight=False, soft_wrap=True)


def show(parts: Iterable[RenderableType], console: Console) -> None:
    """Print each part with a blank line after it."""
    for part in parts:
        put(part, console)
        console.print()


def put(part: RenderableType, console: Console) -> None:
    """Print a table at the width that its numbers need, because a truncated number would be misread."""
    usual = console.width
    console.width = max(usual, Measurement.get(console, console.options.update(max_width=WIDEST), part).minimum)
    console.print(part)
    console.width = usual


def print_json(value: Any) -> None:
    """Print JSON, and nothing else, with NaN and infinities as null: the only writer of --json."""
    text = json_text(value)
    encoding = (sys.stdout.encoding or "").lower().replace("-", "")
    sys.stdout.write(text if encoding == "utf8" else json_text(value, ascii_only=True))


def answer(
    body: Any,
    parts: Iterable[RenderableType],
    lines: Iterable[RenderableType] = (),
    as_json: bool = False,
    out: Path | None = None,
    name: str = "",
    note: str = "",
    quiet: bool = False,
) -> None:
    """Print the result of a command, as JSON or as tables with lines below them.

    With a folder `out`, the JSON is first written there as `name`, and `note` is printed unless `quiet`.
    """
    if out is not None:
        write_whole(out / name, json_text(body))
        notes(quiet).print(note or f"wrote {name} into {out}", markup=False)
    if as_json:
        print_json(body)
        return
    console = screen()
    show(parts, console)
    for line in lines:
        console.print(line, markup=False, emoji=False)


def typed() -> str:
    """Return the command as it was typed; `python -m` goes by the name of the package."""
    program = Path(sys.argv[0])
    name = program.parent.name if program.name == "__main__.py" else program.name
    return shlex.join([name, *sys.argv[1:]])
