"""Fits of recipes: the light, start, checks and description that every record of a recipe has, whatever its kind."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Orders, Setting, exact
from mcml_sim.media.arrays import Floats
from profilefit.fitting.chains import LEVELS, Posterior, posterior
from profilefit.fitting.discrepancy import LawWithErrors, discrepancy
from profilefit.fitting.discrepancy import summary as quantities
from profilefit.fitting.estimate import Fit, fit
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.quality import profile_quality
from profilefit.laws import published
from profilefit.laws.base import Constants
from profilefit.recipes import recipe as recipe_file
from profilefit.recipes import record
from profilefit.recipes.checks import OWN_IS_BEATEN, crosscheck, discretisation_error, random_starts
from profilefit.recipes.folder import fits_folder
from profilefit.recipes.recipe import Albedos, Recipe
from profilefit.recipes.run import COMPARISONS, LAWS, MAPS, RecipeRun, RecordContent, Work
from profilefit.recipes.targets import albedo_values, free, law_class, require_known, starting_law, truth_of

Arrays = dict[str, np.ndarray]
Pipeline = Callable[[Recipe, RecipeRun, Orders | None], RecordContent]
QUALITY_ALBEDOS = Albedos(low=0.05, high=0.995, count=24)
# Indices that a law which spans them is judged at, fitted or not: from next to none to glass. And mean cosines.
JUDGED = (1.001, 1.02, 1.1, 1.2, 1.3, 1.37, 1.4, 1.45, 1.5, 1.6)
JUDGED_COSINES = (0.05, 0.2, 0.5, 0.8, 0.9, 0.95)


def request(name: str, pipelines: Mapping[str, Pipeline]) -> Recipe | None:
    """Return the recipe of a shipped record's name or of a file, checked; None if it is of other pipelines, or none."""
    if not recipe_file.is_recipe(name):
        return None
    found = recipe_file.find(name, fits_folder())
    if found.pipeline not in pipelines:
        return None
    require_known(found)
    return found


def read(path: Path) -> dict[str, Any]:
    """Return all that the record of a recipe says; RecordError where anything that a report shows is damaged."""
    return record.read(path, whole=True)


def work(recipe: Recipe, run: RecipeRun, pipelines: Mapping[str, Pipeline]) -> Work:
    """Return the record to be made of a recipe, its light traced or solved; one part, which a pipeline does."""
    light = run.light(recipe.setting) if needs_photons(recipe) else None
    for n in surfaces(recipe):
        run.solve_surface(n)

    def finish(results: list[Any]) -> RecordContent:
        ((content, arrays), said) = results[0]
        for text in said:
            run.say(text)
        return {**_header(recipe, run, light), **content}, arrays

    spans = bool(recipe.indices)
    # Those that span indices, and those with random starts, take longest: none is left when others are done. Twins of
    # two illuminations do not run side by side: the second takes over what XLA compiled for the first.
    second = spans and recipe.setting.illumination == "diffuse"
    stage = {"albedo": MAPS, "evidence": COMPARISONS}.get(recipe.pipeline, LAWS)
    order = stage, 0 if spans else 2, second, not recipe.cosines, -recipe.random_starts
    part = partial(_run, pipelines[recipe.pipeline], recipe, run.part(), light)
    return Work(recipe.name, (part,), finish, order=order)


def _run(pipeline: Pipeline, recipe: Recipe, run: RecipeRun, light: Orders | None) -> tuple[RecordContent, list[str]]:
    """Return content and arrays of a record, and what was said meanwhile."""
    said: list[str] = []
    return pipeline(recipe, replace(run, say=said.append), light), said


def _header(recipe: Recipe, run: RecipeRun, light: Orders | None) -> dict[str, Any]:
    spans = {key: values for key in ("indices", "cosines") if (values := getattr(recipe, key))}
    header: dict[str, Any] = {
        **{key: getattr(recipe, key) for key in ("title", "law", "equations", "pipeline", "note", "setting")},
        **({"indices": recipe.span} if recipe.indices else {}),
        **({"cosines": (0.0, recipe.cosines[-1])} if recipe.cosines else {}),
        "protocol": {**recipe.model_dump(include={"albedos", "rings", "weighting", "mfp", "start", "held"}), **spans},
        "truth": {"kind": recipe.truth},
        "preset": run.preset,
        "seed": run.seed,
        "versions": record.versions(),
    }
    if recipe.truth == "orders" and light is not None:
        cut = {f"{a:g}": light.cut(a) for a in (0.9, 0.99, 0.995, 0.999, 1.0)}
        own = {"photons": light.photons, "grid_digest": light.grid.digest, "ledger": light.ledger}
        header["truth"] |= {**own, "cut": cut}
    return header


def needs_photons(recipe: Recipe) -> bool:
    """Return whether a recipe needs the order-resolved run of its setting."""
    return "orders" in (recipe.truth, recipe.check)


def surfaces(recipe: Recipe) -> tuple[float, ...]:
    """Return the indices above 1 whose exact light a recipe takes, for isotropic scattering."""
    if recipe.truth != "exact" or recipe.cosines:
        return ()
    at = [setting.n for setting in judged(recipe)] if recipe.indices else []
    return tuple(sorted(n for n in {recipe.setting.n, *recipe.indices, *at} if n > 1))


def judged(recipe: Recipe) -> tuple[Setting, ...]:
    """Return where a law that spans indices, and g, is judged: `JUDGED` within its span, as far as light is exact."""
    low, high = recipe.span
    places = product(JUDGED, JUDGED_COSINES if recipe.cosines else (0.0,))
    each = [replace(recipe.setting, n=n, g=g) for n, g in places if low < n <= high]
    return tuple(setting for setting in each if setting.is_solved)


def places(settings: Sequence[Setting]) -> dict[str, list[float]]:
    """Return the n of settings, and their g where any is not 0."""
    g = [setting.g for setting in settings]
    return {"n": [setting.n for setting in settings], **({"g": g} if any(g) else {})}


def by_index(law: Any, settings: Sequence[Setting]) -> dict[str, list[float]]:
    """Return the worst `rel`, `ks` and error at a single radius over held-out albedos, at each n and g.

    The radius is within 99.5 % of the energy.
    """
    alpha = albedo_values(QUALITY_ALBEDOS)
    each = [profile_quality(law, alpha, setting) for setting in settings]
    worst = {name: [float(np.max(getattr(one, name))) for one in each] for name in ("rel", "ks", "largest")}
    return {**places(settings), **worst}


def inversion_error(law: Any, alpha: Floats) -> Floats:
    """Return max over xi in [0, 0.999] of |cdf_exact(sample(xi)) - xi| at each albedo (m,) [-]."""
    xi = np.linspace(0.0, 0.999, 500)
    errors = [np.max(np.abs(exact.cdf(law.sampler.sample(xi, a), float(a), setting=law.setting) - xi)) for a in alpha]
    return np.array(errors)


def described_fit(recipe: Recipe, run: RecipeRun, light: Orders | None) -> tuple[Fit, Profiles, dict[str, Any], Arrays]:
    """Fit a recipe's law, and check the fit: it, what it was fitted to, and what every record says, with its arrays."""
    profiles, start, checks = truth_of(recipe, light), starting_law(recipe, run.out), dict[str, Any]()
    result = fit_from(recipe, profiles, start)
    if recipe.random_starts:
        checks["starts"] = tried = random_starts(result, start, recipe.random_starts, run.seed)
        if tried["result"] == OWN_IS_BEATEN:
            # Rounding decides which of them find it: constants must not depend on that.
            run.say(f"{recipe.name}: {tried['result']}")
    if recipe.check and light is not None:
        own, seen = result, profiles
        if recipe.indices:
            # Photons are of one index: those constants that it tells apart are fitted, the others held. Nothing resists
            # a law that falls with alpha: a resistance from one side only is no smooth function of the photons.
            at_one = recipe.changed(indices=(), weighting={"rising": 0.0})
            seen = truth_of(at_one, None)
            own = fit_from(at_one, seen, result.law)
        checks["crosscheck"] = crosscheck(own, seen, light)
    content, arrays = description(recipe, run, profiles, result)
    return result, profiles, content | checks, arrays


def fit_from(recipe: Recipe, profiles: Profiles, start: Constants, used: NDArray[np.bool_] | None = None) -> Fit:
    """Fit profiles from a law's constants, with the objective and weights of a recipe."""
    weighting = recipe.weighting
    shares = (np.arange(weighting.shares) + 0.5) / max(weighting.shares, 1) * weighting.last_share
    limits = (weighting.energy_limit, weighting.source_limit, weighting.rising)
    return fit(profiles, start, weighting.objective, free(recipe, start), used, limits, tuple(shares))


def description(recipe: Recipe, run: RecipeRun, profiles: Profiles, result: Fit) -> tuple[dict[str, Any], Arrays]:
    """Return what every record of a fit says, and its arrays."""
    printed, chains = next(iter(printed_sets(recipe).values()), {}), []
    if result.solution.converged:  # elsewhere the curvature describes no optimum, and the record says why
        chains = [
            posterior(result, kind, run.seed, run.max_chain)
            for kind in ("statistical", "misfit")
            if getattr(result, kind) is not None
        ]
    off, width = discrepancy(result, profiles), discretisation_error(result)
    errors = {"model_error": np.sqrt(np.diag(off.covariance)), "discretisation_error": width}
    covariances = {"statistical": result.statistical, "misfit": result.misfit, "model": off.covariance}
    content = {
        "constants": _constants(result, printed, chains, errors),
        "covariance": {"names": result.free, **covariances},
        "discrepancy": off.content(),
        "fit": {
            **{key: getattr(result.solution, key) for key in ("steps", "condition_number")},
            **{"result": result.result, "residuals": result.structure},
        },
        "posterior": {
            c.kind: {
                **{key: getattr(c, key) for key in ("tau", "acceptance", "walkers", "steps", "result")},
                "standard_deviation": dict(zip(c.names, c.standard_deviation, strict=True)),
            }
            for c in chains
        },
        "data_digest": record.digest(profiles.alpha, profiles.r_edges, profiles.energy),
    }
    if result.solution.converged:
        known = LawWithErrors(result.law, result.free, result.objective, result.statistical, off)
        content["derived"] = quantities(known, profiles)
    if profiles.covariance is not None:
        content["covariance_rank"] = {"rank": profiles.covariance.rank, "dropped": profiles.covariance.dropped}
        # Of what rests on too few effective photons: rings, where the objective sees rings, and whole albedos.
        sees_rings = result.objective in ("energy", "radial")
        content["left_out"] = {
            "rings": int(np.sum(~profiles.trusted)) if sees_rings else 0,
            "albedos": int(np.sum(np.asarray(result.rings.weight) == 0)),
        }
    samples = {f"samples_{c.kind}": c.samples.astype(np.float32) for c in chains}
    samples |= {f"log_density_{c.kind}": c.log_density.astype(np.float32) for c in chains}
    return content, samples | off.arrays()


def curves(profiles: Profiles) -> Arrays:
    """Return what the figures draw: the data with its errors; of a fit to several settings, those of its own."""
    own = [one == profiles.setting for one in profiles.settings] if profiles.settings else slice(None)
    return {
        "alpha": profiles.alpha[own],
        "r_edges": profiles.r_edges,
        "energy": profiles.energy[own],
        "energy_error": profiles.standard_error[own],
        "beyond": profiles.beyond[own],
    }


def _constants(
    result: Fit, printed: dict[str, float], chains: list[Posterior], errors: dict[str, Floats]
) -> dict[str, dict[str, Any]]:
    fitted = result.law.constants()
    constants: dict[str, dict[str, Any]] = {
        name: {"published": printed.get(name), "regenerated": fitted[name], "free": name in result.free}
        for name in result.law.seen_by(result.objective)
    }
    for i, name in enumerate(result.free):
        constants[name] |= {
            "statistical_error": None if result.statistical is None else float(np.sqrt(result.statistical[i, i])),
            "misfit_error": float(np.sqrt(result.misfit[i, i])),
            "jackknife_error": float(result.jackknife[i]),
            **{name: float(error[i]) for name, error in errors.items()},
            "intervals": {c.kind: {f"{level:.0%}": c.interval(level)[i] for level in LEVELS} for c in chains},
        }
    return constants


def printed_sets(recipe: Recipe) -> dict[str, dict[str, float]]:
    """Return the printed constants of a recipe's law and setting by name; the first counts as the published one."""
    printed = law_class(recipe).entry.printed
    sets = [s for s in published.SETS if (s.law, s.setting) == (printed, recipe.setting)]
    return {s.name if i else "published": dict(s.constants) for i, s in enumerate(sets)}


def printed_laws(recipe: Recipe, run: RecipeRun) -> dict[str, Any]:
    """Return the laws that the printed constants make."""
    law = starting_law(recipe, run.out)
    return {name: replace(law, **values) for name, values in printed_sets(recipe).items()}
