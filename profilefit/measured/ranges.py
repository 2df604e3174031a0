"""Marginal posterior of what is known as a range only (n, g, the width of a beam), and what it leaves open.

The best fit within the ranges is found from coarse nodes of them. In the box of so many standard errors about it the
fit is repeated at Gauss and Legendre's nodes; between these its coordinates, chi-square and the volume of its errors
are polynomials. The posterior is flat within the ranges and, as the chain's, in sqrt(1 - alpha), ln l and ln k: at each
place these have the errors of the fit there (Laplace).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import reduce
from itertools import product

import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from numpy.typing import NDArray
from scipy import special

from profilefit.fitting.misfit import likelihood
from profilefit.fitting.solver import Solution, differences, solve
from profilefit.measured.model import U
from profilefit.measured.problem import AT_WHITE, WHITE, Problem, descended_from, finite_cost, log_prior

Floats = NDArray[np.float64]
NODES = {"n": 3, "g": 6, "beam": 5}
PLACES = {"n": 15, "g": 121, "beam": 61}  # between the nodes, where the polynomials are evaluated
COARSE = 3  # nodes of each range from which the search begins
STARTS, AGAIN = 4, 2  # how many of the best of these are followed, the first time and where a fit is known
LOWER = 1.0  # chi-square by which one of these must be lower than the one before
REACH = 5.0  # standard errors of a range's value to either side of the best, beyond which it is not looked for
NARROWED = 5  # times at most, until the box has no end where nothing is
STEP = 1e-3  # of a range, for derivatives
ENOUGH, MAX_STEPS = 1e-5, 60  # of chi-square, that another step of the search must gain; of the search
DRAWS, SEED = 4000, 0


@dataclass(frozen=True)
class RangeMarginal:
    """Marginal posterior of ranges.

    mean     of each, by name, and error the standard deviation about it
    there    the fit where the ranges have their means
    offsets  (k, 3) draws: coordinates where the ranges have other values than their means, less those at the means
    """

    mean: Mapping[str, float]
    error: Mapping[str, float]
    there: Solution
    offsets: Floats

    @property
    def covariance(self) -> Floats:
        """Covariance (3, 3) of the coordinates, by the ranges alone."""
        return np.asarray(self.offsets.T @ self.offsets / len(self.offsets), float)


def marginalise(problem: Problem, start: Solution, known: Mapping[str, float] | None = None) -> RangeMarginal | None:
    """Compute the marginal posterior of a problem's ranges; None where the fit has no errors anywhere in them.

    Args:
        problem: data and spec.
        start: a fit somewhere within the ranges.
        known: values of the ranges where `start` is a fit, which may be the best.
    """
    whole = dict(problem.spec.ranges)
    rough = [_scaled(leggauss(COARSE)[0], ends) for ends in whole.values()]
    fits = _fits(problem, tuple(whole), rough, start) + ([] if known is None else [(start, dict(known))])
    first, *others = sorted(fits, key=lambda one: finite_cost(one[0]))[: STARTS if known is None else AGAIN]
    if not np.isfinite(finite_cost(first[0])):
        return None
    start, ranges = _box(problem, *first)
    for one in others:  # which leads elsewhere where the first ended in a local minimum
        if np.isfinite(finite_cost(one[0])) and (best := _box(problem, *one))[0].cost < start.cost - LOWER:
            start, ranges = best
    for _ in range(NARROWED):
        nodes = [_scaled(leggauss(NODES[name])[0], ends) for name, ends in ranges.items()]
        within = [one for one, _ in _fits(problem, tuple(ranges), nodes, start)]
        rise = np.array([finite_cost(one) - finite_cost(start) for one in within])
        narrower = _narrowed(ranges, nodes, rise)
        if narrower == ranges:
            break
        ranges = narrower
    if not np.all(np.isfinite(rise)):
        return None
    theta, log = np.array([one.parameters for one in within]), _log_volumes(problem, within)
    if not np.any(np.isfinite(log)):
        return None
    if np.all(np.isfinite(log)):  # errors at every node
        between = _product([_polynomials(NODES[name], PLACES[name]) for name in ranges])
        theta[:, U] = np.exp(theta[:, U])  # sqrt(1 - alpha), near enough: it ends at 0 where the data allow no other
        theta, log = between @ theta, between @ log
        theta[:, U] = np.log(np.maximum(theta[:, U], np.exp(WHITE)))
        log += likelihood(between @ rise, len(problem.spec.free), problem.data.pooled)
        places = [_scaled(_middles(PLACES[name]), ends) for name, ends in ranges.items()]
    else:
        log += likelihood(rise, len(problem.spec.free), problem.data.pooled)
        log += np.log(_product([leggauss(NODES[name])[1] for name in ranges]))
        places = nodes
    share = np.exp(log - log.max())
    share /= share.sum()
    at = np.array(list(product(*places)))
    mean = share @ at
    means = dict(zip(ranges, map(float, mean), strict=True))
    errors = dict(zip(ranges, map(float, np.sqrt(share @ (at - mean) ** 2)), strict=True))
    drawn = theta[np.random.default_rng(SEED).choice(share.size, DRAWS, p=share)]
    there = fitted_under(problem, means, start)
    return RangeMarginal(means, errors, there, drawn - there.parameters)


def slopes_by_ranges(problem: Problem, values: Mapping[str, float], point: Floats) -> Floats:
    """Return derivatives (m, k) of the residuals at a point (3,) by the spec's k ranges, where these have `values`."""
    low, high = np.array(list(problem.spec.ranges.values())).T
    at = np.array([values[name] for name in problem.spec.ranges])
    theta = point[list(problem.spec.free)]
    return differences(lambda moved: _residuals(problem, theta, moved)[0], STEP * (high - low), high)(at)[1]


def _residuals(problem: Problem, theta: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return residuals (m,) where the free coordinates (p,) and the ranges (k,) have these values; slopes (m, p)."""
    there = problem.under(dict(zip(problem.spec.ranges, map(float, values), strict=True)))
    point, free = there.spec.base, list(problem.spec.free)
    point[free] = theta
    rows, slopes = there.residuals(point)
    return rows, slopes[:, free]


def fitted_under(problem: Problem, values: Mapping[str, float], start: Solution) -> Solution:
    """Return the minimum where the ranges have these values."""
    return descended_from(problem.under(values), start.parameters)


def _fits(
    problem: Problem, names: Sequence[str], nodes: Sequence[Floats], start: Solution
) -> list[tuple[Solution, dict[str, float]]]:
    """Fit at all combinations of the nodes, from the middle ones outward, each begun at the nearest that converged.

    start  a fit somewhere in the middle
    """
    places = np.array(list(product(*(np.linspace(-1.0, 1.0, one.size) for one in nodes))))
    values = [dict(zip(names, map(float, each), strict=True)) for each in product(*nodes)]
    fits: dict[int, Solution] = {}
    for at in map(int, np.argsort(np.sum(places**2, axis=1), kind="stable")):
        ended = [other for other, one in fits.items() if one.converged]
        nearest = min(ended, key=lambda other: float(np.sum((places[at] - places[other]) ** 2)), default=None)
        fits[at] = fitted_under(problem, values[at], start if nearest is None else fits[nearest])
    return [(fits[at], values[at]) for at in range(len(values))]


def _box(
    problem: Problem, start: Solution, values: dict[str, float]
) -> tuple[Solution, dict[str, tuple[float, float]]]:
    """Find the best fit within the ranges, and the box within REACH of it; `start` is the fit under some values."""
    free, ranges = list(problem.spec.free), problem.spec.ranges
    low, high = np.array(list(ranges.values())).T

    def at(x: Floats) -> tuple[Floats, Floats]:
        theta, values = np.split(x, [len(free)])
        step = STEP * (high - low)
        by_range = differences(lambda moved: _residuals(problem, theta, moved)[0], step, high)(values)[1]
        rows, slopes = _residuals(problem, theta, values)
        return rows, np.column_stack([slopes, by_range])

    first, last = (end[free] for end in problem.bounds(start.parameters))
    bounds = np.append(first, low), np.append(last, high)
    inside = np.clip(np.append(start.parameters[free], list(values.values())), *bounds)
    done = solve(at, inside, bounds, gain=ENOUGH, most=MAX_STEPS)
    best, errors = done.parameters[len(free) :], np.sqrt(np.diag(done.covariance))[len(free) :]
    ends = zip(np.maximum(best - REACH * errors, low), np.minimum(best + REACH * errors, high), strict=True)
    box = dict(zip(ranges, ((float(a), float(b)) for a, b in ends), strict=True))
    return fitted_under(problem, dict(zip(ranges, map(float, best), strict=True)), start), box


def _narrowed(
    ranges: Mapping[str, tuple[float, float]], nodes: Sequence[Floats], rise: Floats
) -> dict[str, tuple[float, float]]:
    """Return the box up to the first nodes where chi-square has risen beyond REACH, whatever the other ranges are."""
    each = rise.reshape([one.size for one in nodes])
    box = {}
    for axis, (name, (low, high)) in enumerate(ranges.items()):
        least = np.min(each, axis=tuple(at for at in range(each.ndim) if at != axis))
        near = np.flatnonzero(least < REACH**2)
        first, last = (near[0], near[-1]) if near.size else (0, least.size - 1)
        at = nodes[axis]
        box[name] = float(at[first - 1]) if first > 0 else low, float(at[last + 1]) if last + 1 < at.size else high
    return box


def _log_volumes(problem: Problem, fits: Sequence[Solution]) -> Floats:
    """Return ln of the prior's share within the errors of each fit, up to a constant; -inf where it has none.

    Residuals are linear in s = e^u, in which the prior is flat and ends at s = 0 (alpha = 1), near which it is
    sqrt(1 - alpha): what lies beyond that end is cut off.
    """
    free = list(problem.spec.free)
    volumes = np.full(len(fits), -np.inf)
    for at, one in enumerate(fits):
        slopes = one.jacobian[:, free]
        sign, log = np.linalg.slogdet(slopes.T @ slopes)
        if sign > 0 and (one.converged or one.result == AT_WHITE):
            volumes[at] = -0.5 * log + (_log_inside(one, free) if U in free else 0.0)
    return volumes


def _log_inside(one: Solution, free: Sequence[int]) -> float:
    """Return ln of the prior's density at a fit, times the share of its errors with alpha < 1."""
    others = one.jacobian[:, [at for at in free if at != U]]
    along = one.jacobian[:, U] - others @ np.linalg.lstsq(others, one.jacobian[:, U])[0]
    size = float(np.linalg.norm(along))  # s over its error
    pull = float(along @ one.residuals) / size  # 0 at a minimum, positive at an end
    return float(log_prior(one.parameters[U])) + 0.5 * pull**2 + float(special.log_ndtr(size - pull))


def _scaled(t: Floats, ends: tuple[float, float]) -> Floats:
    """Map from (-1, 1) to a range."""
    return np.asarray(0.5 * (ends[0] + ends[1]) + 0.5 * (ends[1] - ends[0]) * t, float)


def _product(each: Sequence[Floats]) -> Floats:
    """Return the Kronecker product of all."""
    return reduce(lambda one, other: np.asarray(np.kron(one, other), float), each)


def _middles(count: int) -> Floats:
    """Return the middles of as many equal parts of (-1, 1)."""
    return (2.0 * np.arange(count) + 1.0) / count - 1.0


def _polynomials(nodes: int, places: int) -> Floats:
    """Return the matrix (places, nodes) from values at Legendre's nodes to values at `_middles`."""
    return np.asarray(
        legvander(_middles(places), nodes - 1) @ np.linalg.inv(legvander(leggauss(nodes)[0], nodes - 1)), float
    )
