"""Identifiability: which quantities the data determine, by profile likelihood, and which pairs are correlated."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profilefit.measured.fitting import MediumFit
from profilefit.measured.model import NAMES, STRENGTHS, U, alpha_of
from profilefit.measured.solving import BLACK, FARTHEST_LN, FARTHEST_U, WHITE, descended

Floats = NDArray[np.float64]
# A quantity is not identified if its standard error is more than half of its value: it may as well be twice as much.
LOOSE = 0.5
# Two coordinates are not separately identifiable if all but a tenth of the variance of one is shared with the other.
TRADING = 0.95
STRIDES = 14  # doublings of a step outwards
HALVINGS = 7  # of the last one: to a hundredth


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
    """What a fit identifies.

    intervals  of the free coordinates; loose the quantities that are not identified, with their relative errors
    pair       the two most correlated free coordinates; correlation theirs (0 with fewer than two)
    """

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
    """Identifiability by profile likelihood: chi-square as one coordinate is moved and the others are fitted again."""
    intervals = tuple(_interval(fit, at) for at in fit.spec.free)
    relative = relative_errors(fit, fit.total_covariance)
    if fit.minimum.at_edge:  # mu_a is anything down to, or up to, where alpha ends
        relative["mu_a"] = np.inf
    loose = {name: value for name, value in relative.items() if not value < LOOSE}
    pair, correlation = _pair(fit)
    return Identifiability(intervals, loose, pair, correlation)


def relative_errors(fit: MediumFit, covariance: Floats) -> dict[str, float]:
    """Standard errors of mu_s', mu_a and a free scale over themselves [-]."""
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


def _interval(fit: MediumFit, at: int) -> Interval:
    """Both ends of the profile likelihood in coordinate `at`."""
    ends = [_end(fit, at, side) for side in (-1.0, 1.0)]
    values = [float(alpha_of(x)) if at == U else float(np.exp(x)) for x, _ in ends]
    opened = [is_open for _, is_open in ends]
    if at == U:  # alpha falls as u rises
        values, opened = values[::-1], opened[::-1]
    return Interval(NAMES[at], values[0], values[1], opened[0], opened[1])


def _end(fit: MediumFit, at: int, side: float) -> tuple[float, bool]:
    """Where chi-square has risen by the square of the quantile, 3.84 of known errors, and whether it never does.

    It never does where alpha cannot be distinguished from 0 or 1.
    """
    best, others = fit.minimum, tuple(one for one in fit.spec.free if one != at)
    limit = side * FARTHEST_U if at == U else best.point[at] + side * FARTHEST_LN
    last = [best.point]

    def rise(x: float) -> float:
        start = last[-1].copy()
        start[at] = x
        there = descended(fit.problem, start, others)
        last.append(there.point)
        return there.cost - best.cost - threshold

    # What is open of ranges widens an interval in the ratio of the errors.
    variance = max(float(fit.conditional[at, at]), np.finfo(float).tiny)
    threshold = fit.quantile**2 * (1.0 + float(fit.of_ranges[at, at]) / variance)
    step = max(float(np.sqrt(fit.total_covariance[at, at])), 1e-6)
    inside = outside = best.point[at]
    for _ in range(STRIDES):
        outside = best.point[at] + side * min(step, side * (limit - best.point[at]))
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
