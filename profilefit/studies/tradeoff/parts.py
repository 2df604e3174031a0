"""Parts of the measurement by name, in the order in which they run, and the file that keeps them."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import ModuleType
from typing import Any

from mcml_sim.files.text_file import as_json, read_json
from mcml_sim.files.whole_file import write_whole
from profilefit.errors import InputError
from profilefit.studies.tradeoff import fits, fur, laws, samplers, sea, truth
from profilefit.studies.tradeoff.points import TradeoffPart
from profilefit.studies.tradeoff.stopwatch import Track, silent

Content = dict[str, Any]
SAME = ("version", "sha256", "machine")  # of `made`: what parts beside each other have in common
IF_NAMED = ("sea", "fur")  # they need OpenGL, and are of no law
OF_RECORDS = ("laws", "samplers")
# Each measures by `measure(sizes, track)`, those of records with their folder, and has sizes FULL and QUICK.
PARTS: dict[str, ModuleType] = {
    **{"truth": truth, "laws": laws, "samplers": samplers, "fits": fits},
    **{"sea": sea, "fur": fur},
}


def chosen(names: list[str]) -> list[str]:
    """Return the parts named, each once and in order, by default all but `IF_NAMED`; InputError on an unknown one."""
    if unknown := [name for name in names if name not in PARTS]:
        raise InputError(f"part must be one of {', '.join(PARTS)}, got {unknown[0]!r}")
    return [name for name in PARTS if name in (names or PARTS.keys() - set(IF_NAMED))]


def measured(name: str, quick: bool = False, folder: Path | None = None, track: Track = silent) -> TradeoffPart:
    """Run one part."""
    part, given = PARTS[name], {"folder": folder} if name in OF_RECORDS else {}
    measured: TradeoffPart = part.measure(part.QUICK if quick else part.FULL, track=track, **given)
    return measured


def keep(file: Path, new: Mapping[str, Any]) -> None:
    """Write what was measured, and the other parts that the file has, if they are comparable.

    `new` holds "made" and "machine" of this run, and by its name each part measured so far, which has both, too.
    """
    before = read(file)
    kept: Content = {}
    if is_comparable(before, new):
        own = {key: before[key] for key in ("made", "machine") if key in before}
        kept = {name: {**own, **before[name]} for name in PARTS if isinstance(before.get(name), dict)}
    parts = {**kept, **new}
    heads = {name: value for name, value in new.items() if name not in PARTS}
    write_whole(file, as_json({**heads, **{name: parts[name] for name in PARTS if name in parts}}))


def read(file: Path) -> Content:
    """Return the content of a tradeoff.json, nothing if it is damaged or absent: it is only added to, or replaced."""
    try:
        content = read_json(file)
    except InputError:
        return {}
    return content if isinstance(content, dict) and isinstance(content.get("made"), dict) else {}


def is_comparable(before: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """Return whether both are of the same records, version and machine: else they do not compare."""
    return bool(before) and all(before["made"].get(key) == new["made"].get(key) for key in SAME)
