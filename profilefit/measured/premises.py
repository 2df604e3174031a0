"""Premises of a fit: light, surface, scattering and beam as given, else as the file states them, else assumed."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from mcml_sim.media.arrays import require, shown
from mcml_sim.media.setting import ILLUMINATIONS, Setting
from profilefit.errors import InputError
from profilefit.laws import takes_g
from profilefit.measured.data import Measured, length
from profilefit.measured.instrument import FWHM, PENCIL, TOPHAT, Gaussian, Instrument, Irradiance, beam_of, gaussian
from profilefit.measured.model import EXACT
from profilefit.measured.problem import MEDIUM, Ranges

ACCEPTED = {
    "n": "a refractive index > 0, or a range such as 1.33:1.45",
    "g": "a mean cosine in (-1, 1), or a range such as 0.7:0.95",
}


@dataclass(frozen=True)
class Premises:
    """Premises of a fit.

    setting     illumination, surface and scattering; the middle of what is known as a range
    instrument  the beam, and what a row is averaged over
    ranges      (low, high) of n, g, and a Gaussian beam's 1/e^2 radius [unit of r], where these are known no better
    assumed     those of n and g that nobody named
    notes       facts of the file that others replace
    """

    setting: Setting
    instrument: Instrument = PENCIL
    ranges: Ranges = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    notes: tuple[str, ...] = ()


def premises(
    data: Measured,
    law: str = EXACT,
    options: Mapping[str, str | None] | None = None,
    names: Mapping[str, str] | None = None,
) -> Premises:
    """Return the premises of a fit of `law` from options, else from what the file states.

    options  texts by the names light, n, g, beam and fibre; names what messages call these
    """
    chosen = {name: text for name, text in (options or {}).items() if text is not None}
    labels = {name: name for name in ("light", *MEDIUM, "beam", "fibre")} | dict(names or {})
    notes = tuple(
        f"the file's {name} is {shown(fact.text)} (line {fact.line}), fitted with {labels[name]} {chosen[name]}"
        for name, fact in data.stated.items()
        if name in chosen and chosen[name].strip() != fact.text
    )
    stated = {name: fact for name, fact in data.stated.items() if name not in chosen}
    labels |= {name: f"{data.source}:{fact.line}: {name}" for name, fact in stated.items()}
    given = {name: fact.text for name, fact in stated.items()} | chosen
    light = given.get("light", data.illumination or "searchlight")
    require(light in ILLUMINATIONS, labels["light"], f"one of {', '.join(ILLUMINATIONS)}", light)
    if data.illumination not in (None, light):
        raise InputError(
            f"{labels['light']} must be {data.illumination} for {data.source}, which was simulated so, got {light!r}"
        )
    ranges = {name: _parsed(labels[name], given[name], name) for name in MEDIUM if name in given}
    n, g = ranges.get("n", (data.n or 1.0,) * 2), ranges.get("g", (0.0, 0.0))
    setting = Setting(light, 0.5 * sum(n), 0.5 * sum(g))
    # A simulation's g counts only where exact light, or the law that is fitted, has it. Clear layers may state any g.
    forward = replace(setting, g=data.g) if "g" not in given and data.g and abs(data.g) < 1.0 else setting
    if forward.is_solved and (law == EXACT or takes_g(law)):
        setting = forward
    ranges = {name: ends for name, ends in ranges.items() if ends[0] < ends[1]}
    if ranges and law != EXACT:
        name = min(ranges)
        raise InputError(f"{labels[name]} must be a number where a law is fitted, got {shown(given[name])}")
    if "fibre" in given and data.rings:
        raise InputError(f"{labels['fibre']} must be left out where rows are averages over annuli")
    beam: Irradiance | None = None
    if "beam" in given:
        # What a file states lies beside it; a pipe has no place.
        beside = "beam" not in chosen and Path(data.source).is_file()
        folder = Path(data.source).parent if beside else Path()
        beam, widths = _beam(labels["beam"], given["beam"].strip(), data.unit, folder)
        ranges |= {} if widths is None else {"beam": widths}
    fibre = length(labels["fibre"], given["fibre"], data.unit) if "fibre" in given else 0.0
    assumed = () if data.medium is not None else tuple(name for name in MEDIUM if name not in given)
    return Premises(setting, Instrument(beam, fibre), ranges, assumed, notes)


def _beam(option: str, text: str, unit: str, folder: Path) -> tuple[Irradiance, tuple[float, float] | None]:
    """Return a beam, and the range of its 1/e^2 radius if it has one: LOW:HIGH, or fwhm:LOW:HIGH."""
    kind = next((one for one in (FWHM, TOPHAT) if text.lower().startswith(one)), "")
    ends = text[len(kind) :].split(":")
    if len(ends) != 2 or kind == TOPHAT:
        return beam_of(option, text, unit, folder), None
    low, high = (gaussian(option, kind + end, unit).w for end in ends)
    if not low < high:
        raise InputError(f"{option} must have a range that rises, such as 0.3mm:0.7mm, got {shown(text)}")
    return Gaussian(0.5 * (low + high)), (low, high)


def _parsed(option: str, text: str, name: str) -> tuple[float, float]:
    """Return both ends of a number or of a range LOW:HIGH."""
    try:
        ends = [float(part) for part in text.split(":")]
    except ValueError:
        ends = []
    least, most = (0.0, math.inf) if name == "n" else (-1.0, 1.0)
    is_range = 1 <= len(ends) <= 2 and all(least < one < most for one in ends) and ends[0] <= ends[-1]
    require(is_range, option, ACCEPTED[name], text)
    return ends[0], ends[-1]
