"""Arrays of numpy and jax: their type, and which of the two computes with them."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]


def namespace(*values: Any) -> ModuleType:
    """Return jax.numpy if any of the values is a jax array, else numpy."""
    return jnp if any(isinstance(value, jax.Array) for value in values) else np


def scalar_or_array(values: Any) -> Any:
    """Return a result as jax gave it, or else a float for scalars and a numpy array."""
    if isinstance(values, jax.Array):
        return values
    return float(values) if np.ndim(values) == 0 else np.asarray(values)
