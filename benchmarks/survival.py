"""Forms that were tried for the share of light that comes farther than x: what is left is e^{-L(x)}.

Each has the two exact limits built in: L' = near at x = 0, and L ~ far x. Its shapes p are free and positive, given by
their logarithms. Lengths in mfp.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import jax
import jax.numpy as jnp
from jax import Array

Cumulative = Callable[[Array, Array, Array, Array], Array]


@dataclass(frozen=True)
class Form:
    """L(x, p, near, far) with p (shapes,), and ln p to start from."""

    name: str
    cumulative: Cumulative
    start: tuple[float, ...]

    def curve(self, x: Array, shapes: Array, near: Array, far: Array) -> tuple[Array, Array]:
        """What is left [-] and its density 2 pi x R_d / A [1/mfp] at x (...,), p (shapes,)."""
        depth, hazard = jax.jvp(lambda x: self.cumulative(x, shapes, near, far), (x,), (jnp.ones_like(x),))
        left = jnp.exp(-depth)
        return left, left * hazard


def log1p(x: Array) -> Array:
    """ln(1 + x): enough here, and one function where jnp.log1p is another."""
    return jnp.log(1.0 + x)


def even_spread(x: Array, h: Array) -> Array:
    """Integral of 1 - z ln(1 + 1/z), z = x/h: poles at every length from 0 to h alike. Grows as h/2 ln x."""
    z = x / h
    return h * 0.5 * (z - z * z * log1p(1.0 / z) + log1p(z))


def settled_spread(x: Array, h: Array) -> Array:
    """h V(x/h), V(z) = z - z^2 ln(1 + 1/z): decay lengths from 0 to h. Tends to h/2."""
    z = x / h
    return h * (z - z * z * log1p(1.0 / z))


def one_pole(x, p, near, far):
    (h,) = p
    return far * x + h * (near - far) * log1p(x / h)


def two_poles(x, p, near, far):
    a, power, h = p
    return far * x + power * log1p(x / a) + h * (near - far - power / a) * log1p(x / h)


def rational_2_1(x, p, near, far):
    b, c = p
    return far * x + jnp.log((1.0 + x * (c + near - far + b * x)) / (1.0 + c * x))


def rational_3_2(x, p, near, far):
    b, b3, c, d = p
    return far * x + jnp.log((1.0 + x * (c + near - far + x * (b + b3 * x))) / (1.0 + x * (c + d * x)))


def rational_power(x, p, near, far):
    b, c, power = p
    return far * x + power * jnp.log((1.0 + x * (c + (near - far) / power + b * x)) / (1.0 + c * x))


def two_exponentials(x, p, near, far):
    """w e^{-far x} / (1 + x/a) + (1 - w) e^{-b x}."""
    a, b = p
    weight = (near - b) / (far + 1.0 / a - b)
    return -jnp.log(weight * jnp.exp(-far * x) / (1.0 + x / a) + (1.0 - weight) * jnp.exp(-b * x))


def root_near(x, p, near, far):
    a, h, power = p
    root = jnp.sqrt(x)
    settled = (near - far - power / h) * x / (1.0 + a * root) ** 2
    return far * x + settled + power * log1p(x / h)


def distance_pole(x, p, near, far):
    """As a dipole: the distance to a point at depth h, beside one pole."""
    h, power, other = p
    near_by = other * log1p((near - far) * x / other)
    return far * x + 0.5 * power * jnp.log(1.0 + (x / h) ** 2) + near_by


def distance_decay(x, p, near, far):
    """The decay, too, along the distance to a point at depth h."""
    h, power, other = p
    d = jnp.sqrt(x * x + h * h)
    return far * (d - h) + power * jnp.log(d / h) + other * log1p(near * x / other)


def spread(x, p, near, far):
    (h,) = p
    return far * x + (near - far) * even_spread(x, h)


def spread_and_pole(x, p, near, far):
    h, a, power = p
    return far * x + (near - far - power / a) * even_spread(x, h) + power * log1p(x / a)


def settled_and_pole(x, p, near, far):
    h, a, power = p
    return far * x + (near - far - power / a) * settled_spread(x, h) + power * log1p(x / a)


def settled_and_quadratic(x, p, near, far):
    h, a, b, power = p
    return far * x + (near - far - power * a) * settled_spread(x, h) + power * jnp.log(1.0 + x * (a + b * x))


def settled_and_rational(x, p, near, far):
    h, a, b, c = p
    return far * x + (near - far - a + c) * settled_spread(x, h) + jnp.log((1.0 + x * (a + b * x)) / (1.0 + c * x))


HAZARD = Form("settled spread, rational 2/1: the hazard law", settled_and_rational, (0.0, 0.0, -1.0, -1.0))
FORMS = (
    Form("one pole", one_pole, (0.0,)),
    Form("two poles", two_poles, (-1.2, -1.6, 1.1)),
    Form("rational 2/1", rational_2_1, (0.0, 0.0)),
    Form("rational 3/2", rational_3_2, (0.0, -2.0, 1.0, 0.0)),
    Form("a power of rational 2/1", rational_power, (0.0, 0.0, -0.5)),
    Form("a pole and an exponential", two_exponentials, (1.0, 1.0)),
    Form("square root near, a pole", root_near, (1.0, 1.0, 0.0)),
    Form("distance sqrt(x² + h²), a pole", distance_pole, (0.0, 0.0, -1.0)),
    Form("decay along that distance, a pole", distance_decay, (0.0, 0.0, -1.0)),
    Form("even spread of poles", spread, (0.0,)),
    Form("even spread, a pole", spread_and_pole, (0.0, 1.0, 0.0)),
    Form("settled spread, a pole", settled_and_pole, (0.0, 0.0, 0.0)),
    Form("settled spread, a power of a quadratic", settled_and_quadratic, (0.0, 0.0, -1.0, -0.5)),
    HAZARD,
)
