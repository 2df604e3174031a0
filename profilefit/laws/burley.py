"""Normalized diffusion, the sum of two exponentials that most engines run.

Source: P. Christensen and B. Burley, Approximate reflectance profiles for efficient subsurface scattering, Pixar
Technical Memo 15-04, 2015; exact inverse: E. Golubev, Sampling Burley's normalized diffusion profiles, 2019.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim.setting import Setting
from profilefit.laws.base import ProfileLaw, Sampler
from profilefit.laws.rational import Rational


class Burley(ProfileLaw):
    """R_d = A s (e^{-s x} + e^{-s x / 3}) / (8 pi x),  cdf = 1 - e^{-s x}/4 - 3 e^{-s x / 3}/4,  x = r/l.

    s = s0 - s1 A + s2 |A - s3|^3   (searchlight; memo, eq. 5: 1.85, 1, 7, 0.8; 5.5 % mean error reported)

    A is the reflectance at alpha by `albedo` (held fixed). Valid for alpha in (0, 1]; infinite at r = 0.
    """

    setting: Setting = eqx.field(static=True)
    albedo: Rational = eqx.field(static=True)
    s0: float
    s1: float
    s2: float
    s3: float

    def scale(self, reflectance) -> Array:
        """s(A) [-]: the mean free path over the law's own falloff length."""
        return self.s0 - self.s1 * reflectance + self.s2 * jnp.abs(reflectance - self.s3) ** 3

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        reflectance = self.albedo.reflectance(alpha)
        s = self.scale(reflectance)
        t = s * x
        safe = jnp.where(x > 0, x, 1.0)
        value = reflectance * s * (jnp.exp(-t) + jnp.exp(-t / 3.0)) / (8.0 * jnp.pi * safe)
        return jnp.where(x > 0, value, jnp.inf)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        t = self.scale(self.albedo.reflectance(alpha)) * x
        return -0.25 * jnp.expm1(-t) - 0.75 * jnp.expm1(-t / 3.0)

    def unscaled_energy(self, x: Array, alpha: Array) -> Array:
        return self.albedo.reflectance(alpha) * self.scaled_cdf(x, alpha)

    def source_strength(self, alpha: Array) -> Array:
        reflectance = self.albedo.reflectance(alpha)
        return 0.5 * reflectance * self.scale(reflectance)

    @property
    def sampler(self) -> BurleySampler:
        """The exact inverse of the cdf."""
        return BurleySampler(self)


class BurleySampler(Sampler):
    """x = 3 ln((1 + G^{-1/3} + G^{1/3}) / (4 u)) / s,  u = 1 - xi,  G = 1 + 4 u (2 u + sqrt(1 + 4 u^2))   (Golubev)."""

    law: Burley

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        u = 1.0 - xi
        root = jnp.cbrt(1.0 + 4.0 * u * (2.0 * u + jnp.sqrt(1.0 + 4.0 * u**2)))
        t = 3.0 * jnp.log((1.0 + 1.0 / root + root) / (4.0 * u))
        return t / self.law.scale(self.law.albedo.reflectance(alpha))

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        s = self.law.scale(self.law.albedo.reflectance(alpha))
        return 0.25 * s * (jnp.exp(-s * x) + jnp.exp(-s * x / 3.0))
