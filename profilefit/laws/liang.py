"""The laws of Liang et al.: a rational profile with a largest radius, and an inverse cdf fitted on its own.

Source: Liang et al., a subsurface scattering method from an accurate fit of the reflectance profile (Journal of
Software). Equation numbers are that paper's.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from itertools import pairwise

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from profilefit.laws.base import Entry, Normalisation, ProfileLaw, Range, Sampler, Text, evaluated

PROFILE_CONSTANTS = ("a1", "a2", "a3", "b0", "b1", "b2", "b3", "b4", "c1", "c2", "c3")
INVERSE_CONSTANTS = ("g1", "g2", "g3", "g4", "h1", "h2", "h3")
QUANTILES = ("radius", "relative_radius", "share")
DARKEST = float(np.float32(1e-6))  # alpha [-] that the text takes where it is less: at 0 it is 0/0
EPS = 0.01  # of (19)
# Halvings of [0, 1] after which a float64 inverse stops moving.
BISECTIONS = 60


class LiangSampler(Sampler):
    """r = min(|g(xi)|, r_max): g is negative for xi < eps, where a radius in the opposite direction is meant.

    The clip at r_max collects all larger g in one atom; `pdf` is the density beside it.
    """

    law: Liang

    @evaluated
    def unclipped(self, xi, alpha) -> Array:
        """g(xi) in units of the mfp   (19)-(20)."""
        law = self.law
        k1 = law.g1 * alpha ** (law.g2 * alpha**law.g3 + law.g4)
        k2 = law.h1 * alpha ** (law.h2 * alpha + law.h3)
        return (k1 * xi - k2) * jnp.sqrt(xi) * jnp.log(1.0 + law.eps - xi)

    def scaled_sample(self, xi: Array, alpha: Array) -> Array:
        return jnp.minimum(jnp.abs(self.unclipped(xi, alpha)), self.law.largest_radius(alpha))

    @eqx.filter_jit  # the halvings are loops, which would compile anew at each call
    def scaled_pdf(self, x: Array, alpha: Array) -> Array:
        x, alpha = jnp.broadcast_arrays(x, alpha)
        start, eps = jnp.zeros_like(alpha), jnp.full_like(alpha, self.law.eps)
        turn = _halved(lambda xi: ~(self._slope(xi, alpha) < 0), start, eps)[0]  # where g is most negative
        ends = start, turn, eps, jnp.ones_like(alpha)
        density = sum(self._branch_density(x, alpha, low, high) for low, high in pairwise(ends))
        return jnp.where((x > 0) & (x < self.law.largest_radius(alpha)), density, 0.0)

    def _radius(self, xi, alpha) -> Array:
        return jnp.abs(self.unclipped(xi, alpha))

    def _branch_density(self, x, alpha, low, high) -> Array:
        """Return the density of radii x of xi in [low, high], where |g| is monotone; 0 where there are none."""
        first, last = self._radius(low, alpha), self._radius(high, alpha)
        reached = (x > jnp.minimum(first, last)) & (x < jnp.maximum(first, last))
        rising = last > first
        left, right = _halved(lambda xi: (self._radius(xi, alpha) > x) == rising, low, high)
        slope = jnp.abs(self._slope(0.5 * (left + right), alpha))
        return jnp.where(reached, 1.0 / slope, 0.0)

    def _slope(self, xi, alpha) -> Array:
        """dg/dxi."""
        law = self.law
        k1 = law.g1 * alpha ** (law.g2 * alpha**law.g3 + law.g4)
        k2 = law.h1 * alpha ** (law.h2 * alpha + law.h3)
        root, ln = jnp.sqrt(xi), jnp.log(1.0 + law.eps - xi)
        return (k1 + (k1 * xi - k2) / (2.0 * xi)) * root * ln - (k1 * xi - k2) * root / (1.0 + law.eps - xi)


def _halved(is_beyond: Callable[[Array], Array], low: Array, high: Array) -> tuple[Array, Array]:
    """Return the bracket (low, high) of the place from which `is_beyond` holds, halved to rounding."""

    def halve(_, bracket):
        middle = 0.5 * (bracket[0] + bracket[1])
        beyond = is_beyond(middle)
        return jnp.where(beyond, bracket[0], middle), jnp.where(beyond, middle, bracket[1])

    return lax.fori_loop(0, BISECTIONS, halve, (low, high))


class Liang(ProfileLaw):
    """r R_d = (a r + b) / (r + c) up to r_max = -b/a, scaled to the reflectance; lengths in units of l   (7), (18).

    a = a1 alpha + a2 0.1^(-a3 (alpha - 1))                        (9)-(11), printed -0.0064, 0.00316, 30
    b = b0 alpha^k,  k = (b1 (alpha - b2)^2 + b3) alpha + b4       (12)-(13), printed 0.461, 6.7, 0.45, 2.6, 1.3
    c = c1 exp(c2 alpha) + c3                                      (14)-(15), printed 0.0097, 4.2, 0.166
    g(xi) = (k1 xi - k2) sqrt(xi) ln(1 + eps - xi),  r = min(g, r_max)          (19), (21)
    k1 = g1 alpha^(g2 alpha^g3 + g4), k2 = h1 alpha^(h2 alpha + h3)             (20), printed 1.504, 2.175, 0.7,
                                                                                0.19, 3.993, 3.268, 0.2838
    Valid for alpha in (0, 1]: at alpha = 0 r_max is 0/0. The reflectance that (17)-(18) normalise to is `albedo`'s.

    albedo  the map from alpha to A used for normalisation (held fixed)
    eps     the eps of (19) [-], 0.01
    """

    albedo: Normalisation = eqx.field(static=True)
    a1: float
    a2: float
    a3: float
    b0: float
    b1: float
    b2: float
    b3: float
    b4: float
    c1: float
    c2: float
    c3: float
    g1: float
    g2: float
    g3: float
    g4: float
    h1: float
    h2: float
    h3: float
    eps: float = eqx.field(static=True, default=EPS)
    entry = Entry(
        "liang",
        "Liang et al.",
        records=("liang-whole", "liang-inverse-whole"),
        alpha=Range(low=DARKEST),
        xi=Range(low=EPS),  # below, a second time small radii
        as_fitted=True,  # for dark media g turns back before xi = 1
        text=Text(
            "liang",
            ("rational", "near_zero"),
            clamps="R_d within 1e-6 mfp of the source to that at 1e-6 mfp; alpha to at least 1e-6; radii to r_max",
        ),
    )
    sampler_class = LiangSampler

    @classmethod
    def seen_by(cls, objective: str) -> tuple[str, ...]:
        """Return the constants of the profile or of the inverse cdf, which share none."""
        if objective in ("energy", "relative", "radial"):
            return PROFILE_CONSTANTS
        return INVERSE_CONSTANTS if objective in QUANTILES else ()

    def text_numbers(self) -> dict[str, float]:
        """Return eps of the inverse [-], its root, and the largest -ln(1 + eps - xi)."""
        return {"eps": self.eps, "root": self.eps**0.5, "depth": -math.log(self.eps)}

    def coefficients(self, alpha) -> tuple[Array, Array, Array]:
        """Return a [1/mfp], b [-] and c [mfp] at albedo alpha, for l = 1   (9)-(15)."""
        a = self.a1 * alpha + self.a2 * 0.1 ** (-self.a3 * (alpha - 1.0))
        k = (self.b1 * (alpha - self.b2) ** 2 + self.b3) * alpha + self.b4
        return a, self.b0 * alpha**k, self.c1 * jnp.exp(self.c2 * alpha) + self.c3

    @evaluated
    def largest_radius(self, alpha) -> Array:
        """r_max = -b/a in units of the mfp: beyond it the law is zero."""
        a, b, _ = self.coefficients(alpha)
        return -b / a

    def unscaled_energy(self, x, alpha) -> Array:
        """Energy within x = r/l before the correction (18): A cdf(r) of (17), constant beyond r_max [-]."""
        a, b, c = self.coefficients(alpha)
        return rational_energy(jnp.minimum(x, -b / a), a, b, c)

    def source_strength(self, alpha) -> Array:
        _, b, c = self.coefficients(alpha)
        return 2.0 * jnp.pi * b / c

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        a, b, c = self.coefficients(alpha)
        total = rational_energy(-b / a, a, b, c)
        inside = x < -b / a
        safe = jnp.where(x > 0, x, 1.0)
        value = (a * safe + b) / (safe + c) / safe * self.albedo.reflectance(alpha) / total
        return jnp.where(inside, jnp.where(x > 0, value, jnp.inf), 0.0)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        return self.unscaled_energy(x, alpha) / self.unscaled_energy(jnp.inf, alpha)

    @property
    def samplers(self) -> dict[str, Sampler]:
        """Not the inverse of this law's cdf, but one that was fitted beside it."""
        return {"fitted": self.sampler}


def rational_energy(x, a, b, c) -> Array:
    """2 pi times the integral from 0 to x of (a r + b) / (r + c)   (17), without the division by A."""
    return 2.0 * jnp.pi * (a * x + (b - a * c) * jnp.log1p(x / c))
