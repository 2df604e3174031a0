"""Every law that loads, by name and constants: printed sets, laws without constants, and those made of records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcml_sim.setting import Setting
from profilefit import catalogue, record
from profilefit.errors import InputError, RecordError
from profilefit.laws import published

Records = Sequence[str] | None
# What tells a map's name in `published.SETS` and in `catalogue.REGENERATED` from a profile law's.
PRINTED_MAP, REGENERATED_MAP = "_albedo", "albedo "


@dataclass(frozen=True)
class Named:
    """A law with its constants, at home in one setting.

    name     of the law in the catalogue; constants the printed set or the records they come from, "" if it has none
    records  the names of those records
    """

    name: str
    constants: str
    law: Any
    records: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """What a table calls it: its record, or law and printed set."""
        if self.records:
            return self.records[0]
        return f"{self.name}, {self.constants}" if self.constants else self.name

    @property
    def setting(self) -> Setting:
        setting: Setting = self.law.setting
        return setting


def profile_laws(folder: Path, records: Records = None, matched: bool = True) -> list[Named]:
    """Profile laws with their constants; only those of `records`, where such are named.

    matched  only those of settings that have an exact profile
    Records of failed fits have no law.
    """
    return [*_whole_laws(folder, records, matched), *_single(folder, records, ("profile", "as-published"), matched)]


def sampled_laws(folder: Path, records: Records = None) -> list[Named]:
    """Laws whose samplers are worth measuring: whole ones, and inverse cdfs beside a printed profile."""
    return [*_whole_laws(folder, records, True), *_single(folder, records, ("inverse",), True)]


def albedo_laws(folder: Path, records: Records = None, matched: bool = True) -> list[Named]:
    """Maps between alpha and A; arguments as for `profile_laws`."""
    printed = [
        Named(name, s.name, catalogue.albedo_law(name, s.name, folder=folder))
        for s in published.SETS
        if (name := s.law.removesuffix(PRINTED_MAP)) != s.law
    ]
    keys = [key for key in catalogue.REGENERATED if key.startswith(REGENERATED_MAP)]
    return _asked([*printed, *_regenerated(folder, keys, matched)], records)


def find(name: str, folder: Path, constants: str | None = None) -> Named:
    """A law by the name of one of its records, or by its own name, with those constants: see `catalogue.load`.

    InputError, which names what there is, for any other name.
    """
    known = record.available(folder)
    if name in known and constants is None:
        laws = [
            *profile_laws(folder, (name,), False),
            *sampled_laws(folder, (name,)),
            *albedo_laws(folder, (name,), False),
        ]
        if laws:
            return laws[0]
        raise RecordError(f"record {name!r} holds no law of a fit that converged")
    if name in catalogue.PROFILE_LAWS:
        which = constants or "regenerated"
        return _by_name(name, which, folder)
    if constants is None and name.removeprefix(REGENERATED_MAP) in catalogue.ALBEDO_LAWS:
        raise InputError(f"name of a map must be that of its record, got {name!r}")
    accepted = ", ".join([*catalogue.names(), *known])
    raise InputError(f"name must be a law or a record, one of {accepted}, got {name!r}")


def _by_name(name: str, constants: str, folder: Path) -> Named:
    law = catalogue.load(name, constants, folder=folder)
    key = catalogue.SHORT.get(name, name)
    records = catalogue.REGENERATED.get(key, ()) if constants == "regenerated" else ()
    told = " + ".join(records) or (constants.removeprefix("published:") if law.constant_names() else "")
    return Named(key, told, law, records)


def _whole_laws(folder: Path, records: Records, matched: bool) -> list[Named]:
    """Printed sets, laws without constants, and laws made of all their regenerated records."""
    known = catalogue.PROFILE_LAWS
    printed = [
        Named(s.law, s.name, catalogue.load(s.law, s.name, folder=folder)) for s in published.SETS if s.law in known
    ]
    bare = [name for name, kind in known.items() if not kind.constant_names()]
    physical = [Named(name, "", catalogue.load(name, folder=folder)) for name in bare]
    keys = [key for key in catalogue.REGENERATED if not key.startswith(REGENERATED_MAP)]
    return _asked([*printed, *physical, *_regenerated(folder, keys, matched)], records)


def _regenerated(folder: Path, keys: Sequence[str], matched: bool) -> list[Named]:
    """The laws under these keys of `catalogue.REGENERATED`, in every setting whose records all are in the folder."""
    there = _usable(folder, matched)
    settings = dict.fromkeys(catalogue.record_setting(content) for content in there.values())
    found = []
    for key in keys:
        name = key.removeprefix(REGENERATED_MAP)
        load = catalogue.load if name == key else catalogue.albedo_law
        for setting in settings:
            records = tuple(catalogue.record_name(base, setting) for base in catalogue.REGENERATED[key])
            if all(one in there for one in records):
                law = load(name, setting=setting, folder=folder)
                found.append(Named(name, " + ".join(records), law, records))
    return found


def _single(folder: Path, records: Records, pipelines: tuple[str, ...], matched: bool) -> list[Named]:
    """Records that no law takes by its name alone; constants that they do not hold are as printed."""
    taken = {name for one in _regenerated(folder, list(catalogue.REGENERATED), matched) for name in one.records}
    found = []
    for name, content in _usable(folder, matched).items():
        if name not in taken and content["pipeline"] in pipelines:
            law = catalogue.load(content["law"], str(folder / f"{name}.json"), folder=folder)
            found.append(Named(content["law"], name, law, (name,)))
    return _asked(found, records)


def _usable(folder: Path, matched: bool) -> dict[str, dict[str, Any]]:
    """The records of fits that converged."""
    found = {name: record.read(path, whole=True) for name, path in record.available(folder).items()}
    return {name: content for name, content in found.items() if "constants" in content and _is_usable(content, matched)}


def _is_usable(content: dict[str, Any], matched: bool) -> bool:
    setting = catalogue.record_setting(content)
    return content["fit"]["result"] == "converged" and (setting.is_matched_isotropic or not matched)


def _asked(found: list[Named], records: Records) -> list[Named]:
    return found if records is None else [one for one in found if set(one.records) & set(records)]
