"""Premises of a fit: light, surface, scattering and beam as given, else as the file states them, else assumed."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

from mcml_sim.media.arrays import require, shown
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.laws import takes_g
from profilefit.measured.data import Facts, Measured
from profilefit.measured.instrument import PENCIL, Instrument, beam_of
from profilefit.measured.model import EXACT
from profilefit.measured.problem import MEDIUM, Ranges


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
    facts = {name: Facts.parsed(name, given[name], at, data.unit) for name, at in labels.items() if name in given}
    light = facts.get("light", data.illumination or "searchlight")
    accepted = f"{data.illumination} for {data.source}, which was simulated so"
    require(data.illumination in (None, light), labels["light"], accepted, light)
    ranges = {name: facts[name] for name in MEDIUM if name in facts}
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
    if "fibre" in facts and data.rings:
        raise InputError(f"{labels['fibre']} must be left out where rows are averages over annuli")
    # What a file states lies beside it; a pipe has no place.
    folder = Path(data.source).parent if "beam" in stated and Path(data.source).is_file() else Path()
    beam = beam_of(labels["beam"], given["beam"], data.unit, folder) if "beam" in facts else None
    ranges |= {"beam": widths} if len(widths := facts.get("beam", ("", ()))[1]) > 1 else {}
    assumed = () if data.medium is not None else tuple(name for name in MEDIUM if name not in given)
    return Premises(setting, Instrument(beam, facts.get("fibre", 0.0)), ranges, assumed, notes)
