"""How fast a profile decays far from its source: one closed expression for every albedo."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array

# Nearer to white than this share of absorption the series alone is right to 2.4e-5, and Newton's step would cancel.
NEAR_WHITE = 0.08
DARKEST = 1e-6  # below this albedo kappa is 1 to the last bit


def decay_rate(alpha) -> Array:
    """kappa [1/mfp], the root of kappa = tanh(kappa / alpha): R_d falls off as e^{-kappa r} r^-2.

    kappa^2 = q (3 - 12/5 q + 12/175 q^2 + 58/175 q^3), q = 1 - alpha, has the three terms of the root's own series at
    q = 0 and its value at q = 1 (off by 2 % at most between); one step of Newton's method leaves 2.4e-5 (relative).
    No fitted constant. It depends on the scattering only, not on the light or the surface.
    """
    q = 1.0 - alpha
    series = jnp.sqrt(jnp.maximum(q * (3.0 + q * (-12.0 / 5.0 + q * (12.0 / 175.0 + q * (58.0 / 175.0)))), 0.0))
    absorbing = q > NEAR_WHITE
    start = jnp.where(absorbing, series, 0.5)
    bounded = jnp.where(absorbing, jnp.maximum(alpha, DARKEST), 0.9)
    t = jnp.tanh(start / bounded)
    step = (start - t) / (1.0 - (1.0 - t * t) / bounded)
    return jnp.where(absorbing, start - step, series)
