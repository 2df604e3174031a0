"""Dispersion function of isotropic scattering, 1 - alpha arctan(K)/K, and its root, over jax.numpy."""

from __future__ import annotations

import jax
import jax.numpy as jnp

from mcml_sim.exact.special_functions import arctangent, square_root

# Below this albedo 1 - kappa^2 = 4 e^{-2 / alpha} is far below rounding.
LEAST_ALBEDO = 0.02
NEWTON_STEPS = 6  # from a start within 20 % of the root; four reach rounding
SMALL_SQUARE = 0.05  # |K^2| below which 1 - arctan(K)/K cancels and its series is used,
SERIES_TERMS = 13  # which ends below rounding


def dispersion(alpha: jax.Array, square: jax.Array) -> jax.Array:
    """Return 1 - alpha arctan(K)/K by the square K^2 of complex K, not real below -1."""
    return (1.0 - alpha) + alpha * _arctan_defect(square)


def _arctan_defect(square: jax.Array) -> jax.Array:
    """Return 1 - arctan(K)/K = K^2/3 - K^4/5 + ..."""
    small = jnp.abs(square) < SMALL_SQUARE
    t = jnp.where(small, square, 0.0)
    series = jnp.zeros_like(t)
    for n in range(SERIES_TERMS, 0, -1):
        series = t * ((-1) ** (n + 1) / (2 * n + 1) + series)
    root = square_root(jnp.where(small, 1.0, square))
    return jnp.where(small, series, 1.0 - arctangent(root) / root)


@jax.custom_jvp
def squared_decay_rate(alpha: jax.Array) -> jax.Array:
    """Return kappa^2, where alpha artanh(kappa)/kappa = 1; smooth in alpha on [0, 1], unlike kappa.

    With kappa = tanh(t) it is t coth(t) = 1/alpha, which Newton's method solves for t^2.
    """
    alpha = jnp.maximum(alpha, LEAST_ALBEDO)
    excess = (1.0 - alpha) / alpha
    square = excess * (3.0 + excess)  # right to first order for either small or large t

    def improve(_: int, square: jax.Array) -> jax.Array:
        value, slope = _coth_excess(square)
        return square - (value - excess) / slope

    square = jax.lax.fori_loop(0, NEWTON_STEPS, improve, square)
    return jnp.tanh(jnp.sqrt(square)) ** 2


def _coth_excess(square: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return t coth(t) - 1 and its derivative by the square of t, with the series where they would cancel."""
    small = square < SMALL_SQUARE
    x = jnp.where(small, square, 0.0)
    # B_2n 2^2n / (2n)!, n = 1, 2, ... (Abramowitz & Stegun 1964, 4.5.67)
    terms = (1 / 3, -1 / 45, 2 / 945, -1 / 4725, 2 / 93555, -1382 / 638512875, 4 / 18243225, -3617 / 162820783125)
    series, slope = jnp.zeros_like(x), jnp.zeros_like(x)
    for n in range(len(terms), 0, -1):
        series, slope = x * (terms[n - 1] + series), n * terms[n - 1] + x * slope
    t = jnp.sqrt(jnp.where(small, 1.0, square))
    coth = 1.0 / jnp.tanh(t)
    value = jnp.where(small, series, t * coth - 1.0)
    return value, jnp.where(small, slope, (coth - t / jnp.sinh(t) ** 2) / (2.0 * t))


@squared_decay_rate.defjvp
def _squared_decay_rate_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    """Return the derivative from T(q) = artanh(kappa)/kappa = 1/alpha, T' = (1/(1 - q) - T) / (2 q), q = kappa^2."""
    (alpha,), (d_alpha,) = primals, tangents
    square = squared_decay_rate(alpha)
    safe = jnp.maximum(alpha, LEAST_ALBEDO)
    small = square < SMALL_SQUARE
    q = jnp.where(small, square, 0.0)
    series = jnp.zeros_like(q)
    for n in range(SERIES_TERMS, 0, -1):
        series = n / (2 * n + 1) + q * series
    one_less = jnp.where(small | (square == 1.0), 0.5, 1.0 - square)
    slope = jnp.where(small, series, (1.0 / one_less - 1.0 / safe) / (2.0 * jnp.where(small, 1.0, square)))
    # 1/T' at kappa = 1 is 0
    return square, jnp.where(square == 1.0, 0.0, -1.0 / (safe**2 * slope)) * d_alpha


def decay_rate(alpha: jax.Array) -> jax.Array:
    """Return kappa, 1 at alpha = 0 and 0 at alpha = 1."""
    return jnp.sqrt(squared_decay_rate(alpha))
