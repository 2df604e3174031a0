"""Laws are written once over jax.numpy, and evaluated in float64 numpy outside of jit, traced inside."""

from __future__ import annotations

from collections.abc import Callable
from functools import wraps

import jax
import jax.numpy as jnp
import numpy as np


def evaluated(method: Callable) -> Callable:
    """Let a method of a law take numbers, lists or numpy arrays and answer in float64: a float for scalars.

    Arguments that are jax arrays (concrete or traced) keep their type, so that a law can be jitted, vmapped and
    differentiated in whatever precision its caller chose.
    """

    @wraps(method)
    def call(law, *arguments, **named):
        values = (*jax.tree.leaves(law), *arguments, *named.values())
        if any(isinstance(value, jax.Array) for value in values):
            return method(law, *arguments, **named)
        with jax.enable_x64(True):
            arrays = [jnp.asarray(np.asarray(value, float)) for value in arguments]
            keywords = {name: jnp.asarray(np.asarray(value, float)) for name, value in named.items()}
            out = np.asarray(method(law, *arrays, **keywords))
        return float(out) if out.ndim == 0 else out

    return call
