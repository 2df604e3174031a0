"""The hazard law under a surface that refracts: light scattered once, and the rest, each with a hazard of its own."""

from __future__ import annotations

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from mcml_sim.media.setting import Setting
from profilefit.laws.base import Sampler, closed
from profilefit.laws.entry import CLAMPS, Entry, Text
from profilefit.laws.escape import EscapeLaw, decay_rate
from profilefit.laws.hazard import (
    FARTHEST,
    LEAST_B,
    NEAR_SOURCE,
    NEAREST,
    NO_LIGHT,
    Shape,
    cumulative,
    density,
    growth,
    local,
)
from profilefit.laws.refracting_rational import REFRACTING, RefractingRational
from profilefit.laws.surface import Number, Surface, surface_of

# First guesses of a radius: of light scattered once p, of the rest p, q, d and m; their error after a step is least.
ONCE, AGAIN = 0.535, (0.378, 0.266, 0.596, 0.875)


class Coefficients(NamedTuple):
    """The law at one index: 12 constants of the light scattered again, h, a and b of that scattered once.

    once_h [mfp], once_a [1/mfp], once_b [1/mfp^2]; the others as they stand in the class
    """

    h0: Number
    h1: Number
    h2: Number
    a0: Number
    a1: Number
    a2: Number
    b0: Number
    b1: Number
    b2: Number
    c0: Number
    c1: Number
    c2: Number
    once_h: Number
    once_a: Number
    once_b: Number


class Parts(NamedTuple):
    """One material: the light scattered once and again, each a hazard curve whose `reflectance` is its own light;
    `share` of the light is scattered once [-]."""

    once: Shape
    again: Shape
    share: Array


class RefractingHazard(EscapeLaw):
    """2 pi x R_d = alpha A_1 S_1 lambda_1 + (A - alpha A_1) S_2 lambda_2,   S, lambda as in `Hazard`,   x = r/l

    Under a surface that refracts, light scattered once dies with the critical angle, e^{-k_c x}, and all other light
    with kappa(alpha); one hazard cannot follow both. A_1, k_c and the strength at the source lambda_1(0) = s_0 / A_1 are
    exact. No other light is there at the source: lambda_2(0) = 0, kappa is exact again. With v = sqrt(1 - alpha) and
    rho the share of cosine-weighted light from inside that the surface reflects back (`Surface`),

    h = e^{h00 + h10 v + h22 rho^2 kappa}
    a = a00 + a01 rho + (a10 + a11 rho) v + (a20 + a21 rho + a22 rho^2) v^2
    b = b00 + b01 rho + b02 rho^2 + (b10 + b11 rho) v + b20 v^2
    c = (c00 + c01 rho + c02 rho^2 + (c10 + c11 rho + c12 rho^2) v + (c20 + c22 rho^2) kappa)^2       of the rest

    and of light scattered once, whose shape hardly depends on n in units of 1 / lambda_1(0), y = k_c / lambda_1(0),

    h lambda_1(0) = once_h y     a / lambda_1(0) = once_a0 + once_a1 y     b / lambda_1(0)^2 = once_b0 + once_b1 y

    29 constants for every n in (1, 1.6], alpha in [0, 1] and r in [0, inf]; at one n they come to 15. `albedo` is the
    map to A (held fixed). Two exponentials and two logarithms a profile.
    """

    setting: Setting = eqx.field(static=True)
    albedo: RefractingRational = eqx.field(static=True)
    h00: float
    h10: float
    h22: float
    a00: float
    a01: float
    a10: float
    a11: float
    a20: float
    a21: float
    a22: float
    b00: float
    b01: float
    b02: float
    b10: float
    b11: float
    b20: float
    c00: float
    c01: float
    c02: float
    c10: float
    c11: float
    c12: float
    c20: float
    c22: float
    once_h: float
    once_a0: float
    once_a1: float
    once_b0: float
    once_b1: float
    surface: Surface | None = closed()
    entry = Entry(
        "hazard",
        "hazard",
        records=("hazard",),
        start={  # within a tenth of the exact profile
            **{"h00": -0.2, "h10": -0.2, "h22": -1.4, "a00": 0.46, "a01": -0.35, "a10": -0.55, "a11": 0.35},
            **{"a20": 0.5, "a21": 1.2, "a22": -1.2, "b00": 0.12, "b01": -0.18, "b02": 0.06, "b10": -0.2},
            **{"b11": 0.2, "b20": 0.05, "c00": 0.42, "c01": -0.2, "c02": 0.1, "c10": -0.9, "c11": 0.8},
            **{"c12": -1.2, "c20": 0.7, "c22": 0.4, "once_h": 3.2, "once_a0": 0.8, "once_a1": -1.1},
            **{"once_b0": 0.07, "once_b1": -0.16},
        },
        n=REFRACTING,
        own=True,
        text=Text("refracting_hazard", ("rational", "decay", "survival"), prefix="hazard", clamps=CLAMPS),
    )

    @classmethod
    def at_one_index(cls) -> tuple[str, ...]:
        return (
            *("h00", "h10", "h22", "a00", "a10", "a20", "b00", "b10", "b20", "c00", "c10", "c20"),
            *("once_h", "once_a0", "once_b0"),
        )

    def here(self) -> Surface:
        """The closed numbers of its setting, or of those that it was put under."""
        return self.surface or surface_of(self.setting)

    def coefficients(self) -> Coefficients:
        """What the constants come to at its index."""
        here = self.here()
        rho, strength = here.trapped, here.source / here.once
        y = here.critical / strength
        return Coefficients(
            *(self.h00, self.h10, self.h22 * rho**2),
            *(self.a00 + self.a01 * rho, self.a10 + self.a11 * rho, self.a20 + rho * (self.a21 + rho * self.a22)),
            *(self.b00 + rho * (self.b01 + rho * self.b02), self.b10 + self.b11 * rho, self.b20),
            *(self.c00 + rho * (self.c01 + rho * self.c02), self.c10 + rho * (self.c11 + rho * self.c12)),
            self.c20 + self.c22 * rho**2,
            self.once_h * y / strength,
            (self.once_a0 + self.once_a1 * y) * strength,
            (self.once_b0 + self.once_b1 * y) * strength**2,
        )

    def text_numbers(self) -> dict[str, float]:
        """k_c [1/mfp]; the strength of light scattered once at the source over its share, s_0 / A_1 [1/mfp]."""
        here = surface_of(self.setting)
        return {"critical": float(here.critical), "source": float(here.source / here.once)}

    def text_constants(self) -> dict[str, float]:
        return {name: float(value) for name, value in self.coefficients()._asdict().items()}

    def folds(self) -> dict[str, dict[str, float]]:
        here = surface_of(self.setting)
        rho, strength = float(here.trapped), float(here.source / here.once)
        y = float(here.critical) / strength
        found = {
            f"{letter}{i}": {
                name: rho ** int(name[2])
                for name in self.constant_names()
                if name[0] == letter and name[1:2] == str(i)
            }
            for letter in "habc"
            for i in range(3)
        }
        return {
            **found,
            "once_h": {"once_h": y / strength},
            "once_a": {"once_a0": strength, "once_a1": y * strength},
            "once_b": {"once_b0": strength**2, "once_b1": y * strength**2},
        }

    def parts(self, alpha) -> Parts:
        """Everything that depends on alpha only: once a material, or once a pixel where A is a texture."""
        here, of, albedo = self.here(), self.coefficients(), self.albedo.under(self.surface)
        v, kappa, zero = jnp.sqrt(1.0 - alpha), decay_rate(alpha), jnp.zeros_like(alpha)
        h = jnp.exp(of.h0 + of.h1 * v + of.h2 * kappa)
        a = of.a0 + v * (of.a1 + v * of.a2)
        b = jnp.maximum(of.b0 + v * (of.b1 + v * of.b2), LEAST_B)
        c = (of.c0 + of.c1 * v + of.c2 * kappa) ** 2
        strength = here.source / here.once
        once_b = jnp.maximum(of.once_b, LEAST_B)
        once = (here.critical, strength, strength - here.critical - of.once_a, of.once_h, of.once_a, once_b, 0.0)
        return Parts(
            Shape(alpha * here.once, *(jnp.asarray(one) + zero for one in once)),
            Shape(albedo.scattered_again(alpha), kappa, zero, c - kappa - a, h, a, b, c),
            here.once * albedo.albedo_over_reflectance(alpha),
        )

    def scaled_density(self, x: Array, alpha: Array) -> Array:
        of = self.parts(alpha)
        return of.share * density(x, of.once) + (1.0 - of.share) * density(x, of.again)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        of = self.parts(alpha)
        left = of.share * jnp.exp(-cumulative(x, of.once)) + (1.0 - of.share) * jnp.exp(-cumulative(x, of.again))
        return jnp.where(x > 0, jnp.where(x < jnp.inf, jnp.clip(1.0 - left, 0.0, 1.0), 1.0), 0.0)

    def unscaled_energy(self, x: Array, alpha: Array) -> Array:
        return self.albedo.under(self.surface).reflectance(alpha) * self.scaled_cdf(x, alpha)

    def source_strength(self, alpha: Array) -> Array:
        return self.here().source * alpha

    @property
    def sampler(self) -> RefractingHazardSampler:
        """A part of the light by chance, and the inverse of its cdf, to 1e-7 in xi, in a fixed number of operations."""
        return RefractingHazardSampler(self)

    @property
    def samplers(self) -> dict[str, Sampler]:
        """One step of the inversion, or two for an error below float32's."""
        return {"one step": RefractingHazardSampler(self, 1), "two steps": self.sampler}


class RefractingHazardSampler(Sampler):
    """xi below the share of light scattered once draws a radius of that light, another one of the rest.

    Within a part xi is stretched to [0, 1] again, and -ln S(x) = t = -ln(1 - xi) solved by a guess and `steps` steps.
    The guess is right to first order at t = 0 and far away. Step: sqrt(t) is the smooth function of x in both parts; its
    slope around x is taken for f / (1 + y), a straight line in 1/f, and the integral for a cubic.

    Error in xi within a part, at every alpha, xi and n: one step 7e-4, two steps 2e-8.
    """

    law: RefractingHazard
    steps: int = eqx.field(static=True, default=2)

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        of = self.law.parts(alpha)
        is_once = xi < of.share
        low, width = jnp.where(is_once, 0.0, of.share), jnp.where(is_once, of.share, 1.0 - of.share)
        least = jnp.finfo(jnp.result_type(xi, float)).tiny
        left = jnp.maximum((low + width - xi) / jnp.maximum(width, least), least)
        shape = jax.tree.map(lambda once, again: jnp.where(is_once, once, again), of.once, of.again)
        x = _drawn(-jnp.log(jnp.minimum(left, 1.0)), shape, is_once, self.steps)
        return jnp.where(xi < 1.0, x, jnp.inf)

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        """Density of this very map: each part's, by the slope at the t that it sends to x."""
        of = self.law.parts(alpha)
        once, again = (_density(x, shape, shape is of.once, self.steps) for shape in (of.once, of.again))
        return of.share * once + (1.0 - of.share) * again


def _drawn(t: Array, shape: Shape, is_once: Array | bool, steps: int) -> Array:
    """x at t = -ln S of a part."""
    p, q, d, m = AGAIN
    stretch_once = 1.0 + ONCE * t
    near_source = t * stretch_once / (shape.kappa * stretch_once + shape.source - shape.kappa)
    stretch = (1.0 - q) + p * t + q * growth(t)
    rate = m * jnp.sqrt(d * jnp.maximum(-shape.w, NEAREST) / shape.h)
    again = jnp.sqrt(t * (t + 2.0 * d)) * stretch / (shape.kappa * stretch + rate)
    x = jnp.where(is_once, near_source, again)
    for _ in range(steps):
        x = _closer(x, t, shape)
    return x


def _closer(x: Array, t: Array, shape: Shape) -> Array:
    near = jnp.clip(x, NEAREST, FARTHEST)
    here = local(near, shape)
    spent = jnp.maximum(here.exponent - jnp.log(here.ratio), NEAREST)
    root, flight = jnp.sqrt(spent), 1.0 / jnp.maximum(here.hazard, NEAREST)
    step = 2.0 * root * (jnp.sqrt(t) - root) * flight
    y = (here.hazard / (2.0 * spent) - here.bend * flight) * step
    return jnp.maximum(near + step * (1.0 + y * (1.0 / 2 + y * (1.0 / 6))), 0.0)


def _density(x: Array, shape: Shape, is_once: bool, steps: int) -> Array:
    """d xi / dx of `_drawn`: its slope where two steps of Newton's method find x."""

    def slope(t):
        return jax.jvp(lambda u: _drawn(u, shape, is_once, steps), (t,), (jnp.ones_like(t),))

    nearest = NEAR_SOURCE * float(jnp.finfo(jnp.result_type(x, float)).eps) ** 0.5
    law = density(x, shape)
    inner = (x > nearest) & (x < NO_LIGHT)
    x = jnp.clip(x, nearest, NO_LIGHT)
    t = cumulative(x, shape)
    for _ in range(2):
        there, rate = slope(t)
        t = jnp.maximum(t + (x - there) / rate, NEAREST)
    return jnp.where(inner, jnp.exp(-t) / slope(t)[1], law)
