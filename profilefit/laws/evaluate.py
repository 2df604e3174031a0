"""Laws are written once over jax.numpy, and evaluated in float64 numpy outside of jit, traced inside."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from functools import wraps
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim.checks import checked_numbers, require_own_process
from mcml_sim.errors import InputError

# What an argument of this name may be, wherever it occurs. A mean free path beyond these, in whatever unit, has no
# square in float64; jax arrays of single precision want it within 1e-12 and 1e12, and nobody can tell them so.
SHARE, ANY_LENGTH, POSITIVE = (0.0, 1.0), (0.0, np.inf), (1e-100, 1e100)
RANGES = {"alpha": SHARE, "reflectance": SHARE, "xi": SHARE, "r": ANY_LENGTH, "mfp": POSITIVE}
ACCEPTED = {SHARE: "in [0, 1]", ANY_LENGTH: ">= 0", POSITIVE: "> 0, from 1e-100 to 1e+100"}


def evaluated(method: Callable) -> Callable:
    """Let a method of a law take numbers, lists or numpy arrays and answer in float64: a float for scalars.

    Arguments that are jax arrays (concrete or traced) keep their type, so that a law can be jitted, vmapped and
    differentiated in whatever precision its caller chose. Numbers out of range raise InputError.
    """
    names = tuple(inspect.signature(method).parameters)[1:]

    @wraps(method)
    def call(law, *arguments, **named):
        values = (*jax.tree.leaves(law), *arguments, *named.values())
        if any(isinstance(value, jax.Array) for value in values):
            return method(law, *arguments, **named)
        plain = [_checked(name, value) for name, value in zip(names, arguments, strict=False)]
        with jax.enable_x64(True):
            arrays = [jnp.asarray(value) for value in plain]
            keywords = {name: jnp.asarray(_checked(name, value)) for name, value in named.items()}
            out = np.asarray(method(law, *arrays, **keywords))
        return float(out) if out.ndim == 0 else out

    return call


def _checked(name: str, value: Any) -> np.ndarray:
    require_own_process()
    numbers = checked_numbers(name, value, "a number or an array of numbers")
    low, high = span = RANGES.get(name, (-np.inf, np.inf))
    outside = ~((numbers >= low) & (numbers <= high))
    if name in RANGES and np.any(outside):
        raise InputError(f"{name} must be {ACCEPTED[span]}, got {numbers[outside].flat[0]:g}")
    return numbers
