"""Exact light of a half space, interpolated over albedo and radius: what a fit evaluates thousands of times.

Light scattered once is closed (`single_scattering`); the rest, over alpha^2, is smooth in s = sqrt(1 - alpha) up to
both ends, and in ln x once its decay e^{-kappa x} (1 + kappa x) is taken out. So

    2 pi x R_d = alpha D_1(x) + alpha^2 e^{f(s, ln x) - kappa x} (1 + kappa x)

with f a cubic spline in ln x whose coefficients are Chebyshev polynomials in s. Between its nodes this is within 1e-5
of `mcml_sim.exact` for x up to 20 mfp, within 3e-4 farther out, until light has fallen by e^-20. Beyond x = 28 /
kappa, where the exact solution runs out of digits (12 / kappa next to white), R_d goes on as e^{-kappa x} (1 + kappa
x) / x^3.
"""

from __future__ import annotations

from functools import lru_cache

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mcml_sim import exact
from mcml_sim.exact import single_scattering
from mcml_sim.media.setting import Setting

Floats = NDArray[np.float64]
EXACT = "exact"  # its name among laws
DEGREES = 64  # Chebyshev polynomials in s
STEP = 0.06  # of ln x
NEAREST, FARTHEST = 1e-4, 1e3  # mfp, of f; nearer, light scattered more than once is taken for x (1 - ln x) of itself
SINGLE_NEAREST = 1e-7  # mfp, of ln D_1
LEAST = 1e-3  # albedo below which f no longer changes
SOLVED, SOLVED_WHITE, WHITE = (
    28.0,
    12.0,
    0.06,
)  # kappa x that the exact solution reaches; the second where kappa < WHITE
ROUNDING = 1e-14
ENERGY = np.polynomial.legendre.leggauss(32)


class ExactLight(eqx.Module):
    """The profile of a half space with `setting`; lengths in mean free paths."""

    setting: Setting = eqx.field(static=True)
    rest: Array
    """f's spline in Chebyshev polynomials of s, (degrees, intervals, 4), powers falling."""
    once: Array
    """Of ln D_1 + k_c x, (intervals, 4)."""
    kappa: Array
    """Of kappa in the same polynomials as f, (degrees,)."""
    share: Array
    """A / alpha in Chebyshev polynomials of s, (degrees,)."""

    def total(self, alpha) -> Array:
        """Total reflectance A [-]."""
        return alpha * (_chebyshev(jnp.sqrt(1.0 - alpha), 1.0) @ self.share)

    def ring_density(self, x: Array, alpha: Array) -> Array:
        """2 pi x R_d [1/mfp] at x > 0 of any shape, of one albedo."""
        log = jnp.log(x)
        critical = single_scattering.critical_rate(self.setting)
        once = jnp.exp(_spline(self.once, (log - np.log(SINGLE_NEAREST)) / STEP) - critical * x)
        polynomials = _chebyshev(jnp.sqrt(1.0 - alpha), np.sqrt(1.0 - LEAST))
        spline, kappa = jnp.tensordot(polynomials, self.rest, 1), polynomials @ self.kappa
        inside = jnp.clip(x, NEAREST, FARTHEST)
        light = jnp.exp(_spline(spline, (jnp.log(inside) - np.log(NEAREST)) / STEP) - kappa * x) * (1.0 + kappa * x)
        near = jnp.minimum(x, NEAREST)
        light = light * near * (1.0 - jnp.log(near)) / (NEAREST * (1.0 - np.log(NEAREST)))
        light = light * (inside / jnp.maximum(x, inside)) ** 2
        return alpha * once + alpha**2 * light

    def scaled_profile(self, x: Array, alpha: Array) -> Array:
        """R_d [1/mfp^2]."""
        return self.ring_density(x, alpha) / (2.0 * jnp.pi * x)

    def scaled_cdf(self, x: Array, alpha: Array) -> Array:
        """Share of the reflected energy within x [-], to 1e-4."""
        t, weight = 0.5 * (1.0 + ENERGY[0]), 0.5 * ENERGY[1]
        parts = self.ring_density(jnp.maximum(x, 1e-30)[..., None] * t**3, alpha) * (3.0 * t**2 * weight)
        return jnp.clip(x * jnp.sum(parts, axis=-1) / self.total(alpha), 0.0, 1.0)


@lru_cache(maxsize=8)
def exact_light(setting: Setting) -> ExactLight:
    """Of a half space that `mcml_sim.exact` solves; SettingError of another. A second."""
    s = np.sqrt(1.0 - LEAST) * 0.5 * (1.0 + _nodes())
    alpha = 1.0 - s**2
    log = np.arange(np.log(NEAREST), np.log(FARTHEST) + STEP, STEP)
    kappa = np.asarray(exact.decay_rate(alpha))[:, None]
    x = np.exp(log)[None]
    solved = np.minimum(x, np.where(kappa > WHITE, SOLVED, SOLVED_WHITE) / kappa)
    light = 2.0 * np.pi * solved * exact.profile(solved, alpha[:, None], setting=setting)
    rest = (light - alpha[:, None] * np.exp(_log_once(solved, setting))) / alpha[:, None] ** 2
    f = np.log(rest) + kappa * solved - np.log1p(kappa * solved) - 2.0 * np.log(x / solved)
    near = np.arange(np.log(SINGLE_NEAREST), np.log(FARTHEST) + STEP, STEP)
    far = single_scattering.critical_rate(setting) * np.exp(near)
    whole = _nodes() * 0.5 + 0.5
    tables = (
        _coefficients(CubicSpline(log, f, axis=1).c.transpose(2, 1, 0)),
        CubicSpline(near, _log_once(np.exp(near), setting) + far).c.T,
        _coefficients(kappa[:, 0]),
        _coefficients(np.asarray(exact.reflectance(1.0 - whole**2, setting=setting)) / (1.0 - whole**2)),
    )
    with jax.enable_x64(True):
        return ExactLight(setting, *map(jnp.asarray, tables))


def _log_once(x: Floats, setting: Setting) -> Floats:
    """ln of D_1 = 2 pi x R_1 / alpha, light scattered once [1/mfp], also where D_1 has long underflowed."""
    k, weight = single_scattering.transform_density(setting)
    critical = single_scattering.critical_rate(setting)
    decayed = np.exp(-np.multiply.outer(x, k - critical)) @ (k * weight)
    return np.log(single_scattering.entered(setting) * decayed) - critical * x


def _nodes() -> Floats:
    return np.cos(np.pi * (np.arange(DEGREES) + 0.5) / DEGREES)


def _coefficients(values: Floats) -> Floats:
    """Of Chebyshev polynomials, from values at `_nodes`, (DEGREES, ...)."""
    matrix = 2.0 / DEGREES * np.cos(np.outer(np.arange(DEGREES), np.pi * (np.arange(DEGREES) + 0.5) / DEGREES))
    matrix[0] *= 0.5
    found: Floats = np.tensordot(matrix, values, 1)
    return found


def _chebyshev(s, most: float) -> Array:
    """All polynomials at s in [0, most]; above it those at `most`."""
    # Next to either end the angle has no derivative.
    z = jnp.clip(s / most * 2.0 - 1.0, ROUNDING - 1.0, 1.0 - ROUNDING)
    return jnp.cos(jnp.arange(DEGREES) * jnp.arccos(z))


def _spline(coefficients: Array, at: Array) -> Array:
    """At places in intervals of STEP, (intervals, 4) and (...)."""
    interval = jnp.clip(jnp.floor(at), 0, coefficients.shape[0] - 1).astype(int)
    t = (at - interval) * STEP
    a, b, c, d = jnp.moveaxis(coefficients[interval], -1, 0)
    return d + t * (c + t * (b + t * a))
