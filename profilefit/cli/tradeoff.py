"""profilefit tradeoff: speed against accuracy of truths, laws, samplers and fits, measured and charted in one run."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import typer
from rich.console import Console
from rich.progress import track

from profilefit import record
from profilefit.report.tradeoff_figure import tradeoff_figure
from profilefit.report.tradeoff_tables import tradeoff_tables
from profilefit.tradeoff import machine
from profilefit.tradeoff.parts import PARTS, chosen, measured
from profilefit.tradeoff.stopwatch import on_one_core
from profilefit.tradeoff.written import as_csv, as_numbers

OUT = Path("tradeoff")
WIDTH = 120


def tradeoff(
    parts: Annotated[
        list[str] | None, typer.Argument(metavar="PART", help=f"{', '.join(PARTS)}; all of them if none is named.")
    ] = None,
    out: Annotated[Path, typer.Option(help="Folder for the figures (PNG and SVG) and their data (CSV).")] = OUT,
    fits: Annotated[
        Path | None, typer.Option(help="Folder of the records of regenerated constants, by default the ones shipped.")
    ] = None,
    quick: Annotated[bool, typer.Option("--quick", help="Less of everything: under a minute, and noisy.")] = False,
    as_json: Annotated[bool, typer.Option("--json", help="Print all that was measured as JSON instead.")] = False,
) -> None:
    """Measure speed against accuracy, with the spread of both and the front: truths, laws, samplers, fits (6 minutes).

    All on one core, in turns. Times mean something on an idle machine only; each CSV says how idle it was.
    Example: profilefit tradeoff laws --out charts
    """
    names = chosen(parts or [])
    record.require_writable(out)
    console = Console(highlight=False, width=None if sys.stdout.isatty() else WIDTH)
    numbers = {}
    with machine.on_processor(), on_one_core() as pinned:
        known = machine.facts(pinned)
        for name in names:
            found = measured(name, quick, fits, _tracked)
            record.write_text(out / f"tradeoff-{name}.csv", as_csv(found, known))
            files = [*tradeoff_figure(found, machine.caption(known), out), out / f"tradeoff-{name}.csv"]
            numbers[name] = as_numbers(found)
            if not as_json:
                for table in tradeoff_tables(found):
                    console.print(table)
                    console.print()
                console.print(f"wrote {', '.join(map(str, files))}\n", markup=False)
    if as_json:
        print(json.dumps(record.plain({"machine": known, **numbers}), indent=1, ensure_ascii=False))


def _tracked(turns: range, title: str) -> Iterable[int]:
    """Turns as they come, with a bar that goes when all are done."""
    console = Console(stderr=True)
    return track(turns, title, console=console, transient=True, disable=not sys.stderr.isatty())
