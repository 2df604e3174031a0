"""Run the shader texts of laws on this machine's OpenGL, and judge them by their own bounds."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import moderngl
import typer
from rich.console import RenderableType

from mcml_sim.cli.screen import notes, print_json, screen, show, typed
from mcml_sim.files.plain import as_json as json_text
from mcml_sim.files.whole_file import write_whole
from mcml_sim.runs.progress import tracked, working
from profilefit.recipes.evidence import made, require_apart
from profilefit.recipes.folder import Records, records_folder
from profilefit.recipes.inventory import Named
from profilefit.report.tables.check_tables import (
    check_tables,
    content,
    cost_table,
    half_table,
    place_tables,
    verdict_lines,
)
from profilefit.shader.check.chosen import REGENERATED, chosen
from profilefit.shader.check.cost import Cost, law_costs
from profilefit.shader.check.evaluate import half_extension, no_half
from profilefit.shader.check.half import HalfCheck, check_half
from profilefit.shader.check.laws import LawCheck, check_laws
from profilefit.shader.check.maps import MapCheck, check_map
from profilefit.shader.context import opened, renderer

HALF = "float16"
BROKEN = 1


@dataclass(frozen=True)
class Found:
    """All that was measured; `lacking` says why nothing was in half precision."""

    laws: list[LawCheck]
    maps: list[MapCheck]
    costs: dict[str, Cost]
    halves: list[HalfCheck]
    device: str
    lacking: str

    @property
    def is_broken(self) -> bool:
        """Whether any bound is."""
        return any(one.broken for one in (*self.laws, *self.maps))


def check(
    names: list[str] | None,
    constants: str | None,
    precision: str,
    out: Path | None,
    fits: Path | None,
    as_json: bool,
    quiet: bool,
) -> None:
    """Measure, print or keep, and exit with status 1 if a bound is broken."""
    folder = records_folder(fits, quiet)
    records = Records(folder)
    laws, maps = chosen(names or [], constants, records)
    if out is not None:
        require_apart(out, folder)
    found = _measured(laws, maps, records, precision == HALF, quiet)
    if out is not None or as_json:
        told = {"made": made(typed(), folder), "of": asked(names, constants), **_content(found)}
    if out is not None:
        write_whole(out / "check.json", json_text(told))
        notes(quiet).print(f"wrote {out / 'check.json'}", markup=False)
    if as_json:
        print_json(told)
    else:
        _show(found, bool(names), precision == HALF)
    if found.is_broken:
        raise typer.Exit(BROKEN)


def _measured(laws: Sequence[Named], maps: Sequence[Named], folder: Records, in_half: bool, quiet: bool) -> Found:
    with opened() as context:
        checks = list(tracked(_checks(context, laws, maps, folder), "checking", "laws", len(laws) + len(maps), quiet))
        with working("timing the texts", quiet):
            costs = law_costs(context, laws, folder)
        halves = list(
            tracked((check_half(context, one) for one in laws if in_half), "halving", "laws", len(laws), quiet)
        )
        return Found(
            laws=[one for one in checks if isinstance(one, LawCheck)],
            maps=[one for one in checks if isinstance(one, MapCheck)],
            costs=costs,
            halves=halves,
            device=renderer(context),
            lacking="" if half_extension(context) else no_half(context),
        )


def _checks(
    context: moderngl.Context, laws: Sequence[Named], maps: Sequence[Named], folder: Records
) -> Iterator[LawCheck | MapCheck]:
    yield from check_laws(context, laws, folder)
    for one in maps:
        yield check_map(context, one, folder)


def asked(names: list[str] | None, constants: str | None) -> list[str] | str:
    """What is judged, for "of" in check.json: names or "all", so that a part does not pass for the whole."""
    return names or ("all" if constants in (None, REGENERATED) else f"all {constants}")


def _content(found: Found) -> dict[str, Any]:
    return content(found.laws, found.maps, found.costs, found.halves, found.device)


def _show(found: Found, named: bool, in_half: bool) -> None:
    console = screen()
    parts: list[RenderableType] = check_tables(found.laws, found.maps, found.device)
    parts += place_tables(found.laws) if named else []
    parts += [cost_table(found.costs, found.device)] if found.costs else []
    parts += [half_table(found.halves)] if found.halves else []
    show(parts, console)
    if in_half and found.lacking:
        console.print(found.lacking, markup=False)
    for line in verdict_lines([*found.laws, *found.maps]):
        console.print(line)
