"""Rational maps between alpha and A, exact at both ends and closed both ways: what they share, and that of n = 1."""

from __future__ import annotations

import abc

import jax.numpy as jnp
from jax import Array

from profilefit.laws.base import AlbedoLaw, Entry, Range, Text
from profilefit.laws.evaluate import evaluated


class Normalisation(AlbedoLaw):
    """A map that profile laws are scaled to their reflectance with."""

    @property
    @abc.abstractmethod
    def entered(self) -> float:
        """The share of the light that enters [-], which a white half space gives back."""

    @property
    def reflectances(self) -> Range:
        """Range of reflectances: up to what the surface lets out of a white semi-infinite medium."""
        return Range(0.0, self.entered)

    @abc.abstractmethod
    def albedo_over_reflectance(self, alpha) -> Array:
        """Return alpha / A [-], finite at alpha = 0 too."""


class Rational(Normalisation):
    """A = (1 - s)(1 + b s) / (1 + c s + d s^2),  s = sqrt(1 - alpha), where nothing refracts.

    A(0) = 0 and A(1) = 1 whatever the constants, and dA/ds is finite at s = 0 as in the exact solution, where 1 - A is
    proportional to s. The inverse is the root in [0, 1] of (b + A d) s^2 + (1 - b + A c) s - (1 - A) = 0.
    """

    b: float
    c: float
    d: float
    entry = Entry(
        "rational",
        "rational map",
        is_map=True,
        records=("albedo-rational",),
        start={"b": 0.5, "c": 2.0, "d": 1.0},  # the limits hold for any, and these give A within 0.1
        own=True,
        text=Text("rational", ()),
    )

    @property
    def entered(self) -> float:
        return 1.0

    def text_numbers(self) -> dict[str, float]:
        return {"entered": self.entered}

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
