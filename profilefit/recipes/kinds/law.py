"""Profile laws and samplers: fitted by a recipe, or printed; and comparisons of what the paper leaves unsaid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import asdict
from functools import partial
from typing import Any

import numpy as np

from mcml_sim import Orders
from mcml_sim.media.arrays import Floats
from profilefit.fitting import staged
from profilefit.fitting.quality import profile_quality
from profilefit.laws.base import ProfileLaw
from profilefit.recipes import catalogue, pipelines
from profilefit.recipes.catalogue import find_law as find
from profilefit.recipes.pipelines import QUALITY_ALBEDOS, Pipeline, curves, described_fit, judged, printed_laws, read
from profilefit.recipes.recipe import Recipe
from profilefit.recipes.record import Records
from profilefit.recipes.reproduction import printed_halves, readings, table1
from profilefit.recipes.run import RecipeRun, RecordContent
from profilefit.recipes.targets import albedo_values, starting_law, truth_of

__all__ = ["find", "fit", "quality", "read", "request"]


def quality(recipe: Recipe, run: RecipeRun, law: Any) -> dict[str, Any]:
    """Measure every set of constants of a law at held-out albedos, and the fitted ones at each index that they span."""
    alpha = albedo_values(QUALITY_ALBEDOS)
    table: dict[str, Any] = {"alpha": alpha}
    for name, one in {**printed_laws(recipe, run), "regenerated": law}.items():
        measured = asdict(profile_quality(one, alpha))
        table[name] = {key: value for key, value in measured.items() if key != "alpha"}
    return table | ({"by_index": pipelines.by_index(law, judged(recipe))} if recipe.indices else {})


def _profile(recipe: Recipe, run: RecipeRun, light: Orders | None) -> RecordContent:
    result, profiles, content, arrays = described_fit(recipe, run, light)
    content["quality"] = quality(recipe, run, result.law)
    content["normalisation"] = catalogue.normalisation(recipe.setting, run.out).constants()
    return content, arrays | curves(profiles)


def _inverse(recipe: Recipe, run: RecipeRun, light: Orders | None) -> RecordContent:
    result, profiles, content, arrays = described_fit(recipe, run, light)
    alpha = albedo_values(QUALITY_ALBEDOS)
    laws = {"regenerated": result.law}
    if printed := printed_laws(recipe, run).get("published"):  # corrections are of the profile, not of its inverse
        laws["published"] = printed
    measured = {name: {"inversion_error": pipelines.inversion_error(law, alpha)} for name, law in laws.items()}
    content["quality"] = {"alpha": alpha, **measured}
    return content, arrays | curves(profiles) | {"shares": np.asarray(result.rings.xi)}


def _as_published(recipe: Recipe, run: RecipeRun, light: Orders | None) -> RecordContent:
    rings = recipe.rings
    assert rings is not None  # a recipe of this pipeline has them
    start = starting_law(recipe, run.out)
    truths = {mfp: truth_of(recipe, light, mfp) for mfp in recipe.mfp}
    points = {m: staged.fit_per_albedo(truth, start, m, rings.trim, rings.epsilon) for m, truth in truths.items()}
    profiles, unit = truths[1.0], points[1.0]
    laws = staged.fit_coefficient_laws(unit, start, recipe.held)
    staged_constants = {letter: _by_name(law.names, law.solution.parameters) for letter, law in laws.items()}
    by_stage = {name: value for one in staged_constants.values() for name, value in one.items()}
    used, _ = staged.trimmed(profiles, rings.trim, rings.epsilon)
    result = pipelines.fit_from(recipe, profiles, start.with_vector(tuple(by_stage), list(by_stage.values())), used)
    content, arrays = pipelines.description(recipe, run, profiles, result)
    content["stages"] = {
        "coefficient_laws": {
            letter: {
                "constants": staged_constants[letter],
                "standard_error": {} if (v := law.covariance) is None else _by_name(law.names, np.sqrt(np.diag(v))),
                "result": law.solution.result,
                "condition_number": law.solution.condition_number,
            }
            for letter, law in laws.items()
        },
        "length_exponents": staged.length_exponents(tuple(points.values())) if len(points) > 1 else {},
        "per_albedo_failures": {f"{m:g}": sum(r != "converged" for r in p.results) for m, p in points.items()},
    }
    content["quality"] = quality(recipe, run, result.law)
    content["normalisation"] = catalogue.normalisation(recipe.setting, run.out).constants()
    arrays |= {"coefficients": unit.values, "coefficient_errors": unit.standard_error, "r_trim": unit.r_trim}
    return content, arrays | curves(profiles)


def _by_name(names: Sequence[str], values: Floats) -> dict[str, float]:
    return dict(zip(names, values.tolist(), strict=True))


def _evidence(recipe: Recipe, run: RecipeRun, light: Orders | None) -> RecordContent:
    """Compare readings of the paper, and its table with laws of the run's records, else the shipped ones."""
    laws, records = dict[str, ProfileLaw](), Records(run.out)
    for label, law, name in (
        ("normalized diffusion, regenerated", "burley", "burley-whole"),
        ("paper, regenerated as published", "liang", "liang-as-published"),
        ("paper, regenerated whole", "liang", "liang-whole"),
    ):
        path = records.path_or_shipped(name)
        if path.parent != run.out:
            run.say(f"compared with the shipped record {name}: {run.out} has none")
        laws[label] = catalogue.load(law, str(path), folder=records)
    found = {"readings": readings(), "table1": table1(laws), "halves": printed_halves()}
    return {**found, "compared": {label: law.constants() for label, law in laws.items()}}, {}


PIPELINES: dict[str, Pipeline] = {
    "profile": _profile,
    "as-published": _as_published,
    "inverse": _inverse,
    "evidence": _evidence,
}
request = partial(pipelines.request, pipelines=PIPELINES)
fit = partial(pipelines.work, pipelines=PIPELINES)
