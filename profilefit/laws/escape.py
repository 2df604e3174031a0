"""Base of laws that start from the energy left at r: decay far away, strength at the source, reflectance by a map."""

from __future__ import annotations

import abc

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim.exact import single_scattering
from profilefit.laws.base import Normalisation, ProfileLaw

# Nearer to white than this share of absorption the series alone is right to 2.4e-5, and Newton's step would cancel.
NEAR_WHITE = 0.08
DARKEST = 1e-6  # below this albedo kappa is 1 to the last bit


def decay_rate(alpha) -> Array:
    """Return kappa [1/mfp], the root of kappa = tanh(kappa / alpha): R_d falls off as e^{-kappa r} r^-2.

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


class EscapeLaw(ProfileLaw):
    """A law whose cdf tends to 1 by itself, scaled to A by `albedo`: R_d = A `scaled_density` / (2 pi x)."""

    albedo: Normalisation = eqx.field(static=True)

    @abc.abstractmethod
    def scaled_density(self, x: Array, alpha: Array) -> Array:
        """2 pi x R_d / A [1/mfp], finite at x = 0."""

    def text_numbers(self) -> dict[str, float]:
        """Return the strength at the source over alpha, lim 2 pi x R_d / alpha [1/mfp]."""
        return {"source": single_scattering.source_strength(self.setting)}

    def source_hazard(self, alpha) -> Array:
        """lambda_0 = lim 2 pi x R_d / A at x = 0 [1/mfp]: light scattered once, exact, over A."""
        return single_scattering.source_strength(self.setting) * self.albedo.albedo_over_reflectance(alpha)

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        near = jnp.maximum(x, jnp.finfo(jnp.result_type(x, float)).tiny)
        value = self.reflected(alpha) * self.scaled_density(near, alpha) / (2.0 * jnp.pi * near)
        return jnp.where((x > 0) | (alpha == 0), value, jnp.inf)

    def source_strength(self, alpha: Array) -> Array:
        return single_scattering.source_strength(self.setting) * alpha
