"""A rational map between alpha and A that is exact at both ends, in every setting, and closed both ways."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim.exact import single_scattering
from mcml_sim.media.setting import Setting
from profilefit.laws.base import AlbedoLaw
from profilefit.laws.entry import Entry, Range, Text
from profilefit.laws.evaluate import evaluated


class Rational(AlbedoLaw):
    """A = t (1 - s)(1 + b s) / (1 + c s + d s^2),  s = sqrt(1 - alpha).

    t is the share of the light that the surface lets in, 1 where n = 1: a white half space gives all of it back. So
    A(0) = 0 and A(1) = t whatever the constants, and dA/ds is finite at s = 0 as in the exact solution, where t - A is
    proportional to s. The inverse is the root in [0, 1] of (b + B d) s^2 + (1 - b + B c) s - (1 - B) = 0, B = A / t;
    no albedo reflects more than t, and alpha(A > t) = 1.

    b, c, d  constants [-]
    """

    setting: Setting = eqx.field(static=True)
    b: float
    c: float
    d: float
    entry = Entry(
        "rational",
        "rational map",
        is_map=True,
        records=("albedo-rational",),
        start={"b": 0.5, "c": 2.0, "d": 1.0},  # the limits hold for any, and these give A within 0.1
        n=Range(1.0, 1.5),
        own=True,
        text=Text("rational", (), clamps="A to the light that enters"),
    )

    def text_numbers(self) -> dict[str, float]:
        """The share of the light that enters [-]."""
        return {"entered": self.entered}

    @property
    def reflectances(self) -> Range:
        """Those that the surface lets out of a white half space, and less."""
        return Range(0.0, self.entered)

    @property
    def entered(self) -> float:
        """t, the share of the light that enters [-]: by Fresnel at normal incidence, or over cosine-weighted light."""
        return 1.0 if self.setting.n == 1.0 else single_scattering.entered(self.setting)  # 1 to the last bit

    @evaluated
    def reflectance(self, alpha) -> Array:
        """Total reflectance A [-] at single-scattering albedo alpha [-]."""
        s = jnp.sqrt(1.0 - alpha)
        # 1 - s as alpha / (1 + s): where alpha is small, the difference has no digits.
        return self.entered * alpha * (1.0 + self.b * s) / ((1.0 + s) * (1.0 + s * (self.c + self.d * s)))

    @evaluated
    def albedo_over_reflectance(self, alpha) -> Array:
        """alpha / A [-], finite at alpha = 0 too."""
        s = jnp.sqrt(1.0 - alpha)
        return (1.0 + s) * (1.0 + s * (self.c + self.d * s)) / (self.entered * (1.0 + self.b * s))

    @evaluated
    def alpha(self, reflectance) -> Array:
        """Single-scattering albedo alpha [-] at total reflectance A [-]."""
        share = jnp.minimum(reflectance / self.entered, 1.0)
        linear = 1.0 - self.b + share * self.c
        quadratic = self.b + share * self.d
        rest = 1.0 - share
        # The cancellation-free root: linear is positive.
        s = 2.0 * rest / (linear + jnp.sqrt(linear**2 + 4.0 * quadratic * rest))
        return 1.0 - s**2
