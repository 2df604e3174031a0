"""Nonlinear least squares by Levenberg and Marquardt: parameters scaled, in float64, one problem or a batch of them.

Only residuals and their Jacobian are compiled, as one small program for each law and shape of data; the steps between
are numpy. A loop that is compiled takes as long to compile as a fit, for each number of problems anew.

A failure is a result, not an exception: `Optimum.result` is "converged" or says what happened and what to try.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike, NDArray

Floats = NDArray[np.float64]
CONVERGED = "converged"
# Far below any error of a constant, far above what float64 residuals of a few thousand bins resolve.
RELATIVE_TOLERANCE = 1e-10
MAX_STEPS = 200
# Steps that shrink because every longer one leaves the law's domain also look converged; at an optimum the residuals
# are orthogonal to what the constants can do, unless there is no misfit but rounding.
STALLED, NO_MISFIT = 0.03, 1e-8
# Where the residuals are orthogonal to rounding, steps that no longer shrink are rounding too.
ORTHOGONAL = 1e-7
# Of what a step promises to take from the cost, what it must take at least, and what makes the next one longer.
LEAST_WON, WELL_WON = 0.01, 0.99
SHRINK, GROW = 0.25, 3.5


@dataclass(frozen=True)
class Optimum:
    """Where a least-squares problem ended.

    parameters  (p,) the minimiser, in the caller's units
    residuals   (n,) there; jacobian (n, p) d residual / d parameter
    steps       Levenberg-Marquardt steps taken
    result      "converged", or what failed and what to try next
    """

    parameters: Floats
    residuals: Floats
    jacobian: Floats
    steps: int
    result: str

    @property
    def converged(self) -> bool:
        return self.result == CONVERGED

    @property
    def cost(self) -> float:
        """Sum of squared residuals."""
        return float(self.residuals @ self.residuals)

    @property
    def condition_number(self) -> float:
        """Of the Jacobian with its columns scaled to unit length: above 1e7 constants trade against each other."""
        if not np.all(np.isfinite(self.jacobian)):
            return float("inf")
        lengths = np.linalg.norm(self.jacobian, axis=0)
        return float(np.linalg.cond(self.jacobian / np.where(lengths > 0, lengths, 1.0)))


def solve(residual: Callable, start: ArrayLike, data: object = None) -> Optimum:
    """Minimise |residual(parameters, data)|^2 from `start` (p,); `data` is any pytree of arrays."""
    with jax.enable_x64(True):
        arrays = jax.tree.map(jnp.asarray, data)

        def at(parameters: Floats) -> tuple[Floats, Floats]:
            values, jacobian = _linearise(residual, parameters, arrays)
            return np.asarray(values), np.asarray(jacobian)

        return _levenberg_marquardt(at, np.asarray(start, np.float64))


def solve_batch(residual: Callable, starts: ArrayLike, data: object = None) -> tuple[Optimum, ...]:
    """Solve m problems of one shape: `starts` (m, p), every leaf of `data` with a leading axis m.

    One after the other: one program serves them all and `solve` too, and none waits for the slowest.
    """
    begins, leaves = np.asarray(starts, np.float64), jax.tree.map(np.asarray, data)
    items = (jax.tree.map(lambda leaf, row=row: leaf[row], leaves) for row in range(len(begins)))
    return tuple(solve(residual, begin, item) for begin, item in zip(begins, items, strict=True))


@eqx.filter_jit
def _linearise(residual, parameters, data):
    return residual(parameters, data), jax.jacfwd(residual)(parameters, data)


def _levenberg_marquardt(at: Callable[[Floats], tuple[Floats, Floats]], start: Floats) -> Optimum:
    """Damped Gauss-Newton steps (J^T J + 1/size) step = -J^T r, `at` the residuals r and J of constants.

    A step counts if it takes away a hundredth of what the linear problem promises; the size is that of Gould et al.
    (4OR 3, 2005). Constants span four decades, so they are scaled by their start: damping treats them alike.
    """
    scale = np.where(start == 0, 1.0, np.abs(start))
    here, size, code, steps = start / scale, 1.0, 1, 1
    values, jacobian = at(start)
    while steps < MAX_STEPS and np.all(np.isfinite(values)):
        slopes = jacobian * scale
        move = _damped(slopes, values, size)
        there, slopes_there = at((here + move) * scale)
        steps += 1
        with np.errstate(invalid="ignore", over="ignore"):  # of a step to where there is no law
            linear = values + slopes @ move
            won, promised = there @ there - values @ values, linear @ linear - values @ values  # rounded alike
        if not won <= LEAST_WON * promised:
            size *= SHRINK
            continue
        size *= GROW if won < WELL_WON * promised < 0 else 1.0
        ended = _is_small(move, here + move) and _is_small(there - values, there)
        here, values, jacobian = here + move, there, slopes_there
        if ended:
            code = 0
            break
    found = here * scale
    return Optimum(found, values, jacobian, steps, _explain(code, found, values, jacobian))


def _damped(slopes: Floats, values: Floats, size: float) -> Floats:
    """The step; none that is a number where rounding has left no system to solve, which asks for more damping."""
    try:
        return np.asarray(-np.linalg.solve(slopes.T @ slopes + np.eye(slopes.shape[1]) / size, slopes.T @ values))
    except np.linalg.LinAlgError:
        return np.full(slopes.shape[1], np.nan)


def _is_small(change: Floats, what: Floats) -> bool:
    return bool(np.all(np.abs(change) < RELATIVE_TOLERANCE * (1.0 + np.abs(what))))


def _explain(code: int, parameters: Floats, values: Floats, jacobian: Floats) -> str:
    if not np.all(np.isfinite(parameters)) or not np.all(np.isfinite(values)):
        return "the residual is not finite there: start nearer to the data, or narrow the range of alpha"
    if code and _steepness(values, jacobian) > ORTHOGONAL:
        return f"no convergence in {MAX_STEPS} steps: constants trade against each other; fix one or widen the range"
    if _steepness(values, jacobian) > STALLED:
        return "stalled beside an optimum, at the edge of where the law is defined: start elsewhere"
    return CONVERGED


def _steepness(values: Floats, jacobian: Floats) -> float:
    """The largest cosine between the residuals and a column of the Jacobian: none is left at an optimum."""
    lengths = np.linalg.norm(jacobian, axis=0) * np.linalg.norm(values)
    if not np.all(np.isfinite(lengths)) or np.linalg.norm(values) < NO_MISFIT:
        return 0.0
    return float(np.max(np.abs(jacobian.T @ values) / np.where(lengths > 0, lengths, 1.0)))
