"""Maps between alpha and A: fitted by a recipe of pipeline "albedo", or printed."""

from __future__ import annotations

from functools import partial
from typing import Any

from mcml_sim import Orders
from profilefit.fitting.quality import albedo_quality
from profilefit.recipes import pipelines
from profilefit.recipes.catalogue import find_map as find
from profilefit.recipes.pipelines import Pipeline, curves, described_fit, judged, places, printed_laws, read
from profilefit.recipes.recipe import Recipe
from profilefit.recipes.run import RecipeRun, RecordContent

__all__ = ["find", "fit", "quality", "read", "request"]


def quality(recipe: Recipe, run: RecipeRun, law: Any) -> dict[str, Any]:
    """Measure every set of constants of a map, and the fitted one at each index that it is judged at."""
    laws = {**printed_laws(recipe, run), "regenerated": law}
    found: dict[str, Any] = {name: albedo_quality(one) for name, one in laws.items()}
    if recipe.indices:
        off = [albedo_quality(law, setting).delta_A for setting in judged(recipe)]
        found["by_index"] = {**places(judged(recipe)), "delta_A": off}
    return found


def _albedo(recipe: Recipe, run: RecipeRun, light: Orders | None) -> RecordContent:
    result, profiles, content, arrays = described_fit(recipe, run, light)
    content["quality"] = quality(recipe, run, result.law)
    drawn = curves(profiles)
    arrays |= {"reflectance": drawn["energy"].sum(axis=1) + drawn["beyond"]}
    return content, arrays | {"reflectance_error": drawn["energy_error"].sum(axis=1)}


PIPELINES: dict[str, Pipeline] = {"albedo": _albedo}
request = partial(pipelines.request, pipelines=PIPELINES)
fit = partial(pipelines.work, pipelines=PIPELINES)
