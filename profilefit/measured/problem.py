"""Data, and what is fitted to them, as residuals in the three coordinates of `model`; descents to their minima.

A failure is a result: `Solution.result` is "converged" or says what happened and what to try.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.fitting import solver
from profilefit.fitting.solver import Solution, best_apart, lowest
from profilefit.measured.data import Measured
from profilefit.measured.instrument import PENCIL, Gaussian, Instrument
from profilefit.measured.model import EXACT, LENGTH, NAMES, SCALE, Light, Model, U, light_at_hand, u_of
from profilefit.measured.noise import Noise, Origin
from profilefit.measured.oblique import Oblique

Floats = NDArray[np.float64]
MEDIUM = ("n", "g")
LEAST, MOST = 1e-9, 1.0 - 1e-9  # albedos that can be held
# Far below any error that data leave a coordinate, well above what rounding of the profile does to it.
TOLERANCE = 1e-9
GAIN = 1e-8  # of chi-square, below which no further step is worth taking
MAX_STEPS = 1000  # along a ridge, where alpha and scale run away together, hundreds are taken
# Albedos and lengths where the search begins; lengths from a twentieth of the first radius to twice the last.
ALBEDOS = (0.02, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98, 0.99, 0.997, 0.999, 0.9999)
LENGTHS, SHORTEST, LONGEST = 20, 1 / 20, 2.0
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
class Known:
    """A number with its standard error."""

    value: float
    error: float


@dataclass(frozen=True)
class FitSpec:
    """Specification of a fit of the albedo, the transport mean free path and the scale of the values.

    law     exact light, or a law with its constants; instrument the beam, and what a row is averaged over
    held    what stays where it is, by name: alpha or A, l, scale, as values (not logarithms)
    total   the total reflectance A [-], if that was measured as well; scale known to within an error; oblique the
            centre of light that fell in aslant
    ranges  (low, high) of what is known no better: n, g, a Gaussian beam's 1/e^2 radius; assumed those of n and g that
            nobody named
    source  the record that the law's constants came from, which states the law's error
    name, constants  of the law; notes for the reader, beside those of the data
    """

    law: Light
    held: dict[str, float] = field(default_factory=dict)
    total: Known | None = None
    scale: Known | None = None
    oblique: Oblique | None = None
    instrument: Instrument = PENCIL
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()
    source: Origin | None = None
    name: str = EXACT
    constants: str = "regenerated"
    notes: tuple[str, ...] = ()

    @property
    def free(self) -> tuple[int, ...]:
        """Places of the coordinates that move, of the three."""
        held = {"alpha" if name == "A" else name for name in self.held}
        return tuple(at for at, name in enumerate(NAMES) if name not in held)

    @property
    def base(self) -> Floats:
        """Held coordinates (3,); 0 for free ones."""
        point = np.zeros(len(NAMES))
        for name, value in self.held.items():
            if name in ("alpha", "A"):
                point[U] = u_of(held_albedo(self.law, name, value))
            else:
                point[NAMES.index(name)] = np.log(value)
        return point

    def under(self, values: Mapping[str, float]) -> FitSpec:
        """Return the spec where those of the ranges have these values."""
        setting = Setting.of(self.law.setting.as_table() | {name: values[name] for name in MEDIUM if name in values})
        seen = replace(self.instrument, beam=Gaussian(values["beam"])) if "beam" in values else self.instrument
        return replace(self, law=self.law if setting == self.law.setting else light_at_hand(setting), instrument=seen)


def held_albedo(law: Light, name: str, value: float) -> float:
    """Return the albedo at which `alpha` or `A` is `value`; InputError where the law has none."""
    if name == "alpha":
        if not LEAST <= value <= MOST:
            raise InputError(f"held alpha must be a single-scattering albedo in (0, 1), got {value:g}")
        return value

    def total(alpha: float) -> float:
        with jax.enable_x64(True), np.errstate(all="ignore"):
            return float(law.total(jnp.float64(alpha)))

    low, high = (total(end) for end in (LEAST, MOST))
    if not low <= value <= high:
        raise InputError(
            f"held A must be a total reflectance in [{low:.3g}, {high:.5g}] of this light and surface, got {value:g}"
        )
    return float(brentq(lambda alpha: total(alpha) - value, LEAST, MOST, xtol=1e-14))


@dataclass(frozen=True)
class Problem:
    """Data and a spec, as residuals; `noise` weighs the rows: the errors of the data or better."""

    data: Measured
    spec: FitSpec
    noise: Noise

    @cached_property
    def model(self) -> Model:
        return Model(self.spec.law, self.spec.instrument)

    def residuals(self, point: Floats) -> tuple[Floats, Floats]:
        """Return residuals in standard errors (m,), the n rows first, then what else is known; derivatives (m, 3)."""
        light, slope = self.model.linearised(point, self.data.inner, self.data.outer)
        rows, slopes = self.noise.whitened(light[:-1] - self.data.value), self.noise.whitened(slope[:-1])
        for also, by_point in self._also_known(point[None], light[-1:], slope[-1:]):
            rows, slopes = np.append(rows, also), np.vstack([slopes, by_point])
        return rows, slopes

    def costs(self, points: Floats) -> Floats:
        """Return sums of squared residuals (m,) at points (m, 3)."""
        light = self.model.predicted(points, self.data.inner, self.data.outer)
        with np.errstate(over="ignore", invalid="ignore"):  # what is not finite is no start
            cost = np.sum(self.noise.whitened((light[:, :-1] - self.data.value).T) ** 2, axis=0)
        for also, _ in self._also_known(points, light[:, -1], np.zeros(points.shape)):
            cost += also**2
        return cost

    def _also_known(self, points: Floats, total: Floats, slope: Floats) -> Iterator[tuple[Floats, Floats]]:
        """Yield residuals (m,) and derivatives (m, 3) of what is known beside the rows, at points (m, 3).

        Args:
            points: (m, 3) coordinates.
            total: (m,) total reflectance A at the points [-].
            slope: (m, 3) derivatives of the total reflectance by the coordinates.
        """
        spec = self.spec
        if (known := spec.total) is not None:
            yield (total - known.value) / known.error, slope / known.error
        if (known := spec.scale) is not None:
            scale = np.exp(points[:, SCALE])
            yield (scale - known.value) / known.error, (scale / known.error)[:, None] * np.eye(len(NAMES))[SCALE]
        if spec.oblique is not None:
            yield spec.oblique.residuals(spec.law.setting, points)

    def under(self, values: Mapping[str, float]) -> Problem:
        """Return the problem where those of the spec's ranges have these values."""
        return replace(self, spec=self.spec.under(values))

    @property
    def lengths(self) -> tuple[float, float]:
        """Range of ln l where the search begins."""
        return float(np.log(self.data.r[0] * SHORTEST)), float(np.log(self.data.r[-1] * LONGEST))

    def bounds(self, start: Floats) -> tuple[Floats, Floats]:
        """Return the lowest and highest (3,) coordinates of a descent from `start` (3,)."""
        shortest, longest = self.lengths
        far = FARTHEST_LN + longest - shortest
        low = np.array([-FARTHEST_U, shortest - FARTHEST_LN, start[SCALE] - far])
        return low, np.array([FARTHEST_U, longest + FARTHEST_LN, start[SCALE] + far])

    @cached_property
    def starts(self) -> Floats:
        """Best points (k, 3) of a coarse search, no two neighbours."""
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
        """Return the scale that fits best at each point, by linear least squares (m,)."""
        light = self.noise.whitened(self.model.predicted(points, self.data.inner, self.data.outer)[:, :-1].T).T
        value = self.noise.whitened(self.data.value)
        norm = np.maximum(np.sum(light**2, axis=1), np.finfo(float).tiny)
        best = light @ value / norm
        return np.maximum(best, 1e-3 * np.linalg.norm(value) / np.sqrt(norm))  # light is never negative


def minimised(problem: Problem) -> Solution:
    """Return the lowest of the minima that several starts lead to, with the others."""
    return lowest(descended(problem, start, problem.spec.free) for start in problem.starts)


def log_prior(u: Floats) -> Floats:
    """Return ln ds/du (m,), the prior of u that is flat in s = sqrt(1 - alpha)."""
    return np.asarray(-np.logaddexp(0.0, u) - np.logaddexp(0.0, -u), float)


def descended(problem: Problem, start: Floats, free: tuple[int, ...]) -> Solution:
    """Return the minimum below `start` (3,) in the coordinates `free`; the others stay."""
    (low, high), held = problem.bounds(start), np.setdiff1d(range(len(NAMES)), free)
    low[held] = high[held] = start[held]

    def at(point: Floats) -> tuple[Floats, Floats]:
        rows, slopes = problem.residuals(point)
        with np.errstate(over="ignore", invalid="ignore"):  # sums of squares are floats, or the step is taken back
            usable = bool(np.isfinite(np.sum(rows**2) + np.sum(slopes**2)))
        return (rows if usable else np.full(rows.shape, np.nan)), slopes

    done = solver.solve(at, np.clip(start, low, high), (low, high), tolerance=TOLERANCE, gain=GAIN, most=MAX_STEPS)
    edge = EDGE * (high - low)
    ran = (done.parameters <= low + edge) | (done.parameters >= high - edge)
    return replace(done, result=_explained(done, free, [at for at in free if ran[at]]))


def descended_from(problem: Problem, start: Floats) -> Solution:
    """Return the minimum below `start` (3,) of another spec: what is held is where this one has it."""
    point, free = problem.spec.base, problem.spec.free
    point[list(free)] = start[list(free)]
    return descended(problem, point, free)


def _explained(done: Solution, free: tuple[int, ...], ran: list[int]) -> str:
    """Return the verdict on a descent; `ran` are the coordinates at the end of their range."""
    if done.result == solver.NOT_FINITE:
        return NOT_FINITE
    if LENGTH in ran:
        return RAN_AWAY
    # Residuals are linear in s = e^u there: alpha and 1 fit alike where they move by `UNSEEN` at most on the way.
    end = done.parameters[U]
    if U in free and (end < WHITE or (end < 0 and np.linalg.norm(done.jacobian[:, U]) < UNSEEN)):
        return AT_WHITE
    if U in free and end > BLACK:  # there a lower albedo and a larger scale are equivalent
        return AT_BLACK
    if SCALE in ran:
        return RAN_AWAY
    if not np.all(np.any(done.jacobian[:, free] != 0, axis=0)):
        return "the predicted profile does not depend on what is free there: check the unit and what is held"
    if done.steps >= MAX_STEPS:
        return f"no convergence in {MAX_STEPS} steps: hold one of alpha, l and scale, or measure over a wider range"
    return solver.CONVERGED if done.converged else RAN_AWAY


def is_at_edge(end: Solution) -> bool:
    """Return whether the best albedo is 0 or 1: it has no standard error, only a one-sided limit."""
    return end.result in (AT_WHITE, AT_BLACK)


def finite_cost(end: Solution) -> float:
    """Return chi-square, infinite where it is no number."""
    return end.cost if np.isfinite(end.cost) else np.inf
