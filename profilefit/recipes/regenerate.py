"""Regenerate records: trace the light that recipes need, once for each setting, and write a record of each."""

from __future__ import annotations

import itertools
import time
from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any

from mcml_sim import Orders, Setting, exact
from mcml_sim.runs.progress import tracked
from profilefit.recipes import record, starts
from profilefit.recipes.pipelines import PIPELINES, Pipeline, needs_photons, surfaces
from profilefit.recipes.recipe import Recipe
from profilefit.recipes.run import RecipeRun
from profilefit.recipes.work import Made, Step, Work, silent, written
from profilefit.recipes.workers import Workers


def regenerate(
    recipes: Sequence[Recipe],
    run: RecipeRun,
    pipelines: Mapping[str, Pipeline] | None = None,
    processes: int = 1,
    others: Sequence[Work] = (),
) -> list[Step]:
    """Run recipes and write their records: first the maps that others are normalised with, last what compares them.

    Args:
        recipes: what to fit.
        run: preset, seed and folders.
        pipelines: what runs each recipe, by its key `pipeline`; a caller may have more of them.
        processes: number of processes that fit side by side; the records do not depend on it.
        others: further records that read none of these.
    """
    for recipe in recipes:
        starts.require_known(recipe)
    ordered = sorted(recipes, key=_order)
    lights: dict[Setting, Orders] = {}
    steps = []
    for setting in dict.fromkeys(recipe.setting for recipe in ordered if needs_photons(recipe)):
        begin = time.perf_counter()
        lights[setting] = run.light(setting)
        steps.append(Step(f"photons: {setting}", time.perf_counter() - begin))
    # Both illuminations use one solution of a surface, which stays in the user's cache.
    for n in sorted({n for recipe in ordered for n in surfaces(recipe)}):
        begin = time.perf_counter()
        run.say(f"exact light: n = {n:g}")
        exact.reflectance(1.0, Setting(n=n))
        steps.append(Step(f"exact light: n = {n:g}", time.perf_counter() - begin))
    stages = {
        stage: [_work(recipe, run, lights, pipelines or PIPELINES) for recipe in those]
        for stage, those in itertools.groupby(ordered, _stage)
    }
    if others:  # after the laws that span indices: the longest first
        spanning = sum(bool(recipe.indices) for recipe in ordered if _stage(recipe) == LAWS)
        laws = stages.get(LAWS, [])
        stages[LAWS] = [*laws[:spanning], *others, *laws[spanning:]]
    parts = [part for works in stages.values() for work in works for part in work.parts]
    with Workers(min(processes, len(parts))) as workers:
        for stage in sorted(stages):
            made = written(stages[stage], run.out, workers, run.say)
            steps += tracked(made, "fitting", "records", len(stages[stage]), run.progress is False)
    return steps


LAWS = 1  # the stage that reads the records of maps


def _stage(recipe: Recipe) -> int:
    """When a recipe runs: it reads records of earlier ones."""
    return {"albedo": 0, "evidence": 2}.get(recipe.pipeline, LAWS)


def _order(recipe: Recipe) -> tuple[Any, ...]:
    """Key by which recipes begin in their order.

    Those that span indices, and those with random starts, take longest: none is left when all others are done. Twins of
    two illuminations do not run side by side: the second takes over what XLA compiled for the first.
    """
    spans = bool(recipe.indices)
    second = spans and recipe.setting.illumination == "diffuse"
    return _stage(recipe), not spans, second, not recipe.cosines, -recipe.random_starts


def _work(recipe: Recipe, run: RecipeRun, lights: Mapping[Setting, Orders], pipelines: Mapping[str, Pipeline]) -> Work:
    light = lights[recipe.setting] if needs_photons(recipe) else None

    def finish(found: list[Any]) -> Made:
        ((content, arrays), said) = found[0]
        for text in said:
            run.say(text)
        return {**_header(recipe, run, light), **content}, arrays

    part = partial(_made, replace(run, say=silent), (recipe, light, pipelines[recipe.pipeline]))
    return Work(recipe.name, (part,), finish)


def _made(run: RecipeRun, job: tuple[Recipe, Orders | None, Pipeline]) -> tuple[Made, list[str]]:
    """Content and arrays of a record, and what was said meanwhile."""
    recipe, light, pipeline = job
    said: list[str] = []
    return pipeline(recipe, replace(run, say=said.append), light), said


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
