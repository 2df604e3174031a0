"""Nonlinear least squares by optimistix: parameters scaled, in float64, one problem or a batch of them.

A failure is a result, not an exception: `Optimum.result` is "converged" or says what happened and what to try.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import lineax as lx
import numpy as np
import optimistix as optx
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
# A dozen constants against thousands of residuals: ten times as fast as QR. It squares the condition number, which is
# harmless up to the 1e7 at which a fit counts as degenerate, since the damping of each step bounds it.
LINEAR_SOLVER = lx.Normal(lx.Cholesky())


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
    batch = jax.tree.map(lambda leaf: np.asarray(leaf)[None], data)
    return solve_batch(residual, np.asarray(start, float)[None], batch)[0]


def solve_batch(residual: Callable, starts: ArrayLike, data: object = None) -> tuple[Optimum, ...]:
    """Solve m problems of one shape at once: `starts` (m, p), every leaf of `data` with a leading axis m."""
    with jax.enable_x64(True):
        begin = jnp.asarray(starts, jnp.float64)
        arrays = jax.tree.map(lambda leaf: jnp.asarray(leaf), data)
        found, steps, codes = _levenberg_marquardt(residual, begin, arrays)
        ended = (found, *_linearise(residual, found, arrays), steps, codes)
    return tuple(
        Optimum(p, v, j, int(n), _explain(int(c), p, v, j))
        for p, v, j, n, c in zip(*map(np.asarray, ended), strict=True)  # rows of a jax array cost a dispatch each
    )


@eqx.filter_jit
def _levenberg_marquardt(residual, starts, data):
    solver: Any = optx.LevenbergMarquardt(RELATIVE_TOLERANCE, RELATIVE_TOLERANCE, linear_solver=LINEAR_SOLVER)

    def one(start, item):
        scale = jnp.where(start == 0, 1.0, jnp.abs(start))  # constants span four decades; LM damps them alike

        def scaled(y, args):
            return residual(y * scale, args)

        solution: Any = optx.least_squares(scaled, solver, start / scale, item, max_steps=MAX_STEPS, throw=False)
        converged = solution.result == optx.RESULTS.successful
        return solution.value * scale, solution.stats["num_steps"], jnp.where(converged, 0, 1)

    return jax.vmap(one)(starts, data)


@eqx.filter_jit
def _linearise(residual, parameters, data):
    return jax.vmap(residual)(parameters, data), jax.vmap(jax.jacfwd(residual))(parameters, data)


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
