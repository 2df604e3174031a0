"""The atlas: every law, map and function there is, over all its arguments, and the fits; what is red, where and why."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.laws import MAPS
from profilefit.laws.entry import EVERYWHERE
from profilefit.recipes import catalogue
from profilefit.recipes.catalogue import Named
from profilefit.recipes.record import Folder, Records
from profilefit.shader.check import validity
from profilefit.studies.stability import (
    fit_cases,
    fur,
    gradients,
    halfspace,
    heart,
    law_cells,
    map_cells,
    misuse,
    model_cells,
    refracting,
    sea,
    stacks,
)
from profilefit.studies.stability.cells import Cells
from profilefit.studies.stability.fit_cases import FitCase
from profilefit.studies.stability.layout import CDF, PDF, PROFILE, QUANTITIES, SAMPLE, TEXT16, TEXT32
from profilefit.studies.stability.regions import Region, regions_of

EXACT, CONVERT, SOLVER, STACKS, HEART, SEA, FUR = "exact", "convert", "solver", "stacks", "heart", "sea", "fur"
FUNCTIONS = (EXACT, CONVERT, SOLVER, STACKS, HEART, SEA, FUR)
IF_NAMED = (HEART, SEA, FUR)  # one needs OpenGL, and none is of a law
SETTINGS = (Setting(), Setting("diffuse"))
WORKERS = 2  # compiling and numpy leave Python's lock now and then; more would not
# Whose derivatives are looked at, one of a class, and of which quantities: compiling them takes seconds each.
DERIVED: dict[str, tuple[str, ...]] = {
    "hazard": (PROFILE, CDF, SAMPLE),
    "quantile": QUANTITIES,
    "liang-whole": (PROFILE, SAMPLE, PDF),
    "burley-whole": (PROFILE, SAMPLE),
    "gaussians-2": (PROFILE, SAMPLE),
    "dipole": (PROFILE, SAMPLE),
}
DERIVED_IF_NAMED = {"hazard": (PDF,)}  # ten seconds
DERIVED_MAPS = ("albedo-rational", "albedo-liang", "van_de_hulst, published", "chiang, published")
# Law, objective and lanes of the fits.
FITTED = (("rational", "reflectance", 16), ("burley", "relative", 16), ("hazard", "relative", 6))
LONGEST = (SOLVER, STACKS, "hazard", "quantile")  # begun first, so that no core waits at the end
# A look in seconds: what the paper prints, and what is ours; of profile laws their texts, which need no compiling.
QUICK_ARITHMETICS = (TEXT32, TEXT16)
QUICK = ("liang, published", "hazard", "albedo-rational", "map liang, published")


@dataclass(frozen=True)
class Findings:
    """What was found of one subject: its cells, their red regions, and fits."""

    name: str
    cells: tuple[Cells, ...]
    regions: tuple[Region, ...]
    fits: tuple[FitCase, ...] = ()

    @property
    def failures(self) -> int:
        """How often one of our own breaks its word."""
        return sum(one.is_failure for one in self.regions) + sum(one.is_failure for one in self.fits)


Job = tuple[str, Callable[[], Findings]]


def jobs(names: Iterable[str], folder: Folder, quick: bool) -> list[Job]:
    """What there is to do, a job a subject: all of it, or what is named; InputError for a name that there is not."""
    requested, records = list(names), Records.of(folder)
    profiles, albedos = _known(records)
    found: list[Job] = []
    for one in profiles:
        if _is_requested(one, one.label, requested, quick):
            also = DERIVED_IF_NAMED.get(one.label, ()) if requested else ()
            found.append((one.label, _of_law(one, records, quick, also)))
    for one in albedos:
        if _is_requested(one, _map_label(one), requested, quick):
            found.append((_map_label(one), _of_map(one, records, quick)))
    for name, job in _functions(records, quick).items():
        if name in requested or not (requested or quick or name in IF_NAMED):
            found.append((name, job))
    _require_known(requested, [name for name, _ in found], profiles, albedos)
    return found


def run(todo: list[Job]) -> Iterator[Findings]:
    """The parts, in order, several at a time, what takes longest first."""
    with ThreadPoolExecutor(WORKERS) as pool:
        started = {name: pool.submit(job) for name, job in sorted(todo, key=lambda one: one[0] not in LONGEST)}
        try:
            for name, _ in todo:
                yield started[name].result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _known(folder: Records) -> tuple[list[Named], list[Named]]:
    """Those that have a text: no shader runs a quadrature."""
    profiles = [one for one in catalogue.all_profiles(folder) if one.law.entry.has_text]
    return profiles, catalogue.albedo_laws(folder, matched=False)


def _map_label(one: Named) -> str:
    return one.label if one.records else f"map {one.label}"


def _is_requested(one: Named, label: str, requested: list[str], quick: bool) -> bool:
    if requested:
        return bool({label, one.name, *one.records} & set(requested))
    return not quick or label in QUICK


def _require_known(requested: list[str], found: list[str], profiles: list[Named], albedos: list[Named]) -> None:
    known = {*found, *FUNCTIONS, *(n for one in (*profiles, *albedos) for n in (one.name, *one.records))}
    unknown = [name for name in requested if name not in known]
    if unknown or not found:
        names = sorted({one.name for one in (*profiles, *albedos)})
        got = repr(unknown[0]) if unknown else "none"
        raise InputError(f"name must be a law, map or record ({', '.join(names)}) or {', '.join(FUNCTIONS)}, got {got}")


def _of_law(one: Named, folder: Records, quick: bool, also: tuple[str, ...]) -> Callable[[], Findings]:
    def job() -> Findings:
        limits = law_cells.limits_of(one, folder)
        arithmetics = QUICK_ARITHMETICS if quick else law_cells.COMPUTED
        text = map_cells.in_reduced(one)
        cells = [*law_cells.cells_of(text, limits, arithmetics), *model_cells.cells_of(one, limits)]
        cells += misuse.of_law(text)
        if one.label in DERIVED and not quick:
            cells += gradients.of_law(text, (*DERIVED[one.label], *also), limits.valid.alpha or EVERYWHERE)
        return _part(one.label, cells)

    return job


def _of_map(one: Named, folder: Records, quick: bool) -> Callable[[], Findings]:
    def job() -> Findings:
        text = map_cells.in_reduced(one)
        cells = [*map_cells.cells_of(one, folder), *misuse.of_map(text)]
        if one.label in DERIVED_MAPS and not quick:
            cells += gradients.of_map(text, validity.of_map(one, folder))
        return _part(_map_label(one), cells)

    return job


def _functions(folder: Records, quick: bool) -> dict[str, Callable[[], Findings]]:
    def of_exact() -> Findings:
        settings = SETTINGS[:1] if quick else SETTINGS
        cells = [each for s in settings for each in halfspace.cells_of(s, catalogue.normalisation(s, folder))]
        if not quick:
            cells += refracting.cells_of()
        return _part(EXACT, [*cells, *misuse.of_exact()])

    def of_solver() -> Findings:
        cases: list[FitCase] = []
        for name, objective, lanes in FITTED[:2] if quick else FITTED:
            of_map = name in MAPS
            law = (catalogue.albedo_law if of_map else catalogue.load)(name, folder=folder)
            cases += fit_cases.fits_of(law, objective, name, lanes)
        start = catalogue.load("liang", "corrected", folder=folder)
        return Findings(SOLVER, (), (), (*cases, *fit_cases.trimmed_fits(start)))  # type: ignore[arg-type]

    return {
        EXACT: of_exact,
        CONVERT: lambda: _part(CONVERT, [*map_cells.conversion_cells(), *misuse.of_convert()]),
        SOLVER: of_solver,
        STACKS: lambda: _part(STACKS, list(stacks.cells_of(folder.folder))),
        HEART: lambda: _part(HEART, list(heart.cells_of())),
        SEA: lambda: _part(SEA, list(sea.cells_of())),
        FUR: lambda: _part(FUR, list(fur.cells_of())),
    }


def _part(name: str, cells: list[Cells]) -> Findings:
    return Findings(name, tuple(cells), tuple(region for each in cells for region in regions_of(each)))
