"""Two-dimensional Fourier transform of a half space's reflectance profile, over jax.numpy.

At transverse wave number k the half space is a "pseudo" medium with an H function of its own (Chandrasekhar 1950;
Rybicki, J. Quant. Spectrosc. Radiat. Transf. 11, 1971; Williams, J. Fluid Mech. 2007; d'Eon, A Hitchhiker's Guide to
Multiple Scattering, 2016):

    ln H_k(v) = -(v/pi) int_0^inf ln L(K) / (1 + v^2 x^2) dx,     L(K) = 1 - alpha arctan(K)/K,   K = sqrt(k^2 + x^2)
    searchlight  R^(k) = (alpha/2) H_k(1) int_0^1 H_k(1/s) / (1 + s) dm,                 s = sqrt(1/m^2 + k^2)
    diffuse      R^(k) = alpha int_0^1 int_0^1 H_k(1/s) H_k(1/s') / (s + s') dm dm'
    1 / H_k(1) = sqrt(L(k)) + (alpha/2) int_0^1 H_k(1/s) / ((1 + s) (1 + k^2 m^2)) dm

Lengths are in mean free paths. What makes few nodes enough:

- k runs along 0.9 i kappa + rho e^{i pi/4}, kappa the decay rate of the profile, L(i kappa) = 0; see `by_albedo`.
- The zeros of L, at distance kappa from the origin, are divided out: with (K^2 + kappa^2) / (K^2 + 1) for L it is
  H_k(1/s) = (s + sqrt(k^2 + 1)) / (s + sqrt(k^2 + kappa^2)), and what is left has no scale but 1.
- x runs along a ray halfway between the singularities on either side, as |sqrt(k^2 + 1)| sinh(u); trapezoids in u,
  and in the logarithm of rho, converge exponentially (Takahasi & Mori, Publ. RIMS 9, 1974).
- m = sinh(y)/k along a straight line from y = 0: s = k coth(y) has none of the branch points of the square root.

All that is differentiable in alpha. The result does not depend on where contour and nodes lie, so these are held.
"""

from __future__ import annotations

from dataclasses import astuple, dataclass
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim.exact import special_functions as special

# Closer to the source than this the profile is its own limit, alpha / (4 pi r), to 1e-5 [mfp].
NEAREST_RADIUS = 1e-6
# At alpha = 1 light falls off as a power, and is that power beyond, to 1e-9 [mfp].
FARTHEST_RADIUS = 1e6
NO_LIGHT = 1e100  # mfp: nothing is left there but in a conservative medium, and products are finite
START = 0.9  # of the contour, of the way to the singularity at i kappa
DIRECTION = complex(np.exp(0.25j * np.pi))
CONSERVATIVE_SCALE = 0.1 / FARTHEST_RADIUS  # of rho where there is no kappa to set one
LAST_WAVE = 35.0  # k r where e^{i k r} has decayed to e^-25
# rho = scale e^{v - e^-v} ends double exponentially at v below 0: at this v it has 1e-16 of its scale left.
FIRST_V = -3.5
# Stands for k = 0, where m = sinh(y)/k is y/k in floating point too [1/mfp].
ORIGIN = 1e-30 + 0j
X_SCALE, X_LAST = 0.33, 1e4  # of sqrt(k^2 + 1): the x from which nodes grow apart, and the last one


@dataclass(frozen=True)
class Rule:
    """Number of nodes of each quadrature: k, m and x here, the others of `refracting`, where the surface refracts."""

    k: int
    m: int
    x: int
    line: int = 12  # number of wave numbers of a panel
    depth: int = 96  # number of nodes x of `cone`
    angles: int = 72
    degree: int = 18  # number of polynomials in w

    def scaled(self, factor: float) -> Rule:
        """Return the rule with that many times as many nodes."""
        return Rule(*(round(factor * count) for count in astuple(self)))


# Leaves 5e-12 of the profile wrong for alpha in [0.05, 0.999], and 1e-10 at alpha = 1, whose contour has the longest
# way to go; with a tenth less of all three it is 1e-10 and 3e-9. See `benchmarks/exact.py`.
STANDARD = Rule(k=224, m=24, x=40)


class Transform(NamedTuple):
    """Transform of one albedo on its contour, over alpha, so that it has a limit where alpha is 0."""

    k: jax.Array  # wave numbers, complex128 (nodes,) [1/mfp]
    weight: jax.Array  # steps dk, complex128 (nodes,) [1/mfp]
    value: jax.Array  # values R^(k) / alpha, complex128 (nodes,) [-]
    reflectance: jax.Array  # ratio A / alpha, float64 () [-]
    pole: jax.Array  # part of A that the contour leaves out beyond a radius [-]: 1/2 where it starts at 0
    farthest: jax.Array  # radius from which on R_d is its power, r^-3 [mfp]: below NO_LIGHT where alpha = 1


@partial(jax.custom_jvp, nondiff_argnums=(1, 2))
def solve(alpha: jax.Array, illumination: str, rule: Rule = STANDARD) -> Transform:
    """Return the transform of one albedo, a float64 scalar in [0, 1]."""
    k, weight = _contour(alpha, rule)
    value = over_alpha(alpha, jnp.append(k, ORIGIN), illumination, rule)
    return _of_values(alpha, k, weight, value)


@solve.defjvp
def _solve_jvp(illumination: str, rule: Rule, primals: tuple, tangents: tuple) -> tuple[Transform, Transform]:
    """Differentiate under the integral, on held nodes: reverse mode keeps no more of it than the result."""
    (alpha,), (d_alpha,) = primals, tangents
    k, weight = _contour(alpha, rule)
    value, slope = _with_slope(alpha, jnp.append(k, ORIGIN), illumination, rule)
    of_value, of_total = slope[:-1] * d_alpha, slope[-1].real * d_alpha
    held = jnp.zeros_like(k), jnp.zeros_like(k)
    tangent = Transform(*held, of_value, of_total, jnp.zeros_like(alpha), jnp.zeros_like(alpha))
    return _of_values(alpha, k, weight, value), tangent


@partial(jax.custom_jvp, nondiff_argnums=(1, 2))
def reflectance_over_alpha(alpha: jax.Array, illumination: str, rule: Rule = STANDARD) -> jax.Array:
    """Return A / alpha = R^(0) / alpha of one albedo, a float64 scalar in [0, 1]; 1 at alpha = 1."""
    return _total(alpha, over_alpha(alpha, jnp.full(1, ORIGIN), illumination, rule))


@reflectance_over_alpha.defjvp
def _reflectance_jvp(illumination: str, rule: Rule, primals: tuple, tangents: tuple) -> tuple[jax.Array, jax.Array]:
    value, slope = _with_slope(primals[0], jnp.full(1, ORIGIN), illumination, rule)
    return _total(primals[0], value), slope[0].real * tangents[0]


def _with_slope(alpha: jax.Array, k: jax.Array, illumination: str, rule: Rule) -> tuple[jax.Array, jax.Array]:
    """Return R^(k) / alpha and its derivative in alpha, infinite at alpha = 1, k = 0: 1 - A goes with its root."""
    value, slope = jax.jvp(lambda a: over_alpha(a, k, illumination, rule), (alpha,), (jnp.ones_like(alpha),))
    return value, jnp.where((alpha == 1.0) & (k == ORIGIN), jnp.inf, slope)


def _total(alpha: jax.Array, value: jax.Array) -> jax.Array:
    """Return A / alpha, from the last wave number, which is none; 1 where nothing is absorbed."""
    return jnp.where(alpha == 1.0, 1.0, value[-1].real)


def _of_values(alpha: jax.Array, k: jax.Array, weight: jax.Array, value: jax.Array) -> Transform:
    """Return the transform of values at k and, last, at the origin: where alpha is 1 the contour starts there."""
    is_white = alpha == 1.0
    ends = jnp.where(is_white, 0.5, 0.0), jnp.where(is_white, FARTHEST_RADIUS, NO_LIGHT)
    return Transform(k, weight, value[:-1], _total(alpha, value), *ends)


def _contour(alpha: jax.Array, rule: Rule) -> tuple[jax.Array, jax.Array]:
    """Return k and dk, each (rule.k,)."""
    kappa = jnp.sqrt(special.squared_decay_rate(jax.lax.stop_gradient(alpha)))
    scale = jnp.where(kappa > 0.0, (1.0 - START) * kappa, CONSERVATIVE_SCALE)
    step = (jnp.log(LAST_WAVE / (NEAREST_RADIUS * scale)) - FIRST_V) / (rule.k - 1)
    v = FIRST_V + step * np.arange(rule.k)
    rho = scale * jnp.exp(v - jnp.exp(-v))
    return START * kappa * 1j + DIRECTION * rho, DIRECTION * (step * rho * (1.0 + jnp.exp(-v)))


def over_alpha(alpha: jax.Array, k: jax.Array, illumination: str, rule: Rule) -> jax.Array:
    """Return R^(k) / alpha for k of shape (n,), not 0."""
    branch = special.square_root(1.0 + k * k)[:, None]
    cosh, m, dm = _m_line(k[:, None], branch, rule)
    s = cosh / m
    h, of_k = _h_function(alpha, k[:, None], branch, s, rule)
    outgoing = dm * h
    if illumination == "diffuse":
        pairs = outgoing[:, :, None] * outgoing[:, None, :]
        return jnp.sum(pairs / (s[:, :, None] + s[:, None, :]), axis=(1, 2))
    normal = outgoing / (1.0 + s)
    inverse_h = special.square_root(of_k) + 0.5 * alpha * jnp.sum(normal / cosh**2, axis=1)
    return 0.5 * jnp.sum(normal, axis=1) / inverse_h


def _m_line(k: jax.Array, branch: jax.Array, rule: Rule) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return sqrt(1 + k^2 m^2), m and dm for k and sqrt(1 + k^2) of shape (n, 1), each (n, m).

    Gauss nodes t on (0, 1); y = t^2 asinh(k), whose square suits the m ln m of H at grazing angles.
    """
    nodes, weights = np.polynomial.legendre.leggauss(rule.m)
    t = 0.5 * (nodes + 1.0)
    top = special.inverse_sinh(k, branch)
    sinh, cosh = special.sinh_and_cosh(top * t**2)
    return cosh, sinh / k, cosh * (top / k) * (weights * t)


def _h_function(
    alpha: jax.Array, k: jax.Array, branch: jax.Array, s: jax.Array, rule: Rule
) -> tuple[jax.Array, jax.Array]:
    """Return H_k(1/s) for k and sqrt(1 + k^2) of shape (n, 1) and s of shape (n, m), and L(k), (n,)."""
    square = special.squared_decay_rate(alpha)
    # The first node, u = 0, has no weight and is there for its integrand.
    step = np.log(2.0 * X_LAST / X_SCALE) / rule.x
    u = np.append(0.0, step * (np.arange(rule.x) + 0.5))
    du = np.append(0.0, np.full(rule.x, step))
    du[-1] = step / -np.expm1(-2.0 * step)  # beyond, the integrand falls as e^{-2u}: a geometric series
    ray = 0.5 * X_SCALE * (branch + jnp.sqrt(branch.real**2 + branch.imag**2))  # halves the argument of the branch
    x = ray * np.sinh(u)
    squared = k * k + x * x
    values = special.dispersion(alpha, squared)
    rest = special.logarithm(values * (squared + 1.0) / (squared + square)) * (ray * np.cosh(u) * du)
    # Held, or XLA works out each of them anew for every term of the sum.
    rest, s_square, x_square = jax.lax.optimization_barrier((rest, s * s, x * x))
    integral = s * jnp.sum(rest[:, None, :] / (s_square[:, :, None] + x_square[:, None, :]), axis=2)
    return (s + branch) / (s + special.square_root(k * k + square)) * jnp.exp(-integral / np.pi), values[:, 0]
