"""Atlas of failures: every law, map and function over all its arguments, and fits; where each is red."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from typing import Any

from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.laws import MAPS
from profilefit.laws.base import EVERYWHERE
from profilefit.recipes import catalogue
from profilefit.recipes.record import Folder, Records
from profilefit.shader.check import bounds
from profilefit.studies.stability import exact_cells, fit_cases, gradients, law_cells, map_cells, misuse, scenes, stacks
from profilefit.studies.stability.cells import QUANTITIES, TEXT16, TEXT32, Cells, Region, regions_of

IF_NAMED = ("heart", "sea", "fur")  # one needs OpenGL, and none is of a law
SETTINGS = (Setting(), Setting("diffuse"))
PROFILE, CDF, SAMPLE, PDF = QUANTITIES
WORKERS = 2  # compiling and numpy leave Python's lock now and then; more would not
# Laws whose derivatives are looked at, one of a class, and of which quantities: compiling them takes seconds each.
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
LONGEST = ("solver", "stacks", "hazard", "quantile")  # started first, so that no core waits at the end
# A look in seconds: what the paper prints, and what is ours; of profile laws their texts, which need no compiling.
QUICK_ARITHMETICS = (TEXT32, TEXT16)
QUICK = ("liang, published", "hazard", "albedo-rational", "map liang, published")


@dataclass(frozen=True)
class Findings:
    """Cells of one subject, their red regions, and fits."""

    name: str
    cells: tuple[Cells, ...]
    regions: tuple[Region, ...]
    fits: tuple[fit_cases.FitCase, ...] = ()

    @property
    def failures(self) -> int:
        """Number of regions and fits in which one of our own breaks its promise."""
        return sum(one.is_failure for one in self.regions) + sum(one.is_failure for one in self.fits)


Job = tuple[str, Callable[[], Findings]]


def jobs(names: Iterable[str], folder: Folder, quick: bool) -> list[Job]:
    """Return what there is to do, a job a subject: all of it, or what is named; InputError for an unknown name."""
    requested, records = list(names), Records.of(folder)
    profiles = [one for one in catalogue.all_profiles(records) if one.law.entry.has_text]  # no shader runs a quadrature
    albedos = catalogue.albedo_laws(records, matched=False)

    def chosen(named: catalogue.LoadedLaw, label: str) -> bool:
        return bool({label, named.name, *named.records} & set(requested)) if requested else not quick or label in QUICK

    def job(name: str, look: Callable[..., Iterable[Cells | fit_cases.FitCase]], *of: Any) -> Job:
        return name, partial(_findings, name, look, *of, records, quick)

    todo = [job(one.label, _of_law, one, bool(requested)) for one in profiles if chosen(one, one.label)]
    todo += [job(map_cells.map_label(one), _of_map, one) for one in albedos if chosen(one, map_cells.map_label(one))]
    usual = () if requested or quick else set(FUNCTIONS) - set(IF_NAMED)
    todo += [job(name, look) for name, look in FUNCTIONS.items() if name in {*requested, *usual}]
    every = [*profiles, *albedos]
    known = {*FUNCTIONS, *(name for name, _ in todo), *(n for one in every for n in (one.name, *one.records))}
    unknown = [name for name in requested if name not in known]
    if unknown or not todo:
        accepted = f"({', '.join(sorted({one.name for one in every}))}) or {', '.join(FUNCTIONS)}"
        got = repr(unknown[0]) if unknown else "none"
        raise InputError(f"name must be a law, map or record {accepted}, got {got}")
    return todo


def run(todo: list[Job]) -> Iterator[Findings]:
    """Yield the findings in order; several jobs run at a time, the longest first."""
    with ThreadPoolExecutor(WORKERS) as pool:
        started = {name: pool.submit(job) for name, job in sorted(todo, key=lambda one: one[0] not in LONGEST)}
        try:
            for name, _ in todo:
                yield started[name].result()
        finally:
            pool.shutdown(wait=False, cancel_futures=True)


def _findings(name: str, look: Callable[..., Iterable[Cells | fit_cases.FitCase]], *given: Any) -> Findings:
    """Return the cells and the fits that a function yields."""
    every = list(look(*given))
    cells = tuple(one for one in every if isinstance(one, Cells))
    fits = tuple(one for one in every if isinstance(one, fit_cases.FitCase))
    return Findings(name, cells, tuple(region for each in cells for region in regions_of(each)), fits)


def _of_law(named: catalogue.LoadedLaw, is_named: bool, folder: Records, quick: bool) -> Iterator[Cells]:
    limits = law_cells.limits_of(named, folder)
    yield from law_cells.cells_of(named, limits, QUICK_ARITHMETICS if quick else law_cells.COMPUTED)
    yield from law_cells.model_cells(named, limits)
    yield from misuse.of_law(named)
    if named.label in DERIVED and not quick:
        more = DERIVED_IF_NAMED.get(named.label, ()) if is_named else ()
        yield from gradients.of_law(named, (*DERIVED[named.label], *more), limits.valid.alpha or EVERYWHERE)


def _of_map(named: catalogue.LoadedLaw, folder: Records, quick: bool) -> Iterator[Cells]:
    yield from map_cells.cells_of(named, folder)
    yield from misuse.of_law(named)
    if named.label in DERIVED_MAPS and not quick:
        yield from gradients.of_map(named, bounds.valid_map(named, folder))


def _of_exact(folder: Records, quick: bool) -> Iterator[Cells]:
    for setting in SETTINGS[:1] if quick else SETTINGS:
        yield from exact_cells.half_space_cells(setting, catalogue.normalisation(setting, folder))
    if not quick:
        yield from exact_cells.refracting_cells()
    yield from misuse.of_exact()


def _of_solver(folder: Records, quick: bool) -> Iterator[fit_cases.FitCase]:
    for name, objective, lanes in FITTED[:2] if quick else FITTED:
        law = (catalogue.albedo_law if name in MAPS else catalogue.load)(name, folder=folder)
        yield from fit_cases.fits_of(law, objective, name, lanes)
    start = catalogue.load("liang", "corrected", folder=folder)
    yield from fit_cases.trimmed_fits(start)  # type: ignore[arg-type]


FUNCTIONS: dict[str, Callable[[Records, bool], Iterable[Cells | fit_cases.FitCase]]] = {
    "exact": _of_exact,
    "convert": lambda *_: [*map_cells.conversion_cells(), *misuse.of_convert()],
    "solver": _of_solver,
    "stacks": lambda folder, _: stacks.cells_of(folder.folder),
    "heart": lambda *_: scenes.heart_cells(),
    "sea": lambda *_: [*scenes.of_hits(), scenes.of_level_floors(), scenes.of_beam(), *scenes.of_segment()],
    "fur": lambda *_: [*scenes.of_shells(), scenes.of_slabs(), *scenes.of_shadow()],
}
