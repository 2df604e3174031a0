"""Measure speed against accuracy of truths, laws, samplers and fits, and chart it."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any

from mcml_sim.cli.screen import notes, print_json, screen, show, typed
from mcml_sim.files.plain import as_json as json_text
from mcml_sim.files.text_file import read_json
from mcml_sim.files.whole_file import write_whole
from mcml_sim.runs.progress import tracked
from profilefit.errors import InputError
from profilefit.recipes.evidence import made, require_apart
from profilefit.recipes.folder import records_folder
from profilefit.report.figures.tradeoff_figure import tradeoff_figure
from profilefit.report.tables.tradeoff_tables import tradeoff_tables
from profilefit.studies.tradeoff import stopwatch
from profilefit.studies.tradeoff.parts import PARTS, chosen, measured
from profilefit.studies.tradeoff.points import Part
from profilefit.studies.tradeoff.stopwatch import on_one_core
from profilefit.studies.tradeoff.written import as_csv, as_numbers

Told = dict[str, Any]
WIDTH = 120  # columns that the tables take
SAME = ("version", "sha256", "machine")  # of `made`: what parts beside each other have in common


def tradeoff(parts: list[str] | None, out: Path, quick: bool, fits: Path | None, as_json: bool, quiet: bool) -> None:
    """Measure each part, write it at once, and print it."""
    names = chosen(parts or [])
    folder = records_folder(fits, quiet)
    require_apart(out, folder)
    file, said = out / "tradeoff.json", notes(quiet)
    origin = {"made": made(typed(), folder)}
    if file.exists() and not is_alike(read(file), origin):
        said.print(f"{file} is of other records, another version or machine: written afresh", markup=False)

    def track(turns: range, title: str) -> Iterable[int]:
        return tracked(turns, title, "turns", quiet=quiet)

    with stopwatch.on_processor(), on_one_core() as pinned:
        told: Told = {**origin, "machine": (known := stopwatch.facts(pinned))}
        for name in names:
            found = measured(name, quick, folder, track)
            files = _written(found, known, out)
            told[name] = {**as_numbers(found), **origin, "machine": known}
            keep(file, told)
            if not as_json:
                show(list(tradeoff_tables(found)), screen(WIDTH))
            said.print(f"wrote {', '.join(map(str, (*files, file)))}", markup=False)
    if as_json:
        print_json(told)


def keep(file: Path, told: Mapping[str, Any]) -> None:
    """Write what was measured, and the other parts that the file has, if they are comparable.

    told  "made" and "machine" of this run, and by its name each part measured so far, which has both, too
    """
    before = read(file)
    kept: Told = {}
    if is_alike(before, told):
        own = {key: before[key] for key in ("made", "machine") if key in before}
        kept = {name: {**own, **before[name]} for name in PARTS if isinstance(before.get(name), dict)}
    parts = {**kept, **told}
    heads = {name: value for name, value in told.items() if name not in PARTS}
    write_whole(file, json_text({**heads, **{name: parts[name] for name in PARTS if name in parts}}))


def read(file: Path) -> Told:
    """What a tradeoff.json says, which is nothing if it is damaged or not there: it is only added to, or replaced."""
    try:
        content = read_json(file)
    except InputError:
        return {}
    return content if isinstance(content, dict) and isinstance(content.get("made"), dict) else {}


def is_alike(before: Mapping[str, Any], told: Mapping[str, Any]) -> bool:
    """Whether both are of the same records, version and machine: else their times and errors do not compare."""
    return bool(before) and all(before["made"].get(key) == told["made"].get(key) for key in SAME)


def _written(found: Part, known: dict[str, str], out: Path) -> list[Path]:
    data = out / f"tradeoff-{found.name}.csv"
    write_whole(data, as_csv(found, known))
    return [*tradeoff_figure(found, stopwatch.caption(known), out), data]
