"""Checks of a fit: repeated from random constants, on wider rings, and on photons in place of the exact half space.

Random starts show whether optima are better than that of the recipe's own start. The cross-check makes the same
objective small, with its working weights and not the inverse covariance of the photons, on the same rings and albedos:
what rests on too few photons is left out of both fits. A law that is not the truth has another optimum for every
weighting, so only then is the photons' noise all that can part them.

Discretisation is how far constants are from those of infinitely narrow rings. A fit is repeated with rings two and
three times as wide, made of the same photons. What falls with the square of the width (a ring's middle in place of its
average, a straight line in place of the cdf) is extrapolated to a width of zero (Richardson, Phil. Trans. R. Soc. A
210, 1911). An objective that compares integrals over rings has nearly none.
"""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import Any

import equinox as eqx
import jax
import numpy as np
from scipy.stats import chi2

from mcml_sim import Orders
from mcml_sim.media.arrays import Floats
from profilefit.fitting import estimate
from profilefit.fitting.estimate import Fit, ResidualFunction, Rings, judged
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.solver import Solution, solve_batch
from profilefit.laws.base import Constants

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
# Directions of the constants' correlation below this share of the largest are rounding, not photons: the derivative
# of the optimum loses as many digits as its condition number, up to 1e7, has.
SMALLEST_SHARE = 1e-7
LARGEST_CUT = 0.1  # of a standard error of A: what the end of the longest paths may take away
LEAST_CHANCE = 0.0027  # of a difference by noise alone that is none: three standard errors of a single constant
AGREE, DIFFER = "the fits agree", "the fits differ by more than the photons' noise"
NO_ERRORS = "the photon fit has no finite errors: leave out radial bins that hold next to no light"
# Widths of rings [of those fitted] that the error is made of, and the order in which it falls with them.
TRUSTED, ORDER = (2, 3), 2
FACTORS = (1, *TRUSTED)
NONE = 1e-9  # width of a ring that holds nothing [of the next edge]: narrower than any other, wide enough to divide by


def random_starts(own: Fit, start: Constants, count: int, seed: int) -> dict[str, Any]:
    """Repeat the fit `own`, which began at `start`, from `count` random constants in one batch; return `summarised`."""
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


def summarised(
    own: Solution, others: Sequence[Solution], names: tuple[str, ...], seed: int, rule: str
) -> dict[str, Any]:
    """Group the solutions by where they ended, and say whether one is better than the recipe's own, as a record has it.

    count       of random starts; seed and rule say which
    share_best  of them that reach the best optimum [-]: its cost within 1e-6, and its constants as near as `_same` says
    result      whether one beats the recipe's own start
    outcomes    the distinct ends, best first: count of starts, cost over the best one's [-], constants, and what the
                solver said; of those that failed alike only that of lowest cost. `others` ended in still other ones
    """
    converged = [one for one in (own, *others) if one.converged]
    best = min(converged, key=lambda one: one.cost, default=None)
    if best is None:
        result = NONE_CONVERGED
    else:
        result = OWN_IS_BEST if own.converged and _as_cheap(own, best) else OWN_IS_BEATEN
        best = own if result == OWN_IS_BEST else best
    groups = _groups(others)
    unit = max(best.cost if best is not None else min(_cost(one) for one in (own, *others)), ROUNDING)
    outcomes: list[dict[str, Any]] = [
        {"count": len(group), "cost_ratio": _cost(group[0]) / unit, "result": group[0].result}
        | {"constants": dict(zip(names, map(float, group[0].parameters), strict=True))}
        for group in groups
    ]
    reached = sum(_same(one, best) for one in others) if best is not None else 0
    return {
        **{"count": len(others), "seed": seed, "rule": rule, "share_best": reached / len(others), "result": result},
        "outcomes": outcomes[:MOST_OUTCOMES],
        "others": sum(outcome["count"] for outcome in outcomes[MOST_OUTCOMES:]),
    }


def _groups(found: Sequence[Solution]) -> list[list[Solution]]:
    """Group solutions that are one optimum, or that failed in the same way, each group and all by cost."""
    groups: list[list[Solution]] = []
    for one in sorted(found, key=lambda one: (not one.converged, _cost(one))):
        home = next((group for group in groups if _same(one, group[0])), None)
        if home is None:
            groups.append(home := [])
        home.append(one)
    return groups


def _same(one: Solution, other: Solution) -> bool:
    """Return whether two solutions are one optimum, or failed in the same way, whatever the numbers in its text."""
    if not (one.converged and other.converged):
        return re.split("[,:]", one.result)[0] == re.split("[,:]", other.result)[0]
    error = np.sqrt(np.diag(estimate.misfit_covariance(other)))
    near = np.maximum(SAME_CONSTANT * np.abs(other.parameters), SAME_IN_ERROR * error)
    return _as_cheap(one, other) and bool(np.all(np.abs(one.parameters - other.parameters) <= near))


def _as_cheap(one: Solution, other: Solution) -> bool:
    return one.cost <= other.cost * (1.0 + SAME_COST) + ROUNDING


def _cost(one: Solution) -> float:
    return one.cost if np.isfinite(one.cost) else np.inf


def crosscheck(own: Fit, exact: Profiles, light: Orders) -> dict[str, Any]:
    """Repeat the fit `own`, which was to `exact`, on photons of the same setting; return what `compared` does."""
    run, xi = light.merged(exact.r_edges), tuple(np.asarray(own.rings.xi))
    photons = Profiles.from_orders(run, exact.alpha)
    seen = np.asarray(own.rings.used) > 0
    used = seen & photons.trusted & (photons.energy > 0)
    # Albedos that rest on enough photons, none of which were cut to an extent that matters.
    error = np.asarray(run.reflectance(photons.alpha).standard_error)
    uncut = np.asarray(run.cut(photons.alpha)) <= LARGEST_CUT * error
    counted = uncut & (np.asarray(estimate.rings_of(photons, xi=xi).weight) > 0)
    limits = tuple(np.asarray(own.rings.limits))
    one, other = (
        estimate.fit(profiles, own.law, own.objective, own.free, used, limits, xi, counted, jackknife=False)
        for profiles in (exact, photons)
    )
    return compared(one, other, light.photons, int(np.sum(seen & ~used)), int(np.sum(~counted)))


def compared(exact: Fit, photons: Fit, traced: int, rings_left_out: int, albedos_left_out: int) -> dict[str, Any]:
    """Compare two fits of the same constants, in units of the photons' noise, as a record has it.

    constants  by name from either, on the rings and albedos that count in both, statistical_error of those from photons
               (the sandwich's), and z, their difference in units of it
    chi2       of the whole difference under the sandwich covariance, within the `rank` directions that it knows
    chance     that photon noise alone gives a larger chi2 [-];  photons  that were traced
    result     whether the fits agree, or which one failed and how
    """
    one, other = exact.solution.parameters, photons.solution.parameters
    covariance = np.asarray(photons.statistical)
    failed = [(name, each) for name, each in (("exact", exact), ("photon", photons)) if not each.solution.converged]
    if failed or photons.statistical is None or not np.all(np.isfinite(photons.statistical)):
        result = f"the {failed[0][0]} fit failed: {failed[0][1].result}" if failed else NO_ERRORS
        covariance = np.full((one.size,) * 2, np.nan)
        distance, rank, chance = np.nan, 0, np.nan
    else:
        distance, rank = mahalanobis(other - one, covariance)
        chance = float(chi2.sf(distance, rank))
        result = AGREE if chance >= LEAST_CHANCE else DIFFER
    error = np.sqrt(np.diag(covariance))
    rows = zip(exact.free, one, other, error, (other - one) / error, strict=True)
    keys = ("exact", "photons", "statistical_error", "z")
    return {
        "constants": {name: dict(zip(keys, values, strict=True)) for name, *values in rows},
        **{"photons": traced, "chi2": distance, "rank": rank, "chance": chance, "result": result},
        **{"rings_left_out": rings_left_out, "albedos_left_out": albedos_left_out},
    }


def mahalanobis(difference: Floats, covariance: Floats) -> tuple[float, int]:
    """Return chi2 of a difference (p,) under a covariance (p, p), and the number of directions that count."""
    error = np.sqrt(np.diag(covariance))
    share, axes = np.linalg.eigh(covariance / np.outer(error, error))
    known = share > SMALLEST_SHARE * share.max()
    along = axes.T[known] @ (difference / error)
    return float(np.sum(along**2 / share[known])), int(known.sum())


def discretisation_error(fit: Fit) -> Floats:
    """Return the distance (p,) of the constants from those at no width; 0 for a fit that sees one ring.

    The larger of what rings twice and three times as wide extrapolate to. NaN where a fit fails.
    """
    if not fit.solution.converged:
        return np.full(len(fit.free), np.nan)
    if np.asarray(fit.rings.r_edges).size <= 2:
        return np.zeros(len(fit.free))
    moved = by_width(fit)
    off = [np.abs(moved[factor] - moved[1]) / (factor**ORDER - 1) for factor in TRUSTED]
    return np.asarray(np.max(off, axis=0))


def by_width(fit: Fit) -> dict[int, Floats]:
    """Return constants (p,) by how many rings are taken together; NaN where a fit fails."""
    problem = ResidualFunction(fit.objective, fit.free)
    wider = [widened(fit.rings, factor) for factor in FACTORS]
    rings = jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves]), *wider)
    law = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (len(FACTORS), *np.shape(leaf))), fit.law)
    starts = np.tile(fit.solution.parameters, (len(FACTORS), 1))
    found = [judged(one, fit.free) for one in solve_batch(problem, starts, (law, rings))]
    lost = np.full(len(fit.free), np.nan)
    return {k: one.parameters if one.converged else lost for k, one in zip(FACTORS, found, strict=True)}


def widened(rings: Rings, factor: int) -> Rings:
    """Take `factor` rings together, in arrays of the same shape: the rings between hold nothing and do not count.

    A wide ring counts where all its parts do. The last one is as wide as the rings left over.
    """
    edges, energy, used = (np.asarray(part, float) for part in (rings.r_edges, rings.energy, rings.used))
    first = np.arange(0, energy.shape[1], factor)
    last = np.minimum(first + factor, energy.shape[1]) - 1
    whole, kept = np.zeros_like(energy), np.zeros_like(used)
    whole[:, last] = np.add.reduceat(energy, first, axis=1)
    kept[:, last] = np.minimum.reduceat(used, first, axis=1)
    moved = edges.copy()
    for start, end in zip(first, last, strict=True):
        step = NONE * max(edges[start], edges[1])
        moved[start : end + 1] = edges[start] + step * np.arange(end + 1 - start)
    return eqx.tree_at(lambda tree: (tree.r_edges, tree.energy, tree.used), rings, (moved, whole, kept))
