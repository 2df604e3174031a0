"""Parts of the measurement by name, in the order in which they run, and the file that keeps them."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

from mcml_sim.files.whole_file import as_json, read_json, write_whole
from profilefit.errors import InputError
from profilefit.studies.tradeoff import fits, laws, samplers, scenes, truth
from profilefit.studies.tradeoff.points import TradeoffPart
from profilefit.studies.tradeoff.stopwatch import Track, silent

SAME = ("version", "sha256", "machine")  # of `made`: what parts beside each other have in common
IF_NAMED = ("sea", "fur")  # they need OpenGL, and are of no law
OF_RECORDS = ("laws", "samplers")
# Each measures by a function of sizes and track, those of records with their folder: function, all of it, a quick look.
PARTS: dict[str, tuple[Callable[..., TradeoffPart], Any, Any]] = {
    "truth": (truth.measure, truth.FULL, truth.QUICK),
    "laws": (laws.measure, laws.FULL, laws.QUICK),
    "samplers": (samplers.measure, samplers.FULL, samplers.QUICK),
    "fits": (fits.measure, fits.FULL, fits.QUICK),
    "sea": (scenes.measure_sea, scenes.SEA, scenes.QUICK_SEA),
    "fur": (scenes.measure_fur, scenes.FUR, scenes.QUICK_FUR),
}


def chosen(names: list[str]) -> list[str]:
    """Return the parts named, each once and in order, by default all but `IF_NAMED`; InputError on an unknown one."""
    if unknown := [name for name in names if name not in PARTS]:
        raise InputError(f"part must be one of {', '.join(PARTS)}, got {unknown[0]!r}")
    return [name for name in PARTS if name in (names or PARTS.keys() - set(IF_NAMED))]


def measured(name: str, quick: bool = False, folder: Path | None = None, track: Track = silent) -> TradeoffPart:
    """Run one part."""
    measure, full, few = PARTS[name]
    return measure(few if quick else full, track=track, **({"folder": folder} if name in OF_RECORDS else {}))


def keep(file: Path, new: Mapping[str, Any]) -> None:
    """Write what was measured, and the other parts that the file has, if they are comparable.

    `new` holds "made" and "machine" of this run, and by its name each part measured so far, which has both, too.
    """
    before = read(file)
    kept: dict[str, Any] = {}
    if is_comparable(before, new):
        own = {key: before[key] for key in ("made", "machine") if key in before}
        kept = {name: {**own, **before[name]} for name in PARTS if isinstance(before.get(name), dict)}
    parts = {**kept, **new}
    heads = {name: value for name, value in new.items() if name not in PARTS}
    write_whole(file, as_json({**heads, **{name: parts[name] for name in PARTS if name in parts}}))


def read(file: Path) -> dict[str, Any]:
    """Return the content of a tradeoff.json, nothing if it is damaged or absent: it is only added to, or replaced."""
    try:
        content = read_json(file)
    except InputError:
        return {}
    return content if isinstance(content, dict) and isinstance(content.get("made"), dict) else {}


def is_comparable(before: Mapping[str, Any], new: Mapping[str, Any]) -> bool:
    """Return whether both are of the same records, version and machine: else they do not compare."""
    return bool(before) and all(before["made"].get(key) == new["made"].get(key) for key in SAME)
