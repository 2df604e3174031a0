"""The A -> alpha map of Disney's path-traced subsurface scattering.

Source: M. J.-Y. Chiang, P. Kutz and B. Burley, Practical and controllable subsurface scattering for production path
tracing, SIGGRAPH 2016 Talks, who fit it to Monte Carlo simulations.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array, lax

from mcml_sim.media.setting import Setting
from profilefit.laws.base import AlbedoLaw
from profilefit.laws.entry import Entry, Text
from profilefit.laws.evaluate import evaluated

# The slope of the printed cubic stays within a factor of three: Newton settles in six.
STEPS = 7


class Chiang(AlbedoLaw):
    """alpha = 1 - exp(e1 A + e2 A^2 + e3 A^3); as printed -5.09406, 2.61188, -4.31805.

    alpha(1) is 1 - e^{e1 + e2 + e3} = 0.9989, so that nothing maps to albedos beyond; their A is 1. The inverse is the
    root in [0, 1] of the cubic, which falls there, by Newton's method cut to a bracket.

    e1, e2, e3  constants [-]
    """

    setting: Setting = eqx.field(static=True)
    e1: float
    e2: float
    e3: float
    entry = Entry(
        "chiang",
        "map of Chiang et al.",
        is_map=True,
        text=Text("chiang", ("near_zero",), clamps="alpha to that of A = 1"),
    )

    @evaluated
    def alpha(self, reflectance) -> Array:
        """Single-scattering albedo alpha [-] at total reflectance A [-]."""
        return -jnp.expm1(self._exponent(reflectance))

    @evaluated
    def reflectance(self, alpha) -> Array:
        """Total reflectance A [-] at single-scattering albedo alpha [-]."""
        # Off 0 by less than the rounding of alpha: ln 0 would have no derivative.
        target = jnp.log(jnp.maximum(1.0 - alpha, jnp.finfo(jnp.result_type(alpha, float)).eps ** 2))
        target = jnp.maximum(target, self._exponent(1.0))

        def newton(middle):
            slope = self.e1 + middle * (2.0 * self.e2 + 3.0 * middle * self.e3)
            return middle - (self._exponent(middle) - target) / slope

        def step(_, state):
            low, high, middle = state
            beyond = self._exponent(middle) > target
            low, high = jnp.where(beyond, middle, low), jnp.where(beyond, high, middle)
            return low, high, jnp.clip(newton(middle), low, high)

        zero = jnp.zeros_like(target)
        nearly = lax.fori_loop(0, STEPS, step, (zero, zero + 1.0, zero + 0.5))[2]
        return newton(nearly)  # uncut, for the derivative at both ends

    def _exponent(self, reflectance) -> Array:
        """ln(1 - alpha) [-]."""
        return reflectance * (self.e1 + reflectance * (self.e2 + reflectance * self.e3))
