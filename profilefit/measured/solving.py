"""Least squares in the three coordinates, within bounds, from starts that a coarse search of the data finds.

A failure is a result: `Minimum.result` is "converged" or says what happened and what to try.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from profilefit.fitting import solver
from profilefit.measured.data import Measured
from profilefit.measured.model import LENGTH, NAMES, SCALE, Model, U, u_of
from profilefit.measured.noise import Noise
from profilefit.measured.problem import FitSpec

Floats = NDArray[np.float64]
# Far below any error that data leave a coordinate, well above what rounding of the profile does to it.
TOLERANCE = 1e-9
GAIN = 1e-8  # of chi-square, below which no further step is worth taking
MAX_STEPS = 1000  # along a ridge, where alpha and scale run away together, hundreds are taken
# Albedos and lengths where the search begins; lengths from a twentieth of the first radius to twice the last.
ALBEDOS = (0.02, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.997, 0.999, 0.9999)
LENGTHS, SHORTEST, LONGEST = 20, 1 / 20, 2.0
APART = 0.05  # in a coordinate: minima nearer to each other than that are one
STARTS = 4  # the best of them, no two neighbours, that are followed to their minimum
# How far the coordinates may go: beyond, laws have reached their limits. ln l: from the range of the search; ln k: from
# where it starts, as far as l may go.
FARTHEST_U, FARTHEST_LN = 12.0, 7.0
EDGE = 1e-3  # of such a range: nearer to its end than this, a coordinate has run there
WHITE, BLACK = -9.0, 6.0  # u beyond which no data distinguish alpha from 1 or 0
UNSEEN = 0.01  # standard errors by which residuals move on the way from alpha to 1, where they do not show it
AT_WHITE = "alpha runs to 1: these data show no absorption; measure farther out, or hold it with `held` alpha=..."
NOT_FINITE = "the law is not finite there: check the unit and what is held, or leave out the outermost rows"
RAN_AWAY = "a coordinate diverges: the data do not constrain it; check unit and scale, or hold one with `held`"
AT_BLACK = "alpha runs to 0: these data show no multiple scattering; check unit and scale, or use `held` alpha=..."


@dataclass(frozen=True)
class Problem:
    """Data and a spec, as residuals. noise is what weighs the rows: the errors of the data or better."""

    data: Measured
    spec: FitSpec
    noise: Noise

    @cached_property
    def model(self) -> Model:
        return Model(self.spec.law, self.spec.instrument)

    def residuals(self, point: Floats) -> tuple[Floats, Floats]:
        """Residuals in standard errors (m,) and their derivatives (m, 3): the n rows, then what else is known."""
        light, slope = self.model.linearised(point, self.data.inner, self.data.outer)
        rows, slopes = self.noise.whitened(light[:-1] - self.data.value), self.noise.whitened(slope[:-1])
        if (total := self.spec.total) is not None:
            rows = np.append(rows, (light[-1] - total.value) / total.error)
            slopes = np.vstack([slopes, slope[-1:] / total.error])
        if (known := self.spec.scale) is not None:
            scale = np.exp(point[SCALE])
            rows = np.append(rows, (scale - known.value) / known.error)
            slopes = np.vstack([slopes, scale / known.error * np.eye(len(NAMES))[SCALE]])
        if (oblique := self.spec.oblique) is not None:
            off, slope = oblique.residuals(self.spec.law.setting, point[None])
            rows, slopes = np.append(rows, off), np.vstack([slopes, slope])
        return rows, slopes

    def costs(self, points: Floats) -> Floats:
        """Sums of squared residuals (m,) at points (m, 3)."""
        light = self.model.predicted(points, self.data.inner, self.data.outer)
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is no start
            cost = np.sum(self.noise.whitened((light[:, :-1] - self.data.value).T) ** 2, axis=0)
        if (total := self.spec.total) is not None:
            cost += ((light[:, -1] - total.value) / total.error) ** 2
        if (known := self.spec.scale) is not None:
            cost += ((np.exp(points[:, SCALE]) - known.value) / known.error) ** 2
        if (oblique := self.spec.oblique) is not None:
            cost += oblique.residuals(self.spec.law.setting, points)[0] ** 2
        return cost

    def under(self, values: Mapping[str, float]) -> Problem:
        """The same where those of the spec's ranges have these values."""
        return replace(self, spec=self.spec.under(values))

    @property
    def lengths(self) -> tuple[float, float]:
        """The range of ln l where the search begins."""
        return float(np.log(self.data.r[0] * SHORTEST)), float(np.log(self.data.r[-1] * LONGEST))

    def bounds(self, start: Floats) -> tuple[Floats, Floats]:
        """The lowest and highest (3,) coordinates of a descent from `start` (3,)."""
        shortest, longest = self.lengths
        far = FARTHEST_LN + longest - shortest
        low = np.array([-FARTHEST_U, shortest - FARTHEST_LN, start[SCALE] - far])
        return low, np.array([FARTHEST_U, longest + FARTHEST_LN, start[SCALE] + far])

    @cached_property
    def starts(self) -> Floats:
        """(k, 3) the best points of a coarse search, no two neighbours."""
        held = self.spec.base
        u = [held[U]] if U not in self.spec.free else [u_of(alpha) for alpha in ALBEDOS]
        lengths = np.linspace(*self.lengths, LENGTHS)
        ln_l = [held[LENGTH]] if LENGTH not in self.spec.free else lengths
        points = np.array([[a, b, held[SCALE]] for a in u for b in ln_l])
        if SCALE in self.spec.free:
            points[:, SCALE] = np.log(self._best_scales(points))
        places = np.array([[i, j] for i in range(len(u)) for j in range(len(ln_l))])
        return points[best_apart(places, self.costs(points))]

    def _best_scales(self, points: Floats) -> Floats:
        """The scale that fits best at each point, by linear least squares (m,)."""
        light = self.noise.whitened(self.model.predicted(points, self.data.inner, self.data.outer)[:, :-1].T).T
        value = self.noise.whitened(self.data.value)
        norm = np.maximum(np.sum(light**2, axis=1), np.finfo(float).tiny)
        best = light @ value / norm
        return np.maximum(best, 1e-3 * np.linalg.norm(value) / np.sqrt(norm))  # light is never negative


@dataclass(frozen=True)
class Minimum(solver.Solution):
    """End of a descent; `others` other minima that a search found, the lowest first."""

    others: tuple[Minimum, ...] = ()

    @property
    def point(self) -> Floats:
        """Coordinates (p,): those of `model`, and after them what else a problem leaves open."""
        return self.parameters

    @property
    def at_edge(self) -> bool:
        """True where the best albedo is 0 or 1: it has no standard error, only a one-sided limit."""
        return self.result in (AT_WHITE, AT_BLACK)


def best_apart(places: Floats, costs: Floats) -> list[int]:
    """Return the rows of a coarse search where descents start: the cheapest, no two of them neighbours.

    Args:
        places: (m, 2) whole numbers, where each row lies in the search's grid.
        costs: (m,) chi-square of each.
    """
    chosen: list[int] = []
    for at in np.argsort(costs):
        if all(np.max(np.abs(places[at] - places[other])) > 1 for other in chosen):
            chosen.append(int(at))
    return chosen[:STARTS]


def minimised(problem: Problem) -> Minimum:
    """The lowest of the minima that several starts lead to, and the others."""
    return lowest(descended(problem, start, problem.spec.free) for start in problem.starts)


def lowest(ends: Iterable[Minimum]) -> Minimum:
    """Return the end of lowest chi-square, converged or not, with the other minima."""
    first, *others = sorted(ends, key=lambda one: (not np.isfinite(one.cost), one.cost))
    apart: list[Minimum] = []
    for one in others:
        if np.isfinite(one.cost) and all(are_apart(one, other) for other in (first, *apart)):
            apart.append(one)
    return replace(first, others=tuple(apart))


def are_apart(one: Minimum, other: Minimum) -> bool:
    """Whether two ends of descents are two minima: their coordinates differ by more than a search leaves open."""
    return bool(np.max(np.abs(one.point - other.point)[: len(NAMES)]) > APART)


def likelihood(rise: Floats, free: int, pooled: float) -> Floats:
    """ln likelihood (m,) where chi-square has risen by `rise` (m,): normal, or Student's in `free` coordinates."""
    if np.isinf(pooled):
        return -0.5 * rise
    return -0.5 * (pooled + free) * np.log1p(np.maximum(rise, 0.0) / pooled)


def log_prior(u: Floats) -> Floats:
    """ln ds/du (m,): what is flat in s = sqrt(1 - alpha)."""
    found: Floats = -np.logaddexp(0.0, u) - np.logaddexp(0.0, -u)
    return found


def descended(problem: Problem, start: Floats, free: tuple[int, ...]) -> Minimum:
    """The minimum below `start` (3,) in the coordinates `free`; the others stay."""
    (low, high), held = problem.bounds(start), np.setdiff1d(range(len(NAMES)), free)
    low[held] = high[held] = start[held]

    def at(point: Floats) -> tuple[Floats, Floats]:
        rows, slopes = problem.residuals(point)
        return (rows if _usable(rows, slopes) else np.full(rows.shape, np.nan)), slopes

    done = solver.solve(at, np.clip(start, low, high), (low, high), tolerance=TOLERANCE, gain=GAIN, most=MAX_STEPS)
    edge = EDGE * (high - low)
    ran = (done.parameters <= low + edge) | (done.parameters >= high - edge)
    return Minimum(**vars(replace(done, result=_explained(done, free, [at for at in free if ran[at]]))))


def descended_from(problem: Problem, start: Floats) -> Minimum:
    """The minimum below `start` (3,) of another spec: what is held is where this one has it."""
    point, free = problem.spec.base, problem.spec.free
    point[list(free)] = start[list(free)]
    return descended(problem, point, free)


def _usable(rows: Floats, slopes: Floats) -> bool:
    """True where sums of squares of residuals and derivatives are floats."""
    with np.errstate(over="ignore", invalid="ignore"):
        return bool(np.isfinite(np.sum(rows**2) + np.sum(slopes**2)))


def _is_white(done: solver.Solution) -> bool:
    """Whether alpha and 1 fit alike: residuals are linear in s = e^u there, and move by `UNSEEN` at most on the way."""
    return bool(done.parameters[U] < 0 and np.linalg.norm(done.jacobian[:, U]) < UNSEEN)


def _explained(done: solver.Solution, free: tuple[int, ...], ran: list[int]) -> str:
    """Verdict on a descent; `ran` the coordinates at the end of their range."""
    if done.result == solver.NOT_FINITE:
        return NOT_FINITE
    if LENGTH in ran:
        return RAN_AWAY
    if U in free and (done.parameters[U] < WHITE or _is_white(done)):
        return AT_WHITE
    if U in free and done.parameters[U] > BLACK:  # there a lower albedo and a larger scale are equivalent
        return AT_BLACK
    if SCALE in ran:
        return RAN_AWAY
    if not np.all(np.any(done.jacobian[:, free] != 0, axis=0)):
        return "the predicted profile does not depend on what is free there: check the unit and what is held"
    if done.steps >= MAX_STEPS:
        return f"no convergence in {MAX_STEPS} steps: hold one of alpha, l and scale, or measure over a wider range"
    return solver.CONVERGED if done.converged else RAN_AWAY
