"""A law by its escape hazard: of the light that has come as far as r, the share that leaves in the next length dr.

The curve behind it, survival S and escape hazard lambda over x = r/l, is written for float32 and a GPU: logarithms of
numbers that are not near 1, one reciprocal for the rational part.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jax import Array

from profilefit.laws.base import CLAMPS, Entry, EscapeLaw, Sampler, Text
from profilefit.laws.surface import decay_rate

NEAREST = 1e-25  # x [mfp] that stands for 0: every quotient stays finite, x ln x is 0
FARTHEST = 1e8  # x [mfp]: no light is left, and x^4 is finite in float32
# Below this h/x the difference 1 - z ln(1 + 1/z) cancels, and its series takes over: right to 2e-7 there.
SERIES = 0.1
# p and q of the first guess of a radius: the error after one step is least, over every alpha and both lights.
GUESS = (0.43, 0.27)


class Shape(NamedTuple):
    """Parameters of the law for one material; all of them depend on alpha only. Lengths in mfp.

    reflectance  A [-]; kappa decay rate, source hazard at x = 0 [1/mfp]
    w [1/mfp], h [mfp]  the light that leaves early;  a [1/mfp], b [1/mfp^2], c [1/mfp]  the light that spreads
    """

    reflectance: Array
    kappa: Array
    source: Array
    w: Array
    h: Array
    a: Array
    b: Array
    c: Array


class Local(NamedTuple):
    """The curve at one x: S = e^{-exponent} ratio; hazard lambda [1/mfp]; bend dlambda/dx [1/mfp^2]."""

    exponent: Array
    ratio: Array
    hazard: Array
    bend: Array


def density(x: Array, shape: Shape) -> Array:
    """S lambda = 2 pi x R_d / A [1/mfp]."""
    here = local(jnp.clip(x, NEAREST, FARTHEST), shape)
    return jnp.exp(-here.exponent) * here.ratio * here.hazard


def left(x: Array, shape: Shape) -> Array:
    """S [-]."""
    here = local(jnp.clip(x, NEAREST, FARTHEST), shape)
    return jnp.exp(-here.exponent) * here.ratio


def cumulative(x: Array, shape: Shape) -> Array:
    """-ln S [-]."""
    here = local(jnp.clip(x, NEAREST, FARTHEST), shape)
    return here.exponent - jnp.log(here.ratio)


def radius(xi: Array, shape: Shape, steps: int) -> Array:
    """Return x at which the share xi of the energy has left, by `steps` steps from a guess; 0 at xi = 0."""
    left = jnp.maximum(1.0 - xi, jnp.finfo(jnp.result_type(xi, float)).tiny)
    t = -jnp.log(left)
    x = radius_at(t, xi / (left * jnp.maximum(t, NEAREST)), shape, steps)
    return jnp.where(xi < 1.0, x, jnp.inf)


def growth(t: Array) -> Array:
    """(e^t - 1) / t, smooth at 0; where its square would leave the format it grows no more: 1/kappa is all then."""
    near, far = jnp.minimum(t, 0.1), jnp.clip(t, 0.1, 0.45 * math.log(jnp.finfo(t.dtype).max))
    series = 1.0 + near / 2 * (1.0 + near / 3 * (1.0 + near / 4 * (1.0 + near / 5 * (1.0 + near / 6))))
    return jnp.where(t < 0.1, series, jnp.expm1(far) / far)


def radius_at(t: Array, growth: Array, shape: Shape, steps: int) -> Array:
    """Return x at t = -ln(1 - xi), growth = xi / ((1 - xi) t) = (e^t - 1) / t."""
    p, q = GUESS
    rise = shape.source - shape.kappa
    white = q * (rise / shape.source) ** 2
    stretch = (1.0 - white) + p * t + white * growth
    x = t * stretch / (shape.kappa * stretch + rise)
    for _ in range(steps):
        near = jnp.clip(x, NEAREST, FARTHEST)
        here = local(near, shape)
        flight = 1.0 / here.hazard
        step = (t - here.exponent + jnp.log(here.ratio)) * flight
        y = -here.bend * flight * step
        x = jnp.maximum(near + step * (1.0 + y * (1.0 / 2 + y * (1.0 / 6))), 0.0)
    return x


def local(x: Array, shape: Shape) -> Local:
    """Return the curve at x [mfp], NEAREST to FARTHEST."""
    q, per_h = shape.h / x, 1.0 / shape.h
    numerator, denominator, above = 1.0 + x * (shape.a + x * shape.b), 1.0 + shape.c * x, 1.0 + q
    # One reciprocal for three quotients.
    inverse = 1.0 / (numerator * denominator * above)
    rest, one_over_n = numerator * denominator * inverse, denominator * above * inverse
    one_over_d = numerator * above * inverse
    early, spent = early_share(x, q, per_h, rest)
    up, down = (shape.a + 2.0 * shape.b * x) * one_over_n, shape.c * one_over_d
    return Local(
        shape.kappa * x + shape.w * shape.h * early,
        denominator * one_over_n,
        shape.kappa + shape.w * spent + up - down,
        shape.w * per_h * q * (spent - (q * rest) ** 2) + 2.0 * shape.b * one_over_n - up * up + down * down,
    )


def early_share(x: Array, q: Array, per_h: Array, rest: Array) -> tuple[Array, Array]:
    """V and V' at z = x/h: V = z (1 - z ln(1 + q)), q = 1/z, rest = 1/(1 + q)."""
    z = x * per_h
    log = z * jnp.log(1.0 + q)
    s = jnp.minimum(q, SERIES)
    series = 1.0 / 2 - s * (1.0 / 3 - s * (1.0 / 4 - s * (1.0 / 5 - s * (1.0 / 6 - s * (1.0 / 7)))))
    slope_series = s * s * (1.0 / 3 - s * (1.0 / 2 - s * (3.0 / 5 - s * (2.0 / 3 - s * (5.0 / 7)))))
    far = jnp.abs(q) < SERIES  # not q < SERIES: h < 0 is no law, and its light next to the source not finite
    return jnp.where(far, series, z * (1.0 - log)), jnp.where(far, slope_series, 1.0 - 2.0 * log + rest)


# Closer to the source than this many roots of a rounding [mfp] the map's density is the law's, to second order in x,
# where a slope of a slope would be rounding only; and where no light is left but a white medium's.
NEAR_SOURCE, NO_LIGHT = 10.0, 0.1 * FARTHEST
LAST_DRAWN = 37.0  # of -ln(1 - xi): a float64 xi that is less than 1 draws no radius farther out


def map_density(x: Array, shape: Shape, mapped: Callable[[Array], Array]) -> Array:
    """Density in x [1/mfp] of a map t = -ln(1 - xi) -> x: its slope where two steps of Newton's method find x.

    The law's own where no xi draws a radius.
    """

    def slope(t):
        return jax.jvp(mapped, (t,), (jnp.ones_like(t),))

    nearest = NEAR_SOURCE * float(jnp.finfo(jnp.result_type(x, float)).eps) ** 0.5
    law = density(x, shape)
    inner = (x > nearest) & (x < NO_LIGHT)
    x = jnp.clip(x, nearest, NO_LIGHT)
    t = cumulative(x, shape)
    inner &= t < LAST_DRAWN
    for _ in range(2):
        there, rate = slope(t)
        t = jnp.maximum(t + (x - there) / rate, NEAREST)
    return jnp.where(inner, jnp.exp(-t) / slope(t)[1], law)


# 1 + a x + b x^2 must have no zero, which a parabola through small b would give it somewhere [1/mfp^2].
LEAST_B = 1e-4


class HazardSampler(Sampler):
    """x with -ln S(x) = t = -ln(1 - xi): a first guess, and `steps` steps that follow the hazard.

    Guess: x = t / (kappa + (lambda_0 - kappa) / m),  m = 1 + p t + q (1 - kappa/lambda_0)^2 (xi / ((1 - xi) t) - 1)
    where p and q are `GUESS`: right to first order at xi = 0, and x = t/kappa far away, as it must be.
    Step: the hazard around x is taken for lambda / (1 + y), a straight line in 1/lambda, and its integral for a cubic.

    Error in xi at every alpha and xi, under both lights: one step 8e-5, two steps 2e-8.
    """

    law: Hazard
    steps: int = eqx.field(static=True, default=1)

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        return radius(xi, self.law.shape(alpha), self.steps)

    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        shape = self.law.shape(alpha)
        return map_density(x, shape, lambda t: radius_at(t, growth(t), shape, self.steps))


class Hazard(EscapeLaw):
    """Law of the hazard rate at which light leaves.

    2 pi x R_d = A S lambda,   S = 1 - cdf = e^{-kappa x - w h V(x/h)} (1 + c x) / (1 + a x + b x^2),   x = r/l

    V(z) = z - z^2 ln(1 + 1/z)
    lambda = -S'/S = kappa + w V'(x/h) + (a + 2 b x) / (1 + a x + b x^2) - c / (1 + c x)
    V'(z) = 1 - 2 z ln(1 + 1/z) + z / (1 + z)

    Two exact limits are built in, neither of them fitted: at the source, lambda_0 = lim 2 pi x R_d / A, which sets w =
    lambda_0 - kappa - a + c, and far away the decay rate kappa(alpha). V is a spread of decay lengths from 0 to h: it
    has the x ln x that light leaves near the source, and no sum of exponentials has. The four other shapes are

    h = e^{h0 + h1 lambda_0 + h2 kappa}                  a = a0 + a1 lambda_0 + a2 lambda_0^2
    c = (c0 + c1 lambda_0 + c2 kappa + c3 kappa^2)^2     b = b0 + b1 lambda_0 + b2 lambda_0^2 + b3 kappa

    lambda_0 and kappa in 1/mfp. c3 and b3 are for the last of the light: without them the largest error at one radius
    is a half more.

    lambda_0 runs from 1/2 (alpha = 1) to 3.3 or 2.4 (alpha = 0; searchlight or diffuse light): it is smooth in
    sqrt(1 - alpha) and straightens the four shapes more than that or A does. Valid where nothing refracts (n > 1 is
    `RefractingHazard`'s), for alpha in [0, 1] and r in [0, inf]. `albedo` is the map to A (held fixed). One exponential
    and one logarithm a profile.
    """

    h0: float
    h1: float
    h2: float
    a0: float
    a1: float
    a2: float
    b0: float
    b1: float
    b2: float
    b3: float
    c0: float
    c1: float
    c2: float
    c3: float
    entry = Entry(
        "hazard",
        "hazard",
        records=("hazard",),
        start={  # within a tenth of the exact profile
            **{"h0": 1.5, "h1": -0.2, "h2": -0.2, "c0": 0.5, "c1": 0.3, "c2": 0.2, "c3": 0.1},
            **{"a0": 0.5, "a1": -0.25, "a2": 0.04, "b0": 0.17, "b1": -0.2, "b2": 0.06, "b3": 0.01},
        },
        own=True,
        text=Text("hazard", ("rational", "decay", "near_zero", "survival"), clamps=CLAMPS),
    )
    sampler_class = HazardSampler

    def shape(self, alpha) -> Shape:
        """Everything that depends on alpha only: once a material, or once a pixel where A is a texture."""
        source = self.source_hazard(alpha)
        kappa = decay_rate(alpha)
        h = jnp.exp(self.h0 + self.h1 * source + self.h2 * kappa)
        a = self.a0 + source * (self.a1 + source * self.a2)
        b = jnp.maximum(self.b0 + source * (self.b1 + source * self.b2) + self.b3 * kappa, LEAST_B)
        c = (self.c0 + self.c1 * source + kappa * (self.c2 + kappa * self.c3)) ** 2
        return Shape(self.albedo.reflectance(alpha), kappa, source, source - kappa - a + c, h, a, b, c)

    def scaled_density(self, x: Array, alpha: Array) -> Array:
        return density(x, self.shape(alpha))

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        share = jnp.maximum(-jnp.expm1(-cumulative(x, self.shape(alpha))), 0.0)  # rounding may take a tiny one below
        return jnp.where(x > 0, jnp.where(x < jnp.inf, share, 1.0), 0.0)

    @property
    def samplers(self) -> dict[str, Sampler]:
        """One step of the inversion, or two for an error below float32's."""
        return {"one step": HazardSampler(self, 1), "two steps": HazardSampler(self, 2)}
