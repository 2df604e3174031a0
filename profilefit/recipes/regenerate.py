"""Run recipes: trace the light that they need, once for each setting, and write a record of each."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any

import jax

from mcml_sim import Orders
from mcml_sim.runs.progress import tracked
from profilefit.recipes import record, starts
from profilefit.recipes.pipelines import PIPELINES, Pipeline, needs_photons
from profilefit.recipes.recipe import Recipe
from profilefit.recipes.run import RecipeRun

# Every law compiles a fit of its own for each setting: one to three thousand memory maps, of which Linux gives a
# process 65 thousand, and a hundred megabytes. No later recipe needs them.
CLEARED = 8  # recipes after which compiled programs go


def regenerate(
    recipes: tuple[Recipe, ...], run: RecipeRun, pipelines: Mapping[str, Pipeline] = MappingProxyType(PIPELINES)
) -> list[Path]:
    """Run recipes and write their records: first the maps that others are normalised with, last what compares them.

    pipelines  what runs each recipe, by its key `pipeline`; a caller may have more of them
    """
    for recipe in recipes:
        starts.require_known(recipe)
    ordered = sorted(recipes, key=lambda r: (r.pipeline != "albedo", r.pipeline == "evidence"))
    settings = dict.fromkeys(recipe.setting for recipe in ordered if needs_photons(recipe))
    lights = {setting: run.light(setting) for setting in settings}
    written = []
    for number, recipe in enumerate(tracked(ordered, "fitting", "recipes", quiet=run.progress is False), start=1):
        run.say(f"{recipe.name}: {recipe.title}")
        light = lights[recipe.setting] if needs_photons(recipe) else None
        content, arrays = pipelines[recipe.pipeline](recipe, run, light)
        written.append(record.write(run.out, recipe.name, {**_header(recipe, run, light), **content}, arrays))
        if number % CLEARED == 0:
            jax.clear_caches()
    return written


def _header(recipe: Recipe, run: RecipeRun, light: Orders | None) -> dict[str, Any]:
    header: dict[str, Any] = {
        "title": recipe.title,
        "law": recipe.law,
        "equations": recipe.equations,
        "pipeline": recipe.pipeline,
        "note": recipe.note,
        "setting": recipe.setting,
        **({"indices": recipe.span} if recipe.indices else {}),
        "protocol": {
            "albedos": recipe.albedos,
            "rings": recipe.rings,
            "weighting": recipe.weighting,
            "mfp": recipe.mfp,
            "start": recipe.start,
            "held": recipe.held,
            **({"indices": recipe.indices} if recipe.indices else {}),
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
