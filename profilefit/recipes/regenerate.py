"""Run recipes: trace the light that they need, once for each setting, and write a record of each."""

from __future__ import annotations

import itertools
import time
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import Any

import jax
from threadpoolctl import threadpool_limits

from mcml_sim import Orders, Setting, exact
from mcml_sim.runs.progress import tracked
from profilefit.recipes import record, starts
from profilefit.recipes.pipelines import PIPELINES, Made, Pipeline, needs_photons, surfaces
from profilefit.recipes.recipe import Recipe
from profilefit.recipes.run import RecipeRun
from profilefit.recipes.workers import Workers

# Every law compiles a fit of its own for each setting: hundreds of memory maps, of which Linux gives a process 65
# thousand, and tens of megabytes. No later recipe needs them.
CLEARED = 8  # recipes after which compiled programs go
_RECIPES = itertools.count(1)  # of this process


@dataclass(frozen=True)
class Step:
    """What a run did: a record, or the light of a setting.

    name     of the recipe, or the setting; path of the record, None for light
    seconds  that it took; those of a recipe without its light
    """

    name: str
    seconds: float
    path: Path | None = None


def regenerate(
    recipes: tuple[Recipe, ...],
    run: RecipeRun,
    pipelines: Mapping[str, Pipeline] | None = None,
    processes: int = 1,
) -> list[Step]:
    """Run recipes and write their records: first the maps that others are normalised with, last what compares them.

    pipelines  what runs each recipe, by its key `pipeline`; a caller may have more of them
    processes  how many recipes run side by side, each in a process of its own if not one; the records are the same
    """
    for recipe in recipes:
        starts.require_known(recipe)
    # Those that span indices, and those with random starts, take longest: none is left when all others are done.
    ordered = sorted(recipes, key=lambda r: (_stage(r), not r.indices, -r.random_starts))
    lights: dict[Setting, Orders] = {}
    steps = []
    for setting in dict.fromkeys(recipe.setting for recipe in ordered if needs_photons(recipe)):
        begin = time.perf_counter()
        lights[setting] = run.light(setting)
        steps.append(Step(f"photons: {setting}", time.perf_counter() - begin))
    # Both lights take the same solution of a surface, which recipes side by side would both make.
    for n in sorted({n for recipe in ordered for n in surfaces(recipe)}):
        begin = time.perf_counter()
        run.say(f"exact light: n = {n:g}")
        exact.reflectance(1.0, Setting(n=n))
        steps.append(Step(f"exact light: n = {n:g}", time.perf_counter() - begin))
    with Workers(min(processes, len(ordered))) as workers:
        fitted = _fitted(workers, ordered, run, lights, pipelines or PIPELINES)
        return steps + list(tracked(fitted, "fitting", "recipes", len(ordered), run.progress is False))


def _stage(recipe: Recipe) -> int:
    """When a recipe runs: it reads records of earlier ones."""
    return {"albedo": 0, "evidence": 2}.get(recipe.pipeline, 1)


def _fitted(workers: Workers, ordered: Sequence[Recipe], run: RecipeRun, lights, pipelines) -> Iterator[Step]:
    """Write the records, as they come."""
    for _, stage in itertools.groupby(ordered, _stage):
        those = list(stage)
        used = [lights[recipe.setting] if needs_photons(recipe) else None for recipe in those]
        jobs = [(recipe, light, pipelines[recipe.pipeline]) for recipe, light in zip(those, used, strict=True)]
        for number, (made, said, seconds) in workers.each(partial(_made, replace(run, say=_silent)), jobs):
            recipe, (content, arrays) = those[number], made
            path = record.write(run.out, recipe.name, {**_header(recipe, run, used[number]), **content}, arrays)
            for text in (*said, f"{recipe.name}: {seconds:.1f} s, {recipe.title}"):
                run.say(text)
            yield Step(recipe.name, seconds, path)


def _silent(text: str) -> None:
    """Nobody listens: what `RecipeRun.say` is in another process."""


def _made(run: RecipeRun, job: tuple[Recipe, Orders | None, Pipeline]) -> tuple[Made, list[str], float]:
    """Content and arrays of a record, what was said meanwhile, and the seconds it took."""
    recipe, light, pipeline = job
    said: list[str] = []
    begin = time.perf_counter()
    # Matrices are small here: threads of BLAS wait for each other, and their number would decide digits.
    with threadpool_limits(1, "blas"):
        made = pipeline(recipe, replace(run, say=said.append), light)
    if next(_RECIPES) % CLEARED == 0:
        jax.clear_caches()
    return made, said, time.perf_counter() - begin


def _header(recipe: Recipe, run: RecipeRun, light: Orders | None) -> dict[str, Any]:
    header: dict[str, Any] = {
        "title": recipe.title,
        "law": recipe.law,
        "equations": recipe.equations,
        "pipeline": recipe.pipeline,
        "note": recipe.note,
        "setting": recipe.setting,
        **({"indices": recipe.span} if recipe.indices else {}),
        **({"cosines": (0.0, recipe.cosines[-1])} if recipe.cosines else {}),
        "protocol": {
            "albedos": recipe.albedos,
            "rings": recipe.rings,
            "weighting": recipe.weighting,
            "mfp": recipe.mfp,
            "start": recipe.start,
            "held": recipe.held,
            **({"indices": recipe.indices} if recipe.indices else {}),
            **({"cosines": recipe.cosines} if recipe.cosines else {}),
        },
        "truth": {"kind": recipe.truth},
        "preset": run.preset,
        "seed": run.seed,
        "versions": record.versions(),
    }
    if recipe.truth == "orders" and light is not None:
        header["truth"] |= {
            "photons": light.photons,
            "grid_digest": light.grid.digest,
            "cut": {f"{a:g}": light.cut(a) for a in (0.9, 0.99, 0.995, 0.999, 1.0)},
            "ledger": light.ledger,
        }
    return header
