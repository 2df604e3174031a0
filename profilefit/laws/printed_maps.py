"""Printed maps between alpha and A: of Liang et al., of van de Hulst as Kulla and Conty invert him, of Chiang et al."""

from __future__ import annotations

import jax.numpy as jnp
from jax import Array, lax

from profilefit.laws.base import AlbedoLaw, Entry, Range, Text, evaluated

# The slope of Chiang's printed cubic stays within a factor of three: Newton settles in six.
STEPS = 7


class LiangAlbedo(AlbedoLaw):
    """alpha = p A / (A^2 + q A + w)   (8).

    Rises only up to A = sqrt(w); beyond that it folds back, so that two reflectances share one albedo, and
    alpha(1) = p / (1 + q + w) is not 1 unless the constants say so.

    p, q, w  constants [-]; as printed 5.67, 3.84, 0.84

    Source: Liang et al., a subsurface scattering method from an accurate fit of the reflectance profile, equation (8).
    """

    p: float
    q: float
    w: float
    entry = Entry(
        "liang",
        "map of Liang et al.",
        is_map=True,
        records=("albedo-liang",),
        as_fitted=True,
        text=Text("liang_albedo", (), clamps="A(alpha) to where it turns; alpha(A) to 1"),
    )

    def text_numbers(self) -> dict[str, float]:
        """Return the reflectance where it turns [-]."""
        return {"fold": self.fold}

    @property
    def albedos(self) -> Range:
        """Albedos below the largest, at the fold: it has no A for others."""
        return Range(0.0, float(self.alpha(self.fold)), open_high=True)

    @evaluated
    def alpha(self, reflectance) -> Array:
        return self.p * reflectance / (reflectance**2 + self.q * reflectance + self.w)

    @evaluated
    def reflectance(self, alpha) -> Array:
        """Total reflectance A [-] on the rising branch; NaN above the largest albedo that the map reaches."""
        half = 0.5 * (self.p - self.q * alpha)
        return alpha * self.w / (half + jnp.sqrt(half**2 - self.w * alpha**2))

    @property
    def fold(self) -> float:
        """The reflectance above which the map falls again [-]."""
        return float(self.w) ** 0.5


class VanDeHulst(AlbedoLaw):
    """s = p0 + p1 A - sqrt(q0 + q1 A + q2 A^2),  alpha = 1 - s^2  (g = 0; else (1 - s^2) / (1 - g s^2)).

    As printed 4.09712, 4.20863, 9.59217, 41.6808, 17.7126, under diffuse light: within 0.0021 of the exact A. An engine
    shipped 9.59271 for q0. alpha(0) is 6e-6 and alpha(1) is 1 - 3e-11 with these digits. The inverse is the root near 0
    of (p1^2 - q2) A^2 + (2 p1 (p0 - s) - q1) A + (p0 - s)^2 - q0 = 0, cut to [0, 1].

    Near white s passes 0 just before A = 1, so that alpha = 1 - s^2 falls again, by 3e-11; clamping s at 0 mends it.
    The rational map, which is exact at both ends, has no such place.

    Source: C. Kulla and A. Conty, Revisiting physically based shading at Imageworks, SIGGRAPH 2017 course, who invert
    H. C. van de Hulst, Multiple Light Scattering, 1980; also in F. Fong, M. Wrenninge, C. Kulla and R. Habel,
    Production Volume Rendering, SIGGRAPH 2017 course.
    """

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
        square = self.q0 + reflectance * (self.q1 + reflectance * self.q2)
        s = self.p0 + self.p1 * reflectance - jnp.sqrt(square)
        return 1.0 - s**2

    @evaluated
    def reflectance(self, alpha) -> Array:
        rest = self.p0 - jnp.sqrt(1.0 - alpha)
        linear = 2.0 * self.p1 * rest - self.q1
        constant = rest**2 - self.q0
        root = jnp.sqrt(linear**2 - 4.0 * (self.p1**2 - self.q2) * constant)
        return jnp.clip(2.0 * constant / (root - linear), 0.0, 1.0)


class Chiang(AlbedoLaw):
    """alpha = 1 - exp(e1 A + e2 A^2 + e3 A^3); as printed -5.09406, 2.61188, -4.31805.

    alpha(1) is 1 - e^{e1 + e2 + e3} = 0.9989, so that nothing maps to albedos beyond; their A is 1. The inverse is the
    root in [0, 1] of the cubic, which falls there, by Newton's method cut to a bracket.

    Source: M. J.-Y. Chiang, P. Kutz and B. Burley, Practical and controllable subsurface scattering for production path
    tracing, SIGGRAPH 2016 Talks, who fit it to Monte Carlo simulations.
    """

    e1: float
    e2: float
    e3: float
    entry = Entry(
        "chiang",
        "map of Chiang et al.",
        is_map=True,
        text=Text("chiang", ("near_zero",), clamps="alpha to that of A = 1"),
    )

    @evaluated
    def alpha(self, reflectance) -> Array:
        return -jnp.expm1(self._exponent(reflectance))

    @evaluated
    def reflectance(self, alpha) -> Array:
        # Off 0 by less than the rounding of alpha: ln 0 would have no derivative.
        target = jnp.log(jnp.maximum(1.0 - alpha, jnp.finfo(jnp.result_type(alpha, float)).eps ** 2))
        target = jnp.maximum(target, self._exponent(1.0))

        def newton(middle):
            slope = self.e1 + middle * (2.0 * self.e2 + 3.0 * middle * self.e3)
            return middle - (self._exponent(middle) - target) / slope

        def step(_, state):
            low, high, middle = state
            beyond = self._exponent(middle) > target
            low, high = jnp.where(beyond, middle, low), jnp.where(beyond, high, middle)
            return low, high, jnp.clip(newton(middle), low, high)

        zero = jnp.zeros_like(target)
        nearly = lax.fori_loop(0, STEPS, step, (zero, zero + 1.0, zero + 0.5))[2]
        return newton(nearly)  # uncut, for the derivative at both ends

    def _exponent(self, reflectance) -> Array:
        """ln(1 - alpha) [-]."""
        return reflectance * (self.e1 + reflectance * (self.e2 + reflectance * self.e3))
