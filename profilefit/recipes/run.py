"""Runs of a command that regenerates records: its light and folders, and the independent parts of each record.

Parts are done side by side, in processes of their own; a record is written as soon as its parts are done.
"""

from __future__ import annotations

import itertools
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import jax
import numpy as np
from threadpoolctl import threadpool_limits

from mcml_sim import Grid, Orders, Setting, exact, simulate_orders
from profilefit.recipes import record
from profilefit.recipes.targets import RUN_EDGES
from profilefit.recipes.workers import Workers

Say = Callable[[str], None]
RecordContent = tuple[Mapping[str, Any], Mapping[str, np.ndarray]]
PHOTONS = {"quick": 20 * 2**20, "full": 400 * 2**20}
# Surfaces that refract take the general kernel, which needs six times as long for a photon.
REFRACTED_PHOTONS = {"quick": 8 * 2**20, "full": 160 * 2**20}
MAX_CHAIN = {"quick": 64_000, "full": 256_000}
# Every law compiles a fit of its own for each setting: hundreds of memory maps, of which Linux gives a process 65
# thousand, and tens of megabytes. No later part needs them.
CLEARED = 8  # parts of a process after which compiled programs go
UNUSED = " No photon is traced: the preset and number of photons that were given have no effect."
_PARTS = itertools.count(1)  # of this process
MAPS, LAWS, COMPARISONS = range(3)  # stages: a record reads those of earlier stages


def silent(text: str) -> None:
    """Say nothing: the function that takes the place of a caller's on the way to another process."""


@dataclass(frozen=True)
class Step:
    """One thing done: a record written, or the light of a setting made ready.

    name     of the record or of the light; path of the record, None for light
    seconds  that its parts took, added up
    """

    name: str
    seconds: float
    path: Path | None = None


@dataclass(frozen=True)
class Work:
    """One record to be made.

    name    of the record in a folder of records, for example "hazard" or "stacks/skin"
    parts   functions without arguments that processes can do in any order
    finish  content and arrays of the record, from the results of the parts in their order
    notes   lines on its data, to be said before the parts begin
    order   its stage, and what decides among works of one stage which begins first
    """

    name: str
    parts: tuple[Callable[[], Any], ...]
    finish: Callable[[list[Any]], RecordContent]
    notes: tuple[str, ...] = ()
    order: tuple[int, ...] = (LAWS,)


@dataclass(frozen=True)
class RecipeRun:
    """One command's run. `photons` overrides the preset's number; `store` keeps the photons for a later run.

    lights  photons by their setting, traced once;  steps  what was made ready for the records of this run
    """

    preset: str
    seed: int
    out: Path
    store: Path | None
    photons: int | None
    say: Say = silent
    progress: bool | None = None
    lights: dict[Setting, Orders] = field(default_factory=dict, compare=False, repr=False)
    steps: list[Step] = field(default_factory=list, compare=False, repr=False)

    @property
    def max_chain(self) -> int:
        """The longest that a chain may get [steps]."""
        return MAX_CHAIN[self.preset]

    def light(self, setting: Setting) -> Orders:
        """Trace the order-resolved light of a setting, once; what the store has of it is not traced again."""
        if setting not in self.lights:
            grid, photons, begin = Grid.from_edges(r=RUN_EDGES), self.number(setting), time.perf_counter()
            # A folder of each setting, inside that of Setting().
            store = self.store and self.store / record.record_name("", setting).removeprefix("-")
            light = simulate_orders(grid, photons, self.seed, setting, store, progress=self.progress)
            self.say(f"{photons:.3g} photons: {setting}")  # now, since a run that fails says one line
            self.lights[setting] = light
            self.steps.append(Step(f"photons: {setting}", time.perf_counter() - begin))
        return self.lights[setting]

    def solve_surface(self, n: float) -> None:
        """Solve the exact light under a surface of index n: both illuminations use it, from the user's cache."""
        name, begin = f"exact light: n = {n:g}", time.perf_counter()
        if name not in (step.name for step in self.steps):
            self.say(name)
            exact.reflectance(1.0, Setting(n=n))
            self.steps.append(Step(name, time.perf_counter() - begin))

    def number(self, setting: Setting) -> int:
        """Return the number of photons of a setting."""
        return self.photons or preset_photons(self.preset, setting)

    def unused(self) -> str:
        """Return what a record of fixed data says of a preset or number of photons that was given."""
        return "" if self.preset == "quick" and self.photons is None else UNUSED

    def part(self) -> RecipeRun:
        """Return this run as a part in another process has it, without the light."""
        return replace(self, say=silent, lights={}, steps=[])


def preset_photons(preset: str, setting: Setting) -> int:
    """Return the default number of photons of a setting."""
    return (PHOTONS if setting.is_matched_isotropic else REFRACTED_PHOTONS)[preset]


def written(works: Sequence[Work], out: Path, workers: Workers, say: Say = silent) -> Iterator[Step]:
    """Write the records of `works` into the folder `out`, each as soon as its parts are done; parts begin in order."""
    for work in works:
        for note in work.notes:
            say(note)
    parts = [(at, place) for at, work in enumerate(works) for place in range(len(work.parts))]
    results: list[dict[int, Any]] = [{} for _ in works]
    seconds = [0.0] * len(works)
    for number, (result, spent) in workers.each(_done, [works[at].parts[place] for at, place in parts]):
        at, place = parts[number]
        work = works[at]
        results[at][place], seconds[at] = result, seconds[at] + spent
        if len(results[at]) == len(work.parts):
            content, arrays = work.finish([results[at][place] for place in range(len(work.parts))])
            folder, _, name = work.name.rpartition("/")
            path = record.write(out / folder, name, content, arrays)
            say(f"{work.name}: {seconds[at]:.1f} s, {content['title']}")
            yield Step(work.name, seconds[at], path)


def _done(part: Callable[[], Any]) -> tuple[Any, float]:
    """Run a part, and return its result and the seconds it took."""
    begin = time.perf_counter()
    # Matrices are small here: threads of BLAS wait for each other, and their number would decide digits.
    with threadpool_limits(1, "blas"):
        result = part()
    if next(_PARTS) % CLEARED == 0:
        jax.clear_caches()
    return result, time.perf_counter() - begin
