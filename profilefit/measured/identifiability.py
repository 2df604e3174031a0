"""Identifiability: which quantities the data determine, what would determine them, and what assumed premises are worth.

Intervals are those of the profile likelihood. An additional measurement with derivatives g by the coordinates and
standard error sigma adds g g^T / sigma^2 to Fisher's information, which predicts the errors that would remain.

A pencil beam, n = 1 and g = 0 are assumed where nobody states others. To see whether the data know of a beam's width,
the fit is repeated under Gaussian beams of widths from a five-hundredth of the last radius to half of it. They know it
if chi-square falls by more than a pencil beam's noise explains at 5 %, one-sided since a width is not negative. Where a
pencil beam leaves a lack of fit, the noise has the one that the best width leaves. How far the answer moves under the
narrowest beam that moves it, as w^2, says which width would move it by a standard error. Under n and g of soft tissue
the fit is repeated once.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy import stats

from mcml_sim.exact.light import ExactLight
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.fitting.solver import Solution, covariance
from profilefit.measured import model
from profilefit.measured.fitting import MediumFit
from profilefit.measured.model import NAMES, SCALE, STRENGTHS, U, alpha_of, exact_light
from profilefit.measured.noise import WITHIN
from profilefit.measured.problem import (
    BLACK,
    FARTHEST_LN,
    FARTHEST_U,
    WHITE,
    Problem,
    descended,
    descended_from,
    finite_cost,
)

# A quantity is not identified if its standard error is more than half of its value: it may as well be twice as much.
LOOSE = 0.5
# Two coordinates are not separately identifiable if all but a tenth of the variance of one is shared with the other.
TRADING = 0.95
STRIDES = 14  # doublings of a step outwards
HALVINGS = 7  # of the last one: to a hundredth
REFERENCE_ERROR = 0.01  # relative error of a total reflectance or of a reference standard that is easily had
REPEATS = 4
# Radii, in mean free paths, where one more point could be measured; only those within 99.5 % of the energy.
NEAREST, FARTHEST, RADII = 0.03, 60.0, 32
WIDTHS = 9  # that are tried, each half of the next; the last is half of the last radius
FINER = 3  # further trials between the best and its neighbours
NOTICED = 0.05  # chance below which a width is said to be seen
TISSUE = {"n": 1.4, "g": 0.9}


@dataclass(frozen=True)
class Interval:
    """95 % profile-likelihood interval of a coordinate, low and high, as values; an end without a bound is open."""

    name: str
    low: float
    high: float
    open_low: bool
    open_high: bool

    @property
    def is_open(self) -> bool:
        return self.open_low or self.open_high


@dataclass(frozen=True)
class Identifiability:
    """Intervals of the free coordinates, relative errors of quantities not identified, the most correlated pair."""

    intervals: tuple[Interval, ...]
    loose: dict[str, float]
    pair: tuple[str, str] | None
    correlation: float

    @property
    def all_identified(self) -> bool:
        """True if the data identify every quantity."""
        return not self.loose and not any(one.is_open for one in self.intervals)

    @property
    def trades(self) -> bool:
        return not self.all_identified and abs(self.correlation) > TRADING


def identifiability(fit: MediumFit) -> Identifiability:
    """Judge identifiability by profile likelihood: chi-square as one coordinate is moved and the others are fitted."""
    intervals = []
    for at in fit.spec.free:
        ends = [_end(fit, at, side) for side in ((1.0, -1.0) if at == U else (-1.0, 1.0))]  # alpha falls as u rises
        low, high = (float(alpha_of(x)) if at == U else float(np.exp(x)) for x, _ in ends)
        intervals.append(Interval(NAMES[at], low, high, *(is_open for _, is_open in ends)))
    relative = relative_errors(fit, fit.total_covariance)
    if fit.at_edge:  # mu_a is anything down to, or up to, where alpha ends
        relative["mu_a"] = np.inf
    loose = {name: value for name, value in relative.items() if not value < LOOSE}
    pair, correlation = _pair(fit)
    return Identifiability(tuple(intervals), loose, pair, correlation)


def relative_errors(fit: MediumFit, covariance: Floats) -> dict[str, float]:
    """Return standard errors of mu_s', mu_a and a free scale over themselves [-]."""
    errors = fit.errors(covariance)
    names = [name for name in STRENGTHS if name != "scale" or "scale" not in fit.spec.held]
    return {name: errors[name] / max(abs(fit.values[name]), np.finfo(float).tiny) for name in names}


def _pair(fit: MediumFit) -> tuple[tuple[str, str] | None, float]:
    free = list(fit.spec.free)
    if len(free) < 2:
        return None, 0.0
    joint = fit.total_covariance[np.ix_(free, free)]
    spread = np.sqrt(np.maximum(np.diag(joint), np.finfo(float).tiny))
    upper = np.triu(joint / np.outer(spread, spread), 1)
    i, j = np.unravel_index(np.argmax(np.abs(upper)), upper.shape)
    return (NAMES[free[i]], NAMES[free[j]]), float(upper[i, j])


def _end(fit: MediumFit, at: int, side: float) -> tuple[float, bool]:
    """Find where chi-square has risen by the square of the quantile, 3.84 of known errors; True where it never does."""
    best, others = fit.minimum, tuple(one for one in fit.spec.free if one != at)
    limit = side * FARTHEST_U if at == U else best.parameters[at] + side * FARTHEST_LN
    last = [best.parameters]

    def rise(x: float) -> float:
        start = last[-1].copy()
        start[at] = x
        there = descended(fit.problem, start, others)
        last.append(there.parameters)
        return there.cost - best.cost - threshold

    # What is open of ranges widens an interval in the ratio of the errors.
    variance = max(float(fit.conditional[at, at]), np.finfo(float).tiny)
    threshold = fit.quantile**2 * (1.0 + float(fit.of_ranges[at, at]) / variance)
    step = max(float(np.sqrt(fit.total_covariance[at, at])), 1e-6)
    inside = outside = best.parameters[at]
    for _ in range(STRIDES):
        outside = best.parameters[at] + side * min(step, side * (limit - best.parameters[at]))
        if rise(outside) > 0:
            for _ in range(HALVINGS):  # by sign alone: each value is a fit, and known to its tolerance only
                middle = 0.5 * (inside + outside)
                inside, outside = (inside, middle) if rise(middle) > 0 else (middle, outside)
            end = float(0.5 * (inside + outside))
            return end, at == U and not WHITE <= end <= BLACK
        if outside == limit:
            break
        inside, step = outside, 2.0 * step
    return float(outside), True


@dataclass(frozen=True)
class Candidate:
    """Measurement that could be made: a "point", "reflectance", "scale" or "repeats", with the value and error assumed.

    inner, outer  radii of a point or ring [unit], else NaN
    relative      predicted relative errors of mu_s', mu_a and a free scale with it [-]
    """

    kind: str
    inner: float
    outer: float
    value: float
    error: float
    relative: dict[str, float]

    @property
    def worst(self) -> tuple[str, float]:
        name = max(self.relative, key=lambda one: self.relative[one])
        return name, self.relative[name]


@dataclass(frozen=True)
class DesignRanking:
    """Least certain quantity with its relative error, and the best candidate of each kind, best first."""

    name: str
    now: float
    candidates: tuple[Candidate, ...]


def rank_designs(fit: MediumFit) -> DesignRanking:
    """Rank additional measurements by the largest relative error that would remain."""
    now = relative_errors(fit, fit.total_covariance)
    name = max(now, key=lambda one: now[one])
    points = _points(fit)
    each = [*([min(points, key=lambda one: one.worst[1])] if points else []), *_others(fit)]
    return DesignRanking(name, now[name], tuple(sorted(each, key=lambda one: one.worst[1])))


def _points(fit: MediumFit) -> list[Candidate]:
    """Return candidates of one more point or ring, as precise as the data are, in the median."""
    data, model = fit.data, fit.problem.model
    width = float(np.median((data.outer - data.inner) / (data.outer + data.inner)))
    r = fit.values["l"] * np.geomspace(NEAREST, FARTHEST, RADII)
    r = r[model.shares(fit.point, r * (1.0 + width)) < WITHIN]
    inner, outer = r * (1.0 - width), r * (1.0 + width)
    light, slopes = model.linearised(fit.point, inner, outer)
    rows = zip(inner.tolist(), outer.tolist(), light[:-1].tolist(), slopes[:-1], strict=True)
    return [_candidate(fit, "point", a, b, value, data.relative_error * value, slope) for a, b, value, slope in rows]


def _others(fit: MediumFit) -> list[Candidate]:
    (*_, reflectance), (*_, slope) = fit.predicted
    scale, nowhere = fit.values["scale"], (np.nan, np.nan)
    stay = fit.law_rows + fit.lack_rows  # errors that repeating the profile leaves
    rows = stay + (np.eye(len(stay)) - stay) / REPEATS
    four = _predicted_covariance(fit, np.linalg.solve(np.linalg.cholesky(rows), fit.jacobian))
    out = [Candidate("repeats", *nowhere, float(REPEATS), np.nan, relative_errors(fit, four))]
    if fit.spec.total is None and fit.data.medium is None:  # a simulation states it already
        error = REFERENCE_ERROR * reflectance
        out.append(_candidate(fit, "reflectance", *nowhere, float(reflectance), error, slope))
    if SCALE in fit.spec.free and fit.spec.scale is None:
        by_scale = scale * np.eye(len(NAMES))[SCALE]
        out.append(_candidate(fit, "scale", *nowhere, scale, REFERENCE_ERROR * scale, by_scale))
    return out


def _candidate(
    fit: MediumFit, kind: str, inner: float, outer: float, value: float, error: float, slope: Floats
) -> Candidate:
    joint = _predicted_covariance(fit, np.vstack([fit.jacobian, slope[list(fit.spec.free)] / error]))
    return Candidate(kind, inner, outer, value, error, relative_errors(fit, joint))


def _predicted_covariance(fit: MediumFit, jacobian: Floats) -> Floats:
    """Return the covariance (3, 3) of the coordinates from derivatives (m, p) by the free ones, and from ranges."""
    free, joint = list(fit.spec.free), np.zeros((len(NAMES), len(NAMES)))
    joint[np.ix_(free, free)] = covariance(jacobian)
    return joint + fit.of_ranges


@dataclass(frozen=True)
class BeamWidth:
    """Effect of a Gaussian beam on a fit that assumes a pencil beam.

    w        the 1/e^2 radius that explains the data best [unit of r]; fall of chi-square there, chance of it by noise
    telling  the 1/e^2 radius that moves the quantity `moved` by its standard error [unit of r]; None if no width does
    """

    w: float
    fall: float
    chance: float
    telling: float | None
    moved: str

    @property
    def noticed(self) -> bool:
        return self.chance < NOTICED


def beam_width(fit: MediumFit) -> BeamWidth | None:
    """Measure the effect of a beam's width; None where a beam is given, or where the fit has no errors."""
    if fit.spec.instrument.beam is not None or not fit.minimum.converged:
        return None
    plain = fit.plain or fit
    fits = _under_widths(plain.problem, plain.minimum)
    best = _best(fits)
    if fit.plain is not None and best > 0:
        known = {} if plain.range_marginal is None else plain.range_marginal.mean
        spec = replace(plain.spec, ranges={**plain.spec.ranges, "beam": (0.0, 0.5 * float(plain.data.r[-1]))})
        wide = replace(plain.problem, spec=spec).under({"beam": best})
        # Where the best width leaves a lack of fit, too, the widths are judged by errors that allow for it.
        lack = replace(plain, problem=wide, minimum=fits[best]).lack_of_fit({**known, "beam": best})
        if lack is not None:
            problem = replace(plain.problem, noise=replace(plain.problem.noise, lack=lack))
            fits = _under_widths(problem, descended(problem, plain.point, plain.spec.free))
            best = _best(fits)
    fall = max(finite_cost(fits[0.0]) - finite_cost(fits[best]), 0.0)
    chance = 0.5 * float(stats.chi2.sf(fall, 1)) if fall > 0 else 1.0
    if fit.plain is not None:
        fits = _under_widths(fit.problem, fit.minimum)
    return BeamWidth(best, fall, chance, *_telling(fit, {w: fits[w] for w in _widths(fit.problem)}))


def _widths(problem: Problem) -> list[float]:
    return list(0.5 * problem.data.r[-1] * 0.5 ** np.arange(WIDTHS - 1.0, -1.0, -1.0))


def _under_widths(problem: Problem, pencil: Solution) -> dict[float, Solution]:
    """Fit under Gaussian beams, by 1/e^2 radius: the pencil beam, the widths that are tried, and near the best."""
    fits, start = {0.0: pencil}, pencil
    for w in _widths(problem):
        fits[w] = start = descended(problem.under({"beam": w}), start.parameters, problem.spec.free)
    for _ in range(FINER):
        best, tried = _best(fits), sorted(fits)
        at = tried.index(best)
        for low, high in ((best, tried[min(at + 1, len(tried) - 1)]), (tried[max(at - 1, 0)], best)):
            between = float(np.sqrt(low * high))
            if between > 0 and between not in fits:
                there = problem.under({"beam": between})
                fits[between] = descended(there, fits[best].parameters, problem.spec.free)
    return fits


def _best(fits: dict[float, Solution]) -> float:
    return min(fits, key=lambda w: finite_cost(fits[w]))


@dataclass(frozen=True)
class Tissue:
    """Fit of the same data under n and g of soft tissue, where these are assumed: values, and rise of chi-square."""

    setting: Setting
    values: dict[str, float]
    rise: float


def as_tissue(fit: MediumFit) -> Tissue | None:
    """Fit under n and g of soft tissue; None where both are given, a law is fitted, or the fit has no errors."""
    spec = fit.spec
    there = Setting.of(spec.law.setting.as_table() | {name: TISSUE[name] for name in spec.assumed})
    if not (spec.assumed and there.is_solved and isinstance(spec.law, ExactLight) and fit.minimum.converged):
        return None
    plain = fit.plain or fit
    problem = replace(plain.problem, spec=replace(spec, law=exact_light(there)))
    try:
        end = descended_from(problem, plain.point)
    except InputError:  # a total reflectance is held that such a medium has not
        return None
    values = model.quantities(end.parameters[None], np.zeros(1))
    return Tissue(there, {name: float(value[0]) for name, value in values.items()}, end.cost - plain.minimum.cost)


def _telling(fit: MediumFit, fits: dict[float, Solution]) -> tuple[float | None, str]:
    """Return the least width that moves a quantity by its standard error, and the quantity."""
    here = fit.values
    errors = {name: error for name, error in fit.errors(fit.total_covariance).items() if error > 0 and name != "A"}
    for w, one in fits.items():
        values = model.quantities(one.parameters[None], np.zeros(1))  # A, which alpha has already, is not looked at
        moved = {name: abs(float(values[name][0]) - here[name]) / error for name, error in errors.items()}
        name = max(moved, key=lambda each: moved[each], default="")
        if name and moved[name] > 1.0:
            return w / float(np.sqrt(moved[name])), name
    return None, ""
