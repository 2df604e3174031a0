"""Laws and maps that are checked, by name, record or constants, or all that were regenerated; and what checks find."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import chain, product
from pathlib import Path

from mcml_sim.runs.progress import tracked, working
from profilefit.errors import InputError
from profilefit.laws.base import AlbedoLaw
from profilefit.recipes import catalogue
from profilefit.recipes.record import Folder, Records
from profilefit.shader.check.law_check import HalfCheck, LawCheck, MapCheck, check_half, check_laws, check_map
from profilefit.shader.check.law_cost import YARDSTICK, Cost, costs
from profilefit.shader.check.shader_law import half_extension, no_half
from profilefit.shader.context import opened, renderer

REGENERATED = "regenerated"
# Indices, and mean cosines, that a law which spans them is checked at, of those: both ends and between.
INDICES, COSINES = (1.001, 1.02, 1.2, 1.4, 1.6), (0.1, 0.5, 0.95)
Chosen = tuple[list[catalogue.LoadedLaw], list[catalogue.LoadedLaw]]
"""Profile laws, and maps between A and alpha."""


def chosen(names: Sequence[str], constants: str | None, folder: Folder) -> Chosen:
    """List profile laws and maps under these names, or all of them; a name may be a law's, a map's or a record's.

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
        full = catalogue.key_of(name)
        laws, maps = ([one for one in group if full == one.name or name in one.records] for group in known)
        if not laws and not maps:  # it is in no list: without constants, or not regenerated; or a mistake
            one = catalogue.find(name, folder, constants)
            (maps if isinstance(one.law, AlbedoLaw) else laws).append(one)
        found[0].extend(laws)
        found[1].extend(maps)
    return found


def scope(names: Sequence[str] | None, constants: str | None) -> list[str] | str:
    """Return names or "all" as the scope of a check, so that a part does not pass for the whole."""
    return list(names or ()) or ("all" if constants in (None, REGENERATED) else f"all {constants}")


def regenerated(folder: Folder) -> Chosen:
    """List all laws and maps made of records, in every setting; one that spans indices at each of `INDICES`."""
    records = Records.of(folder)

    def spread(loaded: catalogue.LoadedLaw) -> list[catalogue.LoadedLaw]:
        content = records.content(loaded.label)
        low, high = content.get("indices") or (0.0, 0.0)
        cosines = COSINES if "cosines" in content else (loaded.setting.g,)
        places = product((n for n in INDICES if low < n <= high), cosines)
        return [catalogue.find(loaded.label, records, n=n, g=g) for n, g in places] or [loaded]

    profiles, maps = catalogue.all_profiles(records), catalogue.albedo_laws(records, matched=False)
    laws, of_maps = ([each for one in group if one.records for each in spread(one)] for group in (profiles, maps))
    return laws, of_maps


def printed(constants: str, folder: Folder) -> Chosen:
    """List all laws and maps of one printed set that have a source."""
    wanted = constants.removeprefix("published:")
    laws, maps = (
        [one for one in group if not one.records and one.constants == wanted]
        for group in (catalogue.profile_laws(folder), catalogue.albedo_laws(folder))
    )
    return [one for one in laws if one.law.entry.has_text], maps


@dataclass(frozen=True)
class Checked:
    """Measurements on one device; `lacking` says why nothing was in half precision."""

    laws: list[LawCheck]
    maps: list[MapCheck]
    costs: dict[str, Cost]
    halves: list[HalfCheck]
    device: str
    lacking: str

    @property
    def checks(self) -> list[LawCheck | MapCheck]:
        """Laws and maps."""
        return [*self.laws, *self.maps]

    @property
    def is_broken(self) -> bool:
        """Verdict: any bound is broken."""
        return any(one.broken for one in self.checks)


def checked(those: Chosen, folder: Path, in_half: bool = False, quiet: bool = True) -> Checked:
    """Check laws and maps, and time their texts; `in_half` in half precision as well. ShaderError without OpenGL."""
    laws, maps = those
    with opened() as context:
        checks = chain(check_laws(context, laws, folder), (check_map(context, one, folder) for one in maps))
        found = list(tracked(checks, "checking", "laws", len(laws) + len(maps), quiet))
        yardstick = catalogue.load(YARDSTICK, "published", folder=folder)
        with working("timing the sources", quiet):
            timed = costs(context, [one.law for one in laws], yardstick) if laws else {}
        halves = (check_half(context, one) for one in laws if in_half)
        return Checked(
            laws=[one for one in found if isinstance(one, LawCheck)],
            maps=[one for one in found if isinstance(one, MapCheck)],
            costs=timed,
            halves=list(tracked(halves, "halving", "laws", len(laws), quiet)),
            device=renderer(context),
            lacking="" if half_extension(context) else no_half(context),
        )
