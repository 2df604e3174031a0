"""Rational maps between alpha and A, exact at both ends and closed both ways, with and without a refracting interface.

Under one they hold the light scattered once, too, which is exact.
"""

from __future__ import annotations

import abc
from dataclasses import replace
from functools import reduce
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from profilefit.laws.base import CLOSED, Entry, Normalisation, Range, Text, evaluated
from profilefit.laws.surface import Number, RefractingSurface, surface_of

REFRACTING = Range(1.0, 1.6, open_low=True)  # n [-] that constants are fitted to
INDICES, COSINES = Range(1.3, 1.5, open_low=True), Range(0.0, 0.95, open_low=True)  # n and g [-] of those with g
STEPS = 6  # of Newton's method in the inverse, which starts right to a hundredth, a tenth where g > .9
COUNTS = {"c": 5, "d": 6, "f": 2}  # constants of each at g = 0, coefficients of powers of q
TEXT = Text("refracting_rational", (), prefix="rational")
ENTRY = Entry("rational", "rational map", is_map=True, records=("albedo-rational",), own=True, text=TEXT)  # of each map


class Rational(Normalisation):
    """A = (1 - s)(1 + b s) / (1 + c s + d s^2),  s = sqrt(1 - alpha), where nothing refracts.

    A(0) = 0 and A(1) = 1 whatever the constants, and dA/ds is finite at s = 0 as in the exact solution, where 1 - A is
    proportional to s. The inverse is the root in [0, 1] of (b + A d) s^2 + (1 - b + A c) s - (1 - A) = 0.
    """

    b: float
    c: float
    d: float
    # The limits hold for any start, and this one gives A within 0.1.
    entry = replace(ENTRY, start={"b": 0.5, "c": 2.0, "d": 1.0}, text=Text("rational", ()))

    @evaluated
    def reflectance(self, alpha) -> Array:
        s = jnp.sqrt(1.0 - alpha)
        # 1 - s as alpha / (1 + s): where alpha is small, the difference has no digits.
        return alpha * (1.0 + self.b * s) / ((1.0 + s) * (1.0 + s * (self.c + self.d * s)))

    @evaluated
    def albedo_over_reflectance(self, alpha) -> Array:
        s = jnp.sqrt(1.0 - alpha)
        return (1.0 + s) * (1.0 + s * (self.c + self.d * s)) / (1.0 + self.b * s)

    @evaluated
    def alpha(self, reflectance) -> Array:
        linear = 1.0 - self.b + reflectance * self.c
        quadratic = self.b + reflectance * self.d
        rest = 1.0 - reflectance
        # The cancellation-free root: linear is positive.
        s = 2.0 * rest / (linear + jnp.sqrt(linear**2 + 4.0 * quadratic * rest))
        return 1.0 - s**2


class Terms(NamedTuple):
    """The map at one index: A / alpha = p (1 + b s + f s^2) / ((1 + s)(g0 + g1 s + g2 s^2 + g3 s^3)).

    p = entered (1 - rho) [-];  m0 ... m3 those of the light scattered twice and more, alpha^2 M(s) / ((1 + s)^2 G(s))
    """

    p: Number
    b: Number
    c: Number
    d: Number
    f: Number
    g: tuple[Number, Number, Number, Number]
    m: tuple[Number, Number, Number, Number]


class FoldedRational(Normalisation):
    """Map of a reflectance that is rational inside, under a refracting interface.

    A = t (1 - rho) R / (1 - rho R),  R = (1 - s)(1 + b s + f s^2) / (1 + c s + d s^2),  s = sqrt(1 - a)

    a is the reduced albedo; t is the share of the light that enters, rho that which the surface reflects back of
    cosine-weighted light from inside: were all light inside cosine-weighted, R would be the reflectance without a
    surface, whatever n. What c, d and f are made of is each map's own (`folded`).

    b follows from light scattered once, which is exact: A / a -> A_1 at a = 0. So A(0) = 0, the slope there and A(1) =
    t hold whatever the constants. The inverse is the root in [0, 1] of a cubic in s; no albedo reflects more than t,
    and alpha(A > t) = 1.
    """

    surface: RefractingSurface | None = eqx.field(default=None, kw_only=True, metadata=CLOSED)

    @classmethod
    def at_one_index(cls) -> tuple[str, ...]:
        return ("c0", "d0", "f0")

    @abc.abstractmethod
    def folded(self) -> tuple[Number, Number, Number]:
        """c, d, f at its index and g."""

    def here(self) -> RefractingSurface:
        """Return the closed numbers of its setting, or of those that it was put under."""
        return self.surface or surface_of(self.setting)

    def text_numbers(self) -> dict[str, float]:
        """Return the share that enters, rho, and A_1 over alpha [-]."""
        here = self.here()
        return {"entered": here.entered, "trapped": here.trapped, "once": here.once}

    def text_constants(self) -> dict[str, float]:
        c, d, f = self.folded()
        return {"c": float(c), "d": float(d), "f": float(f)}

    @property
    def entered(self) -> float:
        """t, the share of the light that enters [-]."""
        return float(self.here().entered)

    def terms(self) -> Terms:
        """All that depends on n and g only."""
        here = self.here()
        (c, d, f), rho, once = self.folded(), here.trapped, here.once
        p = here.entered * (1.0 - rho)
        b = 2.0 * once / p * (1.0 + c + d) - 1.0 - f
        g = 1.0 - rho, c - rho * (b - 1.0), d - rho * (f - b), rho * f
        m0 = p - once * g[0]
        m1 = m0 + p * b - once * (g[0] + g[1])
        m2 = m1 + p * f - once * (g[1] + g[2])
        return Terms(p, b, c, d, f, g, (m0, m1, m2, once * g[3]))

    @evaluated
    def reflectance(self, alpha) -> Array:
        return alpha / self.albedo_over_reflectance(alpha)

    @evaluated
    def albedo_over_reflectance(self, alpha) -> Array:
        """Return alpha / A [-], finite at alpha = 0 too."""
        s, of = jnp.sqrt(1.0 - alpha), self.terms()
        return (1.0 + s) * _cubic(of.g, s) / (of.p * (1.0 + s * (of.b + of.f * s)))

    @evaluated
    def scattered_again(self, alpha) -> Array:
        """Reflectance by light scattered twice and more over alpha^2 [-], of a reduced albedo.

        A - alpha A_1 without its cancellation.
        """
        s, of = jnp.sqrt(1.0 - alpha), self.terms()
        return _cubic(of.m, s) / ((1.0 + s) ** 2 * _cubic(of.g, s))

    @evaluated
    def alpha(self, reflectance) -> Array:
        here, of = self.here(), self.terms()
        share = jnp.minimum(reflectance / here.entered, 1.0)
        inside = 1.0 - here.trapped * (1.0 - share)
        light, dark = share / inside, (1.0 - here.trapped) * (1.0 - share) / inside  # R and 1 - R
        # In s where A is large, in 1 - s where it is small, so that neither cancels.
        s = _root(dark, 1.0 - of.b + light * of.c, of.b - of.f + light * of.d, of.f)
        linear = 1.0 + of.b + of.f + light * (of.c + 2.0 * of.d)
        y = _root(light * (1.0 + of.c + of.d), linear, -(of.b + 2.0 * of.f + light * of.d), of.f)
        return jnp.where(share < 0.5, y * (2.0 - y), (1.0 - s) * (1.0 + s))


class RefractingRational(FoldedRational):
    """Map `FoldedRational` where g = 0, of constants that depend on n since light inside is not cosine-weighted.

    They do by q = mu_c^(2/3), mu_c = sqrt(1 - 1/n^2): A changes fastest next to n = 1.

    c = c0 + c1 q + c2 q^2 + c3 q^3 + c4 q^4     d likewise, up to d5 q^5     f = f0 + f1 q

    For n in (1, 1.6], under either light.
    """

    __annotations__ = {f"{name}{i}": "float" for name, count in COUNTS.items() for i in range(count)}
    entry = replace(
        ENTRY,
        start={  # within a hundredth of the exact map
            **{"c0": 1.6, "c1": 0.1, "c2": 0.1, "c3": 0.1, "c4": 0.1, "f0": 0.03, "f1": 0.01},
            **{"d0": 0.4, "d1": 0.5, "d2": 1.0, "d3": 0.5, "d4": 0.1, "d5": -0.1},
        },
        n=REFRACTING,
    )

    def folds(self) -> dict[str, dict[str, float]]:
        q = self.here().cosine ** (2 / 3)
        return {x: {one: q ** int(one[1]) for one in self.constant_names() if one[0] == x} for x in "cdf"}

    def folded(self) -> tuple[Number, Number, Number]:
        q = self.here().cosine ** (2 / 3)
        each = ([getattr(self, f"{name}{i}") for i in range(count)] for name, count in COUNTS.items())
        c, d, f = (reduce(lambda rest, own: own + q * rest, reversed(own)) for own in each)
        return c, d, f


class ForwardRational(FoldedRational):
    """`FoldedRational` with g as an argument: similarity in the reduced albedo holds next to white only.

    c = c0 + c2 (1 - g)^2 + c3 (1 - g)^3 + cn rho, d and f likewise: 12 constants [-] for n from 1.3 to 1.5, g up to
    .95, under either light. A_1 is that of the phase function.
    """

    __annotations__ = {f"{name}{term}": "float" for name in COUNTS for term in "023n"}
    entry = replace(
        ENTRY,
        start={  # within a tenth of the exact map
            **{"c0": -0.2, "c2": 6.7, "c3": -4.6, "cn": -0.1},
            **{"d0": -0.9, "d2": 4.5, "d3": -1.7, "dn": 1.3},
            **{"f0": 0.8, "f2": -5.8, "f3": 5.0, "fn": -0.2},
        },
        n=INDICES,
        g=COSINES,
    )

    def folds(self) -> dict[str, dict[str, float]]:
        here = self.here()
        forward = 1.0 - float(here.g)
        terms = {"0": 1.0, "2": forward**2, "3": forward**3, "n": float(here.trapped)}
        return {letter: {letter + name: value for name, value in terms.items()} for letter in "cdf"}

    def folded(self) -> tuple[Number, Number, Number]:
        here = self.here()
        z, rho = 1.0 - here.g, here.trapped
        each = ([getattr(self, name + term) for term in "023n"] for name in COUNTS)
        c, d, f = (k0 + z**2 * (k2 + z * k3) + rho * kn for k0, k2, k3, kn in each)
        return c, d, f


def _cubic(terms: tuple[Number, Number, Number, Number], s: Array) -> Array:
    return terms[0] + s * (terms[1] + s * (terms[2] + s * terms[3]))


def _root(rest: Array, linear: Array, quadratic: Array, cubic: Number) -> Array:
    """Return x >= 0 with rest = linear x + quadratic x^2 + cubic x^3, by Newton's method from the quadratic's."""
    inside = linear**2 + 4.0 * quadratic * rest
    root = jnp.where(inside > 0.0, jnp.sqrt(jnp.where(inside > 0.0, inside, 1.0)), 0.0)  # 0 has no derivative
    x = 2.0 * rest / (linear + root)
    for _ in range(STEPS):
        over = x * (linear + x * (quadratic + x * cubic)) - rest
        x = x - over / (linear + x * (2.0 * quadratic + 3.0 * cubic * x))
    return x
