"""The laws by name, with the constants requested: published, corrected, regenerated, or from a record."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any, TypeVar

from mcml_sim.media.setting import Setting
from profilefit import laws
from profilefit.errors import InputError, RecordError, SettingError, ShippedMap
from profilefit.laws import gaussians, published
from profilefit.laws.base import AlbedoLaw, Constants, ProfileLaw
from profilefit.laws.rational import Normalisation, Rational
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.record import covers, record_setting
from profilefit.recipes.record_folder import SEARCHLIGHT, Folder, Records

Law = TypeVar("Law", bound=Constants)
# The map that profile laws normalise with: it is exact to a few parts in a million.
(ALBEDO_RECORD,) = Rational.entry.records


def names() -> tuple[str, ...]:
    """The names of the profile laws; `gaussians:N` is a sum of N = 1 ... 8 Gaussians, `gaussians` one of six."""
    return tuple(laws.PROFILES)


def load(
    name: str, constants: str = "regenerated", setting: Setting | None = None, folder: Folder | None = None
) -> ProfileLaw:
    """A profile law by name, one of `names()` or gaussians:1 ... gaussians:8.

    constants  "regenerated" (this project's records), "published", "published:<set>" or "<set>" (see
               `laws.published`), or the path of a record (.json); a law without constants has but one form
    setting    the light and surface the constants must belong to; by default that of the set or record that was named,
               and Setting() of regenerated ones
    folder     where the regenerated records lie, by default those of this installation
    Raises InputError on an unknown law or set, RecordError where the folder has no such record, SettingError where no
    such constants exist for the setting. Where the folder lacks only the map between alpha and A that normalises laws,
    the shipped one serves, with a ShippedMap warning.
    """
    kind, records = _profile_law(name), Records.of(folder or fits_folder())
    values, where = _constants(kind, constants, _checked(setting), records)
    at = laws.at(kind, where)
    given = {} if kind.own_reflectance else {"albedo": normalisation(where, records)}
    return _made(at, values, constants, setting=where, **given)


def albedo_law(
    name: str, constants: str = "regenerated", setting: Setting | None = None, folder: Folder | None = None
) -> AlbedoLaw:
    """A map between alpha and A by name; arguments as for `load`."""
    if name not in laws.MAPS:
        raise InputError(f"albedo law must be one of {', '.join(laws.MAPS)}, got {name!r}")
    kind: type[AlbedoLaw] = laws.home(laws.MAPS[name])
    values, where = _constants(kind, constants, _checked(setting), Records.of(folder or fits_folder()))
    return _made(laws.at(kind, where), values, constants, setting=where)


def normalisation(setting: Setting, folder: Folder | None = None) -> Normalisation:
    """The map that scales profile laws to their reflectance; SettingError where the setting has none."""
    records = Records.of(folder or fits_folder())
    path = records.path_or_shipped(ALBEDO_RECORD, setting)
    if path.parent != records.folder:
        warnings.warn(
            f"no record {path.stem!r} in {str(records.folder)!r}: the shipped map serves", ShippedMap, stacklevel=3
        )
    kind = laws.at(Rational, setting)
    return _made(kind, _of_record(records.read(path), setting, path.stem), path.stem, setting=setting)


def key_of(name: str) -> str:
    """What the name of a profile law stands for: "gaussians" for "gaussians:6"; any other name for itself."""
    known = laws.profile_classes()
    return str(known[name].entry.key) if name in known else name


def _profile_law(name: str) -> type[ProfileLaw]:
    known: dict[str, type[ProfileLaw]] = laws.profile_classes()
    if name in known:
        return known[name]
    if name.startswith("gaussians:"):
        raise InputError(f"law must be gaussians:N with N a whole number in 1 ... {gaussians.MOST}, got {name!r}")
    raise InputError(f"law must be one of {', '.join(names())}, got {name!r}")


def _checked(setting: Setting | None) -> Setting | None:
    if setting is not None and not isinstance(setting, Setting):
        raise InputError(f"setting must be a mcml_sim.Setting, got {setting!r}")
    return setting


def _constants(
    kind: type[Constants], which: str, requested: Setting | None, records: Records
) -> tuple[dict[str, float], Setting]:
    """The constants of a law, and the setting that they belong to."""
    entry = kind.entry
    if which == "regenerated" or (which == "published" and not kind.constant_names()):
        where = requested or SEARCHLIGHT
        return _all_regenerated(kind, where, records), where
    if which.endswith(".json"):
        content = records.read(Path(which))
        owner = content.get("law")
        owner = f"albedo {owner}" if content.get("pipeline") == "albedo" else key_of(str(owner))
        if owner != entry.key:
            raise RecordError(f"{which}: holds constants of law {owner!r}, got a request for {entry.key!r}")
        where = requested or record_setting(content)
        return {**published.constants(entry.printed), **_of_record(content, where, which)}, where
    return _printed(entry.printed, which, requested)


def _all_regenerated(kind: type[Constants], setting: Setting, records: Records) -> dict[str, float]:
    """The constants of every record that a law is made of; none for a law that has none."""
    if not kind.constant_names():
        return {}
    entry = kind.entry
    if not entry.records:
        raise RecordError(
            f"constants of {entry.key} must be one of {_accepted(entry.printed)}: none were regenerated, "
            "got 'regenerated'"
        )
    values: dict[str, float] = {}
    for base in entry.records:
        path = records.path(base, setting)
        values |= _of_record(records.read(path), setting, path.stem)
    return values


def _printed(law: str, which: str, requested: Setting | None) -> tuple[dict[str, float], Setting]:
    wanted = which.removeprefix("published:")
    sets = [s for s in published.SETS if s.law == law]
    chosen = next((s for s in sets if s.name == wanted), None)
    if chosen is None:
        raise InputError(f"constants must be one of regenerated, {_accepted(law)}, got {which!r}")
    if requested not in (None, chosen.setting):
        raise SettingError(f"the {which} constants of {law} belong to {chosen.setting}, got a request for {requested}")
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
    """A law from its constants, every one of them there and none besides."""
    known = kind.constant_names()
    if set(values) != set(known):
        raise RecordError(f"constants {which} must be {', '.join(known)}, got {', '.join(values) or '(none)'}")
    return kind(**given, **values)  # type: ignore[arg-type]
