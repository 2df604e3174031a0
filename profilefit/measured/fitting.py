"""A fit of one's own data: the medium, its statistical, model and lack-of-fit errors, and the goodness of fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mcml_sim.exact.light import ExactLight
from mcml_sim.media.checks import require_own_process
from profilefit.errors import InputError
from profilefit.measured import law_error, model
from profilefit.measured.data import Measured, require_workable
from profilefit.measured.misfit import Misfit, alone, gaussianised, misfit
from profilefit.measured.model import Model, alpha_of
from profilefit.measured.noise import Noise, noise
from profilefit.measured.problem import Question
from profilefit.measured.ranges import Opened, opened
from profilefit.measured.replicates import widening
from profilefit.measured.solving import Minimum, Problem, are_apart, descended, descended_from, minimised

Floats = NDArray[np.float64]
# Weights of counted rings come from the fit itself; three rounds leave nothing to gain.
REWEIGHTED = 3
ROUNDS = 1  # the errors of a law are those at the medium of the fit, which they hardly move
FAR = 100.0  # above the lowest chi-square of the search: such minima are not followed under the final errors
SEARCHED = (0.3, 0.9, 0.99)  # albedos whose largest error of the law the search allows for
# A ring counts as if at least this share of its light were expected, lest its error be none where the law has none.
LEAST_EXPECTED = 0.01
LEVEL = 0.95  # of every interval


@dataclass(frozen=True)
class MediumFit:
    """Where a fit ended. `source` is the record of the law's constants, `rel` its own relative error there.

    widening    factor on the variances that the errors of the data, themselves estimates, put on those of the fit
    rivals      other minima whose chi-square is no more above it than where the 95 % interval ends
    open        what the data leave open of ranges; the fit is that at their means
    """

    problem: Problem
    minimum: Minimum
    source: law_error.Origin | None
    rel: float | None
    widening: float = 1.0
    rivals: tuple[Minimum, ...] = ()
    open: Opened | None = None

    @property
    def data(self) -> Measured:
        return self.problem.data

    @property
    def question(self) -> Question:
        return self.problem.question

    @property
    def point(self) -> Floats:
        return self.minimum.point

    @property
    def rows(self) -> int:
        return self.data.value.size

    @cached_property
    def predicted(self) -> tuple[Floats, Floats]:
        """The light that the fit expects (n + 1,), the last being A, and its derivatives (n + 1, 3)."""
        model: Model = self.problem.model
        return model.linearised(self.point, self.data.inner, self.data.outer)

    @property
    def light(self) -> Floats:
        return self.predicted[0][:-1]

    @cached_property
    def values(self) -> dict[str, float]:
        """A, alpha, l, mu_s', mu_a, scale."""
        found = model.quantities(self.point[None], self.predicted[0][-1:])
        return {name: float(value[0]) for name, value in found.items()}

    @cached_property
    def gradients(self) -> dict[str, Floats]:
        return model.slopes(self.point, self.predicted[1][-1])

    @property
    def jacobian(self) -> Floats:
        """Derivatives (m, p) of the residuals by the free coordinates."""
        return self.minimum.jacobian[:, list(self.question.free)]

    @cached_property
    def gain(self) -> Floats:
        """(3, m) how the coordinates follow errors of the rows, in standard errors."""
        full = np.zeros((3, self.minimum.residuals.size))
        if np.all(np.isfinite(self.jacobian)):  # else the fit has failed and has no errors
            full[list(self.question.free)] = np.linalg.pinv(self.jacobian)
        return full

    @property
    def statistical(self) -> Floats:
        """Covariance (3, 3) of the coordinates from the data's own errors."""
        rows = np.eye(self.minimum.residuals.size) - self.law_rows  # of all errors, the rows' covariance is 1
        return self.gain @ rows @ self.gain.T

    @property
    def likely(self) -> Floats:
        """Covariance (3, 3) of the coordinates: the data's own errors, the law's, and what is open of ranges."""
        return self.conditional + self.of_ranges

    @property
    def conditional(self) -> Floats:
        """Covariance (3, 3) of the coordinates by the likelihood, all else known."""
        return self.gain @ self.gain.T

    @property
    def of_ranges(self) -> Floats:
        """Covariance (3, 3) of the coordinates from what is open of ranges."""
        return np.zeros((3, 3)) if self.open is None else self.open.covariance

    @cached_property
    def law_rows(self) -> Floats:
        """Covariance (m, m) of the rows, in standard errors, from the law's own error; zero if that is unknown."""
        return self._law_rows(self.problem.noise)

    def _law_rows(self, noise: Noise) -> Floats:
        model = self.problem.noise.model
        return self._rows_of(np.zeros((self.rows,) * 2) if model is None else model, np.ones(self.rows), noise)

    @property
    def law_size(self) -> Floats:
        """(n,) standard deviation of the law's own error in the light of each row; zero if that is unknown."""
        model = self.problem.noise.model
        return np.zeros(self.rows) if model is None else np.sqrt(np.diag(model))

    @cached_property
    def beyond(self) -> NDArray[np.bool_]:
        """(n,) rows farther out than the radii that `rel` covers."""
        if isinstance(self.question.law, ExactLight):
            return np.zeros(self.rows, bool)
        return self.problem.model.shares(self.point, self.data.inner) > law_error.WITHIN

    @cached_property
    def wave_rows(self) -> Floats:
        """The same of a relative error 1 in waves."""
        return self._rows_of(law_error.waves(self.data.r), self.light, self.problem.noise)

    def _rows_of(self, shape: Floats, size: Floats, noise: Noise) -> Floats:
        return law_error.whitened(shape, size, noise, self.minimum.residuals.size)

    @property
    def of_law(self) -> Floats:
        """Covariance (3, 3) of the coordinates from the law's own error, and from what is open of ranges."""
        return self.gain @ self.law_rows @ self.gain.T + self.of_ranges

    @property
    def of_misfit(self) -> Floats:
        """Covariance (3, 3) of the coordinates from the misfit that is left, taken for an error in waves."""
        return self.misfit.relative**2 * self.gain @ self.wave_rows @ self.gain.T

    @cached_property
    def misfit(self) -> Misfit:
        """Judged by the errors of the data as they are: what widens those of the coordinates is no noise in a row."""
        times = np.ones(self.minimum.residuals.size)
        times[: self.rows] = np.sqrt(self.widening)
        own = self.problem.noise.alone
        rows, slopes = replace(self.problem, noise=own).residuals(self.point)
        rows, both = times * rows, np.outer(times, times)
        rows[: self.rows] = gaussianised(rows[: self.rows], alone(self.data.freedom, self.data.pooled))
        waves, uneven = (
            both * self._rows_of(shape, self.light, own) for shape in (law_error.waves(self.data.r), np.eye(self.rows))
        )
        jacobian = times[:, None] * slopes[:, list(self.question.free)]
        return misfit(rows, jacobian, both * self._law_rows(own), waves, self.rows, uneven, self.data.pooled)

    @property
    def sigma(self) -> Floats:
        """(n,) standard errors of the data's rows; of counts those of the light that the fit expects."""
        return self.problem.noise.sigma / np.sqrt(self.widening)

    @property
    def quantile(self) -> float:
        """How many standard errors an interval of 95 % goes to either side: Student's, of the errors' own freedom."""
        return float(stats.t.ppf(0.5 + LEVEL / 2, self.data.pooled))

    def errors(self, covariance: Floats) -> dict[str, float]:
        """Standard errors of the quantities from a covariance of the coordinates."""
        return model.errors(self.gradients, covariance)


def fitted(data: Measured, question: Question, source: law_error.Origin | None = None) -> MediumFit:
    """Fit the free ones of alpha, l and scale to the data; a failure is named in `minimum.result`.

    source  the record that the law's constants came from, which knows how far it is from the truth
    InputError if there are not more rows than free coordinates, or if the data are beyond `require_workable`.
    """
    require_own_process()
    free = len(question.free)
    if data.value.size <= free:
        raise InputError(f"{data.source}: expected more than {free} rows, one more than is free, got {data.value.size}")
    require_workable(data)
    wider = widening(data.freedom, free)
    each = [law_error.relative_error(question.law, alpha, source) or 0.0 for alpha in SEARCHED]
    model = law_error.covariance(data, max(each), np.zeros(data.value.size, bool))
    problem = Problem(data, question, noise(data, widening=wider, model=model))
    minimum = first = minimised(problem)
    found = MediumFit(problem, minimum, source, _rel(question, minimum, source), wider)
    reweighted = REWEIGHTED if data.counted else ROUNDS if model is not None else 0
    for _ in range(reweighted):
        found = _reweighted(found)
    if question.ranges and (left := opened(found.problem, found.minimum)) is not None:
        found = replace(found, problem=found.problem.under(left.mean), minimum=left.there, open=left)
        found = _reweighted(found) if reweighted else found
    return replace(found, rivals=_rivals(found, first.others))


def _reweighted(found: MediumFit) -> MediumFit:
    """The same with the errors that its own light has; as it was where this is not finite."""
    light, data = found.problem.model.linearised(found.point, found.data.inner, found.data.outer)[0][:-1], found.data
    if not np.all(np.isfinite(light)):
        return found
    expected = np.maximum(light, LEAST_EXPECTED * data.value)
    model = law_error.covariance(data, found.rel, found.beyond)
    problem = replace(found.problem, noise=noise(data, expected, found.widening, model))
    minimum = descended(problem, found.point, found.question.free)
    return replace(found, problem=problem, minimum=minimum, rel=_rel(found.question, minimum, found.source))


def _rivals(found: MediumFit, others: tuple[Minimum, ...]) -> tuple[Minimum, ...]:
    """Of other minima of the search those that fit as well within the interval's level, under the final errors."""
    rivals: list[Minimum] = []
    for one in others:
        if one.cost > found.minimum.cost + FAR:
            continue
        there = descended_from(found.problem, one.point)
        near = there.cost - found.minimum.cost < found.quantile**2
        if near and all(are_apart(there, other) for other in (found.minimum, *rivals)):
            rivals.append(there)
    return tuple(rivals)


def _rel(question: Question, minimum: Minimum, source: law_error.Origin | None) -> float | None:
    return law_error.relative_error(question.law, float(alpha_of(minimum.point[0])), source)
