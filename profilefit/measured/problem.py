"""Data, and what is fitted to them, as residuals in the three coordinates of `model`; descents to their minima.

A failure is a result: `Solution.result` is "converged" or says what happened and what to try.

What is known as a range only (n, g, the width of a beam) has a marginal posterior. The best fit within the ranges is
found from coarse nodes of them. In the box of so many standard errors about it the fit is repeated at Gauss and
Legendre's nodes; between these its coordinates, chi-square and the volume of its errors are polynomials. The posterior
is flat within the ranges and, as the chain's, in sqrt(1 - alpha), ln l and ln k: at each place these have the errors of
the fit there (Laplace).
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, reduce
from itertools import product

import jax
import jax.numpy as jnp
import numpy as np
from numpy.polynomial.legendre import leggauss, legvander
from scipy import special
from scipy.optimize import brentq

from mcml_sim.media.arrays import Floats, require
from mcml_sim.media.setting import Setting
from profilefit.fitting import solver
from profilefit.fitting.misfit import likelihood
from profilefit.fitting.solver import Solution, best_apart, differences
from profilefit.measured.data import Measured
from profilefit.measured.instrument import PENCIL, Gaussian, Instrument
from profilefit.measured.model import EXACT, LENGTH, NAMES, SCALE, Light, Model, Oblique, U, light_at_hand, u_of
from profilefit.measured.noise import Noise, Origin

Ranges = Mapping[str, tuple[float, float]]
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
NODES = {"n": 3, "g": 6, "beam": 5}
PLACES = {"n": 15, "g": 121, "beam": 61}  # between the nodes, where the polynomials are evaluated
COARSE = 3  # nodes of each range from which the search begins
STARTS, AGAIN = 4, 2  # how many of the best of these are followed, the first time and where a fit is known
LOWER = 1.0  # chi-square by which one of these must be lower than the one before
REACH = 5.0  # standard errors of a range's value to either side of the best, beyond which it is not looked for
NARROWED = 5  # times at most, until the box has no end where nothing is
STEP = 1e-3  # of a range, for derivatives
ENOUGH, RANGE_STEPS = 1e-5, 60  # of chi-square, that another step of the search must gain; of the search
DRAWS, SEED = 4000, 0


@dataclass(frozen=True)
class Known:
    """A number with its standard error."""

    value: float
    error: float


@dataclass(frozen=True)
class FitSpec:
    """Specification of a fit of the albedo, the transport mean free path and the scale of the values.

    law     exact light, or a law with its constants, their record (`source`) and names; instrument the beam and fibre
    held    what stays where it is, by name: alpha or A, l, scale, as values (not logarithms)
    total   the total reflectance A [-], if that was measured as well; scale known to within an error; oblique the
            centre of light of a beam aslant
    ranges  (low, high) of what is known no better: n, g, a Gaussian beam's 1/e^2 radius; assumed those of n and g that
            nobody named
    """

    law: Light
    held: dict[str, float] = field(default_factory=dict)
    total: Known | None = None
    scale: Known | None = None
    oblique: Oblique | None = None
    instrument: Instrument = PENCIL
    ranges: Ranges = field(default_factory=dict)
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
        """Return the spec where the ranges have these values."""
        setting = Setting.of(self.law.setting.as_table() | {name: values[name] for name in MEDIUM if name in values})
        seen = replace(self.instrument, beam=Gaussian(values["beam"])) if "beam" in values else self.instrument
        return replace(self, law=self.law if setting == self.law.setting else light_at_hand(setting), instrument=seen)


def held_albedo(law: Light, name: str, value: float) -> float:
    """Return the albedo at which `alpha` or `A` is `value`; InputError where the law has none."""
    if name == "alpha":
        require(LEAST <= value <= MOST, "held alpha", "a reduced albedo in (0, 1)", value)
        return value

    def total(alpha: float) -> float:
        with jax.enable_x64(True), np.errstate(all="ignore"):
            return float(law.total(jnp.float64(alpha)))

    low, high = (total(end) for end in (LEAST, MOST))
    accepted = f"a total reflectance in [{low:.3g}, {high:.5g}] of this light and surface"
    require(low <= value <= high, "held A", accepted, value)
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
        """Yield residuals (m,) and derivatives (m, 3) of what is known beside the rows; total and slope are A's."""
        spec = self.spec
        if (known := spec.total) is not None:
            yield (total - known.value) / known.error, slope / known.error
        if (known := spec.scale) is not None:
            scale = np.exp(points[:, SCALE])
            yield (scale - known.value) / known.error, (scale / known.error)[:, None] * np.eye(len(NAMES))[SCALE]
        if spec.oblique is not None:
            yield spec.oblique.residuals(spec.law.setting, points)

    def under(self, values: Mapping[str, float]) -> Problem:
        """Return the problem where the spec's ranges have these values."""
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
        ln_l = [held[LENGTH]] if LENGTH not in self.spec.free else np.linspace(*self.lengths, LENGTHS)
        points = np.array([[a, b, held[SCALE]] for a in u for b in ln_l])
        if SCALE in self.spec.free:
            points[:, SCALE] = np.log(self._best_scales(points))
        return points[best_apart(self.costs(points).reshape(len(u), len(ln_l)))]

    def _best_scales(self, points: Floats) -> Floats:
        """Return the scale that fits best at each point, by linear least squares (m,)."""
        light = self.noise.whitened(self.model.predicted(points, self.data.inner, self.data.outer)[:, :-1].T).T
        value = self.noise.whitened(self.data.value)
        norm = np.maximum(np.sum(light**2, axis=1), np.finfo(float).tiny)
        best = light @ value / norm
        return np.maximum(best, 1e-3 * np.linalg.norm(value) / np.sqrt(norm))  # light is never negative


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


def finite_cost(end: Solution) -> float:
    """Return chi-square, infinite where it is no number."""
    return end.cost if np.isfinite(end.cost) else np.inf


@dataclass(frozen=True)
class RangeMarginal:
    """Marginal posterior of ranges.

    mean     of each, by name, and error the standard deviation about it; there the fit at the means
    offsets  (k, 3) draws: coordinates where the ranges have other values, less those at the means
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
    """Compute the marginal posterior of ranges from a fit within them; None where the fit has no errors anywhere.

    known  values of the ranges at `start`, which may be the best
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
    there = descended_from(problem.under(means), start.parameters)
    return RangeMarginal(means, errors, there, drawn - there.parameters)


def slopes_by_ranges(problem: Problem, theta: Floats, values: Floats) -> Floats:
    """Return derivatives (m, k) of the residuals by the spec's k ranges: free coordinates (p,), the ranges' values."""
    low, high = np.array(list(problem.spec.ranges.values())).T
    return differences(lambda moved: _residuals(problem, theta, moved)[0], STEP * (high - low), high)(values)[1]


def _residuals(problem: Problem, theta: Floats, values: Floats) -> tuple[Floats, Floats]:
    """Return residuals (m,) where the free coordinates (p,) and the ranges (k,) have these values; slopes (m, p)."""
    there = problem.under(dict(zip(problem.spec.ranges, map(float, values), strict=True)))
    point, free = there.spec.base, list(problem.spec.free)
    point[free] = theta
    rows, slopes = there.residuals(point)
    return rows, slopes[:, free]


def _fits(
    problem: Problem, names: Sequence[str], nodes: Sequence[Floats], start: Solution
) -> list[tuple[Solution, dict[str, float]]]:
    """Fit at all combinations of the nodes, from the middle (`start`) outward, each begun at the nearest converged."""
    places = np.array(list(product(*(np.linspace(-1.0, 1.0, one.size) for one in nodes))))
    values = [dict(zip(names, map(float, each), strict=True)) for each in product(*nodes)]
    fits: dict[int, Solution] = {}
    for at in map(int, np.argsort(np.sum(places**2, axis=1), kind="stable")):
        ended = [other for other, one in fits.items() if one.converged]
        nearest = min(ended, key=lambda other: float(np.sum((places[at] - places[other]) ** 2)), default=None)
        near = start if nearest is None else fits[nearest]
        fits[at] = descended_from(problem.under(values[at]), near.parameters)
    return [(fits[at], values[at]) for at in range(len(values))]


def _box(problem: Problem, start: Solution, values: dict[str, float]) -> tuple[Solution, Ranges]:
    """Find the best fit within the ranges, and the box within REACH of it; `start` is the fit under some values."""
    free, ranges = list(problem.spec.free), problem.spec.ranges
    low, high = np.array(list(ranges.values())).T

    def at(x: Floats) -> tuple[Floats, Floats]:
        theta, values = np.split(x, [len(free)])
        by_range = slopes_by_ranges(problem, theta, values)
        rows, slopes = _residuals(problem, theta, values)
        return rows, np.column_stack([slopes, by_range])

    first, last = (end[free] for end in problem.bounds(start.parameters))
    bounds = np.append(first, low), np.append(last, high)
    inside = np.clip(np.append(start.parameters[free], list(values.values())), *bounds)
    done = solver.solve(at, inside, bounds, gain=ENOUGH, most=RANGE_STEPS)
    best, errors = done.parameters[len(free) :], np.sqrt(np.diag(done.covariance))[len(free) :]
    ends = zip(np.maximum(best - REACH * errors, low), np.minimum(best + REACH * errors, high), strict=True)
    box = dict(zip(ranges, ((float(a), float(b)) for a, b in ends), strict=True))
    there = problem.under(dict(zip(ranges, map(float, best), strict=True)))
    return descended_from(there, start.parameters), box


def _narrowed(ranges: Ranges, nodes: Sequence[Floats], rise: Floats) -> Ranges:
    """Return the box up to the first nodes where chi-square has risen beyond REACH, whatever the other ranges are."""
    each, box = rise.reshape([one.size for one in nodes]), {}
    for axis, (name, (low, high)) in enumerate(ranges.items()):
        least = np.min(each, axis=tuple(at for at in range(each.ndim) if at != axis))
        near = np.flatnonzero(least < REACH**2)
        first, last = (near[0], near[-1]) if near.size else (0, least.size - 1)
        at = nodes[axis]
        box[name] = float(at[first - 1]) if first > 0 else low, float(at[last + 1]) if last + 1 < at.size else high
    return box


def _log_volumes(problem: Problem, fits: Sequence[Solution]) -> Floats:
    """Return ln of the prior's share within the errors of each fit, up to a constant; -inf where it has none.

    In s = e^u, near alpha = 1, residuals are linear and the prior is flat; what lies beyond s = 0 is cut off.
    """
    free = list(problem.spec.free)
    volumes = np.full(len(fits), -np.inf)
    for at, one in enumerate(fits):
        slopes = one.jacobian[:, free]
        sign, log = np.linalg.slogdet(slopes.T @ slopes)
        if sign > 0 and (one.converged or one.result == AT_WHITE):
            volumes[at] = -0.5 * log
            if U not in free:
                continue
            # The prior's density at the fit, times the share of its errors with alpha < 1.
            others = one.jacobian[:, [other for other in free if other != U]]
            along = one.jacobian[:, U] - others @ np.linalg.lstsq(others, one.jacobian[:, U])[0]
            size = float(np.linalg.norm(along))  # s over its error
            pull = float(along @ one.residuals) / size  # 0 at a minimum, positive at an end
            inside = float(log_prior(one.parameters[U])) + 0.5 * pull**2 + float(special.log_ndtr(size - pull))
            volumes[at] += inside
    return volumes


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
    inverse = np.linalg.inv(legvander(leggauss(nodes)[0], nodes - 1))
    return np.asarray(legvander(_middles(places), nodes - 1) @ inverse, float)
