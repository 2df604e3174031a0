"""Which library computes with arrays of a kind."""

from __future__ import annotations

from types import ModuleType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np


def namespace(*values: Any) -> ModuleType:
    """jax.numpy if any of the values is a jax array, else numpy."""
    return jnp if any(isinstance(value, jax.Array) for value in values) else np
