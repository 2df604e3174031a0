"""Special functions over jax.numpy: of finite complex numbers, Bessel's K0 and K1, and the dispersion function.

jax.numpy has the former for every infinity and signed zero, which takes XLA seconds to compile and several times as
long to run; and its sinh of small complex numbers has no digit right.

K0 and K1 take a complex argument and have derivatives of any order. Near the origin their power series (Abramowitz &
Stegun 1964, 9.6.10-13). Elsewhere e^z sqrt(2 z / pi) K(z) is analytic but for a cut along the negative axis, and known
on both of its sides (9.6.31), so that Cauchy's formula gives

    e^z sqrt(2 z / pi) K_v(z) = 1 -+ int_0^inf mu_v(t) / (z + t) dt,   mu_v(t) = sqrt(2 t / pi) e^-t K_v(t) / pi,

- for v = 0 and + for v = 1, with K_v of a real, positive argument. Gauss's rule for the measure mu_v dt turns the
integral into a short sum of partial fractions, the same for all z.
"""

from __future__ import annotations

from functools import lru_cache, partial

import jax
import jax.numpy as jnp
import numpy as np
from scipy.special import digamma, gammaln, k0e, k1e

from mcml_sim.media.arrays import Floats

# Where the series, which cancels ever more, and the partial fractions, which need ever fewer terms, are both good to
# 5e-14.
SERIES_RADIUS = 3.0
SERIES_TERMS = 14
FRACTIONS = 16

# Below this albedo 1 - kappa^2 = 4 e^{-2 / alpha} is far below rounding.
LEAST_ALBEDO = 0.02
NEWTON_STEPS = 6  # from a start within 20 % of the root; four reach rounding
SMALL_SQUARE = 0.05  # |K^2| below which 1 - arctan(K)/K cancels and its series is used,
SMALL_TERMS = 13  # which ends below rounding


@partial(jax.custom_jvp, nondiff_argnums=(0,))
def bessel_k(order: int, z: jax.Array) -> jax.Array:
    """Return K_order(z) for `order` 0 or 1, complex128 `z` != 0, |arg z| <= pi/4; relative error below 1e-13."""
    near, angle = jnp.abs(z) < SERIES_RADIUS, jnp.arctan(z.imag / z.real)  # which takes a quarter of the time
    series = _series(order, jnp.where(near, z, SERIES_RADIUS), angle)
    return jnp.where(near, series, _fractions(order, jnp.where(near, SERIES_RADIUS, z), angle))


@bessel_k.defjvp
def _bessel_k_jvp(order: int, primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    """Differentiate: K0' = -K1 and K1' = -K0 - K1 / z."""
    (z,), (dz,) = primals, tangents
    value = bessel_k(order, z)
    slope = -bessel_k(1, z) if order == 0 else -bessel_k(0, z) - value / z
    return value, slope * dz


def _series(order: int, z: jax.Array, angle: jax.Array) -> jax.Array:
    k = np.arange(SERIES_TERMS)
    bessel_i = np.exp(-gammaln(k + 1) - gammaln(k + order + 1))
    rest = bessel_i * 0.5 * (digamma(k + 1) + digamma(k + order + 1))
    half = 0.5 * z
    square = half * half
    # jnp.log of complex numbers takes ten times as long
    ln_half = jax.lax.complex(0.5 * jnp.log(half.real**2 + half.imag**2), angle)
    logarithmic, regular = ln_half * _polynomial(bessel_i, square), _polynomial(rest, square)
    if order == 0:
        return regular - logarithmic
    return 1.0 / z + half * (logarithmic - regular)


def _polynomial(coefficients: Floats, x: jax.Array) -> jax.Array:
    value = jnp.full_like(x, coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        value = value * x + coefficient
    return value


def _fractions(order: int, z: jax.Array, angle: jax.Array) -> jax.Array:
    real, imag = z.real, z.imag
    sum_real, sum_imag = jnp.zeros_like(real), jnp.zeros_like(imag)
    for pole, weight in zip(*_gauss_rule(order), strict=True):
        part = weight / ((real + pole) ** 2 + imag**2)
        sum_real, sum_imag = sum_real + part * (real + pole), sum_imag - part * imag
    sign = -1.0 if order == 0 else 1.0
    decay = jnp.exp(-real) * jnp.sqrt(0.5 * np.pi / jnp.sqrt(real**2 + imag**2))
    phase = -imag - 0.5 * angle
    wave = jax.lax.complex(decay * jnp.cos(phase), decay * jnp.sin(phase))
    return wave * jax.lax.complex(1.0 + sign * sum_real, sign * sum_imag)


@lru_cache(maxsize=2)
def _gauss_rule(order: int) -> tuple[Floats, Floats]:
    """Return nodes and weights of Gauss's rule for mu_order(t) dt (Golub & Welsch, Math. Comp. 23, 1969).

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


def inverse(z: jax.Array) -> jax.Array:
    """Return 1 / z of z != 0."""
    return jnp.conj(z) / (z.real**2 + z.imag**2)


@jax.custom_jvp
def square_root(z: jax.Array) -> jax.Array:
    """Return the principal root of z != 0."""
    larger = jnp.sqrt(0.5 * (jnp.sqrt(z.real**2 + z.imag**2) + jnp.abs(z.real)))
    smaller = 0.5 * z.imag / larger
    ahead = z.real >= 0.0
    real, imag = jnp.where(ahead, larger, jnp.abs(smaller)), jnp.where(ahead, smaller, jnp.copysign(larger, z.imag))
    return jax.lax.complex(real, imag)


@square_root.defjvp
def _square_root_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    root = square_root(primals[0])
    return root, 0.5 * tangents[0] / root


@jax.custom_jvp
def logarithm(z: jax.Array) -> jax.Array:
    """Return the principal logarithm."""
    return jax.lax.complex(0.5 * jnp.log(z.real**2 + z.imag**2), jnp.arctan2(z.imag, z.real))


@logarithm.defjvp
def _logarithm_jvp(primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    return logarithm(primals[0]), tangents[0] / primals[0]


def arctangent(z: jax.Array) -> jax.Array:
    """Return the principal arctan of z with Re z >= 0 and not near i or beyond it."""
    real, imag = z.real, z.imag
    angle = 0.5 * jnp.arctan2(2.0 * real, 1.0 - real**2 - imag**2)
    return jax.lax.complex(angle, 0.25 * jnp.log1p(4.0 * imag / (real**2 + (1.0 - imag) ** 2)))


def inverse_sinh(z: jax.Array, root: jax.Array) -> jax.Array:
    """Return asinh of z with Re z >= 0 and not near i, and sqrt(1 + z^2); accurate where z is small, too."""
    less_one = z + z * z / (1.0 + root)  # e^asinh(z) - 1
    real, imag = less_one.real, less_one.imag
    return jax.lax.complex(0.5 * jnp.log1p(2.0 * real + real**2 + imag**2), jnp.arctan2(imag, 1.0 + real))


def sinh_and_cosh(z: jax.Array) -> tuple[jax.Array, jax.Array]:
    """Return sinh and cosh, accurate where z is small, too."""
    less_one = jnp.expm1(z.real)
    inverse = 1.0 / (1.0 + less_one)
    # Held, or XLA works them out and compiles them anew wherever they are used.
    sinh, cosh, sin, cos = jax.lax.optimization_barrier(
        (0.5 * less_one * (1.0 + inverse), 1.0 + 0.5 * less_one**2 * inverse, jnp.sin(z.imag), jnp.cos(z.imag))
    )
    return jax.lax.complex(sinh * cos, cosh * sin), jax.lax.complex(cosh * cos, sinh * sin)


def panels(edges: Floats, nodes: int) -> tuple[Floats, Floats]:
    """Return Gauss's nodes and weights in each of the panels between edges (m,), both ((m - 1) nodes,)."""
    t, weight = np.polynomial.legendre.leggauss(nodes)
    half = 0.5 * np.diff(edges)[:, None]
    return (edges[:-1, None] + half * (t + 1.0)).ravel(), (half * weight).ravel()


def dispersion(alpha: jax.Array, square: jax.Array) -> jax.Array:
    """Return 1 - alpha arctan(K)/K by the square K^2 of complex K, not real below -1."""
    return (1.0 - alpha) + alpha * _arctan_defect(square)


def _arctan_defect(square: jax.Array) -> jax.Array:
    """Return 1 - arctan(K)/K = K^2/3 - K^4/5 + ..."""
    small = jnp.abs(square) < SMALL_SQUARE
    t = jnp.where(small, square, 0.0)
    series = jnp.zeros_like(t)
    for n in range(SMALL_TERMS, 0, -1):
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
    for n in range(SMALL_TERMS, 0, -1):
        series = n / (2 * n + 1) + q * series
    one_less = jnp.where(small | (square == 1.0), 0.5, 1.0 - square)
    slope = jnp.where(small, series, (1.0 / one_less - 1.0 / safe) / (2.0 * jnp.where(small, 1.0, square)))
    # 1/T' at kappa = 1 is 0
    return square, jnp.where(square == 1.0, 0.0, -1.0 / (safe**2 * slope)) * d_alpha
