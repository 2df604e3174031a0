"""What laws share that start from the energy left at r: exact strength at the source, reflectance by the map to A."""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim import single
from profilefit.laws.base import ProfileLaw
from profilefit.laws.rational import Rational


class EscapeLaw(ProfileLaw):
    """A law whose cdf tends to 1 by itself, scaled to A by `albedo`: R_d = A `scaled_density` / (2 pi x)."""

    albedo: eqx.AbstractVar[Rational]

    @abc.abstractmethod
    def scaled_density(self, x: Array, alpha: Array) -> Array:
        """2 pi x R_d / A [1/mfp], finite at x = 0."""

    def source_hazard(self, alpha) -> Array:
        """lambda_0 = lim 2 pi x R_d / A at x = 0 [1/mfp]: light scattered once, exact, over A."""
        return single.source_strength(self.setting) * self.albedo.albedo_over_reflectance(alpha)

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        near = jnp.maximum(x, jnp.finfo(jnp.result_type(x, float)).tiny)
        value = self.albedo.reflectance(alpha) * self.scaled_density(near, alpha) / (2.0 * jnp.pi * near)
        return jnp.where((x > 0) | (alpha == 0), value, jnp.inf)

    def unscaled_energy(self, x: Array, alpha: Array) -> Array:
        return self.albedo.reflectance(alpha) * self.scaled_cdf(x, alpha)

    def source_strength(self, alpha: Array) -> Array:
        return single.source_strength(self.setting) * alpha
