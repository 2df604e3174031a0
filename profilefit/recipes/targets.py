"""Albedos, rings and truth that a recipe is fitted to."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Orders, Setting, exact
from profilefit.errors import RecipeError, SettingError
from profilefit.fitting.profiles import Profiles
from profilefit.recipes.recipe import Albedos, Recipe, RingLayout

Floats = NDArray[np.float64]
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
