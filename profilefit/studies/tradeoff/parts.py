"""The parts of the measurement by name, in the order in which they run."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

from profilefit.errors import InputError
from profilefit.studies.tradeoff import fits, laws, samplers, truth
from profilefit.studies.tradeoff.points import Part
from profilefit.studies.tradeoff.stopwatch import Track, silent

Measure = Callable[[bool, Path | None, Track], Part]
"""Whether quickly, where the records lie, who is shown the progress -> part."""


def _truth(quick: bool, folder: Path | None, track: Track) -> Part:
    del folder
    return truth.measure(truth.QUICK if quick else truth.FULL, track)


def _laws(quick: bool, folder: Path | None, track: Track) -> Part:
    return laws.measure(laws.QUICK if quick else laws.FULL, folder, track)


def _samplers(quick: bool, folder: Path | None, track: Track) -> Part:
    return samplers.measure(samplers.QUICK if quick else samplers.FULL, folder, track)


def _fits(quick: bool, folder: Path | None, track: Track) -> Part:
    del folder
    return fits.measure(fits.QUICK if quick else fits.FULL, track)


PARTS: dict[str, Measure] = {"truth": _truth, "laws": _laws, "samplers": _samplers, "fits": _fits}


def chosen(names: list[str]) -> list[str]:
    """The parts named, each once and in their own order; all of them if none is. InputError on an unknown one."""
    if unknown := [name for name in names if name not in PARTS]:
        raise InputError(f"PART must be one of {', '.join(PARTS)}, got {unknown[0]!r}")
    return [name for name in PARTS if not names or name in names]


def measured(name: str, quick: bool = False, folder: Path | None = None, track: Track = silent) -> Part:
    """Run one part."""
    return PARTS[name](quick, folder, track)
