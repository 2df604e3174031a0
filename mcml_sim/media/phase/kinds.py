"""Phase functions as tables of files have them, and back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import fields
from typing import Any

from mcml_sim.errors import InputError
from mcml_sim.media.arrays import require, shown
from mcml_sim.media.phase.fournier_forand import FournierForand
from mcml_sim.media.phase.mixture import Mixture
from mcml_sim.media.phase.phase import HenyeyGreenstein, Isotropic, Phase
from mcml_sim.media.phase.tabulated import Tabulated

KINDS: dict[str, type[Phase]] = {
    "isotropic": Isotropic,
    "henyey-greenstein": HenyeyGreenstein,
    "fournier-forand": FournierForand,
    "mixture": Mixture,
    "tabulated": Tabulated,
}
DEEPEST = 4  # mixtures within one another


def settle(of: Any) -> None:
    """Bring `g` and `phase` of a layer or a setting, frozen, into one: g of a phase function is its mean cosine.

    Henyey and Greenstein's, and isotropic, is said by g alone. InputError on what is no phase function.
    """
    require(isinstance(of.phase, Phase), "phase", "a phase function of mcml_sim.phase", of.phase)
    phase = of.phase.simplest
    object.__setattr__(of, "g", float(phase.mean_cosine))
    object.__setattr__(of, "phase", None if isinstance(phase, HenyeyGreenstein | Isotropic) else phase)


def as_table(phase: Phase) -> dict[str, Any]:
    """Return the kind of a phase function, and the arguments of its constructor: numbers, lists, and such tables."""
    kind = next(name for name, known in KINDS.items() if type(phase) is known)
    return {"kind": kind, **{name: _plain(getattr(phase, name)) for name in _arguments(type(phase))}}


def from_table(table: object, deepest: int = DEEPEST) -> Phase:
    """Return the phase function of a table from `as_table`; InputError on anything else."""
    if not isinstance(table, Mapping):
        raise InputError(f"a phase function must be a table, got {shown(table)}")
    kind: Any = table.get("kind")
    require(isinstance(kind, str) and kind in KINDS, "kind of a phase function", f"one of {', '.join(KINDS)}", kind)
    if kind == "mixture" and deepest == 0:
        raise InputError(f"a mixture must hold mixtures of at most {DEEPEST} levels, got more")
    names = _arguments(KINDS[kind])
    if set(table) != {"kind", *names}:
        got = ", ".join(map(str, sorted(set(table) - {"kind"}))) or "nothing"
        raise InputError(f"a phase function of kind {kind} must have {', '.join(names) or 'nothing else'}, got {got}")
    given = {name: table[name] for name in names}
    if kind == "mixture" and isinstance(given["phases"], list | tuple):
        given["phases"] = [from_table(term, deepest - 1) for term in given["phases"]]
    return KINDS[kind](**given)


def _arguments(kind: type[Phase]) -> list[str]:
    return [field.name for field in fields(kind) if field.init]  # type: ignore[arg-type]


def _plain(value: Any) -> Any:
    if isinstance(value, Phase):
        return as_table(value)
    return [_plain(item) for item in value] if isinstance(value, tuple) else float(value)
