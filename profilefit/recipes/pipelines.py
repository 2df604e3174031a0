"""What becomes of a recipe: each pipeline makes its truth, fits, judges, and gives a record's content and arrays."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import asdict, replace
from itertools import product
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Orders, Setting, exact
from profilefit.errors import RecipeError
from profilefit.fitting import staged
from profilefit.fitting.estimate import Fit, fit
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.quality import albedo_quality, profile_quality
from profilefit.laws import published
from profilefit.laws.base import Constants, ProfileLaw
from profilefit.recipes import catalogue, starts
from profilefit.recipes.crosscheck import crosscheck
from profilefit.recipes.paper.reproduction import readings
from profilefit.recipes.paper.table1 import printed_halves, table1
from profilefit.recipes.paper.truth import ExactTruth, TallyTruth, Truth
from profilefit.recipes.recipe import Albedos, Recipe, RingLayout
from profilefit.recipes.record_folder import Records
from profilefit.recipes.run import RecipeRun
from profilefit.recipes.summary import Arrays, curves, described, errors_by_name
from profilefit.recipes.targets import albedo_values, ring_edges, truth_of

Floats = NDArray[np.float64]
Made = tuple[dict[str, Any], Arrays]
EVIDENCE_RINGS = RingLayout(last=30.0, dr=0.01)
QUALITY_ALBEDOS = Albedos(0.05, 0.995, 24)
# Indices that a law which spans them is judged at, fitted or not: from next to none to glass. And mean cosines.
JUDGED = (1.001, 1.02, 1.1, 1.2, 1.3, 1.37, 1.4, 1.45, 1.5, 1.6)
JUDGED_COSINES = (0.05, 0.2, 0.5, 0.8, 0.9, 0.95)


def needs_photons(recipe: Recipe) -> bool:
    """Whether a recipe needs the order-resolved run of its setting."""
    return "orders" in (recipe.truth, recipe.check)


def _albedo(recipe: Recipe, run: RecipeRun, light: Orders | None) -> Made:
    profiles = truth_of(recipe, light)
    result, found = _fitted(recipe, run, profiles, light)
    content, arrays = _described(recipe, run, profiles, result)
    laws = {**_printed_laws(recipe, run), "regenerated": result.law}
    content["quality"] = {name: albedo_quality(law) for name, law in laws.items()}
    if recipe.indices:
        law: Any = result.law
        there = _judged(recipe)
        off = [albedo_quality(law.at(setting)).delta_A for setting in there]
        content["quality"]["by_index"] = {**_places(there), "delta_A": off}
    drawn = curves(profiles)
    arrays |= {"reflectance": drawn["energy"].sum(axis=1) + drawn["beyond"]}
    arrays |= {"reflectance_error": drawn["energy_error"].sum(axis=1)}
    return content | found, arrays


def _profile(recipe: Recipe, run: RecipeRun, light: Orders | None) -> Made:
    profiles = truth_of(recipe, light)
    result, found = _fitted(recipe, run, profiles, light)
    content, arrays = _described(recipe, run, profiles, result)
    content["quality"] = _compare(recipe, run, result.law)
    if recipe.indices:
        content["quality"]["by_index"] = by_index(result.law, _judged(recipe))
    content["normalisation"] = catalogue.normalisation(recipe.setting, run.out).constants()
    return content | found, arrays | curves(profiles)


def _inverse(recipe: Recipe, run: RecipeRun, light: Orders | None) -> Made:
    profiles = truth_of(recipe, light)
    result, found = _fitted(recipe, run, profiles, light)
    content, arrays = _described(recipe, run, profiles, result)
    alpha = albedo_values(QUALITY_ALBEDOS)
    laws = {"regenerated": result.law}
    if printed := _printed_laws(recipe, run).get("published"):  # corrections are of the profile, not of its inverse
        laws["published"] = printed
    measured = {name: {"inversion_error": inversion_error(law, alpha)} for name, law in laws.items()}
    content["quality"] = {"alpha": alpha, **measured}
    return content | found, arrays | curves(profiles) | {"shares": np.asarray(result.rings.xi)}


def _as_published(recipe: Recipe, run: RecipeRun, light: Orders | None) -> Made:
    rings = recipe.rings
    if rings is None:
        raise RecipeError(f"{recipe.path}: a recipe of pipeline {recipe.pipeline!r} needs a table [rings]")
    start = starts.starting_law(recipe, run.out)
    truths = {mfp: truth_of(recipe, light, mfp) for mfp in recipe.mfp}
    points = {m: staged.fit_per_albedo(truth, start, m, rings.trim, rings.epsilon) for m, truth in truths.items()}
    profiles, unit = truths[1.0], points[1.0]
    laws = staged.fit_coefficient_laws(unit, start, recipe.held)
    by_stage = {
        name: float(value)
        for law in laws.values()
        for name, value in zip(law.names, law.solution.parameters, strict=True)
    }
    used, _ = staged.trimmed(profiles, rings.trim, rings.epsilon)
    result = _fit(recipe, profiles, start.with_vector(tuple(by_stage), list(by_stage.values())), used)
    content, arrays = _described(recipe, run, profiles, result)
    content["stages"] = {
        "coefficient_laws": {
            letter: {
                "constants": dict(zip(law.names, law.solution.parameters, strict=True)),
                "standard_error": errors_by_name(law.names, law.covariance),
                "result": law.solution.result,
                "condition_number": law.solution.condition_number,
            }
            for letter, law in laws.items()
        },
        "length_exponents": staged.length_exponents(tuple(points.values())) if len(points) > 1 else {},
        "per_albedo_failures": {f"{m:g}": sum(r != "converged" for r in p.results) for m, p in points.items()},
    }
    content["quality"] = _compare(recipe, run, result.law)
    content["normalisation"] = catalogue.normalisation(recipe.setting, run.out).constants()
    arrays |= {"coefficients": unit.values, "coefficient_errors": unit.standard_error, "r_trim": unit.r_trim}
    return content, arrays | curves(profiles)


def _evidence(recipe: Recipe, run: RecipeRun, light: Orders | None) -> Made:
    if recipe.truth == "orders" and light is not None:
        truth: Truth = TallyTruth(light.merged(ring_edges(EVIDENCE_RINGS)))
    else:
        truth = ExactTruth()
    laws = _regenerated_laws(run)
    found = {"readings": readings(truth), "table1": table1(truth, laws), "halves": printed_halves()}
    return {**found, "compared": {label: law.constants() for label, law in laws.items()}}, {}


Pipeline = Callable[[Recipe, RecipeRun, Orders | None], Made]
PIPELINES: dict[str, Pipeline] = {
    "albedo": _albedo,
    "profile": _profile,
    "as-published": _as_published,
    "inverse": _inverse,
    "evidence": _evidence,
}


def inversion_error(law: Any, alpha: Floats) -> Floats:
    """max over xi in [0, 0.999] of |cdf_exact(sample(xi)) - xi| at each albedo (m,) [-]."""
    xi = np.linspace(0.0, 0.999, 500)
    errors = [np.max(np.abs(exact.cdf(law.sampler.sample(xi, a), float(a), setting=law.setting) - xi)) for a in alpha]
    return np.array(errors)


def by_index(law: Any, settings: Sequence[Setting]) -> dict[str, list[float]]:
    """Worst `rel`, `ks` and error at a single radius within 99.5 % of the energy, over held-out albedos, at each n and
    g."""
    alpha = albedo_values(QUALITY_ALBEDOS)
    each = [profile_quality(law.at(setting), alpha) for setting in settings]
    worst = {name: [float(np.max(getattr(one, name))) for one in each] for name in ("rel", "ks", "largest")}
    return {**_places(settings), **worst}


def _places(settings: Sequence[Setting]) -> dict[str, list[float]]:
    """Their n; and their g, where these have one."""
    g = [one.g for one in settings]
    return {"n": [one.n for one in settings], **({"g": g} if any(g) else {})}


def surfaces(recipe: Recipe) -> tuple[float, ...]:
    """The indices above 1 whose exact light a recipe takes, that of isotropic scattering."""
    if recipe.truth != "exact" or recipe.cosines:
        return ()
    judged = [one.n for one in _judged(recipe)] if recipe.indices else []
    return tuple(n for n in {recipe.setting.n, *recipe.indices, *judged} if n > 1)


def _judged(recipe: Recipe) -> tuple[Setting, ...]:
    """Where a law that spans indices, and g, is judged: at `JUDGED` as far as the recipe reaches and light is exact."""
    low, high = recipe.span
    places = product(JUDGED, JUDGED_COSINES if recipe.cosines else (0.0,))
    each = [replace(recipe.setting, n=n, g=g) for n, g in places if low < n <= high]
    return tuple(one for one in each if one.is_solved)


def _fitted(recipe: Recipe, run: RecipeRun, profiles: Profiles, light: Orders | None) -> tuple[Fit, dict[str, Any]]:
    """The fit of a recipe, and what random starts and the other truth say of it."""
    start, found = starts.starting_law(recipe, run.out), {}
    result = _fit(recipe, profiles, start)
    if recipe.random_starts:
        tried = starts.random_starts(result, start, recipe.random_starts, run.seed)
        found["starts"] = tried.content()
        if tried.beats_own:  # rounding decides which of them find it: constants must not depend on that
            run.say(f"{recipe.name}: {tried.result}")
    if recipe.check and light is not None:
        own, seen = result, profiles
        if recipe.indices:
            # Photons are of one index: those constants that it tells apart are fitted, the others held. Nothing resists
            # a law that falls with alpha: a resistance from one side only is no smooth function of the photons.
            at_one = replace(recipe, indices=(), weighting=replace(recipe.weighting, rising=0.0))
            seen = truth_of(at_one, None)
            own = _fit(at_one, seen, result.law)
        found["crosscheck"] = crosscheck(own, seen, light).content()
    return result, found


def _fit(recipe: Recipe, profiles: Profiles, start: Constants, used: NDArray[np.bool_] | None = None) -> Fit:
    weighting = recipe.weighting
    shares = (np.arange(weighting.shares) + 0.5) / max(weighting.shares, 1) * weighting.last_share
    limits = (weighting.energy_limit, weighting.source_limit, weighting.rising)
    return fit(profiles, start, weighting.objective, starts.free(recipe, start), used, limits, tuple(shares))


def _described(recipe: Recipe, run: RecipeRun, profiles: Profiles, result: Fit) -> Made:
    printed = next(iter(printed_sets(recipe).values()), {})
    return described(result, profiles, printed, run.seed, run.max_chain)


def printed_sets(recipe: Recipe) -> dict[str, dict[str, float]]:
    """The printed constants of a recipe's law and setting by their names; the first one counts as the published one."""
    printed = starts.law_class(recipe).entry.printed
    sets = [s for s in published.SETS if (s.law, s.setting) == (printed, recipe.setting)]
    return {s.name if i else "published": dict(s.constants) for i, s in enumerate(sets)}


def _printed_laws(recipe: Recipe, run: RecipeRun) -> dict[str, Any]:
    """The laws that the printed constants make."""
    kind: Any = starts.law_class(recipe)
    given: dict[str, Any] = {"setting": recipe.setting}
    if recipe.pipeline != "albedo":
        given["albedo"] = catalogue.normalisation(recipe.setting, run.out)
    return {name: kind(**given, **values) for name, values in printed_sets(recipe).items()}


def _compare(recipe: Recipe, run: RecipeRun, law: Any) -> dict[str, Any]:
    """The measures of every set of constants of this law, at held-out albedos."""
    alpha = albedo_values(QUALITY_ALBEDOS)
    table: dict[str, Any] = {"alpha": alpha}
    for name, one in {**_printed_laws(recipe, run), "regenerated": law}.items():
        measured = asdict(profile_quality(one, alpha))
        table[name] = {key: value for key, value in measured.items() if key != "alpha"}
    return table


def _regenerated_laws(run: RecipeRun) -> dict[str, ProfileLaw]:
    """The laws that a table of published ones is compared with: of the run's records, else the shipped ones."""
    laws, records = {}, Records(run.out)
    for label, law, name in (
        ("normalized diffusion, regenerated", "burley", "burley-whole"),
        ("paper, regenerated as published", "liang", "liang-as-published"),
        ("paper, regenerated whole", "liang", "liang-whole"),
    ):
        path = records.path_or_shipped(name)
        if path.parent != run.out:
            run.say(f"compared with the shipped record {name}: {run.out} has none")
        laws[label] = catalogue.load(law, str(path), folder=records)
    return laws
