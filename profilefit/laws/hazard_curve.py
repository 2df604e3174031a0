"""The curve behind the hazard law: survival S and escape hazard lambda of one material, over x = r/l.

Written for float32 and a GPU: logarithms of numbers that are not near 1, one reciprocal for the rational part.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import jax.numpy as jnp
from jax import Array

NEAREST = 1e-25  # x [mfp] that stands for 0: every quotient stays finite, x ln x is 0
FARTHEST = 1e8  # x [mfp]: no light is left, and x^4 is finite in float32
# Below this h/x the difference 1 - z ln(1 + 1/z) cancels, and its series takes over: right to 2e-7 there.
SERIES = 0.1
# p and q of the first guess of a radius: the error after one step is least, over every alpha and both lights.
GUESS = (0.43, 0.27)


class Shape(NamedTuple):
    """What the law needs of one material; all of it depends on alpha only. Lengths in mfp.

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
    here = _local(jnp.clip(x, NEAREST, FARTHEST), shape)
    return jnp.exp(-here.exponent) * here.ratio * here.hazard


def cumulative(x: Array, shape: Shape) -> Array:
    """-ln S [-]."""
    here = _local(jnp.clip(x, NEAREST, FARTHEST), shape)
    return here.exponent - jnp.log(here.ratio)


def radius(xi: Array, shape: Shape, steps: int) -> Array:
    """x at which the share xi of the energy has left, by `steps` steps from a guess; 0 at xi = 0, infinite at 1."""
    left = jnp.maximum(1.0 - xi, jnp.finfo(jnp.result_type(xi, float)).tiny)
    t = -jnp.log(left)
    x = radius_at(t, xi / left / jnp.maximum(t, NEAREST), shape, steps)
    return jnp.where(xi < 1.0, x, jnp.inf)


def growth(t: Array) -> Array:
    """(e^t - 1) / t, smooth at 0; where its square would leave the format it grows no more: 1/kappa is all then."""
    near, far = jnp.minimum(t, 0.1), jnp.clip(t, 0.1, 0.45 * math.log(jnp.finfo(t.dtype).max))
    series = 1.0 + near / 2 * (1.0 + near / 3 * (1.0 + near / 4 * (1.0 + near / 5 * (1.0 + near / 6))))
    return jnp.where(t < 0.1, series, jnp.expm1(far) / far)


def radius_at(t: Array, growth: Array, shape: Shape, steps: int) -> Array:
    """x at t = -ln(1 - xi), growth = xi / ((1 - xi) t) = (e^t - 1) / t."""
    p, q = GUESS
    rise = shape.source - shape.kappa
    white = q * (rise / shape.source) ** 2
    stretch = (1.0 - white) + p * t + white * growth
    x = t * stretch / (shape.kappa * stretch + rise)
    for _ in range(steps):
        x = _closer(x, t, shape)
    return x


def _closer(x: Array, t: Array, shape: Shape) -> Array:
    near = jnp.clip(x, NEAREST, FARTHEST)
    here = _local(near, shape)
    flight = 1.0 / here.hazard
    step = (t - here.exponent + jnp.log(here.ratio)) * flight
    y = -here.bend * flight * step
    return jnp.maximum(near + step * (1.0 + y * (1.0 / 2 + y * (1.0 / 6))), 0.0)


def _local(x: Array, shape: Shape) -> Local:
    q, per_h = shape.h / x, 1.0 / shape.h
    numerator, denominator, above = 1.0 + x * (shape.a + x * shape.b), 1.0 + shape.c * x, 1.0 + q
    # One reciprocal for three quotients.
    inverse = 1.0 / (numerator * denominator * above)
    rest, one_over_n, one_over_d = (
        numerator * denominator * inverse,
        denominator * above * inverse,
        numerator * above * inverse,
    )
    early, spent = _early(x, q, per_h, rest)
    up, down = (shape.a + 2.0 * shape.b * x) * one_over_n, shape.c * one_over_d
    return Local(
        shape.kappa * x + shape.w * shape.h * early,
        denominator * one_over_n,
        shape.kappa + shape.w * spent + up - down,
        shape.w * per_h * q * (spent - (q * rest) ** 2) + 2.0 * shape.b * one_over_n - up * up + down * down,
    )


def _early(x: Array, q: Array, per_h: Array, rest: Array) -> tuple[Array, Array]:
    """V and V' at z = x/h: V = z (1 - z ln(1 + q)), q = 1/z, rest = 1/(1 + q)."""
    z = x * per_h
    log = z * jnp.log(1.0 + q)
    s = jnp.minimum(q, SERIES)
    series = 1.0 / 2 - s * (1.0 / 3 - s * (1.0 / 4 - s * (1.0 / 5 - s * (1.0 / 6 - s * (1.0 / 7)))))
    slope_series = s * s * (1.0 / 3 - s * (1.0 / 2 - s * (3.0 / 5 - s * (2.0 / 3 - s * (5.0 / 7)))))
    far = q < SERIES
    return jnp.where(far, series, z * (1.0 - log)), jnp.where(far, slope_series, 1.0 - 2.0 * log + rest)
