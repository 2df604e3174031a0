"""Nonlinear least squares and minimisation by optimistix: parameters scaled, bounds kept, in float64.

Residuals and Jacobian are evaluated here, by one small compiled program per model and shape of data, or by any numpy
function. Levenberg and Marquardt's method needs only their triangular factor: the QR factor of the matrix (J, r) has
the same products J'J, J'r and r'r. `optimistix.LevenbergMarquardt` therefore steps on a problem of p + 1 rows, through
its interface for interactive solves, which compiles once per size of p, whatever the model and the data.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
from jax import Array
from numpy.typing import ArrayLike, NDArray

from mcml_sim.exact.compiled import filter_jit, jit
from mcml_sim.media.arrays import Floats

Bounds = tuple[Floats | float, Floats | float]
Linearised = Callable[[Floats], tuple[Floats, Floats]]
CONVERGED = "converged"
# Far below any error of a constant, far above what float64 residuals of a few thousand bins resolve.
RELATIVE_TOLERANCE = 1e-10
MAX_STEPS = 300
NOT_FINITE = "the residual is not finite there: start nearer to the data, or narrow the range of alpha"
# Steps that shrink because every longer one leaves the law's domain also look converged; at an optimum the residuals
# are orthogonal to what the constants can do, unless there is no misfit but rounding.
STALLED, NO_MISFIT = 0.03, 1e-8
# Where the residuals are orthogonal to rounding, steps that no longer shrink are rounding too.
ORTHOGONAL = 1e-7
# A step that promises less than this of the sum of squares is lost in rounding, one after a step that was taken back
# sooner: whether it gains anything cannot be seen.
ROUNDING, UNSEEN = 0.25 * np.finfo(float).eps, 8.0 * np.finfo(float).eps
# `solve` decides when it ends. Damping falls to a fifth after each step that gains three quarters of what it promised:
# optimistix's own 99 hundredths creep along curved valleys, such as those of sums of Gaussians, and beside bounds.
SOLVER: Any = eqx.tree_at(
    lambda solver: (solver.search.high_cutoff, solver.search.high_constant),
    optx.LevenbergMarquardt(0.0, 0.0, linear_solver=lx.QR()),
    (0.75, 5.0),
)
MINIMISER: Any = optx.BFGS(0.0, 0.0)
# Length of the Jacobian's longest column, by the unit of the residuals: damping, which begins at 1, is its square times
# 1e-2 (Madsen, Nielsen, Tingleff, Methods for Non-Linear Least Squares, 3.14).
COLUMN = 10.0
STRAIGHT = 0.01  # cosine of the angle y that stands for a bounded parameter: below it, the parameter is at its bound
SIZES = (4, 8, 16, 32, 64, 128)  # of a compiled step: fewer parameters are filled up with some that move nothing
OPTIONS = {"jac": "bwd"}  # optimistix keeps the Jacobian as an array, not as a program
NO_TAGS: frozenset[object] = frozenset()
APART = 0.05  # in a parameter of size 1: minima nearer to each other than that are one
STARTS = 4  # the best of a coarse search, no two neighbours, that are followed to their minimum


@dataclass(frozen=True)
class Solution:
    """End of a least-squares search.

    parameters  (p,) the minimiser, in the caller's units
    residuals   (n,) there; jacobian (n, p) d residual / d parameter; steps how often these were evaluated
    result      "converged", or what failed and what to try next
    at_bound    (p,) True for each parameter that a bound holds
    others      other minima that a search from several starts found, the lowest first
    """

    parameters: Floats
    residuals: Floats
    jacobian: Floats
    steps: int
    result: str
    at_bound: NDArray[np.bool_] | None = None
    others: tuple[Solution, ...] = ()

    @property
    def converged(self) -> bool:
        return self.result == CONVERGED

    @property
    def cost(self) -> float:
        """Sum of squared residuals; infinite or NaN where they are."""
        return _squares(self.residuals)

    @property
    def covariance(self) -> Floats:
        """Covariance (J'J)^-1 (p, p) for residuals in standard errors; times `variance` for others."""
        return covariance(self.jacobian)

    @property
    def variance(self) -> float:
        """Sum of squared residuals per degree of freedom; residuals of exactly 0 do not count."""
        return self.cost / max(int(np.count_nonzero(self.residuals)) - self.parameters.size, 1)

    @property
    def condition_number(self) -> float:
        """Condition number of the Jacobian, columns of unit length: above 1e7 constants trade against each other."""
        if not np.all(np.isfinite(self.jacobian)):
            return float("inf")
        return float(np.linalg.cond(unit_columns(self.jacobian)))


def _squares(values: Floats) -> float:
    with np.errstate(over="ignore", invalid="ignore"):
        return float(values @ values)


def covariance(jacobian: Floats) -> Floats:
    """Return (J'J)^-1 (p, p) of derivatives (n, p) of residuals in standard errors; infinite where one is not finite.

    By singular values of J, columns of unit length: products would lose half of the digits. Directions beyond rounding
    get the error of rounding.
    """
    if not np.all(np.isfinite(jacobian)):
        return np.full((jacobian.shape[1],) * 2, np.inf)
    size = np.linalg.norm(jacobian, axis=0)
    size = np.maximum(size, np.finfo(float).tiny ** 0.25)
    _, singular, ways = np.linalg.svd(jacobian / size, full_matrices=False)
    scaled = ways / np.maximum(singular, np.finfo(float).eps * singular[0])[:, None]
    return np.asarray((scaled.T @ scaled) / np.outer(size, size), float)


def least_squares(
    residual: Callable[..., Any],
    start: ArrayLike,
    data: object = None,
    bounds: Bounds | None = None,
    worth: float = ROUNDING,
    scale: ArrayLike | None = None,
) -> Solution:
    """Minimise |residual(parameters, data)|^2.

    Args:
        residual: function of jax arrays, (p,) and a pytree, that returns residuals: (n,), a tuple of such, or
            of tables (m, k). XLA would compute what parts share for each row anew if a program joined them.
        start: (p,) parameters to start from, in the caller's units.
        data: any pytree of arrays.
        bounds: as of `solve`, and so are worth and scale.
        worth: share of the sum of squares that a step must promise.
        scale: (p,) size of each parameter.
    """
    with jax.enable_x64(True):
        arrays = jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf)), data)  # a float would be another type

        def at(parameters: Floats) -> tuple[Floats, Floats]:
            values, jacobian = _linearise(residual, parameters, arrays)
            rows = 0 if np.ndim(values[0]) < 2 else 1
            return _joined(values, rows).ravel(), _joined(jacobian, rows).reshape(-1, parameters.size)

        return solve(at, np.asarray(start, np.float64), bounds, worth=worth, scale=scale)


def solve_batch(
    residual: Callable[..., Any],
    starts: ArrayLike,
    data: object = None,
    worth: float = ROUNDING,
    scales: ArrayLike | None = None,
) -> tuple[Solution, ...]:
    """Solve m problems of one shape: `starts` (m, p), `scales` too, every leaf of `data` with a leading axis m.

    One after the other: one program serves them all and `least_squares` too, and none waits for the slowest.
    """
    begins, leaves = np.asarray(starts, np.float64), jax.tree.map(np.asarray, data)
    solutions = []
    for row, begin in enumerate(begins):
        item = jax.tree.map(lambda leaf, row=row: leaf[row], leaves)
        scale = None if scales is None else np.asarray(scales)[row]
        solutions.append(least_squares(residual, begin, item, worth=worth, scale=scale))
    return tuple(solutions)


def best_apart(costs: Floats) -> list[int]:
    """Return where descents start, of a coarse search on a grid (m, k), counted row by row: no two are neighbours."""
    places = np.indices(costs.shape).reshape(2, -1).T
    chosen: list[int] = []
    for at in np.argsort(costs, axis=None):
        if all(np.max(np.abs(places[at] - places[other])) > 1 for other in chosen):
            chosen.append(int(at))
    return chosen[:STARTS]


def lowest(ends: Iterable[Solution], compared: int | None = None) -> Solution:
    """Return the solution of lowest cost, converged or not, with the other minima; `compared` as of `are_apart`."""
    first, *others = sorted(ends, key=lambda one: (not np.isfinite(one.cost), one.cost))
    apart: list[Solution] = []
    for one in others:
        if np.isfinite(one.cost) and all(are_apart(one, other, compared) for other in (first, *apart)):
            apart.append(one)
    return replace(first, others=tuple(apart))


def are_apart(first: Solution, other: Solution, compared: int | None = None) -> bool:
    """Return whether two solutions are two minima: one of the first `compared` parameters differs by over `APART`."""
    return bool(np.max(np.abs(first.parameters - other.parameters)[:compared]) > APART)


@filter_jit
def _linearise(residual, parameters, data):
    return residual(parameters, data), jax.jacfwd(residual)(parameters, data)


def _joined(parts: Array | tuple[Array, ...], axis: int) -> Floats:
    return np.concatenate([np.asarray(part) for part in parts], axis) if isinstance(parts, tuple) else np.asarray(parts)


def differences(
    residual: Callable[[Floats], Floats], step: float | Floats, highest: Floats | float = np.inf
) -> Linearised:
    """Return residuals and their Jacobian by forward differences of `step`, backward where that passes `highest`."""

    def at(x: Floats) -> tuple[Floats, Floats]:
        here, ways = residual(x), np.broadcast_to(np.where(x + step > highest, -step, step), x.shape)
        columns = [(residual(x + way) - here) / way.sum() for way in np.diag(ways)]
        return here, np.stack(columns, axis=1)

    return at


def with_curvature(values: Floats, jacobian: Floats, hessian: Floats) -> tuple[Floats, Floats]:
    """Return residuals (p + 1,) and a Jacobian with the same sum of squares and slope, whose J'J is the Hessian (p, p).

    Where residuals stay large, J'J alone lacks their curvature, and steps creep. The given ones are returned where the
    Hessian is not positive, or promises to gain more than there is.
    """
    if not (np.all(np.isfinite(hessian)) and np.all(np.diag(hessian) > 0)):
        return values, jacobian
    scale = np.sqrt(np.diag(hessian))
    try:
        root = np.linalg.cholesky(hessian / np.outer(scale, scale))
    except np.linalg.LinAlgError:
        return values, jacobian
    top = np.asarray(np.linalg.solve(root, jacobian.T @ values / scale), float)
    rest = _squares(values) - _squares(top)
    if not rest >= 0:
        return values, jacobian
    return np.append(top, np.sqrt(rest)), np.vstack([root.T * scale, np.zeros(scale.size)])


def solve(
    at: Linearised,
    start: Floats,
    bounds: Bounds | None = None,
    *,
    scale: ArrayLike | None = None,
    rescaled: bool = False,
    tolerance: float = RELATIVE_TOLERANCE,
    gain: float = 0.0,
    worth: float = ROUNDING,
    longest: ArrayLike = np.inf,
    most: int = MAX_STEPS,
) -> Solution:
    """Minimise the sum of squares of residuals that `at` returns with their Jacobian, (n,) and (n, p), for (p,).

    Args:
        at: residuals and Jacobian; either may be not finite, and then the step is taken back.
        start: (p,) parameters to start from, inside the bounds.
        bounds: lowest and highest parameters; None for none.
        scale: (p,) size of each parameter; by default that with which its column of the Jacobian at the start has
            length 1.
        rescaled: scale parameters by their columns at each point that is accepted: where slopes change by decades.
        tolerance: relative size of a step at which the search ends.
        gain: reduction of the sum of squares that a step must promise for the search to go on.
        worth: the same as a share of the sum of squares.
        longest: (p,) longest step of each parameter.
        most: number of evaluations after which the search gives up.
    """
    low, high = np.broadcast_arrays(*(np.asarray(end, float) for end in bounds or (-np.inf, np.inf)), start)[:2]
    values, jacobian = at(start)
    if not (np.all(np.isfinite(values)) and np.all(np.isfinite(jacobian))):
        return Solution(start, values, jacobian, 1, NOT_FINITE, np.zeros(start.size, bool))
    sizes = np.linalg.norm(jacobian, axis=0)
    scale = 1.0 / np.where(sizes > 0, sizes, 1.0) if scale is None else np.asarray(scale, float)
    unit = COLUMN / (float(np.max(sizes * scale, initial=0.0)) or 1.0)
    ends, reach = (low / scale, high / scale), np.asarray(longest, float) / scale
    y, proposed, point, state, steps = start / scale, start / scale, start, None, 1
    while True:
        slope = _held(values, _scaled(jacobian, scale), proposed, ends)
        here, aimed, damping, state, *factor = _stepped(proposed, values, slope, unit, state, y)
        taken = steps == 1 or not np.array_equal(here, y)
        if taken:
            y, best = here, (point, values, jacobian)
            if rescaled and steps > 1:
                # Begun anew where each column of the Jacobian has its length here, with the damping that was reached.
                sizes, unit = np.linalg.norm(jacobian, axis=0), unit / np.sqrt(damping)
                scale = np.where(sizes > 0, 1.0 / np.where(sizes > 0, sizes, 1.0), scale)
                y, ends, reach = point / scale, (low / scale, high / scale), np.asarray(longest, float) / scale
                slope = _held(values, _scaled(jacobian, scale), y, ends)
                _, aimed, damping, state, *factor = _stepped(y, values, slope, unit, None, y)
            top, triangle = factor  # stand for values and slope: the same products of columns
        room = np.maximum(ends[0] - y, -reach), np.minimum(ends[1] - y, reach)
        step = _within(room, aimed - y, damping, top, triangle)
        proposed = np.clip(y + step, *ends)
        ended = bool(np.linalg.norm(proposed - y) <= tolerance * (tolerance + np.linalg.norm(y)))
        least = max(gain, (worth if taken else max(worth, UNSEEN)) * _squares(best[1]))
        if ended or steps >= most:
            break
        change = triangle @ (aimed - y)  # of the residuals, by the linear model
        if -float(change @ (2.0 * top + change)) < least * unit**2:
            break
        point = np.clip(proposed * scale, low, high)
        values, jacobian = at(point)
        steps += 1
    settled = ended or steps < most
    if not (ended or taken or gain) and settled:  # a step too small for the sum is none too small for parameters
        point = np.clip(proposed * scale, low, high)
        values, jacobian = at(point)
        if _squares(values) <= (1.0 + UNSEEN) * _squares(best[1]):
            best = (point, values, jacobian)
        steps += 1
    active = _active(best[1], best[2] * scale, proposed, ends)  # where the last step ends: beside a bound it is no step
    # A parameter that gains nothing within its longest step has no slope but rounding.
    uphill = 2.0 * np.abs(best[2].T @ best[1])
    counts = ~active & (np.multiply(uphill, longest, out=np.zeros(start.size), where=uphill > 0) > gain)
    result = _explain(settled, most, best[1], best[2][:, counts], gain)
    return Solution(*best, steps, result, active)


def _within(room: tuple[Floats, Floats], step: Floats, damping: float, values: Floats, slope: Floats) -> Floats:
    """Return a damped step (p,) within bounds: parameters that pass one end there, and the others follow."""
    free = np.ones(step.size, bool)
    while np.any(out := free & ((step < room[0]) | (step > room[1]))):
        step, free = np.clip(step, *room), free & ~out
        damped = np.vstack([slope, np.sqrt(damping) * np.eye(step.size)])
        left = np.append(values, np.zeros(step.size)) + damped[:, ~free] @ step[~free]
        step[free] = -np.linalg.lstsq(damped[:, free], left)[0]
    return step


def _active(values: Floats, jacobian: Floats, y: Floats, ends: tuple[Floats, Floats]) -> NDArray[np.bool_]:
    """Return whether each parameter (p,) is at a bound that descent would pass."""
    with np.errstate(over="ignore", invalid="ignore"):  # a point that is no answer may be far out
        uphill = jacobian.T @ values
    return ((y <= ends[0]) & (uphill > 0)) | ((y >= ends[1]) & (uphill < 0))


def _scaled(numbers: Floats, scale: Floats | float) -> Floats:
    """Multiply without a warning: the numbers of a failed point may overflow, and its step is taken back."""
    with np.errstate(over="ignore", invalid="ignore"):
        return numbers * scale


def _held(values: Floats, jacobian: Floats, y: Floats, ends: tuple[Floats, Floats]) -> Floats:
    """Return the Jacobian without what would move parameters beyond bounds (Bertsekas, SIAM J. Control Optim. 20)."""
    active = _active(values, jacobian, y, ends)
    return np.where(active, 0.0, jacobian) if np.any(active) else jacobian


class _Tangent(eqx.Module):
    """Value and slope at a point (p,), as the function that optimistix evaluates at that point only."""

    at: Array
    value: Array
    slope: Array

    def __call__(self, y, args):
        return self.value + self.slope @ (y - self.at), None


@lru_cache
def _step(solver: Any, size: int, rows: tuple[int, ...]) -> tuple[Callable[..., Any], list[Array]]:
    """Compile the step of a solver, which accepts or takes back a point and proposes another; with its first state."""
    y, value = jnp.zeros(size), jnp.zeros(rows)
    tangent = _Tangent(y, value, jnp.zeros((*rows, size)))
    blank = solver.init(tangent, y, None, OPTIONS, jax.eval_shape(lambda: value), None, NO_TAGS)
    leaves, tree = jax.tree.flatten(blank)

    @jit
    def step(at, value, slope, leaves, y):
        state = replace(jax.tree.unflatten(tree, leaves), y_eval=at)
        y, state, _ = solver.step(_Tangent(at, value, slope), y, None, OPTIONS, state, NO_TAGS)
        return y, state.y_eval, 1.0 / state.search_state.step_size, jax.tree.leaves(state)

    return step, leaves


def _advanced(solver: Any, at: Floats, value: Floats, slope: Floats, state: Any, y: Floats) -> tuple[Any, ...]:
    """Return the point (p,) after value and slope at `at`, the next proposal (p,), its damping, and the state."""
    with jax.enable_x64(True):
        step, first = _step(solver, y.size, value.shape)
        here, proposed, damping, state = step(at, value, slope, first if state is None else state, y)
    return np.asarray(here), np.asarray(proposed), float(damping), state


def _stepped(at: Floats, values: Floats, slope: Floats, unit: float, state: Any, y: Floats) -> tuple[Any, ...]:
    """Advance least squares by the triangular factor, filled up to one of `SIZES`; return it after `_advanced`'s."""
    count, size = y.size, next((size for size in SIZES if size >= y.size), y.size)
    triangle = np.zeros((size + 1, size + 1))
    rows = _scaled(np.column_stack([slope, values]), unit)
    if np.all(np.isfinite(rows)):
        with np.errstate(over="ignore", invalid="ignore"):
            factor = np.linalg.qr(rows[np.any(rows, axis=1)], mode="r")  # residuals that do not count are 0
        triangle[: len(factor), [*range(count), size]] = factor
    else:
        triangle[:, size] = np.nan
    more = (0, size - count)
    at, y = np.pad(at, more), np.pad(y, more)
    here, aimed, damping, state = _advanced(SOLVER, at, triangle[:, size], triangle[:, :size], state, y)
    return here[:count], aimed[:count], damping, state, triangle[:, size], triangle[:, :count]


def _explain(ended: bool, most: int, values: Floats, jacobian: Floats, gain: float) -> str:
    # The largest cosine between the residuals and a column of the Jacobian is 0 at an optimum.
    steepness = float(np.max(np.abs(unit_columns(jacobian).T @ unit_columns(values)), initial=0.0))
    size = float(np.linalg.norm(values))
    if not ended and steepness > ORTHOGONAL:
        return f"no convergence in {most} steps: constants trade against each other; fix one or widen the range"
    if steepness > STALLED and size > NO_MISFIT and (steepness * size) ** 2 > gain:
        return "stalled beside an optimum, at the edge of where the law is defined: start elsewhere"
    return CONVERGED


def unit_columns(columns: Floats) -> Floats:
    """Return columns of length 1, or 0; by the largest number first, since squares of small ones would be 0."""
    for size in (lambda c: np.max(np.abs(c), axis=0), lambda c: np.linalg.norm(c, axis=0)):
        columns = columns / np.where(size(columns) > 0, size(columns), 1.0)
    return columns


def minimise(
    at: Callable[[Floats], tuple[float, Floats]], start: Floats, bounds: Bounds, tolerance: float, most: int
) -> tuple[Floats, float, bool]:
    """Minimise a function by `optimistix.BFGS`, between finite bounds by x = middle + half sin y.

    Args:
        at: value and gradient (p,) for (p,).
        start: (p,) point to start from.
        bounds: lowest and highest points, all finite.
        tolerance: size of every derivative by x, times cos y, at which the search ends.
        most: number of evaluations after which the search gives up.

    Returns:
        The minimiser (p,), exactly on a bound that holds it; the value there; whether the search converged.
    """
    low, high = (np.asarray(end, float) for end in bounds)
    middle, half = 0.5 * (low + high), 0.5 * (high - low)

    def evaluated(y: Floats) -> tuple[Floats, float, Floats]:
        value, gradient = at(middle + half * np.sin(y))
        return y, value, gradient * half * np.cos(y)

    reach = np.where(half > 0, half, 1.0)
    best = last = evaluated(np.arcsin(np.clip((start - middle) / reach, -1.0, 1.0)))
    unit = max(float(np.max(np.abs(last[2]))), 1.0)  # the first step is the gradient: of length 1 at most
    state = None
    for _ in range(most):
        value = np.asarray(last[1] / unit)
        here, aimed, _, state = _advanced(MINIMISER, last[0], value, last[2] / unit, state, best[0])
        best = last if np.array_equal(here, last[0]) else best
        if converged := bool(np.max(np.abs(best[2]) / reach) <= tolerance):
            break
        last = evaluated(aimed)
    y = best[0]
    x = np.where(np.abs(np.cos(y)) < STRAIGHT, np.where(np.sin(y) > 0, high, low), middle + half * np.sin(y))
    return x, best[1], converged
