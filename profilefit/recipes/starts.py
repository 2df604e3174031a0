"""Starts of fits: the constants that a recipe names, and random ones around them, to see whether optima are better."""

from __future__ import annotations

import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import jax
import numpy as np
from numpy.typing import NDArray

from profilefit import laws
from profilefit.errors import RecipeError
from profilefit.fitting.estimate import Fit, ResidualFunction, judged, misfit_covariance
from profilefit.fitting.solver import Solution, solve_batch
from profilefit.laws import published
from profilefit.laws.base import Constants, Entry
from profilefit.recipes import catalogue
from profilefit.recipes.recipe import Recipe

Floats = NDArray[np.float64]
# Where a law with published constants begins at those of its entry: one without such constants always does.
OWN_START = "none"
# A random start multiplies each constant by e^(SPREAD * normal): two of three within a factor of two. It keeps its
# sign, since most laws are not defined beyond; a constant that is 0 starts at SPREAD * normal.
SPREAD = float(np.log(2.0))
# Two solutions are one optimum if their costs [relative] and their constants are this near: constants as a share of
# their size, or of their misfit error, which a small one among large ones needs.
SAME_COST, SAME_CONSTANT, SAME_IN_ERROR = 1e-6, 1e-3, 0.1
ROUNDING = 1e-20  # a cost that float64 residuals cannot distinguish from zero
MOST_OUTCOMES = 12
OWN_IS_BEST = "no random start found a better optimum than the recipe's own start"
OWN_IS_BEATEN = "a random start found a better optimum than the recipe's own start, where the fit stays: begin there"
NONE_CONVERGED = "no start converged"


def law_class(recipe: Recipe) -> type[Constants]:
    """Return the class that a recipe's law names; RecipeError if there is none."""
    known = _laws(recipe)
    if recipe.law not in known:
        raise RecipeError(f"{recipe.path}: law must be one of {', '.join(known)}, got {recipe.law!r}")
    kind: type[Constants] = laws.at(known[recipe.law], recipe.setting)
    return kind


def require_known(recipe: Recipe) -> None:
    """Raise RecipeError where there is no such law, start or constant, or where the law does not see the objective."""
    kind, objective = law_class(recipe), recipe.weighting.objective
    if objective and not kind.seen_by(objective):
        seeing = [name for name, one in _laws(recipe).items() if one.seen_by(objective) and ":" not in name]
        got = f"must be {' or '.join(seeing)}, got {recipe.law!r}"
        raise RecipeError(f"{recipe.path}: law of pipeline {recipe.pipeline!r} {got}")
    if not _start_constants(recipe) and recipe.pipeline != "evidence":
        accepted = [*_published_names(kind.entry), *([OWN_START] if kind.entry.start else [])]
        raise RecipeError(
            f"{recipe.path}: start must be one of {', '.join(accepted) or '(none)'}, got {recipe.start!r}"
        )
    spans = kind.at_one_index() != kind.constant_names()
    if recipe.indices and not spans:
        raise RecipeError(
            f"{recipe.path}: indices are for a law that spans them, got {recipe.law!r} at n = {recipe.setting.n:g}"
        )
    if beyond := [n for n in recipe.indices if not kind.entry.n.holds(n)]:
        raise RecipeError(f"{recipe.path}: indices of {recipe.law} must be in {kind.entry.n}, got {beyond[0]:g}")
    if recipe.cosines and not kind.entry.g.holds(recipe.setting.g):
        raise RecipeError(f"{recipe.path}: cosines are for a law with g, got {recipe.law!r}")
    if objective and not free(recipe, kind):
        raise RecipeError(f"{recipe.path}: held leaves no constant of {recipe.law} free")
    unknown = [name for name in recipe.held if name not in kind.constant_names()]
    if unknown:
        raise RecipeError(f"{recipe.path}: held must name constants of {recipe.law}, got {', '.join(unknown)}")


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


@dataclass(frozen=True)
class Outcome:
    """End of some of the starts: how many, the cost over the best one's [-], constants, and what the solver said.

    Of those that failed in the same way only the one of lowest cost is told.
    """

    count: int
    cost_ratio: float
    result: str
    constants: dict[str, float]


@dataclass(frozen=True)
class RandomStarts:
    """Fits from random constants.

    count       of random starts; seed and rule say which
    share_best  of them that reach the best optimum [-]: its cost within 1e-6, and its constants as near as `_same` says
    result      whether one beats the recipe's own start
    outcomes    the distinct ones, best first; `others` starts ended in still other ones
    best        (p,) constants of the best optimum, None if no start converged
    """

    count: int
    seed: int
    rule: str
    share_best: float
    result: str
    outcomes: tuple[Outcome, ...]
    others: int
    best: Floats | None

    @property
    def beats_own(self) -> bool:
        return self.result == OWN_IS_BEATEN

    def content(self) -> dict[str, Any]:
        """Return what a record says of it."""
        return {name: value for name, value in vars(self).items() if name != "best"}


def random_starts(own: Fit, start: Constants, count: int, seed: int) -> RandomStarts:
    """Repeat the fit `own`, which began at `start`, from `count` random constants, all in one batch."""
    constants = start.vector(own.free)
    begins = spread_out(constants, count, seed)
    data = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (count, *np.shape(leaf))), (start, own.rings))
    # By their sizes, which were drawn: where slopes at such a start scale them, half as many find the best optimum.
    sizes = np.where(begins == 0, 1.0, np.abs(begins))
    found = solve_batch(ResidualFunction(own.objective, own.free), begins, data, scales=sizes)
    rule = f"constant x e^({SPREAD:.3g} normal), around the recipe's start"
    return summarised(own.solution, [judged(one, own.free) for one in found], own.free, seed, rule)


def spread_out(constants: Floats, count: int, seed: int) -> Floats:
    """Return random constants (count, p) around `constants` (p,)."""
    normal = SPREAD * np.random.default_rng(seed).standard_normal((count, constants.size))
    return np.where(constants == 0, normal, constants * np.exp(normal))


def summarised(own: Solution, others: Sequence[Solution], names: tuple[str, ...], seed: int, rule: str) -> RandomStarts:
    """Group the solutions by where they ended, and say whether one is better than the recipe's own."""
    converged = [one for one in (own, *others) if one.converged]
    best = min(converged, key=lambda one: one.cost, default=None)
    if best is None:
        result = NONE_CONVERGED
    else:
        result = OWN_IS_BEST if own.converged and _as_cheap(own, best) else OWN_IS_BEATEN
        best = own if result == OWN_IS_BEST else best
    groups = _groups(others)
    unit = max(best.cost if best is not None else min(_cost(one) for one in (own, *others)), ROUNDING)
    outcomes = [
        Outcome(len(g), _cost(g[0]) / unit, g[0].result, dict(zip(names, map(float, g[0].parameters), strict=True)))
        for g in groups
    ]
    reached = sum(_same(one, best) for one in others) if best is not None else 0
    return RandomStarts(
        len(others),
        seed,
        rule,
        reached / len(others),
        result,
        tuple(outcomes[:MOST_OUTCOMES]),
        sum(outcome.count for outcome in outcomes[MOST_OUTCOMES:]),
        None if best is None else best.parameters,
    )


def _groups(found: Sequence[Solution]) -> list[list[Solution]]:
    """Group solutions that are one optimum, or that failed in the same way, each group and all by cost."""
    groups: list[list[Solution]] = []
    for one in sorted(found, key=lambda one: (not one.converged, _cost(one))):
        home = next((group for group in groups if _same(one, group[0])), None)
        if home is None:
            groups.append([one])
        else:
            home.append(one)
    return groups


def _same(one: Solution, other: Solution) -> bool:
    """Return whether two solutions are one optimum, or failed in the same way, whatever the numbers in its text."""
    if not (one.converged and other.converged):
        return re.split("[,:]", one.result)[0] == re.split("[,:]", other.result)[0]
    error = np.sqrt(np.diag(misfit_covariance(other)))
    near = np.maximum(SAME_CONSTANT * np.abs(other.parameters), SAME_IN_ERROR * error)
    return _as_cheap(one, other) and bool(np.all(np.abs(one.parameters - other.parameters) <= near))


def _as_cheap(one: Solution, other: Solution) -> bool:
    return one.cost <= other.cost * (1.0 + SAME_COST) + ROUNDING


def _cost(one: Solution) -> float:
    return one.cost if np.isfinite(one.cost) else np.inf
