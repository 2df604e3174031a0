"""Law, start and data of a fit that a recipe names: constants to begin at, albedos, rings and truth."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from mcml_sim import Orders, Setting, exact
from mcml_sim.media.arrays import Floats
from profilefit import laws
from profilefit.errors import RecipeError, SettingError
from profilefit.fitting.profiles import Profiles
from profilefit.laws import published
from profilefit.laws.base import Constants, Entry
from profilefit.recipes import catalogue
from profilefit.recipes.recipe import Albedos, Recipe, RingLayout

# Where a law with published constants begins at those of its entry: one without such constants always does.
OWN_START = "none"
SEARCHLIGHT = Setting()
# Even rings for the paper's protocol, log-spaced ones beyond it; every recipe's rings are unions of these [mfp].
RUN_EDGES = np.concatenate(
    [[0.0, 0.0025, 0.005], np.round(np.arange(1, 4001) * 0.01, 2), np.geomspace(40, 1000, 41)[1:]]
)


def albedo_values(albedos: Albedos, setting: Setting = SEARCHLIGHT) -> Floats:
    """Return the albedos (count,) of a recipe, rising, even in its spacing, maybe the reflectance of `setting`."""
    if albedos.spacing == "alpha":
        return np.linspace(albedos.low, albedos.high, albedos.count)
    if albedos.spacing == "reflectance":
        dense = 1.0 - np.linspace(1.0, 0.0, 4001) ** 2
        low, high = np.asarray(exact.reflectance([albedos.low, albedos.high], setting=setting))
        return np.interp(np.linspace(low, high, albedos.count), exact.reflectance(dense, setting=setting), dense)
    s = np.linspace(np.sqrt(1.0 - albedos.low), np.sqrt(1.0 - albedos.high), albedos.count)
    return 1.0 - s**2


def ring_edges(rings: RingLayout | None, mfp: float = 1.0) -> Floats:
    """Return the edges [mfp] of a recipe's rings in a medium of this mean free path, each one an edge of the run."""
    if rings is None:
        return np.array([0.0, RUN_EDGES[-1]])
    if rings.dr > 0:
        width = rings.dr / mfp
        wanted = np.arange(0.0, rings.last + 0.5 * width, width)
    else:
        wanted = np.concatenate([[0.0], np.geomspace(rings.first, rings.last, rings.count)])
    index = np.unique(np.abs(RUN_EDGES[None, :] - wanted[:, None]).argmin(axis=1))
    found = RUN_EDGES[index]
    if rings.dr > 0 and (found.size != wanted.size or np.max(np.abs(found - wanted)) > 1e-9):
        raise RecipeError(f"rings.dr / mfp must be a multiple of 0.01 up to 40 mfp, got {rings.dr!r} / {mfp!r}")
    return found


def truth_of(recipe: Recipe, light: Orders | None, mfp: float = 1.0) -> Profiles:
    """Return the profiles that a recipe fits; `light` is of its setting."""
    alpha, edges = albedo_values(recipe.albedos, recipe.setting), ring_edges(recipe.rings, mfp)
    if recipe.truth == "exact":
        each = [Profiles.from_exact(alpha, edges, where) for where in recipe.settings]
        return Profiles.joined(each, recipe.setting) if recipe.indices else each[0]
    if light is None:
        raise ValueError(f"recipe {recipe.name} needs photons, got none")
    if light.setting != recipe.setting:
        raise SettingError(f"recipe {recipe.name} belongs to {recipe.setting}, its photons to {light.setting}")
    return Profiles.from_orders(light.merged(edges), alpha, correlated=mfp == 1.0)


def law_class(recipe: Recipe) -> type[Constants]:
    """Return the class that a recipe's law names; RecipeError if there is none."""
    known = _laws(recipe)
    if recipe.law not in known:
        raise RecipeError(f"{recipe.path}: law must be one of {', '.join(known)}, got {recipe.law!r}")
    kind: type[Constants] = laws.at(known[recipe.law], recipe.setting)
    return kind


def require_known(recipe: Recipe) -> None:
    """Raise RecipeError where there is no such law, start or constant, or where the law does not see the objective."""
    if problem := next(_problems(recipe, law_class(recipe)), None):
        raise RecipeError(f"{recipe.path}: {problem}")


def _problems(recipe: Recipe, kind: type[Constants]) -> Iterator[str]:
    law, entry, objective = recipe.law, kind.entry, recipe.weighting.objective
    if objective and not kind.seen_by(objective):
        seeing = [name for name, one in _laws(recipe).items() if one.seen_by(objective) and ":" not in name]
        yield f"law of pipeline {recipe.pipeline!r} must be {' or '.join(seeing)}, got {law!r}"
    if not _start_constants(recipe) and recipe.pipeline != "evidence":
        accepted = [*_published_names(entry), *([OWN_START] if entry.start else [])]
        yield f"start must be one of {', '.join(accepted) or '(none)'}, got {recipe.start!r}"
    if recipe.pipeline == "evidence" and recipe.truth != "exact":
        yield f"truth of pipeline 'evidence' must be 'exact', got {recipe.truth!r}"
    if recipe.indices and kind.at_one_index() == kind.constant_names():
        yield f"indices are for a law that spans them, got {law!r} at n = {recipe.setting.n:g}"
    if beyond := [n for n in recipe.indices if not entry.n.holds(n)]:
        yield f"indices of {law} must be in {entry.n}, got {beyond[0]:g}"
    if recipe.cosines and not entry.g.holds(recipe.setting.g):
        yield f"cosines are for a law with g, got {law!r}"
    if objective and not free(recipe, kind):
        yield f"held leaves no constant of {law} free"
    if unknown := [name for name in recipe.held if name not in kind.constant_names()]:
        yield f"held must name constants of {law}, got {', '.join(unknown)}"


def free(recipe: Recipe, kind: type[Constants] | Constants) -> tuple[str, ...]:
    """Return the constants that a recipe moves; of a law that spans indices, at one index those that it tells apart."""
    seen = kind.seen_by(recipe.weighting.objective)
    told = seen if recipe.indices else kind.at_one_index()
    return tuple(name for name in seen if name in told and name not in recipe.held)


def starting_law(recipe: Recipe, folder: Path) -> Any:
    """Return the law that a fit starts from, in the recipe's setting; constants named in `held` keep their values.

    Constants of another setting are numbers to start from like any others. `folder` holds the records of A.
    """
    given: dict[str, Any] = {"setting": recipe.setting, **_start_constants(recipe)}
    if recipe.pipeline != "albedo":
        given["albedo"] = catalogue.normalisation(recipe.setting, folder)
    return law_class(recipe)(**given)


def _laws(recipe: Recipe) -> Mapping[str, type[Constants]]:
    return laws.map_classes() if recipe.pipeline == "albedo" else laws.profile_classes()


def _published_names(entry: Entry) -> list[str]:
    return [s.name for s in published.SETS if s.law == entry.printed]


def _start_constants(recipe: Recipe) -> dict[str, float]:
    entry = law_class(recipe).entry
    if recipe.start == OWN_START or not _published_names(entry):
        return dict(entry.start)
    return published.constants(entry.printed, recipe.start)
