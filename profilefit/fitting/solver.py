"""Nonlinear least squares by a trust region: parameters scaled, in float64, one problem or a batch of them.

Only residuals and their Jacobian are compiled, as one small program for each law and shape of data; the steps between
are scipy's. A loop that is compiled takes as long to compile as a fit, for each number of problems anew.

A failure is a result, not an exception: `Optimum.result` is "converged" or says what happened and what to try.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.optimize import least_squares

Floats = NDArray[np.float64]
CONVERGED = "converged"
# Far below any error of a constant, far above what float64 residuals of a few thousand bins resolve.
RELATIVE_TOLERANCE = 1e-10
MAX_STEPS = 200
NOT_FINITE = "the residual is not finite there: start nearer to the data, or narrow the range of alpha"
# Steps that shrink because every longer one leaves the law's domain also look converged; at an optimum the residuals
# are orthogonal to what the constants can do, unless there is no misfit but rounding.
STALLED, NO_MISFIT = 0.03, 1e-8
# Where the residuals are orthogonal to rounding, steps that no longer shrink are rounding too.
ORTHOGONAL = 1e-7


@dataclass(frozen=True)
class Optimum:
    """Where a least-squares problem ended.

    parameters  (p,) the minimiser, in the caller's units
    residuals   (n,) there; jacobian (n, p) d residual / d parameter
    steps       points at which the residuals were asked for
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
        arrays = jax.tree.map(lambda leaf: jnp.asarray(np.asarray(leaf)), data)  # a float would be another type

        def at(parameters: Floats) -> tuple[Floats, Floats]:
            values, jacobian = _linearise(residual, parameters, arrays)
            return np.asarray(values), np.asarray(jacobian)

        return _least_squares(at, np.asarray(start, np.float64))


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


def _least_squares(at: Callable[[Floats], tuple[Floats, Floats]], start: Floats) -> Optimum:
    """From `start` (p,), `at` the residuals and the Jacobian of constants.

    Constants span four decades, so they are scaled by their start: the trust region treats them alike.
    """
    scale = np.where(start == 0, 1.0, np.abs(start))

    @lru_cache(maxsize=2)
    def linear(here: bytes) -> tuple[Floats, Floats]:
        values, jacobian = at(np.frombuffer(here) * scale)
        # A step to where there is no slope is one to take back, which residuals say that are not finite.
        return values if np.all(np.isfinite(jacobian)) else np.full_like(values, np.nan), jacobian * scale

    begin = start / scale
    if not np.all(np.isfinite(linear(begin.tobytes())[0])):
        return Optimum(start, *at(start), 1, NOT_FINITE)
    with np.errstate(over="ignore", divide="ignore", invalid="ignore"):  # of constants that run away
        found = least_squares(
            lambda here: linear(here.tobytes())[0], begin, lambda here: linear(here.tobytes())[1],
            xtol=RELATIVE_TOLERANCE, ftol=None, gtol=None, max_nfev=MAX_STEPS,
        )  # fmt: skip
    jacobian = found.jac / scale
    return Optimum(found.x * scale, found.fun, jacobian, found.nfev, _explain(found.success, found.fun, jacobian))


def _explain(ended: bool, values: Floats, jacobian: Floats) -> str:
    steepness = _steepness(values, jacobian)
    if not ended and steepness > ORTHOGONAL:
        return f"no convergence in {MAX_STEPS} steps: constants trade against each other; fix one or widen the range"
    if steepness > STALLED and np.linalg.norm(values) > NO_MISFIT:
        return "stalled beside an optimum, at the edge of where the law is defined: start elsewhere"
    return CONVERGED


def _steepness(values: Floats, jacobian: Floats) -> float:
    """The largest cosine between the residuals and a column of the Jacobian: none is left at an optimum."""
    return float(np.max(np.abs(_unit(jacobian).T @ _unit(values))))


def _unit(columns: Floats) -> Floats:
    """Columns of length 1, or 0; the largest number is divided by first, since squares of small ones would be 0."""
    for size in (lambda c: np.max(np.abs(c), axis=0), lambda c: np.linalg.norm(c, axis=0)):
        columns = columns / np.where(size(columns) > 0, size(columns), 1.0)
    return columns
