"""Laws of two parts: light scattered once, and the rest, each with a hazard of its own; and their sampler."""

from __future__ import annotations

import abc
from collections import namedtuple
from dataclasses import replace
from types import SimpleNamespace
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from profilefit.laws.base import CLAMPS, CLOSED, Entry, EscapeLaw, ProfileLaw, Sampler, Text
from profilefit.laws.hazard import FARTHEST, NEAREST, Shape, cumulative, density, growth, left, local, map_density
from profilefit.laws.rational import COSINES, INDICES, REFRACTING, FoldedRational
from profilefit.laws.surface import Number, RefractingSurface, decay_rate, surface_of

ROUND = 1e-2  # of b [1/mfp^2]: where its parabola is as small, it turns to zero and never gets there
LEAST_W = 1e-3  # of -w [1/mfp]: h must be positive
# First guesses of a radius: of light scattered once p; of the rest p, q, d, m, and what bends them at small t and large
# kappa. Their error after a step is least, over every alpha, n from 1.001 to 1.6 and both lights.
ONCE, AGAIN = 0.535, (1.3479, 0.7442, 3.0873, 1.2056, 2.1187, -1.4458, 0.456)
SOURCE = Text("refracting_hazard", ("rational", "decay", "near_zero", "survival"), prefix="hazard", clamps=CLAMPS)
ENTRY = Entry("hazard", "hazard", records=("hazard",), own=True, text=SOURCE)  # of each law here that spans indices
LEAST_STRETCH = 1e-3  # keeps the guess positive
MOST_WHITE = 16.0  # keeps the guess finite in dark media, where the tail that it is made for is not reached


class ShapeCoefficients(
    namedtuple("ShapeCoefficients", "m0 m1 m2 a0 a1 a2 a3 b0 b1 b2 c0 c1 c2 once_h once_a once_b")  # each a Number
):
    """A law at one index and g: m, a, b and c of the light scattered again, h, a and b of that scattered once.

    once_h [mfp], once_a [1/mfp], once_b [1/mfp^2]; the others as they stand in the class
    """


class Parts(NamedTuple):
    """One material: light scattered once and more often, each a hazard curve whose `reflectance` is its own light.

    `share` of the light is scattered once, `rest` again [-]: 1 - share, which would cancel where the medium is dark.
    """

    once: Shape
    multiple: Shape
    share: Array
    rest: Array

    def density(self, x: Array) -> Array:
        """2 pi x R_d / A [1/mfp]."""
        return self.share * density(x, self.once) + self.rest * density(x, self.multiple)

    def cdf(self, x: Array) -> Array:
        """Share of the light within x [-]."""
        both = self.share * left(x, self.once) + self.rest * left(x, self.multiple)
        return jnp.where(x > 0, jnp.where(x < jnp.inf, jnp.clip(1.0 - both, 0.0, 1.0), 1.0), 0.0)


def once_shape(reflectance: Array, here: RefractingSurface, h: Number, a: Number, b: Number) -> Shape:
    """Return the curve of light scattered once, of which A is `reflectance` [-]; strength and decay are exact."""
    strength = here.source / here.once
    numbers = (here.critical, strength, strength - here.critical - a, h, a, b, 0.0)
    return Shape(reflectance, *(jnp.asarray(each) + jnp.zeros_like(reflectance) for each in numbers))


class TwoPartSampler(Sampler):
    """xi below the share of light scattered once draws a radius of that light, another one of the rest.

    Within a part xi is stretched to [0, 1] again, and -ln S(x) = t = -ln(1 - xi) solved by a guess and `steps` steps.
    The guess is right to first order at t = 0 and far away. Step: sqrt(t) is the smooth function of x in both parts;
    its slope around x is taken for f / (1 + y), a straight line in 1/f, and the integral for a cubic.

    Error in xi within a part, at every alpha, xi and n: one step 6e-5, two steps 1e-8.
    """

    law: Any  # a `TwoPartHazard`, or another law of these `Parts`
    steps: int = eqx.field(static=True, default=1)

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        of = self.law.parts(alpha)
        is_once = xi < of.share
        high, width = jnp.where(is_once, of.share, 1.0), jnp.where(is_once, of.share, of.rest)
        least = jnp.finfo(jnp.result_type(xi, float)).tiny
        left = jnp.maximum((high - xi) / jnp.maximum(width, least), least)
        left = jnp.minimum(left, 1.0)
        t = -jnp.log(left)
        x = drawn(t, (1.0 - left) / (left * jnp.maximum(t, NEAREST)), of, is_once, self.steps)
        return jnp.where(xi < 1.0, x, jnp.inf)

    def scaled_undone(self, x: Array, xi: Array, alpha: Array) -> Array:
        """Each part draws every radius once."""
        of = self.law.parts(alpha)
        once, again = (-jnp.expm1(-cumulative(x, shape)) for shape in (of.once, of.multiple))
        first, second = of.share * once, of.share + of.rest * again
        return jnp.where(jnp.abs(first - xi) < jnp.abs(second - xi), first, second)

    def jump(self, alpha: Array) -> Array:
        """Return the share of light scattered once."""
        return self.law.parts(alpha).share

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        """Density of this very map: each part's own."""
        of = self.law.parts(alpha)

        def own(shape: Shape, is_once: bool) -> Array:
            return map_density(x, shape, lambda t: drawn(t, growth(t), of, is_once, self.steps))

        return of.share * own(of.once, True) + of.rest * own(of.multiple, False)


class TwoPartHazard(EscapeLaw):
    """Law of two hazard curves: light scattered once, and more often.

    2 pi x R_d = a A_1 S_1 lambda_1 + (A - a A_1) S_2 lambda_2,   S, lambda as in `Hazard`,   x = r / l*

    a is the reduced albedo mu_s' / (mu_s' + mu_a), l* = 1 / (mu_s' + mu_a), mu_s' = mu_s (1 - g). Light scattered once
    dies with the critical angle, e^{-k_c x}, and all other light with kappa(a); one hazard cannot follow both. A_1, k_c
    and the strength at the source, lambda_1(0) = s_0 / A_1, are exact. No other light is there at the source:
    lambda_2(0) = 0, so w = c - kappa - a_2.

    Next to the source that light grows as 2 pi x R_d -> 2 a^2 m x ln(1/x), m = e^{m0 + m1 (1 - a) + m2 (1 - a)^2}
    smooth in a, which sets h = -w (A - a A_1) / (a^2 m): A and kappa go with v = sqrt(1 - a) next to white, but R_d
    near the source does not. The shapes of light scattered again are

    a_2 = a0 + a1 v + a2 v^2 + a3 kappa     c = (c0 + c1 v + c2 kappa)^2
    b = (q + sqrt(q^2 + 1e-4)) / 2, q = b0 + b1 v + b2 v^2, positive and smooth

    and of light scattered once h, a and b are numbers. All 16 are those of one index and one g (`coefficients`); what
    they are made of is each law's own. Two exponentials and two logarithms a profile.
    """

    albedo: FoldedRational = eqx.field(static=True)
    surface: RefractingSurface | None = eqx.field(default=None, kw_only=True, metadata=CLOSED)
    sampler_class = TwoPartSampler

    @abc.abstractmethod
    def coefficients(self) -> ShapeCoefficients:
        """Return the constants of the shader source at the law's index and g."""

    def here(self) -> RefractingSurface:
        """Return the closed numbers of its setting, or of those that it was put under."""
        return self.surface or surface_of(self.setting)

    def text_numbers(self) -> dict[str, float]:
        """k_c [1/mfp]; the strength of light scattered once at the source over its share, s_0 / A_1 [1/mfp]."""
        here = self.here()
        return {"critical": float(here.critical), "source": float(here.source / here.once)}

    def text_constants(self) -> dict[str, float]:
        return {name: float(value) for name, value in self.coefficients()._asdict().items()}

    def reflected(self, alpha: Array) -> Array:
        return alpha / self.albedo.under(self.surface).albedo_over_reflectance(alpha)

    def parts(self, alpha) -> Parts:
        """Everything that depends on the reduced albedo only: once a material, or a pixel where A is a texture."""
        here, of, albedo = self.here(), self.coefficients(), self.albedo.under(self.surface)
        v, kappa, zero = jnp.sqrt(1.0 - alpha), decay_rate(alpha), jnp.zeros_like(alpha)
        a = of.a0 + v * (of.a1 + v * of.a2) + of.a3 * kappa
        q = of.b0 + v * (of.b1 + v * of.b2)
        b = 0.5 * (q + jnp.sqrt(q**2 + ROUND**2))
        c = (of.c0 + of.c1 * v + of.c2 * kappa) ** 2
        w = jnp.minimum(c - kappa - a, -LEAST_W)
        again, u = albedo.scattered_again(alpha), 1.0 - alpha
        h = -w * again * jnp.exp(-(of.m0 + u * (of.m1 + u * of.m2)))
        of_all = albedo.albedo_over_reflectance(alpha)
        return Parts(
            once_shape(alpha * here.once, here, of.once_h, of.once_a, of.once_b),
            Shape(alpha**2 * again, kappa, zero, w, h, a, b, c),
            here.once * of_all,
            alpha * again * of_all,
        )

    def scaled_density(self, x: Array, alpha: Array) -> Array:
        return self.parts(alpha).density(x)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        return self.parts(alpha).cdf(x)

    def source_strength(self, alpha: Array) -> Array:
        return self.here().source * alpha

    @property
    def samplers(self) -> dict[str, Sampler]:
        """One step of the inversion, or two for an error below float32's."""
        return {"one step": self.sampler, "two steps": TwoPartSampler(self, 2)}


def drawn(t: Array, growth: Array, of: Parts, is_once: Array | bool, steps: int) -> Array:
    """Return x at t = -ln S of a part, growth = (e^t - 1) / t."""
    first, rest = of.once, of.multiple
    p, _, d, _, _, _, g = AGAIN
    white, slowest = guess(of)
    stretch = jnp.maximum((1.0 - white) + p * t + white * growth, LEAST_STRETCH)
    bend = 1.0 + g * jnp.sqrt(t)
    once = 1.0 + ONCE * t
    length = jnp.where(is_once, t * once, jnp.sqrt(t * (t + 2.0 * d)) * stretch)
    again = (rest.kappa * stretch + slowest) * bend
    x = length / jnp.where(is_once, first.kappa * once + (first.source - first.kappa), again)
    shape = jax.tree.map(lambda one, other: jnp.where(is_once, one, other), first, rest)
    for _ in range(steps):
        near = jnp.clip(x, NEAREST, FARTHEST)
        here = local(near, shape)
        spent = jnp.maximum(here.exponent - jnp.log(here.ratio), NEAREST)
        flight, beyond = 1.0 / jnp.maximum(here.hazard, NEAREST), jnp.sqrt(t / spent) - 1.0
        step = 2.0 * spent * beyond * flight
        y = beyond - here.bend * flight * step
        x = jnp.maximum(near + step * (1.0 + y * (1.0 / 2 + y * (1.0 / 6))), 0.0)
    return x


def guess(of: Parts) -> tuple[Array, Array]:
    """Return what the first guess of a radius takes from the material: the share that grows with e^t, and its slope.

    Far away x -> A e^t in a white medium, and t / kappa in any other; next to the source x goes with sqrt(t).
    """
    rest, (_, q, d, m, e, f, _) = of.multiple, AGAIN
    rate = m * jnp.sqrt(d * jnp.maximum(-rest.w, NEAREST) / rest.h)
    white = q * jnp.minimum(rate * rest.c / rest.b * jnp.exp(-0.5 * rest.w * rest.h), MOST_WHITE)
    return white, rate * (1.0 + rest.kappa * (e + f * rest.kappa))


# What fits under refracting interfaces start from, within a tenth of the exact profile under either light: constants by
# letter, which of its coefficients, and power of rho.
IN_RHO = {
    **{"m00": -1.2, "m01": -0.25, "m02": -0.65, "m10": -0.4, "m21": 1.7, "m22": -2.3},
    **{"a00": 0.46, "a01": -0.32, "a10": -0.6, "a11": -6.3, "a20": 0.54, "a21": 3.0, "a31": 3.8, "a32": 0.5},
    **{"b00": 0.11, "b01": -0.11, "b10": -0.2, "b11": 0.3, "b20": 0.07, "b21": -0.33},
    **{"c00": 0.38, "c01": -0.03, "c10": -0.97, "c12": -2.6, "c20": 0.72, "c21": 0.48, "c22": 2.0},
}


class RefractingHazard(TwoPartHazard):
    """`TwoPartHazard` under a refracting interface, where g = 0.

    With rho the share of cosine-weighted light from inside that the surface reflects back (`RefractingSurface`), the
    shapes of light scattered again are those of `TwoPartHazard` with

    m0 = m00 + m01 rho + m02 rho^2     m1 = m10                    m2 = m21 rho + m22 rho^2
    a0 = a00 + a01 rho                 a1 = a10 + a11 rho          a2 = a20 + a21 rho        a3 = a31 rho + a32 rho^2
    b0 = b00 + b01 rho                 b1 = b10 + b11 rho          b2 = b20 + b21 rho
    c0 = c00 + c01 rho                 c1 = c10 + c12 rho^2        c2 = c20 + c21 rho + c22 rho^2

    and of light scattered once, whose shape hardly depends on n in units of 1 / lambda_1(0), y = k_c / lambda_1(0),

    h lambda_1(0) = once_h y     a / lambda_1(0) = once_a0 + once_a1 y     b / lambda_1(0)^2 = (once_b0 + once_b1 y)^2

    32 constants for every n in (1, 1.6], alpha in [0, 1] and r in [0, inf]; at one n they come to 16.
    """

    __annotations__ |= dict.fromkeys(IN_RHO, "float")
    once_h: float
    once_a0: float
    once_a1: float
    once_b0: float
    once_b1: float
    entry = replace(
        ENTRY,
        start=IN_RHO | {"once_h": 3.1, "once_a0": 0.79, "once_a1": -1.1, "once_b0": 0.073, "once_b1": -0.17},
        n=REFRACTING,
    )

    @classmethod
    def at_one_index(cls) -> tuple[str, ...]:
        return ("m00", "m10", "a00", "a10", "a20", "b00", "b10", "b20", "c00", "c10", "c20")

    def coefficients(self) -> ShapeCoefficients:
        here = self.here()
        rho, strength = here.trapped, here.source / here.once
        y = here.critical / strength
        k = SimpleNamespace(**{name: getattr(self, name) for name in IN_RHO})
        return ShapeCoefficients(
            *(k.m00 + rho * (k.m01 + rho * k.m02), k.m10, rho * (k.m21 + rho * k.m22)),
            *(k.a00 + k.a01 * rho, k.a10 + k.a11 * rho, k.a20 + k.a21 * rho, rho * (k.a31 + rho * k.a32)),
            *(k.b00 + k.b01 * rho, k.b10 + k.b11 * rho, k.b20 + k.b21 * rho),
            *(k.c00 + k.c01 * rho, k.c10 + k.c12 * rho**2, k.c20 + rho * (k.c21 + rho * k.c22)),
            self.once_h * y / strength,
            (self.once_a0 + self.once_a1 * y) * strength,
            ((self.once_b0 + self.once_b1 * y) * strength) ** 2,
        )

    def folds(self) -> dict[str, dict[str, float]]:
        here = self.here()
        rho, strength = float(here.trapped), float(here.source / here.once)
        y = float(here.critical) / strength
        by_part: dict[str, dict[str, float]] = {}
        for name in IN_RHO:
            by_part.setdefault(name[:2], {})[name] = rho ** int(name[2])
        twice = 2.0 * float(self.once_b0 + self.once_b1 * y) * strength**2
        return {
            **by_part,
            "once_h": {"once_h": y / strength},
            "once_a": {"once_a0": strength, "once_a1": y * strength},
            "once_b": {"once_b0": twice, "once_b1": y * twice},
        }


# Each shape's k0, kg and kn that fits with g start from: within a tenth of exact light.
STARTS = {
    **{"m0": (-1.4, 1.1, -1.9), "m1": (-0.4, 0.0, 0.0), "m2": (0.6, -1.0, -0.4)},
    **{"a0": (0.4, 0.0, -0.1), "a1": (-0.5, 1.2, 0.3), "a2": (0.1, -0.0, 0.2)},
    **{"b0": (0.2, 0.0, -0.2), "b1": (-0.0, -0.2, 0.0), "b2": (-0.2, 0.1, 0.2)},
    **{"c0": (0.5, 0.1, 0.0), "c1": (-1.5, -0.3, -0.8), "c2": (1.4, 0.3, 0.5)},
    **{"once_h": (3.4, -0.6, 0.0), "once_a": (0.25, 0.0, 0.0), "once_b": (0.1, -0.1, 0.0)},
}
SHAPES = tuple(STARTS)


class ForwardHazard(TwoPartHazard):
    """`TwoPartHazard` with g as an argument, in the reduced albedo a and l*.

    In these light changes little with g, and smoothly up to g = 1: light scattered once is that of p / (1 - g), exact,
    and each of the other shapes a straight line in 1 - g, and in rho, the share of cosine-weighted light from inside
    that the surface reflects back (`RefractingSurface`): with k any of them,

    k = k0 + kg (1 - g) + kn rho     m0 m1 m2, a0 a1 a2 (a3 = 0), b0 b1 b2, c0 c1 c2 of light scattered again;
    once_h lambda / y, once_a / lambda, sqrt(once_b) / lambda of light scattered once

    with lambda = s_0 / A_1 its strength at the source and y = k_c / lambda. 45 constants for n from 1.3 to 1.5, g up to
    .95, alpha in [0, 1] and r in [0, inf]; at one n and g they come to 15. kappa is that of isotropic light.
    """

    __annotations__ = {f"{name}{term}": "float" for name in SHAPES for term in "0gn"}
    entry = replace(
        ENTRY,
        start={f"{name}{term}": k for name, row in STARTS.items() for term, k in zip("0gn", row, strict=True)},
        n=INDICES,
        g=COSINES,
    )

    @classmethod
    def at_one_index(cls) -> tuple[str, ...]:
        return tuple(f"{name}0" for name in SHAPES)

    def coefficients(self) -> ShapeCoefficients:
        here, k = self.here(), self._shapes()
        strength = here.source / here.once
        k["once_h"] = k["once_h"] * here.critical / strength**2
        k["once_a"] = k["once_a"] * strength
        k["once_b"] = (k["once_b"] * strength) ** 2
        return ShapeCoefficients(a3=0.0, **k)

    def folds(self) -> dict[str, dict[str, float]]:
        here = self.here()
        strength = float(here.source / here.once)
        slopes = {
            "once_h": float(here.critical) / strength**2,
            "once_a": strength,
            "once_b": 2.0 * float(self._shapes()["once_b"]) * strength**2,
        }
        terms = {"0": 1.0, "g": 1.0 - float(here.g), "n": float(here.trapped)}
        return {name: {name + term: value * slopes.get(name, 1.0) for term, value in terms.items()} for name in SHAPES}

    def _shapes(self) -> dict[str, Number]:
        """Return k of each."""
        z, rho = 1.0 - self.here().g, self.here().trapped
        return {
            name: getattr(self, f"{name}0") + z * getattr(self, f"{name}g") + rho * getattr(self, f"{name}n")
            for name in SHAPES
        }


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

    albedo: float  # a
    total_reflectance: float  # A
    once_h: float
    once_a: float
    once_b: float
    h: float
    a: float
    b: float
    c: float
    entry = Entry("forward", text=replace(SOURCE, clamps=""))
    own_reflectance = True
    sampler_class = TwoPartSampler

    def parts(self, alpha: Array) -> Parts:
        """Both curves."""
        zero, here = jnp.zeros_like(alpha), surface_of(self.setting)
        first, kappa = self.albedo * here.once, decay_rate(self.albedo)
        w = jnp.minimum(self.c - kappa - self.a, -LEAST_W)
        again = (kappa, 0.0, w, self.h, self.a, self.b, self.c)
        rest = self.total_reflectance - first
        return Parts(
            once_shape(first + zero, here, self.once_h, self.once_a, self.once_b),
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

    def total(self, alpha: Array) -> Array:
        return self.total_reflectance + jnp.zeros_like(alpha)

    def source_strength(self, alpha: Array) -> Array:
        of = self.parts(alpha)
        return of.once.reflectance * of.once.source

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
