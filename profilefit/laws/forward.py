"""The half space of one medium that scatters forward: light scattered once, closed, and the rest by its hazard."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim.exact import single_scattering
from mcml_sim.media.setting import Setting
from profilefit.laws.base import ProfileLaw
from profilefit.laws.entry import Entry, Text
from profilefit.laws.escape import decay_rate
from profilefit.laws.hazard import Shape
from profilefit.laws.two_parts import LEAST_W, Parts, TwoPartSampler, guess


class ForwardHalfSpace(ProfileLaw):
    """Law of two hazard curves for anisotropic scattering.

    2 pi x R_d = a P S_1 lambda_1 + (A - a P) S_2 lambda_2,   S, lambda as in `Hazard`,   x = r / l*

    of one medium: reduced albedo a = mu_s (1 - g) / (mu_s (1 - g) + mu_a), l* = 1 / (mu_s (1 - g) + mu_a). The first
    part is light scattered once by the phase function p / (1 - g) with attenuation 1 / l*: its share P = A_1 / (1 - g)
    and its strength at the source s_0 / (1 - g) are closed, and it dies with the critical angle, e^{-k_c x}. It stands
    for light that has hardly been turned; what forward scattering leaves of the rest is smooth in 1 - g. The second
    part has no strength at the source and dies with kappa(a), that of isotropic light.

    A is traced; fitted are h, a, b of the first part and h, a, b, c of the second. Holds for its own medium only:
    arguments alpha are not looked at.
    """

    setting: Setting = eqx.field(static=True)
    albedo: float  # a
    total_reflectance: float  # A
    once_h: float
    once_a: float
    once_b: float
    h: float
    a: float
    b: float
    c: float
    entry = Entry(
        "forward", text=Text("refracting_hazard", ("rational", "decay", "near_zero", "survival"), prefix="hazard")
    )
    own_reflectance = True

    @property
    def once(self) -> float:
        """P [-], of the light that arrives, over a."""
        return single_scattering.reflected(self.setting) / (1.0 - self.setting.g)

    def parts(self, alpha: Array) -> Parts:
        """Both curves."""
        zero, g = jnp.zeros_like(alpha), self.setting.g
        first, kappa = self.albedo * self.once, decay_rate(self.albedo)
        strength = single_scattering.source_strength(self.setting) / (1.0 - g) / self.once
        critical = single_scattering.critical_rate(self.setting)
        own = (critical, strength, strength - critical - self.once_a, self.once_h, self.once_a, self.once_b, 0.0)
        w = jnp.minimum(self.c - kappa - self.a, -LEAST_W)
        again = (kappa, 0.0, w, self.h, self.a, self.b, self.c)
        rest = self.total_reflectance - first
        return Parts(
            Shape(first + zero, *(jnp.asarray(one) + zero for one in own)),
            Shape(rest + zero, *(jnp.asarray(one) + zero for one in again)),
            first / self.total_reflectance + zero,
            rest / self.total_reflectance + zero,
        )

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        near = jnp.maximum(x, jnp.finfo(jnp.result_type(x, float)).tiny)
        value = self.total_reflectance * self.parts(alpha).density(near) / (2.0 * jnp.pi * near)
        return jnp.where(x > 0, value, jnp.inf)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        return self.parts(alpha).cdf(x)

    def unscaled_energy(self, x: Array, alpha: Array) -> Array:
        return self.total_reflectance * self.scaled_cdf(x, alpha)

    def total(self, alpha: Array) -> Array:
        return self.total_reflectance + jnp.zeros_like(alpha)

    def source_strength(self, alpha: Array) -> Array:
        of = self.parts(alpha)
        return of.once.reflectance * of.once.source

    @property
    def sampler(self) -> TwoPartSampler:
        """Sampler like that of `TwoPartHazard`: a part of the light by chance, and the inverse of its cdf."""
        return TwoPartSampler(self)

    def text_shape(self) -> dict[str, float]:
        """Return the constants of the shader source of `TwoPartHazard`."""
        of = self.parts(jnp.asarray(0.0))
        white, slowest = guess(of)
        curve = ("kappa", "source", "w", "h", "a", "b", "c")
        numbers: dict[str, Any] = {
            "reflectance": self.total_reflectance,
            "share": of.share,
            "rest": of.rest,
            **{f"once.{name}": getattr(of.once, name) for name in curve},
            **{f"again.{name}": getattr(of.multiple, name) for name in curve},
            "white": white,
            "slowest": slowest,
        }
        return {name: float(value) for name, value in numbers.items()}
