"""The parts of the measurement by name, in the order in which they run, and the file that keeps them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mcml_sim.files.text_file import as_json, read_json
from mcml_sim.files.whole_file import write_whole
from profilefit.errors import InputError
from profilefit.studies.tradeoff import fits, fur, laws, samplers, sea, truth
from profilefit.studies.tradeoff.points import TradeoffPart
from profilefit.studies.tradeoff.stopwatch import Track, silent

Content = dict[str, Any]
SAME = ("version", "sha256", "machine")  # of `made`: what parts beside each other have in common
Measure = Callable[[bool, Path | None, Track], TradeoffPart]
"""Whether quickly, where the records lie, who is shown the progress -> part."""


def _truth(quick: bool, folder: Path | None, track: Track) -> TradeoffPart:
    del folder
    return truth.measure(truth.QUICK if quick else truth.FULL, track)


def _laws(quick: bool, folder: Path | None, track: Track) -> TradeoffPart:
    return laws.measure(laws.QUICK if quick else laws.FULL, folder, track)


def _samplers(quick: bool, folder: Path | None, track: Track) -> TradeoffPart:
    return samplers.measure(samplers.QUICK if quick else samplers.FULL, folder, track)


def _fits(quick: bool, folder: Path | None, track: Track) -> TradeoffPart:
    del folder
    return fits.measure(fits.QUICK if quick else fits.FULL, track)


def _sea(quick: bool, folder: Path | None, track: Track) -> TradeoffPart:
    del folder
    return sea.measure(sea.QUICK if quick else sea.FULL, track)


def _fur(quick: bool, folder: Path | None, track: Track) -> TradeoffPart:
    del folder
    return fur.measure(fur.QUICK if quick else fur.FULL, track)


IF_NAMED = ("sea", "fur")  # they need OpenGL, and are of no law
PARTS: dict[str, Measure] = {
    **{"truth": _truth, "laws": _laws, "samplers": _samplers, "fits": _fits},
    **{"sea": _sea, "fur": _fur},
}


def chosen(names: list[str]) -> list[str]:
    """The parts named, each once and in order; if none is, all but `IF_NAMED`. InputError on an unknown one."""
    if unknown := [name for name in names if name not in PARTS]:
        raise InputError(f"part must be one of {', '.join(PARTS)}, got {unknown[0]!r}")
    return [name for name in PARTS if name in (names or PARTS.keys() - set(IF_NAMED))]


def measured(name: str, quick: bool = False, folder: Path | None = None, track: Track = silent) -> TradeoffPart:
    """Run one part."""
    return PARTS[name](quick, folder, track)


def keep(file: Path, new: Mapping[str, Any]) -> None:
    """Write what was measured, and the other parts that the file has, if they are comparable.

    new  "made" and "machine" of this run, and by its name each part measured so far, which has both, too
    """
    before = read(file)
    kept: Content = {}
    if is_alike(before, new):
        own = {key: before[key] for key in ("made", "machine") if key in before}
        kept = {name: {**own, **before[name]} for name in PARTS if isinstance(before.get(name), dict)}
    parts = {**kept, **new}
    heads = {name: value for name, value in new.items() if name not in PARTS}
    write_whole(file, as_json({**heads, **{name: parts[name] for name in PARTS if name in parts}}))


def read(file: Path) -> Content:
    """What a tradeoff.json says, which is nothing if it is damaged or not there: it is only added to, or replaced."""
    try:
        content = read_json(file)
    except InputError:
        return {}
    return content if isinstance(content, dict) and isinstance(content.get("made"), dict) else {}


def is_alike(before: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """Whether both are of the same records, version and machine: else their times and errors do not compare."""
    return bool(before) and all(before["made"].get(key) == new["made"].get(key) for key in SAME)
