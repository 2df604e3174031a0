"""Every law that loads, by name and constants: printed sets, laws without constants, and those made of records."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any

from mcml_sim.media.setting import Setting
from profilefit.errors import InputError, RecordError
from profilefit.laws import published
from profilefit.recipes import catalogue, record

Records = Sequence[str] | None
NEAR = 0.7  # of difflib's similarity, 1 for the same name: one or two letters off
# What tells a map's name in `published.SETS` and in `catalogue.REGENERATED` from a profile law's.
PRINTED_MAP, REGENERATED_MAP = "_albedo", "albedo "


@dataclass(frozen=True)
class Named:
    """A law with its constants, at home in one setting.

    name     of the law in the catalogue; constants the printed set or the records they come from, "" if it has none
    files    those records; constants that they do not hold are as printed
    """

    name: str
    constants: str
    law: Any
    files: tuple[Path, ...] = ()

    @property
    def records(self) -> tuple[str, ...]:
        """The names of those records."""
        return tuple(path.stem for path in self.files)

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
    return [*(printed if records is None else ()), *_regenerated(folder, keys, records, matched)]


def find(name: str, folder: Path, constants: str | None = None) -> Named:
    """A law or map by the name of one of its records, or by its own name.

    A name of both is the profile law's; "albedo liang" is the map's.

    constants  as in `catalogue.load`; None takes the regenerated ones or, where there are none, the only printed set
    InputError, with the nearest names that there are, for any other name.
    """
    known = record.available(folder)
    if name in known and constants in (None, "regenerated"):
        laws = [
            *profile_laws(folder, (name,), False),
            *sampled_laws(folder, (name,)),
            *albedo_laws(folder, (name,), False),
        ]
        if laws:
            return laws[0]
        raise RecordError(f"record {name!r} holds no law of a fit that converged")
    map_name = name.removeprefix(REGENERATED_MAP)
    if name in catalogue.PROFILE_LAWS:
        return _profile_by_name(name, constants, folder)
    if map_name in catalogue.ALBEDO_LAWS:
        return _map_by_name(map_name, constants, folder)
    if name in known:
        raise InputError(f"constants of a record are its own: name must be a law's with {constants}, got {name!r}")
    raise InputError(_unknown(name, [*known, *catalogue.names(), *catalogue.ALBEDO_LAWS]))


def _unknown(name: str, there: Sequence[str]) -> str:
    near = get_close_matches(name.lower(), sorted(set(there)), n=2, cutoff=NEAR)
    told = f"did you mean {', '.join(near)}?" if near else f"laws: {', '.join(catalogue.names())};"
    return f"name must be a law, map or record, got {name!r}; {told} `profilefit report` lists records"


def _profile_by_name(name: str, constants: str | None, folder: Path) -> Named:
    key = catalogue.SHORT.get(name, name)
    which = constants or _default(key, key, bool(catalogue.PROFILE_LAWS[name].constant_names()))
    law = catalogue.load(name, which, folder=folder)
    return _named(key, key, which, law, folder)


def _map_by_name(name: str, constants: str | None, folder: Path) -> Named:
    key = REGENERATED_MAP + name
    which = constants or _default(key, name + PRINTED_MAP, True)
    return _named(name, key, which, catalogue.albedo_law(name, which, folder=folder), folder)


def _named(name: str, key: str, which: str, law: Any, folder: Path) -> Named:
    """Under the key of `catalogue.REGENERATED`."""
    if which == "regenerated":
        files = _files(key, law.setting, folder)
    else:
        files = (Path(which),) if which.endswith(".json") else ()
    told = " + ".join(path.stem for path in files) or which.removeprefix("published:")
    return Named(name, told if law.constant_names() else "", law, files)


def _files(key: str, setting: Setting, folder: Path) -> tuple[Path, ...]:
    bases = catalogue.REGENERATED.get(key, ())
    return tuple(folder / f"{catalogue.record_name(base, setting)}.json" for base in bases)


def _default(key: str, printed_as: str, has_constants: bool) -> str:
    """The regenerated constants, or the only ones printed where none were regenerated."""
    if key in catalogue.REGENERATED or not has_constants:
        return "regenerated"
    printed = [s.name for s in published.SETS if s.law == printed_as]
    if len(printed) == 1:
        return printed[0]
    accepted = ", ".join([*printed, "the path of a record (.json)"])
    several = "one of " if printed else ""
    raise InputError(f"constants must be {several}{accepted}: {key} was not regenerated, got none")


def _whole_laws(folder: Path, records: Records, matched: bool) -> list[Named]:
    """Printed sets, laws without constants, and laws made of all their regenerated records."""
    keys = [key for key in catalogue.REGENERATED if not key.startswith(REGENERATED_MAP)]
    regenerated = _regenerated(folder, keys, records, matched)
    if records is not None:  # others are of none
        return regenerated
    known = catalogue.PROFILE_LAWS
    printed = [
        Named(s.law, s.name, catalogue.load(s.law, s.name, folder=folder)) for s in published.SETS if s.law in known
    ]
    bare = [name for name, kind in known.items() if not kind.constant_names()]
    return [*printed, *(Named(name, "", catalogue.load(name, folder=folder)) for name in bare), *regenerated]


def _regenerated(folder: Path, keys: Sequence[str], records: Records, matched: bool) -> list[Named]:
    """The laws under these keys of `catalogue.REGENERATED`, in every setting whose records all are in the folder."""
    there = _usable(folder, records, matched)
    settings = dict.fromkeys(catalogue.record_setting(content) for content in there.values())
    found = []
    for key in keys:
        name = key.removeprefix(REGENERATED_MAP)
        load = catalogue.load if name == key else catalogue.albedo_law
        for setting in settings:
            names = [path.stem for path in _files(key, setting, folder)]
            if set(names) & set(there) and len(_usable(folder, names, matched)) == len(names):
                found.append(_named(name, key, "regenerated", load(name, setting=setting, folder=folder), folder))
    return found


def _single(folder: Path, records: Records, pipelines: tuple[str, ...], matched: bool) -> list[Named]:
    """Records that no law takes by its name alone; constants that they do not hold are as printed."""
    whole = _regenerated(folder, list(catalogue.REGENERATED), records, matched)
    taken = {name for one in whole for name in one.records}
    found = []
    for name, content in _usable(folder, records, matched).items():
        if name not in taken and content["pipeline"] in pipelines:
            path = folder / f"{name}.json"
            found.append(Named(content["law"], name, catalogue.load(content["law"], str(path), folder=folder), (path,)))
    return found


def _usable(folder: Path, records: Records, matched: bool) -> dict[str, dict[str, Any]]:
    """The records of a folder, or those named, of fits that converged."""
    there = {n: path for n, path in record.available(folder).items() if records is None or n in records}
    found = {name: record.read(path, whole=True) for name, path in there.items()}
    return {name: content for name, content in found.items() if "constants" in content and _is_usable(content, matched)}


def _is_usable(content: dict[str, Any], matched: bool) -> bool:
    setting = catalogue.record_setting(content)
    return content["fit"]["result"] == "converged" and (setting.is_matched_isotropic or not matched)
