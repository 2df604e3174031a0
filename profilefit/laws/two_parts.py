"""Laws of two parts: light scattered once, and the rest, each with a hazard of its own; and their sampler."""

from __future__ import annotations

import abc
from dataclasses import replace
from typing import Any, NamedTuple, Self

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from mcml_sim.exact.light import reduced, unreduced
from profilefit.laws.base import CLOSED, Sampler
from profilefit.laws.escape import EscapeLaw, decay_rate
from profilefit.laws.hazard import FARTHEST, NEAREST, Shape, cumulative, density, growth, left, local, map_density
from profilefit.laws.refracting_rational import FoldedRational
from profilefit.laws.surface import Number, RefractingSurface, surface_of

ROUND = 1e-2  # of b [1/mfp^2]: where its parabola is as small, it turns to zero and never gets there
LEAST_W = 1e-3  # of -w [1/mfp]: h must be positive
# First guesses of a radius: of light scattered once p; of the rest p, q, d, m, and what bends them at small t and large
# kappa. Their error after a step is least, over every alpha, n from 1.001 to 1.6 and both lights.
ONCE, AGAIN = 0.535, (1.3479, 0.7442, 3.0873, 1.2056, 2.1187, -1.4458, 0.456)
LEAST_STRETCH = 1e-3  # keeps the guess positive
MOST_WHITE = 16.0  # keeps the guess finite in dark media, where the tail that it is made for is not reached


class ShapeCoefficients(NamedTuple):
    """A law at one index and g: m, a, b and c of the light scattered again, h, a and b of that scattered once.

    once_h [mfp], once_a [1/mfp], once_b [1/mfp^2]; the others as they stand in the class
    """

    m0: Number
    m1: Number
    m2: Number
    a0: Number
    a1: Number
    a2: Number
    a3: Number
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

    albedo: eqx.AbstractVar[FoldedRational]
    surface: RefractingSurface | None = eqx.field(default=None, kw_only=True, metadata=CLOSED)

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

    def in_reduced(self) -> Self:
        here, isotropic = self.here(), replace(self.setting, g=0.0)
        return replace(self, setting=isotropic, surface=here, albedo=self.albedo.in_reduced())

    def similar(self, alpha: Any, mfp: Any) -> tuple[Any, Any]:
        by, length = reduced(alpha, self.setting.g)
        return by, mfp * length

    def total(self, alpha) -> Array:
        return self.albedo.reflectance(unreduced(alpha, self.setting.g))

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
        strength = here.source / here.once
        once = (here.critical, strength, strength - here.critical - of.once_a, of.once_h, of.once_a, of.once_b, 0.0)
        of_all = albedo.albedo_over_reflectance(alpha)
        return Parts(
            Shape(alpha * here.once, *(jnp.asarray(one) + zero for one in once)),
            Shape(alpha**2 * again, kappa, zero, w, h, a, b, c),
            here.once * of_all,
            alpha * again * of_all,
        )

    def scaled_density(self, x: Array, alpha: Array) -> Array:
        return self.parts(alpha).density(x)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        return self.parts(alpha).cdf(x)

    def unscaled_energy(self, x: Array, alpha: Array) -> Array:
        return self.reflected(alpha) * self.scaled_cdf(x, alpha)

    def source_strength(self, alpha: Array) -> Array:
        return self.here().source * alpha

    @property
    def sampler(self) -> TwoPartSampler:
        """A part of the light by chance, and the inverse of its cdf, to 6e-5 in xi, in a fixed number of operations."""
        return TwoPartSampler(self)

    @property
    def samplers(self) -> dict[str, Sampler]:
        """One step of the inversion, or two for an error below float32's."""
        return {"one step": self.sampler, "two steps": TwoPartSampler(self, 2)}


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


def drawn(t: Array, growth: Array, of: Parts, is_once: Array | bool, steps: int) -> Array:
    """Return x at t = -ln S of a part, growth = (e^t - 1) / t."""
    first, rest = of.once, of.multiple
    p, _, d, _, _, _, g = AGAIN
    white, slowest = guess(of)
    stretch = jnp.maximum((1.0 - white) + p * t + white * growth, LEAST_STRETCH)
    bend = 1.0 + g * jnp.sqrt(t)
    once = 1.0 + ONCE * t
    length = jnp.where(is_once, t * once, jnp.sqrt(t * (t + 2.0 * d)) * stretch)
    x = length / jnp.where(
        is_once, first.kappa * once + (first.source - first.kappa), (rest.kappa * stretch + slowest) * bend
    )
    shape = jax.tree.map(lambda one, other: jnp.where(is_once, one, other), first, rest)
    for _ in range(steps):
        x = _closer(x, t, shape)
    return x


def guess(of: Parts) -> tuple[Array, Array]:
    """Return what the first guess of a radius takes from the material: the share that grows with e^t, and its slope.

    Far away x -> A e^t in a white medium, and t / kappa in any other; next to the source x goes with sqrt(t).
    """
    rest, (_, q, d, m, e, f, _) = of.multiple, AGAIN
    rate = m * jnp.sqrt(d * jnp.maximum(-rest.w, NEAREST) / rest.h)
    white = q * jnp.minimum(rate * rest.c / rest.b * jnp.exp(-0.5 * rest.w * rest.h), MOST_WHITE)
    return white, rate * (1.0 + rest.kappa * (e + f * rest.kappa))


def _closer(x: Array, t: Array, shape: Shape) -> Array:
    near = jnp.clip(x, NEAREST, FARTHEST)
    here = local(near, shape)
    spent = jnp.maximum(here.exponent - jnp.log(here.ratio), NEAREST)
    flight, beyond = 1.0 / jnp.maximum(here.hazard, NEAREST), jnp.sqrt(t / spent) - 1.0
    step = 2.0 * spent * beyond * flight
    y = beyond - here.bend * flight * step
    return jnp.maximum(near + step * (1.0 + y * (1.0 / 2 + y * (1.0 / 6))), 0.0)
