"""The laws that the explorer offers, each with the text that is exported."""

from __future__ import annotations

import re
from dataclasses import dataclass
from pathlib import Path

from profilefit.errors import InputError
from profilefit.inventory import Named, profile_laws
from profilefit.shader.export import export

PREFIX = "law"  # of the names in each text: one law runs at a time
FIRST = ("hazard-diffuse", "hazard")  # what is shown at the start, if it is there
TITLES = {
    "burley": "normalized diffusion",
    "burley_diffuse_mfp": "normalized diffusion by diffuse mfp",
    "liang": "Liang et al.",
    "dipole": "dipole",
    "better_dipole": "better dipole",
}
ORDER = ("hazard", "quantile", "burley", "burley_diffuse_mfp", "liang", "gaussians", "better_dipole", "dipole")


@dataclass(frozen=True)
class Offered:
    """id for addresses; name of the law; light that its constants belong to; label for readers; text in GLSL ES."""

    id: str
    name: str
    light: str
    label: str
    text: str


def offered(folder: Path) -> list[Offered]:
    """Every law of a matched surface that has a text, the best first; records are those in `folder`."""
    found = []
    for named in sorted(profile_laws(folder), key=_place):
        try:
            text = export(named, folder, "glsl-es", PREFIX)
        except InputError:  # a law without a closed form
            continue
        found.append(Offered(address(named), named.name, named.setting.illumination, _label(named), text))
    return found


def first(laws: list[Offered]) -> str:
    """The id of the law to begin with."""
    there = [law.id for law in laws]
    return next((name for name in FIRST if name in there), there[0])


def address(named: Named) -> str:
    """The id of a law: its label, without what the address of a page may not hold."""
    return re.sub(r"[^\w.]+", "-", named.label)


def _place(named: Named) -> int:
    kind = named.name.partition(":")[0]
    return ORDER.index(kind) if kind in ORDER else len(ORDER)


def _label(named: Named) -> str:
    kind, _, count = named.name.partition(":")
    title = TITLES.get(kind, f"{count} Gaussians" if count else kind)
    if not named.records:
        return f"{title}, {named.constants}" if named.constants else title
    return title if named.records[0].replace("-diffuse", "") == title else f"{title}: {named.records[0]}"
