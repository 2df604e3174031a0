"""A fit of one's own data: the medium, its statistical, model and lack-of-fit errors, and the goodness of fit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy import stats

from mcml_sim.media.checks import require_own_process
from profilefit.errors import InputError
from profilefit.measured import law_error, model
from profilefit.measured.data import Measured, require_workable
from profilefit.measured.misfit import Misfit, alone, gaussianised, misfit
from profilefit.measured.model import Model, alpha_of
from profilefit.measured.noise import noise
from profilefit.measured.problem import Question
from profilefit.measured.replicates import widening
from profilefit.measured.solving import Minimum, Problem, descended, minimised

Floats = NDArray[np.float64]
# Weights of counted rings come from the fit itself; three rounds leave nothing to gain.
REWEIGHTED = 3
# A ring counts as if at least this share of its light were expected, lest its error be none where the law has none.
LEAST_EXPECTED = 0.01
LEVEL = 0.95  # of every interval


@dataclass(frozen=True)
class MediumFit:
    """Where a fit ended. `source` is the record of the law's constants, `rel` its own relative error there.

    widening    factor on the variances that the errors of the data, themselves estimates, put on those of the fit
    """

    problem: Problem
    minimum: Minimum
    source: law_error.Origin | None
    rel: float | None
    widening: float = 1.0

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
        return self.gain @ self.gain.T

    @cached_property
    def law_rows(self) -> Floats:
        """Covariance (m, m) of the rows, in standard errors, from the law's own error; zero if that is unknown."""
        return self._rows_of(law_error.waves(self.data.r), self.law_size)

    @property
    def law_size(self) -> Floats:
        """(n,) standard deviation of the law's own error in the light of each row; zero if that is unknown."""
        return law_error.RMS * (self.rel or 0.0) * np.where(self.beyond, law_error.BEYOND, 1.0) * self.light

    @cached_property
    def beyond(self) -> NDArray[np.bool_]:
        """(n,) rows farther out than the radii that `rel` covers."""
        return self.problem.model.shares(self.point, self.data.inner) > law_error.WITHIN

    @cached_property
    def wave_rows(self) -> Floats:
        """The same of a relative error 1 in waves."""
        return self._rows_of(law_error.waves(self.data.r), self.light)

    def _rows_of(self, shape: Floats, size: Floats) -> Floats:
        return law_error.whitened(shape, size, self.problem.noise, self.minimum.residuals.size)

    @property
    def of_law(self) -> Floats:
        """Covariance (3, 3) of the coordinates from the law's own error."""
        return self.gain @ self.law_rows @ self.gain.T

    @property
    def of_misfit(self) -> Floats:
        """Covariance (3, 3) of the coordinates from the misfit that is left, taken for an error in waves."""
        return self.misfit.relative**2 * self.gain @ self.wave_rows @ self.gain.T

    @cached_property
    def misfit(self) -> Misfit:
        """Judged by the errors of the data as they are: what widens those of the coordinates is no noise in a row."""
        times = np.ones(self.minimum.residuals.size)
        times[: self.rows] = np.sqrt(self.widening)
        rows, both = times * self.minimum.residuals, np.outer(times, times)
        rows[: self.rows] = gaussianised(rows[: self.rows], alone(self.data.freedom, self.data.pooled))
        uneven = self._rows_of(np.eye(self.rows), self.light)
        return misfit(
            rows, times[:, None] * self.jacobian, both * self.law_rows, both * self.wave_rows, self.rows,
            both * uneven, self.data.pooled,
        )  # fmt: skip

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
    problem = Problem(data, question, noise(data, widening=wider))
    minimum = minimised(problem)
    for _ in range(REWEIGHTED if data.counted else 0):
        light = problem.model.linearised(minimum.point, data.inner, data.outer)[0][:-1]
        if not np.all(np.isfinite(light)):
            break
        expected = np.maximum(light, LEAST_EXPECTED * data.value)
        problem = replace(problem, noise=noise(data, expected, wider))
        minimum = descended(problem, minimum.point, question.free)
    alpha = float(alpha_of(minimum.point[0]))
    return MediumFit(problem, minimum, source, law_error.relative_error(question.law, alpha, source), wider)
