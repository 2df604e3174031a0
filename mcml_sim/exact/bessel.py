"""The modified Bessel functions K0 and K1 of complex argument, over jax.numpy, with derivatives of any order.

Near the origin their power series (Abramowitz & Stegun 1964, 9.6.10-13). Elsewhere e^z sqrt(2 z / pi) K(z) is analytic
but for a cut along the negative axis, and known on both of its sides (9.6.31), so that Cauchy's formula gives

    e^z sqrt(2 z / pi) K_v(z) = 1 -+ int_0^inf mu_v(t) / (z + t) dt,   mu_v(t) = sqrt(2 t / pi) e^-t K_v(t) / pi,

- for v = 0 and + for v = 1, with K_v of a real, positive argument. Gauss's rule for the measure mu_v dt turns the
integral into a short sum of partial fractions, the same for all z.
"""

from __future__ import annotations

from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.special import digamma, gammaln, k0e, k1e

Floats = NDArray[np.float64]

# Where the series, which cancels ever more, and the partial fractions, which need ever fewer terms, are both good to
# 5e-14.
SERIES_RADIUS = 3.0
SERIES_TERMS = 14
FRACTIONS = 16


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def bessel_k(order: int, z: jax.Array) -> jax.Array:
    """K_order(z) for `order` 0 or 1 and complex128 `z` != 0 with |arg z| <= pi/4; relative error below 1e-13."""
    near = jnp.abs(z) < SERIES_RADIUS
    series = _series(order, jnp.where(near, z, SERIES_RADIUS))
    return jnp.where(near, series, _fractions(order, jnp.where(near, SERIES_RADIUS, z)))


@bessel_k.defjvp
def _bessel_k_jvp(order: int, primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    """K0' = -K1 and K1' = -K0 - K1 / z."""
    (z,), (dz,) = primals, tangents
    value = bessel_k(order, z)
    slope = -bessel_k(1, z) if order == 0 else -bessel_k(0, z) - value / z
    return value, slope * dz


def _series(order: int, z: jax.Array) -> jax.Array:
    k = np.arange(SERIES_TERMS)
    bessel_i = np.exp(-gammaln(k + 1) - gammaln(k + order + 1))
    rest = bessel_i * 0.5 * (digamma(k + 1) + digamma(k + order + 1))
    half = 0.5 * z
    square = half * half
    # jnp.log of complex numbers takes ten times as long
    ln_half = jax.lax.complex(0.5 * jnp.log(half.real**2 + half.imag**2), jnp.arctan(z.imag / z.real))
    logarithmic, regular = ln_half * _polynomial(bessel_i, square), _polynomial(rest, square)
    if order == 0:
        return regular - logarithmic
    return 1.0 / z + half * (logarithmic - regular)


def _polynomial(coefficients: Floats, x: jax.Array) -> jax.Array:
    value = jnp.full_like(x, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        value = value * x + coefficient
    return value


def _fractions(order: int, z: jax.Array) -> jax.Array:
    real, imag = z.real, z.imag
    sum_real, sum_imag = jnp.zeros_like(real), jnp.zeros_like(imag)
    for pole, weight in zip(*_gauss_rule(order), strict=True):
        part = weight / ((real + pole) ** 2 + imag**2)
        sum_real, sum_imag = sum_real + part * (real + pole), sum_imag - part * imag
    sign = -1.0 if order == 0 else 1.0
    decay = jnp.exp(-real) * jnp.sqrt(0.5 * np.pi / jnp.sqrt(real**2 + imag**2))
    phase = -imag - 0.5 * jnp.arctan(imag / real)
    wave = jax.lax.complex(decay * jnp.cos(phase), decay * jnp.sin(phase))
    return wave * jax.lax.complex(1.0 + sign * sum_real, sign * sum_imag)


@lru_cache(maxsize=2)
def _gauss_rule(order: int) -> tuple[Floats, Floats]:
    """Nodes and weights of Gauss's rule for mu_order(t) dt (Golub & Welsch, Math. Comp. 23, 1969).

    The measure is first put on many nodes, a trapezoid in ln t, whose three-term recurrence Lanczos then finds.
    """
    ln_t = np.linspace(-80.0, 4.2, 900)
    t = np.exp(ln_t)
    scaled = k0e(t) if order == 0 else k1e(t)
    measure = (ln_t[1] - ln_t[0]) * t * np.sqrt(2.0 * t / np.pi) * np.exp(-2.0 * t) * scaled / np.pi
    basis = [np.sqrt(measure / measure.sum())]
    diagonal, beside = [], []
    for _ in range(FRACTIONS):
        new = t * basis[-1]
        diagonal.append(new @ basis[-1])
        for _twice in range(2):  # or rounding brings the earlier ones back
            for old in basis:
                new = new - (new @ old) * old
        beside.append(np.linalg.norm(new))
        basis.append(new / beside[-1])
    nodes, vectors = np.linalg.eigh(np.diag(diagonal) + np.diag(beside[:-1], 1) + np.diag(beside[:-1], -1))
    return nodes, measure.sum() * vectors[0] ** 2
