"""The A -> alpha map that production path tracers took from van de Hulst's similarity relations.

Source: C. Kulla and A. Conty, Revisiting physically based shading at Imageworks, SIGGRAPH 2017 course Physically Based
Shading in Theory and Practice, who invert H. C. van de Hulst, Multiple Light Scattering, 1980; also in F. Fong, M.
Wrenninge, C. Kulla and R. Habel, Production Volume Rendering, SIGGRAPH 2017 course.
"""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim.media.setting import Setting
from profilefit.laws.base import AlbedoLaw
from profilefit.laws.entry import Entry, Text
from profilefit.laws.evaluate import evaluated


class VanDeHulst(AlbedoLaw):
    """s = p0 + p1 A - sqrt(q0 + q1 A + q2 A^2),  alpha = 1 - s^2  (g = 0; else (1 - s^2) / (1 - g s^2)).

    As printed 4.09712, 4.20863, 9.59217, 41.6808, 17.7126, under diffuse light: within 0.0021 of the exact A. An engine
    shipped 9.59271 for q0. alpha(0) is 6e-6 and alpha(1) is 1 - 3e-11 with these digits. The inverse is the root near 0
    of (p1^2 - q2) A^2 + (2 p1 (p0 - s) - q1) A + (p0 - s)^2 - q0 = 0, cut to [0, 1].

    Near white s passes 0 just before A = 1, so that alpha = 1 - s^2 falls again, by 3e-11; clamping s at 0 mends it.
    The rational map, which is exact at both ends, has no such place.

    p0, p1, q0, q1, q2  constants [-]
    """

    setting: Setting = eqx.field(static=True)
    p0: float
    p1: float
    q0: float
    q1: float
    q2: float
    entry = Entry(
        "van_de_hulst",
        "map of van de Hulst",
        is_map=True,
        text=Text("van_de_hulst", (), clamps="both results to [0, 1]"),
    )

    @evaluated
    def alpha(self, reflectance) -> Array:
        """Single-scattering albedo alpha [-] at total reflectance A [-]."""
        square = self.q0 + reflectance * (self.q1 + reflectance * self.q2)
        s = self.p0 + self.p1 * reflectance - jnp.sqrt(square)
        return 1.0 - s**2

    @evaluated
    def reflectance(self, alpha) -> Array:
        """Total reflectance A [-] at single-scattering albedo alpha [-]."""
        rest = self.p0 - jnp.sqrt(1.0 - alpha)
        linear = 2.0 * self.p1 * rest - self.q1
        constant = rest**2 - self.q0
        root = jnp.sqrt(linear**2 - 4.0 * (self.p1**2 - self.q2) * constant)
        return jnp.clip(2.0 * constant / (root - linear), 0.0, 1.0)
