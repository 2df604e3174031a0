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
