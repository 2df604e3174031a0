"""Exact light of a half space, interpolated over albedo and radius: what is evaluated thousands of times.

Light scattered once is closed (`single_scattering`); the rest, over alpha^2, is smooth in s = sqrt(1 - alpha) up to
both ends, and in ln x once its decay e^{-kappa x} (1 + kappa x) is taken out. So

    2 pi x R_d = alpha D_1(x) + alpha^2 e^{f(s, ln x) - kappa x} (1 + kappa x)

with f a cubic spline in ln x whose coefficients are Chebyshev polynomials in s.

Where scattering has a direction, lengths are in l* = 1 / (mu_a + mu_s (1 - g)) and alpha is the reduced albedo
mu_s (1 - g) l*. D_1 belongs to the unreduced medium, 1 + alpha g / (1 - g) mean free paths an l*.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from scipy.interpolate import CubicSpline

from mcml_sim.exact import single_scattering
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import SEARCHLIGHT, Setting

STEP = 0.06  # of ln x, of D_1
SINGLE_NEAREST, SINGLE_FARTHEST = 1e-7, 1e5  # mfp
LEAST = 1e-3  # albedo below which f no longer changes
ROUNDING = 1e-14
GONE = 40.0  # kappa x, from where there is no light that counts
ENERGY = np.polynomial.legendre.leggauss(96)


def unreduced(alpha: Any, g: float) -> Any:
    """Return mu_s / (mu_s + mu_a) of a reduced albedo."""
    return alpha / (alpha + (1.0 - g) * (1.0 - alpha))


class ExactLight(eqx.Module):
    """Profile of a half space with `setting`; albedos and lengths are reduced ones."""

    setting: Setting = eqx.field(static=True)
    g: Array
    critical: Array  # rate k_c of light scattered once [1/mfp]
    nearest: Array  # radius x of f's first knot; nearer, light scattered again is x (1 - ln x) of itself
    farthest: Array  # radius x of the last knot; farther, light goes on as its decay over x^2
    step: Array  # step of ln x, from knot to knot
    rest: Array  # spline of f in Chebyshev polynomials of s, (degrees, intervals, 4), powers falling
    once: Array  # spline of ln D_1 + k_c x, x in mean free paths, (intervals, 4)
    kappa: Array  # decay rate kappa in the same polynomials as f, (degrees,)
    share: Array  # ratio A / alpha in Chebyshev polynomials of s, (degrees,)

    @property
    def unlabelled(self) -> ExactLight:
        """This light without its setting: what is compiled for one serves all."""
        return replace(self, setting=SEARCHLIGHT)

    def total(self, alpha) -> Array:
        """Return the total reflectance A [-]."""
        return alpha * (_chebyshev(self.share.size, jnp.sqrt(1.0 - alpha), 1.0) @ self.share)

    def ring_density(self, x: Array, alpha: Array) -> Array:
        """Return 2 pi x R_d [1/l*] at x > 0 of any shape, of one albedo."""
        paths = x * (1.0 + alpha * self.g / (1.0 - self.g))
        log = (jnp.log(paths) - np.log(SINGLE_NEAREST)) / STEP
        once = jnp.exp(_spline(self.once, log, STEP) - self.critical * paths) / (1.0 - self.g)
        polynomials = _chebyshev(self.kappa.size, jnp.sqrt(1.0 - alpha), np.sqrt(1.0 - LEAST))
        spline, kappa = jnp.tensordot(polynomials, self.rest, 1), polynomials @ self.kappa
        inside = jnp.clip(x, self.nearest, self.farthest)
        at = jnp.log(inside / self.nearest) / self.step
        light = jnp.exp(_spline(spline, at, self.step) - kappa * x) * (1.0 + kappa * x)
        near = jnp.minimum(x, self.nearest)
        light = light * near * (1.0 - jnp.log(near)) / (self.nearest * (1.0 - jnp.log(self.nearest)))
        light = light * (inside / jnp.maximum(x, inside)) ** 2
        return alpha * once + alpha**2 * light

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        """Return R_d [1/l*^2]."""
        return self.ring_density(x, alpha) / (2.0 * jnp.pi * x)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        """Return the share of the reflected energy within x [-], to 1e-6 where g = 0, else as profile and A agree."""
        return jnp.clip(self.energy(x, alpha) / self.total(alpha), 0.0, 1.0)

    def reach(self, alpha: Array) -> Array:
        """Return the radius beyond which e^-40 of the light is left [l*]; infinite at alpha = 1."""
        kappa = _chebyshev(self.kappa.size, jnp.sqrt(1.0 - alpha), np.sqrt(1.0 - LEAST)) @ self.kappa
        return GONE / jnp.maximum(kappa, ROUNDING)

    def energy(self, x: Array, alpha: Array) -> Array:
        """Return the integral of the profile over the disc of radius x [-]."""
        t, weight = 0.5 * (1.0 + ENERGY[0]), 0.5 * ENERGY[1]
        parts = self.ring_density(jnp.maximum(x, 1e-30)[..., None] * t**3, alpha) * (3.0 * t**2 * weight)
        return x * jnp.sum(parts, axis=-1)


def tabulated(setting: Setting, nearest: float, step: float, rest: Floats, kappa: Floats, share: Floats) -> ExactLight:
    """Make the light from numpy arrays, as in `ExactLight`."""
    critical, farthest = single_scattering.critical_rate(setting), nearest * np.exp(step * rest.shape[1])
    parts = setting.g, critical, nearest, farthest, step, rest, once(setting), kappa, share
    with jax.enable_x64(True), jax.core.eval_context():
        return ExactLight(setting, *(jnp.asarray(part, float) for part in parts))


def once(setting: Setting) -> Floats:
    """Return ln D_1 + k_c x as cubics in ln x from SINGLE_NEAREST on, (intervals, 4)."""
    log = np.arange(np.log(SINGLE_NEAREST), np.log(SINGLE_FARTHEST) + STEP, STEP)
    far = single_scattering.critical_rate(setting) * np.exp(log)
    cubics: Floats = CubicSpline(log, log_once(np.exp(log), setting) + far).c.T
    return cubics


def log_once(x: Floats, setting: Setting) -> Floats:
    """Return ln of D_1 = 2 pi x R_1 / alpha, light scattered once [1/mfp], also where D_1 has long underflowed."""
    k, weight = single_scattering.transform_density(setting)
    critical = single_scattering.critical_rate(setting)
    decayed = np.exp(-np.multiply.outer(x, k - critical)) @ (k * weight)
    return np.log(single_scattering.entered(setting) * decayed) - critical * x


def nodes(degrees: int) -> Floats:
    """Return Chebyshev's nodes, from 1 to -1."""
    return np.cos(np.pi * (np.arange(degrees) + 0.5) / degrees)


def coefficients(values: Floats) -> Floats:
    """Return coefficients of Chebyshev polynomials, from values at `nodes`, (degrees, ...)."""
    degrees = values.shape[0]
    matrix = 2.0 / degrees * np.cos(np.outer(np.arange(degrees), np.pi * (np.arange(degrees) + 0.5) / degrees))
    matrix[0] *= 0.5
    series: Floats = np.tensordot(matrix, values, 1)
    return series


def _chebyshev(degrees: int, s, most: float) -> Array:
    """Return all polynomials at s in [0, most]; above it those at `most`."""
    # Next to either end the angle has no derivative.
    z = jnp.clip(s / most * 2.0 - 1.0, ROUNDING - 1.0, 1.0 - ROUNDING)
    return jnp.cos(jnp.arange(degrees) * jnp.arccos(z))


def _spline(coefficients: Array, at: Array, step) -> Array:
    """Return a spline at places in intervals of one step, (intervals, 4) and (...)."""
    interval = jnp.clip(jnp.floor(at), 0, coefficients.shape[0] - 1).astype(int)
    t = (at - interval) * step
    a, b, c, d = jnp.moveaxis(coefficients[interval], -1, 0)
    return d + t * (c + t * (b + t * a))
