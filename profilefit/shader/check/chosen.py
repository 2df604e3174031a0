"""Which laws and maps a check is of: by name, by record, by constants, or all that were regenerated."""

from __future__ import annotations

from collections.abc import Sequence

from profilefit.errors import InputError
from profilefit.laws.base import AlbedoLaw
from profilefit.recipes import catalogue, inventory
from profilefit.recipes.folder import Folder
from profilefit.recipes.inventory import Named

REGENERATED = "regenerated"
Chosen = tuple[list[Named], list[Named]]
"""Profile laws, and maps between A and alpha."""


def chosen(names: Sequence[str], constants: str | None, folder: Folder) -> Chosen:
    """Profile laws and maps under these names, or all of them; a name may be a law's, a map's or a record's.

    A law's name means all its settings.

    constants  "regenerated" or a printed set, as in `catalogue.load`; None takes the regenerated ones, or the only
               printed set of a law that was not regenerated
    InputError, RecordError, SettingError where there are none.
    """
    if constants is not None and constants.endswith(".json"):
        raise InputError(f"constants must be regenerated or a printed set; name the record itself, got {constants!r}")
    known = regenerated(folder) if constants in (None, REGENERATED) else printed(constants, folder)
    if not names:
        if not any(known):
            raise InputError(f"constants must be regenerated or a printed set, got {constants!r} and no law's name")
        return known
    found: Chosen = ([], [])
    for name in names:
        laws, maps = (_under(name, group) for group in known)
        if not laws and not maps:
            laws, maps = _loaded(name, constants, folder)
        found[0].extend(laws)
        found[1].extend(maps)
    return found


def regenerated(folder: Folder) -> Chosen:
    """All laws and maps made of records, in every setting."""
    profiles, maps = inventory.all_profiles(folder), inventory.albedo_laws(folder, matched=False)
    return [one for one in profiles if one.records], [one for one in maps if one.records]


def printed(constants: str, folder: Folder) -> Chosen:
    """All laws and maps of one printed set that have a text."""
    wanted = constants.removeprefix("published:")
    laws, maps = (
        [one for one in group if not one.records and one.constants == wanted]
        for group in (inventory.profile_laws(folder), inventory.albedo_laws(folder))
    )
    return [one for one in laws if one.law.entry.has_text], maps


def _under(name: str, group: Sequence[Named]) -> list[Named]:
    full = catalogue.key_of(name)
    return [one for one in group if full == one.name or name in one.records]


def _loaded(name: str, constants: str | None, folder: Folder) -> Chosen:
    """A law or map that is in no list: one without constants, one that was not regenerated, or a mistake."""
    one = inventory.find(name, folder, constants)
    return ([], [one]) if isinstance(one.law, AlbedoLaw) else ([one], [])
