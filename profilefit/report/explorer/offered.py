"""The laws that the explorer runs: what each is called, its text, and how that text changes with the index."""

from __future__ import annotations

import re
from dataclasses import dataclass, replace

from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import LoadedLaw, profile_laws
from profilefit.recipes.record import Folder, Records
from profilefit.shader.law_file import export

PREFIX = "law"  # of the names in each text: one law runs at a time
FIRST = ("hazard-diffuse", "hazard")  # what is shown at the start, if it is there
ORDER = ("hazard", "quantile", "burley", "burley_diffuse_mfp", "liang", "gaussians", "better_dipole", "dipole")
RANK = {name: place for place, name in enumerate(ORDER)}
STEP, STEPS = 0.02, 30
INDICES = tuple(round(1.0 + STEP * (k + 1), 2) for k in range(STEPS))  # n of a surface that refracts
WORDS = r"([\s;]+)"  # between two words of a text; the same in laws.js


@dataclass(frozen=True)
class Refracting:
    """A law's text under surfaces that refract: the same words at every index but for a few, most of them numbers.

    text of the first of `INDICES`; places of the words that change; words (indices, places) of each index
    """

    text: str
    places: list[int]
    words: list[list[str]]


@dataclass(frozen=True)
class Offered:
    """Law under one illumination: its name in addresses, its own, the illumination, its name for readers.

    text, refracting  shader source in GLSL ES at n = 1, and at other indices where the law has constants for them
    """

    id: str
    name: str
    light: str
    label: str
    text: str
    refracting: Refracting | None = None


def offered(folder: Folder) -> list[Offered]:
    """Return every law of a matched surface that has a text, the best first; records are those in `folder`."""
    records, laws = Records.of(folder), []
    for named in sorted(profile_laws(records), key=lambda one: RANK.get(one.name.partition(":")[0], len(RANK))):
        if named.law.entry.has_text:
            label = title = named.law.entry.title
            if not named.records:
                label += f", {named.constants}" if named.constants else ""
            elif named.records[0].replace("-diffuse", "") != title:
                label += f": {named.records[0]}"
            text, refracting = export(named, records, "glsl-es", PREFIX), _refracting(named, records)
            laws.append(Offered(address(named), named.name, named.setting.illumination, label, text, refracting))
    return laws


def first(laws: list[Offered]) -> str:
    """Return the id of the law to begin with."""
    there = [law.id for law in laws]
    return next((name for name in FIRST if name in there), there[0])


def address(named: LoadedLaw) -> str:
    """Return the id of a law: its label, without what the address of a page may not hold."""
    return re.sub(r"[^\w.]+", "-", named.label)


def _refracting(named: LoadedLaw, records: Records) -> Refracting | None:
    """Return the text of the record of the same law and light that holds for every index, if the folder has one."""
    of = profile_laws(records, matched=False) if named.records else []
    same = (one for one in of if one.name == named.name and one.setting == replace(named.setting, n=one.setting.n))
    label = next((one.label for one in same if one.setting.n != named.setting.n), None)
    if label is None:
        return None
    texts = [export(catalogue.find(label, records, n=n), records, "glsl-es", PREFIX) for n in INDICES]
    pieces = [re.split(WORDS, text) for text in texts]
    places = [at for at, words in enumerate(zip(*pieces, strict=True)) if len(set(words)) > 1]
    return Refracting(texts[0], places, [[words[at] for at in places] for words in pieces])
