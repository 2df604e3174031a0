"""A fit of one's own data: the medium, its statistical, model and lack-of-fit errors, and the goodness of fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mcml_sim.exact.light import ExactLight
from mcml_sim.media.arrays import Floats, require_own_process
from profilefit.errors import InputError
from profilefit.fitting.misfit import Misfit, gaussianised, lack_of_fit, misfit, waves
from profilefit.fitting.solver import Solution, are_apart, lowest
from profilefit.measured import model
from profilefit.measured.data import Measured, require_workable, widening
from profilefit.measured.model import Model, alpha_of
from profilefit.measured.noise import WAVE, WITHIN, law_covariance, noise, relative_error
from profilefit.measured.problem import (
    AT_BLACK,
    AT_WHITE,
    FitSpec,
    Problem,
    RangeMarginal,
    descended,
    descended_from,
    marginalise,
    slopes_by_ranges,
)

# Weights of counted rings come from the fit itself; three rounds leave nothing to gain.
REWEIGHTED = 3
ROUNDS = 1  # the errors of a law are those at the medium of the fit, which they hardly move
FAR = 100.0  # above the lowest chi-square of the search: such minima are not followed under the final errors
SEARCHED = (0.3, 0.9, 0.99)  # albedos whose largest error of the law the search allows for
# A ring counts as if at least this share of its light were expected, lest its error be none where the law has none.
LEAST_EXPECTED = 0.01
LEVEL = 0.95  # of every interval
# Correlation lengths [ln r] of a lack of fit, whose waves are some six times as long; 0 is one of each row alone.
LACK_WAVES = (0.0, 0.1, 0.2, 0.4, 0.8)
LACK_ROUNDS, BETTER = 3, 0.9  # of its estimate; share of chi-square below which a minimum is another, better one


@dataclass(frozen=True)
class MediumFit:
    """End of a fit.

    rel         relative error of the law there; None where it is not known
    widening    factor on the variances that the errors of the data, themselves estimates, put on those of the fit
    rivals      other minima whose chi-square is no more above it than where the 95 % interval ends
    range_marginal  what the data leave open of ranges; the fit is that at their means
    plain       the fit by the errors of data and law alone, whose residuals suggest the lack of fit that this one
                allows for; None where none is allowed for
    """

    problem: Problem
    minimum: Solution
    rel: float | None
    widening: float = 1.0
    rivals: tuple[Solution, ...] = ()
    range_marginal: RangeMarginal | None = None
    plain: MediumFit | None = None

    @property
    def data(self) -> Measured:
        return self.problem.data

    @property
    def spec(self) -> FitSpec:
        return self.problem.spec

    @property
    def point(self) -> Floats:
        return self.minimum.parameters

    @property
    def at_edge(self) -> bool:
        """True where the best albedo is 0 or 1: it has no standard error, only a one-sided limit."""
        return self.minimum.result in (AT_WHITE, AT_BLACK)

    @property
    def has_ended(self) -> bool:
        """True at a minimum, or at an end of the albedo's range."""
        return self.minimum.converged or self.at_edge

    @cached_property
    def predicted(self) -> tuple[Floats, Floats]:
        """Light that the fit expects (n + 1,), the last being A, and its derivatives (n + 1, 3)."""
        model: Model = self.problem.model
        return model.linearised(self.point, self.data.inner, self.data.outer)

    @property
    def light(self) -> Floats:
        return self.predicted[0][:-1]

    @cached_property
    def values(self) -> dict[str, float]:
        """Values of A, alpha, l, mu_s', mu_a and scale."""
        each = model.quantities(self.point[None], self.predicted[0][-1:])
        return {name: float(value[0]) for name, value in each.items()}

    @cached_property
    def gradients(self) -> dict[str, Floats]:
        return model.slopes(self.point, self.predicted[1][-1])

    @property
    def jacobian(self) -> Floats:
        """Derivatives (m, p) of the residuals by the free coordinates."""
        return self.minimum.jacobian[:, list(self.spec.free)]

    @cached_property
    def gain(self) -> Floats:
        """Derivatives (3, m) of the coordinates by errors of the rows, in standard errors."""
        full = np.zeros((3, self.minimum.residuals.size))
        if np.all(np.isfinite(self.jacobian)):  # else the fit has failed and has no errors
            full[list(self.spec.free)] = np.linalg.pinv(self.jacobian)
        return full

    @property
    def statistical(self) -> Floats:
        """Covariance (3, 3) of the coordinates from the data's own errors."""
        # Of all errors the rows' covariance is 1.
        rows = np.eye(self.minimum.residuals.size) - self.law_rows - self.lack_rows
        return self.gain @ rows @ self.gain.T

    @property
    def total_covariance(self) -> Floats:
        """Covariance (3, 3) of the coordinates: errors of the data, of the law and by lack of fit, and open ranges."""
        return self.conditional + self.of_ranges

    @property
    def conditional(self) -> Floats:
        """Covariance (3, 3) of the coordinates by the likelihood, all else known."""
        return self.gain @ self.gain.T

    @property
    def of_ranges(self) -> Floats:
        """Covariance (3, 3) of the coordinates from what is open of ranges."""
        return np.zeros((3, 3)) if self.range_marginal is None else self.range_marginal.covariance

    @cached_property
    def law_rows(self) -> Floats:
        """Covariance (m, m) of the rows, in standard errors, from the law's own error; zero if that is unknown."""
        return self.problem.noise.in_errors(self.problem.noise.model, self.minimum.residuals.size)

    @cached_property
    def lack_rows(self) -> Floats:
        """Covariance (m, m) of the rows, in standard errors, from the lack of fit; zero where none is allowed for."""
        return self.problem.noise.in_errors(self.problem.noise.lack, self.minimum.residuals.size)

    @cached_property
    def beyond(self) -> NDArray[np.bool_]:
        """True (n,) for rows farther out than the radii that `rel` covers."""
        if isinstance(self.spec.law, ExactLight):
            return np.zeros(self.data.value.size, bool)
        return self.problem.model.shares(self.point, self.data.inner) > WITHIN

    @property
    def of_law(self) -> Floats:
        """Covariance (3, 3) of the coordinates from the law's own error, and from what is open of ranges."""
        return self.gain @ self.law_rows @ self.gain.T + self.of_ranges

    @property
    def of_misfit(self) -> Floats:
        """Covariance (3, 3) of the coordinates from the lack of fit; zero where none is allowed for."""
        return self.gain @ self.lack_rows @ self.gain.T

    @cached_property
    def misfit(self) -> Misfit:
        """Goodness of fit by the errors of the data and of the law, without any lack of fit that is allowed for."""
        if self.plain is not None:
            return self.plain.misfit
        rows, jacobian, law, (smooth, uneven) = self._in_data_errors((WAVE, 0.0))
        return misfit(rows, jacobian, law, smooth, self.data.value.size, uneven, self.data.pooled)

    def lack_of_fit(self, values: Mapping[str, float]) -> Floats | None:
        """Estimate the covariance (n, n) of a lack of fit from the residuals; None where they do not suggest any.

        values  of the spec's ranges, which take up residuals as free coordinates do: any lack allowed is presumed
        """
        rows, jacobian, law, shapes = self._in_data_errors(LACK_WAVES, values)
        variances, likelier = lack_of_fit(rows, jacobian, law, shapes, self.data.pooled)
        if likelier <= (-np.inf if values else 0.0):
            return None
        each = zip(variances, LACK_WAVES, strict=True)
        joint = sum(variance * waves(self.data.r, length, rough=True) for variance, length in each)
        return np.asarray(joint * np.outer(self.light, self.light), float)

    def _in_data_errors(
        self, lengths: Sequence[float], values: Mapping[str, float] | None = None
    ) -> tuple[Floats, Floats, Floats, Floats]:
        """Return residuals (m,), their derivatives, and covariances of the law's and of relative errors 1 in waves.

        All are in the errors of the data as they are: what widens those of the coordinates is no noise in a row.
        Derivatives are by the free coordinates and, where `values` of them are given, by the spec's ranges.
        """
        own, count = replace(self.problem.noise, model=None, lack=None), self.minimum.residuals.size
        times = np.ones(count)
        times[: self.data.value.size] = np.sqrt(self.widening)
        problem = replace(self.problem, noise=own)
        rows, slopes = problem.residuals(self.point)
        rows, both = gaussianised(times * rows, self.data.freedom, self.data.pooled), np.outer(times, times)
        size = np.outer(self.light, self.light)
        shapes = [both * own.in_errors(size * waves(self.data.r, length), count) for length in lengths]
        free = list(self.spec.free)
        slopes = slopes[:, free]
        if values:
            at = np.array([values[name] for name in self.spec.ranges])
            slopes = np.column_stack([slopes, slopes_by_ranges(problem, self.point[free], at)])
        law = both * own.in_errors(self.problem.noise.model, count)
        return rows, times[:, None] * slopes, law, np.array(shapes)

    @property
    def sigma(self) -> Floats:
        """Standard errors (n,) of the data's rows; of counts those of the light that the fit expects."""
        return self.problem.noise.sigma / np.sqrt(self.widening)

    @property
    def quantile(self) -> float:
        """Standard errors to either side in an interval of 95 %: Student's, of the errors' own freedom."""
        return float(stats.t.ppf(0.5 + LEVEL / 2, self.data.pooled))

    def errors(self, covariance: Floats) -> dict[str, float]:
        """Return standard errors of the quantities from a covariance of the coordinates."""
        return model.errors(self.gradients, covariance)


def fitted(data: Measured, spec: FitSpec) -> MediumFit:
    """Fit the free ones of alpha, l and scale to the data; a failure is named in `minimum.result`. InputError."""
    require_own_process()
    free = len(spec.free)
    if data.value.size <= free:
        raise InputError(f"{data.source}: expected more than {free} rows, one more than is free, got {data.value.size}")
    require_workable(data)
    wider = widening(data.freedom, free)
    data = replace(data, notes=(*data.notes, *spec.notes))
    each = [relative_error(spec.law, alpha, spec.source) or 0.0 for alpha in SEARCHED]
    model = law_covariance(data, max(each), np.zeros(data.value.size, bool))
    problem = Problem(data, spec, noise(data, widening=wider, model=model))
    minimum = first = lowest(descended(problem, start, spec.free) for start in problem.starts)
    fit = MediumFit(problem, minimum, _rel(spec, minimum), wider)
    rounds = REWEIGHTED if data.counted else ROUNDS if model is not None else 0
    fit = _allowing_for_lack(_settled(fit, rounds), rounds)
    return replace(fit, rivals=_rivals(fit, first.others))


def _settled(fit: MediumFit, rounds: int) -> MediumFit:
    """Fit again with the errors that the fit's own light has, so many times, then with what is open of ranges."""
    for _ in range(rounds):
        fit = _reweighted(fit)
    if fit.spec.ranges:
        left = marginalise(fit.problem, fit.minimum, None if fit.range_marginal is None else fit.range_marginal.mean)
        fit = replace(fit, range_marginal=left)
        if left is not None:
            fit = replace(fit, problem=fit.problem.under(left.mean), minimum=left.there)
            fit = _reweighted(fit) if rounds else fit
    return fit


def _allowing_for_lack(fit: MediumFit, rounds: int) -> MediumFit:
    """Fit again under errors with the lack of fit that the residuals suggest; unchanged where they suggest none."""
    wider = fit
    for _ in range(LACK_ROUNDS):
        values = {} if fit.range_marginal is None else fit.range_marginal.mean
        lack = fit.lack_of_fit(values) if fit.has_ended else None
        if lack is None:
            return fit
        problem = replace(fit.problem, noise=replace(fit.problem.noise, lack=lack))
        wider = _settled(replace(fit, problem=problem, plain=fit), 1)
        if not wider.has_ended:
            return fit
        back = replace(wider.problem, noise=fit.problem.noise)
        there = descended_from(back, wider.point)  # wider errors let the search out of a local minimum
        if not there.cost < BETTER * fit.minimum.cost:
            break
        fit = _settled(replace(wider, problem=back, minimum=there, plain=None), rounds)
    return wider


def _reweighted(fit: MediumFit) -> MediumFit:
    """Fit again with the errors that the fit's own light has; return it as it was where this is not finite."""
    light, data = fit.problem.model.linearised(fit.point, fit.data.inner, fit.data.outer)[0][:-1], fit.data
    if not np.all(np.isfinite(light)):
        return fit
    expected = np.maximum(light, LEAST_EXPECTED * data.value)
    model = law_covariance(data, fit.rel, fit.beyond)
    weights = noise(data, expected, fit.widening, model, fit.problem.noise.lack)
    problem = replace(fit.problem, noise=weights)
    minimum = descended(problem, fit.point, fit.spec.free)
    return replace(fit, problem=problem, minimum=minimum, rel=_rel(fit.spec, minimum))


def _rivals(fit: MediumFit, others: tuple[Solution, ...]) -> tuple[Solution, ...]:
    """Return other minima of the search that fit as well within the interval's level, under the final errors."""
    rivals: list[Solution] = []
    for one in others:
        if one.cost > fit.minimum.cost + FAR:
            continue
        there = descended_from(fit.problem, one.parameters)
        near = there.cost - fit.minimum.cost < fit.quantile**2
        if near and all(are_apart(there, other) for other in (fit.minimum, *rivals)):
            rivals.append(there)
    return tuple(rivals)


def _rel(spec: FitSpec, minimum: Solution) -> float | None:
    return relative_error(spec.law, float(alpha_of(minimum.parameters[0])), spec.source)
