"""Number of transcendental functions of a law, read off what jax traces: for each point, and for each material."""

from __future__ import annotations

from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from jax.extend import core
from jax.interpreters import partial_eval

# All that a processor has no instruction for, or a slow one; products, quotients and whole powers are not counted.
COUNTED = (
    *("exp", "exp2", "expm1", "log", "log1p", "pow", "cbrt", "sqrt", "rsqrt"),
    *("sin", "cos", "tan", "asin", "acos", "atan", "atan2", "sinh", "cosh", "tanh", "asinh", "acosh", "atanh"),
    *("erf", "erfc", "erf_inv", "lgamma", "logistic"),
)
# An axis of this length is the points'; a prime that no law has for a number of nodes.
POINTS = 1009
ROOTS = ("sqrt", "rsqrt")


@dataclass(frozen=True)
class FunctionCounts:
    """Functions by name: `point` for each point, `material` for each albedo, whatever the number of points."""

    point: Counter[str]
    material: Counter[str]

    @property
    def transcendental(self) -> int:
        """Number of functions of each point, without square roots."""
        return sum(self.point.values()) - sum(self.point[name] for name in ROOTS)


def count(function: Callable[[Array, Array], object], alpha: float = 0.8) -> FunctionCounts:
    """Count in `function(x, alpha)`, of an array and a scalar, all that its answer needs.

    What has no axis of points depends on alpha only, and counts for the material; steps of a loop count as often as
    they are made. Raises ValueError at a loop whose number of steps is not known beforehand.
    """
    closed = jax.make_jaxpr(function)(jnp.zeros(POINTS, jnp.float32), jnp.float32(alpha))
    needed, _ = partial_eval.dce_jaxpr(closed.jaxpr, [True] * len(closed.jaxpr.outvars))
    counts = FunctionCounts(Counter(), Counter())
    _add(needed, 1, counts)
    return counts


def _add(jaxpr: core.Jaxpr, times: int, counts: FunctionCounts) -> None:
    for equation in jaxpr.eqns:
        name = equation.primitive.name
        if name in COUNTED:
            result: Any = equation.outvars[0].aval
            size = int(np.prod(result.shape, dtype=int))
            if POINTS in result.shape:
                counts.point[name] += times * (size // POINTS)
            else:
                counts.material[name] += times * size
        if name == "while":
            raise ValueError(f"function must have no loop of unknown length, got {equation}")
        inner = times * (equation.params["length"] if name == "scan" else 1)
        for nested in core.jaxprs_in_params(equation.params):
            _add(nested, inner, counts)


def described(functions: Counter[str]) -> str:
    """Return functions as text, for example "2 exp, log"; a dash where there is none."""
    parts = [f"{number} {name}" if number > 1 else name for name, number in sorted(functions.items())]
    return ", ".join(parts) or "–"
