"""A rational map between alpha and A that is exact at both ends and closed both ways."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim.setting import Setting
from profilefit.laws.base import AlbedoLaw
from profilefit.laws.evaluate import evaluated


class Rational(AlbedoLaw):
    """A = (1 - s)(1 + b s) / (1 + c s + d s^2),  s = sqrt(1 - alpha).

    A(0) = 0 and A(1) = 1 whatever the constants, and dA/ds is finite at s = 0 as in the exact solution, where
    1 - A is proportional to s. The inverse is the root in [0, 1] of (b + A d) s^2 + (1 - b + A c) s - (1 - A) = 0.

    b, c, d  constants [-]
    """

    setting: Setting = eqx.field(static=True)
    b: float
    c: float
    d: float

    @evaluated
    def reflectance(self, alpha) -> Array:
        """Total reflectance A [-] at single-scattering albedo alpha [-]."""
        s = jnp.sqrt(1.0 - alpha)
        return (1.0 - s) * (1.0 + self.b * s) / (1.0 + s * (self.c + self.d * s))

    @evaluated
    def alpha(self, reflectance) -> Array:
        """Single-scattering albedo alpha [-] at total reflectance A [-]."""
        linear = 1.0 - self.b + reflectance * self.c
        quadratic = self.b + reflectance * self.d
        rest = 1.0 - reflectance
        # The cancellation-free root: linear is positive.
        s = 2.0 * rest / (linear + jnp.sqrt(linear**2 + 4.0 * quadratic * rest))
        return 1.0 - s**2
