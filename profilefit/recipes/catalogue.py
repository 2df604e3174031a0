"""The laws by name, with the constants that were asked for: published, corrected, regenerated, or from a record."""

from __future__ import annotations

import warnings
from pathlib import Path
from typing import Any, TypeVar

import numpy as np

from mcml_sim.media.setting import Setting
from profilefit.errors import InputError, RecordError, SettingError, ShippedMap
from profilefit.laws import gaussians, published
from profilefit.laws.base import AlbedoLaw, Constants, ProfileLaw
from profilefit.laws.beam_diffusion import BeamDiffusion
from profilefit.laws.better_dipole import BetterDipole
from profilefit.laws.burley import Burley, BurleyDiffuseMfp
from profilefit.laws.chiang import Chiang
from profilefit.laws.diffusion import DiffusionLaw
from profilefit.laws.dipole import Dipole
from profilefit.laws.hazard import Hazard
from profilefit.laws.liang import Liang
from profilefit.laws.liang_albedo import LiangAlbedo
from profilefit.laws.quantile import Quantile
from profilefit.laws.rational import Rational
from profilefit.laws.van_de_hulst import VanDeHulst
from profilefit.recipes import record
from profilefit.recipes.folder import fits_folder

Law = TypeVar("Law", bound=Constants)
SEARCHLIGHT = Setting()
PROFILE_LAWS: dict[str, type[ProfileLaw]] = {
    "liang": Liang,
    "burley": Burley,
    "burley_diffuse_mfp": BurleyDiffuseMfp,
    "dipole": Dipole,
    "better_dipole": BetterDipole,
    "beam_diffusion": BeamDiffusion,
    "gaussians": gaussians.law_class(),
    **{f"gaussians:{count}": gaussians.law_class(count) for count in range(1, gaussians.MOST + 1)},
    "hazard": Hazard,
    "quantile": Quantile,
}
# A name for short, and what it stands for.
SHORT = {"gaussians": f"gaussians:{gaussians.DEFAULT}"}
ALBEDO_LAWS: dict[str, type[AlbedoLaw]] = {
    "liang": LiangAlbedo,
    "rational": Rational,
    "van_de_hulst": VanDeHulst,
    "chiang": Chiang,
}
# Which records make up the regenerated constants of a law; a later one adds to an earlier one. These are the names for
# Setting(); see `record_name` for those of others.
REGENERATED = {
    "liang": ("liang-whole", "liang-inverse-whole"),
    "burley": ("burley-whole",),
    "gaussians:2": ("gaussians-2",),
    "gaussians:4": ("gaussians-4",),
    "gaussians:6": ("gaussians-6",),
    "hazard": ("hazard",),
    "quantile": ("quantile",),
    "albedo liang": ("albedo-liang",),
    "albedo rational": ("albedo-rational",),
}
# The map that profile laws normalise with: it is exact to a few parts in a million.
ALBEDO_RECORD = "albedo-rational"


def names() -> tuple[str, ...]:
    """The names of the profile laws; `gaussians:N` is a sum of N = 1 ... 8 Gaussians, `gaussians` one of six."""
    return tuple(name for name in PROFILE_LAWS if ":" not in name)


def load(
    name: str, constants: str = "regenerated", setting: Setting | None = None, folder: Path | None = None
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
    kind, key = _profile_law(name), SHORT.get(name, name)
    values, where = _constants(kind, key, key, constants, _checked(setting), folder or fits_folder())
    if issubclass(kind, DiffusionLaw):  # it has a reflectance of its own
        return _made(kind, values, constants, setting=where)
    return _made(kind, values, constants, setting=where, albedo=normalisation(where, folder))


def albedo_law(
    name: str, constants: str = "regenerated", setting: Setting | None = None, folder: Path | None = None
) -> AlbedoLaw:
    """A map between alpha and A by name; arguments as for `load`."""
    if name not in ALBEDO_LAWS:
        raise InputError(f"albedo law must be one of {', '.join(ALBEDO_LAWS)}, got {name!r}")
    kind, places = ALBEDO_LAWS[name], folder or fits_folder()
    values, where = _constants(kind, f"albedo {name}", f"{name}_albedo", constants, _checked(setting), places)
    return _made(kind, values, constants, setting=where)


def normalisation(setting: Setting, folder: Path | None = None) -> Rational:
    """The map that scales profile laws to their reflectance; SettingError where the setting has none."""
    path = map_file(setting, folder)
    if folder is not None and path.parent != folder:
        warnings.warn(
            f"no record {path.stem!r} in {str(folder)!r}: the shipped map serves",
            ShippedMap,
            stacklevel=3,
        )
    return _made(Rational, _of_record(record.read(path), setting, path.stem), path.stem, setting=setting)


def map_file(setting: Setting, folder: Path | None = None) -> Path:
    """The record of that map: in the folder, or the one shipped. SettingError where neither has one of the setting."""
    if folder is not None and (path := folder / f"{record_name(ALBEDO_RECORD, setting)}.json").exists():
        return path
    return record_file(ALBEDO_RECORD, setting, fits_folder())


def record_name(base: str, setting: Setting) -> str:
    """The record of another setting than Setting(): albedo-rational, -diffuse, -n1.4, -diffuse-n1.4, -g0.8."""
    parts = [base]
    if setting.illumination != SEARCHLIGHT.illumination:
        parts.append(setting.illumination)
    if setting.n != SEARCHLIGHT.n:
        parts.append(f"n{_shortest(setting.n)}")
    if setting.g != SEARCHLIGHT.g:
        parts.append(f"g{_shortest(setting.g)}")
    return "-".join(parts)


def record_file(base: str, setting: Setting, folder: Path) -> Path:
    """The record of a setting in a folder, by its name for Setting().

    SettingError that lists the settings there are; RecordError where there is none at all.
    """
    if (path := folder / f"{record_name(base, setting)}.json").exists():
        return path
    if known := regenerated_settings(base, folder):
        there = "; ".join(str(one) for one in known)
        raise SettingError(f"record {base} belongs to {there}, got a request for {setting}")
    raise RecordError(f"{path}: there is no such record; `profilefit regenerate {base} --out {folder}` makes it")


def regenerated_settings(base: str, folder: Path | None = None) -> tuple[Setting, ...]:
    """The settings that a record was regenerated for, by its name for Setting()."""
    found = {}
    for name, path in record.available(folder or fits_folder()).items():
        if name.startswith(base) and record_name(base, setting := record_setting(record.read(path))) == name:
            found[name] = setting
    return tuple(found[name] for name in sorted(found))


def record_setting(content: dict[str, Any]) -> Setting:
    """The setting that a record belongs to."""
    try:
        return Setting(**content["setting"])
    except (KeyError, TypeError, InputError):
        raise RecordError(f"record {content.get('name')!r} is damaged: it has no valid setting") from None


def _profile_law(name: str) -> type[ProfileLaw]:
    if name in PROFILE_LAWS:
        return PROFILE_LAWS[name]
    if name.startswith("gaussians:"):
        raise InputError(f"law must be gaussians:N with N a whole number in 1 ... {gaussians.MOST}, got {name!r}")
    raise InputError(f"law must be one of {', '.join(names())}, got {name!r}")


def _checked(setting: Setting | None) -> Setting | None:
    if setting is not None and not isinstance(setting, Setting):
        raise InputError(f"setting must be a mcml_sim.Setting, got {setting!r}")
    return setting


def _shortest(value: float) -> str:
    """The fewest digits that are this number: 1.4, 2."""
    return np.format_float_positional(value, trim="-")


def _constants(
    kind: type[Constants], key: str, law: str, which: str, asked: Setting | None, folder: Path
) -> tuple[dict[str, float], Setting]:
    """The constants of a law, and the setting that they belong to."""
    if which == "regenerated" or (which == "published" and not kind.constant_names()):
        where = asked or SEARCHLIGHT
        return _all_regenerated(kind, key, law, where, folder), where
    if which.endswith(".json"):
        content = record.read(Path(which))
        owner = content.get("law")
        owner = f"albedo {owner}" if content.get("pipeline") == "albedo" else SHORT.get(str(owner), owner)
        if owner != key:
            raise RecordError(f"{which}: holds constants of law {owner!r}, got a request for {key!r}")
        where = asked or record_setting(content)
        return {**published.constants(law), **_of_record(content, where, which)}, where
    return _printed(law, which, asked)


def _all_regenerated(kind: type[Constants], key: str, law: str, setting: Setting, folder: Path) -> dict[str, float]:
    """The constants of every record that a law is made of; none for a law that has none."""
    if not kind.constant_names():
        return {}
    if key not in REGENERATED:
        raise RecordError(
            f"constants of {key} must be one of {_accepted(law)}: none were regenerated, got 'regenerated'"
        )
    values: dict[str, float] = {}
    for base in REGENERATED[key]:
        path = record_file(base, setting, folder)
        values |= _of_record(record.read(path), setting, path.stem)
    return values


def _printed(law: str, which: str, asked: Setting | None) -> tuple[dict[str, float], Setting]:
    wanted = which.removeprefix("published:")
    sets = [s for s in published.SETS if s.law == law]
    chosen = next((s for s in sets if s.name == wanted), None)
    if chosen is None:
        raise InputError(f"constants must be one of regenerated, {_accepted(law)}, got {which!r}")
    if asked not in (None, chosen.setting):
        raise SettingError(f"the {which} constants of {law} belong to {chosen.setting}, got a request for {asked}")
    return dict(chosen.constants), chosen.setting


def _accepted(law: str) -> str:
    return ", ".join([*(s.name for s in published.SETS if s.law == law), "the path of a record (.json)"])


def _of_record(content: dict[str, Any], setting: Setting, name: str) -> dict[str, float]:
    if record_setting(content) != setting:
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
