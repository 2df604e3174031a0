"""Laws and maps by name, with the constants requested: published, corrected, regenerated, or those of a record."""

from __future__ import annotations

import warnings
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from difflib import get_close_matches
from pathlib import Path
from typing import Any, TypeVar, cast

from mcml_sim.media.arrays import require
from mcml_sim.media.setting import Setting
from profilefit import laws
from profilefit.errors import InputError, RecordError, SettingError, ShippedMap
from profilefit.laws import gaussians, published
from profilefit.laws.base import AlbedoLaw, Constants, Entry, Normalisation, ProfileLaw
from profilefit.laws.rational import Rational
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import SEARCHLIGHT, Folder, Records, covers, record_setting

Law = TypeVar("Law", bound=Constants)
# The map that profile laws normalise with: it is exact to a few parts in a million.
(ALBEDO_RECORD,) = Rational.entry.records
Names = Sequence[str] | None
Lists = Sequence[Callable[..., "list[LoadedLaw]"]]
REGENERATED = "regenerated"
NEAR = 0.7  # of difflib's similarity, 1 for the same name: one or two letters off


def names() -> tuple[str, ...]:
    """Return the names of the profile laws; `gaussians:N` is a sum of N = 1 ... 8 Gaussians, `gaussians` one of six."""
    return tuple(laws.PROFILES)


def load(
    name: str, constants: str = "regenerated", setting: Setting | None = None, folder: Folder | None = None
) -> ProfileLaw:
    """Load a profile law by name, one of `names()` or gaussians:1 ... gaussians:8.

    constants  "regenerated" (this project's records), "published", "published:<set>" or "<set>" (see
               `laws.published`), or the path of a record (.json); a law without constants has but one form
    setting    the light and surface the constants must belong to; by default that of the set or record that was named,
               and Setting() of regenerated ones
    folder     where the regenerated records lie, by default those of this installation
    Raises InputError on an unknown law or set, RecordError where the folder has no such record, SettingError where no
    such constants exist for the setting. Where the folder lacks only the map between alpha and A that normalises laws,
    the shipped one serves, with a ShippedMap warning.
    """
    kind, records = laws.find_class(laws.PROFILES, name), Records.of(folder or fits_folder())
    if kind is None and name.startswith("gaussians:"):
        raise InputError(f"law must be gaussians:N with N a whole number in 1 ... {gaussians.MOST}, got {name!r}")
    if kind is None:
        raise InputError(f"law must be one of {', '.join(names())}, got {name!r}")
    values, where = _constants(kind, constants, setting, records)
    given = {} if kind.own_reflectance else {"albedo": normalisation(where, records)}
    return _made(laws.at(kind, where), values, constants, setting=where, **given)


def albedo_law(
    name: str, constants: str = "regenerated", setting: Setting | None = None, folder: Folder | None = None
) -> AlbedoLaw:
    """Load a map between alpha and A by name; arguments as for `load`."""
    require(name in laws.MAPS, "albedo law", f"one of {', '.join(laws.MAPS)}", name)
    kind: type[AlbedoLaw] = laws.home(laws.MAPS[name])
    values, where = _constants(kind, constants, setting, Records.of(folder or fits_folder()))
    return _made(laws.at(kind, where), values, constants, setting=where)


def normalisation(setting: Setting, folder: Folder | None = None) -> Normalisation:
    """Load the map that scales profile laws to their reflectance; SettingError where the setting has none."""
    records = Records.of(folder or fits_folder())
    path = records.path_or_shipped(ALBEDO_RECORD, setting)
    if path.parent != records.folder:
        text = f"no record {path.stem!r} in {str(records.folder)!r}: the shipped albedo inversion is used"
        warnings.warn(text, ShippedMap, stacklevel=3)
    kind = laws.at(Rational, setting)
    return _made(kind, _of_record(records.read(path), setting, path.stem), path.stem, setting=setting)


def key_of(name: str) -> str:
    """Return the name under which a profile law is listed: "gaussians:6" for "gaussians", any other name for itself."""
    kind = laws.find_class(laws.PROFILES, name)
    return name if kind is None else str(kind.entry.key)


def _constants(
    kind: type[Constants], which: str, requested: Setting | None, records: Records
) -> tuple[dict[str, float], Setting]:
    """Return the constants of a law, and the setting that they belong to."""
    require(requested is None or isinstance(requested, Setting), "setting", "a mcml_sim.Setting", requested)
    entry = kind.entry
    if which == REGENERATED or (which == "published" and not kind.constant_names()):
        if kind.constant_names() and not entry.records:
            accepted = f"constants of {entry.key} must be one of {_accepted(entry.printed)}"
            raise RecordError(f"{accepted}: none were regenerated, got 'regenerated'")
        where, values = requested or SEARCHLIGHT, dict[str, float]()
        for base in entry.records:  # none of a law without constants
            path = records.path(base, where)
            values |= _of_record(records.read(path), where, path.stem)
        return values, where
    if which.endswith(".json"):
        content = records.read(Path(which))
        owner = content.get("law")
        owner = f"albedo {owner}" if content.get("pipeline") == "albedo" else key_of(str(owner))
        if owner != entry.key:
            raise RecordError(f"{which}: holds constants of law {owner!r}, got a request for {entry.key!r}")
        where = requested or record_setting(content)
        return {**published.constants(entry.printed), **_of_record(content, where, which)}, where
    sets = {s.name: s for s in published.SETS if s.law == entry.printed}
    if (chosen := sets.get(which.removeprefix("published:"))) is None:
        raise InputError(f"constants must be one of regenerated, {_accepted(entry.printed)}, got {which!r}")
    if requested not in (None, chosen.setting):
        belong = f"the {which} constants of {entry.printed} belong to {chosen.setting}"
        raise SettingError(f"{belong}, got a request for {requested}")
    return dict(chosen.constants), chosen.setting


def _accepted(law: str) -> str:
    return ", ".join([*(s.name for s in published.SETS if s.law == law), "the path of a record (.json)"])


def _of_record(content: dict[str, Any], setting: Setting, name: str) -> dict[str, float]:
    if not covers(content, setting):
        raise SettingError(f"record {name} belongs to {record_setting(content)}, got a request for {setting}")
    try:
        return {key: float(value["regenerated"]) for key, value in content["constants"].items()}
    except (KeyError, TypeError, ValueError, AttributeError):
        raise RecordError(f"record {name} is damaged: its constants have no regenerated values") from None


def _made(kind: type[Law], values: dict[str, float], which: str, **given: Any) -> Law:
    known = kind.constant_names()
    if set(values) != set(known):
        raise RecordError(f"constants {which} must be {', '.join(known)}, got {', '.join(values) or '(none)'}")
    return kind(**given, **values)  # type: ignore[arg-type]


@dataclass(frozen=True)
class LoadedLaw:
    """Law with its constants, in one setting.

    name     of the law in the catalogue; constants the printed set or the records they come from, "" if it has none
    files    those records; constants that they do not hold are as printed;  folder  of them and of the map behind it
    """

    name: str
    constants: str
    law: Any
    files: tuple[Path, ...] = ()
    folder: Path = field(default_factory=fits_folder, compare=False, repr=False)

    @property
    def records(self) -> tuple[str, ...]:
        return tuple(path.stem for path in self.files)

    @property
    def label(self) -> str:
        """Name in tables: its record, or law and printed set."""
        if self.records:
            return self.records[0]
        return f"{self.name}, {self.constants}" if self.constants else self.name

    @property
    def setting(self) -> Setting:
        return cast(Setting, self.law.setting)


def profile_laws(folder: Folder, names: Names = None, matched: bool = True) -> list[LoadedLaw]:
    """List profile laws with their constants; only those of the records `names`, where such are named.

    matched  only those of settings that have an exact profile
    Records of failed fits have no law.
    """
    records = Records.of(folder)
    return [*_whole_laws(records, names, matched), *_single(records, names, ("profile", "as-published"), matched)]


def sampled_laws(folder: Folder, names: Names = None, matched: bool = True) -> list[LoadedLaw]:
    """List laws whose samplers are worth measuring: whole ones, and inverse cdfs beside a printed profile."""
    records = Records.of(folder)
    return [*_whole_laws(records, names, matched), *_single(records, names, ("inverse",), matched)]


def all_profiles(folder: Folder) -> list[LoadedLaw]:
    """List every profile law of every setting, and last the inverse cdfs that none of them is made of."""
    records = Records.of(folder)
    whole = profile_laws(records, matched=False)
    taken = {name for one in whole for name in one.records}
    return [*whole, *(one for one in sampled_laws(records) if one.records and not set(one.records) & taken)]


def albedo_laws(folder: Folder, names: Names = None, matched: bool = True) -> list[LoadedLaw]:
    """List maps between alpha and A; arguments as for `profile_laws`."""
    records = Records.of(folder)
    entries = _entries(_classes(laws.MAPS, records, names))
    printed = _printed_laws(entries, records) if names is None else []
    return [*printed, *_regenerated(records, entries, names, matched)]


def find(
    name: str, folder: Folder, constants: str | None = None, n: float | None = None, g: float | None = None
) -> LoadedLaw:
    """Return a law or map by the name of one of its records, or by its own name.

    A name of both is the profile law's; "albedo liang" is the map's.

    constants  as in `load`; None takes the regenerated ones or, where there are none, the only printed set
    n, g       refractive index and mean cosine, if not those of the record or set [-]
    InputError, with the nearest names that there are, for any other name; SettingError for others without constants.
    """
    records, options = Records.of(folder), {"constants": constants, "n": n, "g": g}
    if (found := find_law(name, records, **options) or find_map(name, records, **options)) is not None:
        return found
    raise not_found(name, records, constants)


def find_law(name: str, folder: Folder, **options: Any) -> LoadedLaw | None:
    """Return a profile law or sampler as `find` does; None where the name is of something else."""
    own = laws.find_class(laws.PROFILES, name)
    return _found(name, Records.of(folder), own, (profile_laws, sampled_laws), **options)


def find_map(name: str, folder: Folder, **options: Any) -> LoadedLaw | None:
    """Return a map between alpha and A as `find` does; None where the name is of something else."""
    classes = laws.map_classes()
    own = {kind.entry.key: kind for kind in classes.values()} | classes
    return _found(name, Records.of(folder), own.get(name), (albedo_laws,), **options)


def _found(
    name: str, records: Records, kind: Any, lists: Lists, constants: str | None = None, **of: Any
) -> LoadedLaw | None:
    """Return the law of a record, else of a class of that name, with the n and g given; None where there is neither."""
    if name in records.paths and constants in (None, REGENERATED):
        found = next((law for each in lists for law in each(records, (name,), False)), None)
    elif kind is not None:
        which = constants or _default(kind.entry, bool(kind.constant_names()))
        found = _named(kind.entry, which, None, records)
    else:
        return None
    given = {key: value for key, value in of.items() if value is not None}
    if found is None or (setting := replace(found.setting, **given)) == found.setting:
        return found
    entry = found.law.entry
    which = constants or (REGENERATED if found.records or not found.constants else found.constants)
    return _named(entry, which, setting, records)


def not_found(name: str, folder: Folder, constants: str | None = None) -> InputError:
    """Return the error for a name that no law or map of these constants has."""
    records = Records.of(folder)
    if name in records.paths and constants in (None, REGENERATED):
        return RecordError(f"record {name!r} holds no law of a fit that converged")
    if name in records.paths:
        return InputError(f"constants of a record are its own: name must be a law's with {constants}, got {name!r}")
    there = {*records.paths, *names(), *laws.MAPS}
    near = get_close_matches(name.lower(), sorted(there), n=2, cutoff=NEAR)
    hint = f"did you mean {', '.join(near)}?" if near else f"laws: {', '.join(names())};"
    return InputError(f"name must be a law, map or record, got {name!r}; {hint} `profilefit report` lists records")


def _classes(table: Mapping[str, str], records: Records, names: Names) -> dict[str, Any]:
    """Return the classes of a table by name; of records that are named, those of their laws."""
    if names is None:
        return laws.profile_classes() if table is laws.PROFILES else laws.map_classes()
    own = sorted({content["law"] for content in records.named(names).contents(whole=True).values()})
    each = [name for base in table for name in own if name.partition(":")[0] == base]
    return {name: kind for name in each if (kind := laws.find_class(table, name)) is not None}


def _entries(classes: Mapping[str, Any]) -> list[Entry]:
    return list({kind: kind.entry for kind in classes.values()}.values())


def _named(entry: Entry, which: str, setting: Setting | None, records: Records) -> LoadedLaw:
    law: Any = (albedo_law if entry.is_map else load)(entry.name, which, setting, records)
    if which == REGENERATED:
        files = _files(entry, law.setting, records)
    else:
        files = (Path(which),) if which.endswith(".json") else ()
    constants = " + ".join(path.stem for path in files) or which.removeprefix("published:")
    return LoadedLaw(entry.name, constants if law.constant_names() else "", law, files, records.folder)


def _files(entry: Entry, setting: Setting, records: Records) -> tuple[Path, ...]:
    return tuple(records.folder / f"{records.name(base, setting)}.json" for base in entry.records)


def _default(entry: Entry, has_constants: bool) -> str:
    """Return the regenerated constants, or the only ones printed where none were regenerated."""
    if entry.records or not has_constants:
        return REGENERATED
    if len(printed := [s.name for s in published.SETS if s.law == entry.printed]) == 1:
        return printed[0]
    accepted = ("one of " if printed else "") + _accepted(entry.printed)
    raise InputError(f"constants must be {accepted}: {entry.key} was not regenerated, got none")


def _printed_laws(entries: Iterable[Entry], records: Records) -> list[LoadedLaw]:
    known = {entry.printed: entry for entry in entries}
    return [_named(known[s.law], s.name, None, records) for s in published.SETS if s.law in known]


def _whole_laws(records: Records, names: Names, matched: bool) -> list[LoadedLaw]:
    """List printed sets, laws without constants, and laws made of all their regenerated records."""
    classes = _classes(laws.PROFILES, records, names)
    entries = _entries(classes)
    regenerated = _regenerated(records, entries, names, matched)
    if names is not None:  # others are of none
        return regenerated
    bare = [name for name, kind in classes.items() if not kind.constant_names()]
    unfitted = [LoadedLaw(name, "", load(name, folder=records), (), records.folder) for name in bare]
    return [*_printed_laws(entries, records), *unfitted, *regenerated]


def _regenerated(records: Records, entries: Sequence[Entry], names: Names, matched: bool) -> list[LoadedLaw]:
    """List these laws, in every setting whose records all are in the folder."""
    there = _usable(records.named(names), matched)
    settings = dict.fromkeys(record_setting(content) for content in there.values())
    found = []
    for entry in entries:
        for setting in settings if entry.records else ():
            parts = [path.stem for path in _files(entry, setting, records)]
            if set(parts) & set(there) and len(_usable(records.named(parts), matched)) == len(parts):
                found.append(_named(entry, REGENERATED, setting, records))
    return found


def _single(records: Records, names: Names, pipelines: tuple[str, ...], matched: bool) -> list[LoadedLaw]:
    """List records that no law takes by its name alone; constants that they do not hold are as printed."""
    entries = [one for table in (laws.PROFILES, laws.MAPS) for one in _entries(_classes(table, records, names))]
    found = []
    for name, content in _usable(records.named(names), matched).items():
        wholes = [[path.stem for path in _files(one, record_setting(content), records)] for one in entries]
        taken = any(name in parts and len(_usable(records.named(parts), matched)) == len(parts) for parts in wholes)
        if content["pipeline"] in pipelines and not taken:
            path = records.folder / f"{name}.json"
            law = load(content["law"], str(path), folder=records)
            found.append(LoadedLaw(content["law"], name, law, (path,), records.folder))
    return found


def _usable(records: Records, matched: bool) -> dict[str, dict[str, Any]]:
    """Return the records of fits that converged."""
    return {
        name: content
        for name, content in records.contents(whole=True).items()
        if "constants" in content
        and content["fit"]["result"] == "converged"
        and (record_setting(content).is_matched_isotropic or not matched)
    }
