"""The laws by name, with the constants that were asked for: published, corrected, regenerated, or from a record."""

from __future__ import annotations

from pathlib import Path
from typing import Any, TypeVar

from mcml_sim.setting import Setting
from profilefit import record
from profilefit.errors import InputError, RecordError, SettingError
from profilefit.laws import published
from profilefit.laws.base import AlbedoLaw, Constants, ProfileLaw
from profilefit.laws.burley import Burley
from profilefit.laws.liang import Liang
from profilefit.laws.liang_albedo import LiangAlbedo
from profilefit.laws.rational import Rational

Law = TypeVar("Law", bound=Constants)
PROFILE_LAWS: dict[str, type[ProfileLaw]] = {"liang": Liang, "burley": Burley}
ALBEDO_LAWS: dict[str, type[AlbedoLaw]] = {"liang": LiangAlbedo, "rational": Rational}
# Which records make up the regenerated constants of a law; a later one adds to an earlier one.
REGENERATED = {
    "liang": ("liang-whole", "liang-inverse-whole"),
    "burley": ("burley-whole",),
    "albedo liang": ("albedo-liang",),
    "albedo rational": ("albedo-rational",),
}
# The map that profile laws normalise with: it is exact to a few parts in a million.
ALBEDO_RECORD = "albedo-rational"


def fits_folder() -> Path:
    """The recipes and records that came with this installation: in the wheel, or beside the package in a checkout."""
    package = Path(__file__).resolve().parent
    shipped = package / "fits"
    return shipped if shipped.is_dir() else package.parent / "fits"


def names() -> tuple[str, ...]:
    """The names of the profile laws."""
    return tuple(PROFILE_LAWS)


def load(
    name: str, constants: str = "regenerated", setting: Setting | None = None, folder: Path | None = None
) -> ProfileLaw:
    """A profile law by name.

    constants  "regenerated" (this project's records), "published", "published:<set>" or "<set>" (see
               `laws.published`), or the path of a record (.json)
    setting    the light and surface the constants must belong to, by default Setting()
    folder     where the regenerated records lie, by default those of this installation
    Raises InputError on an unknown law or set, SettingError where no such constants exist for the setting.
    """
    if name not in PROFILE_LAWS:
        raise InputError(f"law must be one of {', '.join(names())}, got {name!r}")
    where = setting or Setting()
    values = _constants(name, name, constants, where, folder or fits_folder())
    return _made(PROFILE_LAWS[name], values, constants, setting=where, albedo=normalisation(where, folder))


def albedo_law(
    name: str, constants: str = "regenerated", setting: Setting | None = None, folder: Path | None = None
) -> AlbedoLaw:
    """A map between alpha and A by name; arguments as for `load`."""
    if name not in ALBEDO_LAWS:
        raise InputError(f"albedo law must be one of {', '.join(ALBEDO_LAWS)}, got {name!r}")
    where = setting or Setting()
    values = _constants(f"albedo {name}", f"{name}_albedo", constants, where, folder or fits_folder())
    return _made(ALBEDO_LAWS[name], values, constants, setting=where)


def normalisation(setting: Setting, folder: Path | None = None) -> Rational:
    """The map that scales profile laws to their reflectance."""
    content = _record(ALBEDO_RECORD, folder or fits_folder())
    return _made(Rational, _of_record(content, setting, ALBEDO_RECORD), ALBEDO_RECORD, setting=setting)


def record_setting(content: dict[str, Any]) -> Setting:
    """The setting that a record belongs to."""
    try:
        return Setting(**content["setting"])
    except (KeyError, TypeError, InputError):
        raise RecordError(f"record {content.get('name')!r} is damaged: it has no valid setting") from None


def _constants(key: str, law: str, which: str, setting: Setting, folder: Path) -> dict[str, float]:
    if which == "regenerated":
        values: dict[str, float] = {}
        for name in REGENERATED[key]:
            values |= _of_record(_record(name, folder), setting, name)
        return values
    if which.endswith(".json"):
        content = record.read(Path(which))
        owner = f"albedo {content.get('law')}" if content.get("pipeline") == "albedo" else content.get("law")
        if owner != key:
            raise RecordError(f"{which}: holds constants of law {owner!r}, got a request for {key!r}")
        return {**published.constants(law), **_of_record(content, setting, which)}
    return _printed(law, which, setting)


def _printed(law: str, which: str, setting: Setting) -> dict[str, float]:
    wanted = which.removeprefix("published:")
    sets = [s for s in published.SETS if s.law == law]
    chosen = next((s for s in sets if s.name == wanted), None)
    if chosen is None:
        accepted = ["regenerated", *(s.name for s in sets), "the path of a record (.json)"]
        raise InputError(f"constants must be one of {', '.join(accepted)}, got {which!r}")
    if chosen.setting != setting:
        raise SettingError(f"the {which} constants of {law} belong to {chosen.setting}, got a request for {setting}")
    return dict(chosen.constants)


def _record(name: str, folder: Path) -> dict[str, Any]:
    """A record from `folder`, or else from this installation: a folder may hold only what was made there."""
    for place in (folder, fits_folder()):
        if (place / f"{name}.json").exists():
            return record.read(place / f"{name}.json")
    return record.read(folder / f"{name}.json")


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
