"""Half space under a surface that refracts, n > 1, scattering isotropically: mirror and escape cone.

A surface that reflected everything would make the half space, with its mirror image, an infinite medium, which a
Fourier transform in depth solves. The real surface is that mirror less the light that leaves through the cone of angles
that total reflection spares. With phi the fluence, its cosine transform u(x) = int_0^inf phi cos(x z) dz obeys, at
transverse wave number k, in mean free paths,

    u(x) = s(x) + alpha [D(x) u(x) - (2/pi) int_0^inf B(x, x') u(x') dx'],     D = arctan(K)/K,   K^2 = k^2 + x^2
    B(x, x') = 1/2 (Q(x) - Q(x')) / (x^2 - x'^2),      R^(k) = (alpha/pi) int_0^inf q(x) u(x) dx

where, with mu the cosine inside to the normal and T Fresnel's transmittance from inside,

    f(x) = mu / sqrt((1 + i x mu)^2 + k^2 (1 - mu^2))            the mean over azimuth of 1 / (1/mu + i (x + k tan cos))
    q(x) = int T (f(x) + f(-x)) / 2 dmu,        Q(x) = -x int (T / mu) (f(x) - f(-x)) / 2i dmu        over the cone
    s = 4 n / (n + 1)^2 / (1 + x^2) under a searchlight,   2 n^2 q under diffuse light,   per photon that arrives

With nodes x of weights w, M = D - (2/pi) sqrt(w) B sqrt(w) is symmetric and knows nothing of alpha:

    R^(k) / alpha = (1/pi) sqrt(w) q . (1 - alpha M)^-1 sqrt(w) s

What makes few nodes enough:

- k and x lie on rays at pi/4, where nothing oscillates (complex scaling); k may start at i b, b < 1.
- The angle of refraction outside is theta = (pi/2) / (1 + e^-tau): trapezoids in tau converge exponentially at both
  ends of the cone. They run midway between the zeros of f's square root, which close in on real angles as k grows.
- x has trapezoids in a variable that is even about 0, fine about the edge of the cone, x = k tan(theta), and else
  logarithmic.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim.exact.compiled import jit
from mcml_sim.exact.special_functions import dispersion, inverse, logarithm, square_root

SLOPES = np.linspace(-0.8, 0.8, 7)  # Im tau of the paths at hand
FIRST_TAU, LAST_TAU = -7.0, 10.0  # beyond, the integrand is its own leading power to 1e-12
FARTHEST_X = 1e3  # of 1 + |k|: the integrand has fallen as x^-4
BISECTIONS = 50


class System(NamedTuple):
    """Equations of the half space at one wave number, on nodes x."""

    matrix: jax.Array  # matrix M, complex128 (x, x)
    leaving: jax.Array  # vector sqrt(w) q, complex128 (x,)
    source: jax.Array  # vectors sqrt(w) s under a searchlight and under diffuse light, complex128 (2, x)


def series(equations: System, orders: int) -> jax.Array:
    """Return m_j, where R^(k) / alpha = sum alpha^j m_j over the orders of scattering less one: (2, orders)."""
    matrix, leaving, source = equations
    _, powers = jax.lax.scan(lambda v, _: (matrix @ v, v), leaving, None, length=orders)
    return source @ powers.T / np.pi


@partial(jit, static_argnames=("x_nodes", "angles"))
def orders(n: float, alpha: float, k: jax.Array, x_nodes: int = 240, angles: int = 72) -> tuple[jax.Array, jax.Array]:
    """Return R^(k) of one albedo at real k > 0 (k,), and the part scattered once: float64 (2, k) each."""

    def at(k: jax.Array) -> tuple[jax.Array, jax.Array]:
        matrix, leaving, source = system(jnp.asarray(n), k + 0j, x_nodes, angles)
        all_orders = jnp.linalg.solve(jnp.eye(x_nodes) - alpha * matrix, leaving)
        return (alpha / np.pi * source @ all_orders).real, (alpha / np.pi * source @ leaving).real

    whole, once = jax.lax.map(at, k)
    return whole.T, once.T


def system(n: jax.Array, k: jax.Array, x_nodes: int, angles: int) -> System:
    """Return the system at k = rho e^{i pi/4} or i b + rho e^{i pi/4}, or real, complex128 (), not 0; n > 1."""
    turn = jnp.where(k.imag == 0.0, 1.0, np.exp(0.25j * np.pi))
    y, dy = _y_nodes(jax.lax.stop_gradient(n), jnp.abs(k), x_nodes)
    x, root = turn * y, jnp.sqrt(dy) * square_root(turn)
    q, h, dh = _over_cone(n, k, turn, y, angles)
    whole, derivative = -x * h, -(h + x * dh) / (2.0 * x)  # Q and dQ / d(x^2)
    squares = x * x
    same = np.eye(x_nodes, dtype=bool)
    apart = jnp.where(same, 1.0, squares[:, None] - squares)
    loewner = jnp.where(same, derivative, (whole[:, None] - whole) * inverse(apart))
    spread = 1.0 - dispersion(jnp.ones(()), squares + k * k)
    matrix = jnp.where(same, spread, 0.0) - root[:, None] * loewner * root / np.pi
    source = root * jnp.stack([4.0 * n / (n + 1.0) ** 2 / (1.0 + squares), 2.0 * n**2 * q])
    return System(matrix, root * q, source)


def _over_cone(
    n: jax.Array, k: jax.Array, turn: jax.Array, y: jax.Array, angles: int
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return q(x), h(x) = -Q / x and dh/dx by nodes of the cone, each complex128 (x,)."""
    both = jnp.stack([y, -y])
    cone = _cone(n, jnp.abs(k), angles)
    middle = _between_singularities(*jax.lax.stop_gradient((n, k, turn * both)))
    nearest = jnp.argmin(jnp.abs(middle[..., None] - SLOPES), axis=-1)
    # XLA takes rows of complex numbers one number at a time.
    mu, sine, weight = (jax.lax.complex(part.real[nearest], part.imag[nearest]) for part in cone)
    depth = 1.0 + 1j * (turn * both)[..., None] * mu
    across = 1j * k * sine
    # The first factor winds from the fourth quadrant to the third, the second from the second to the fourth.
    roots = np.exp(0.25j * np.pi) * square_root(-1j * (depth + across)) * square_root(depth - across)
    over_mu = inverse(roots)  # f / mu
    ahead, back = -0.5j * jnp.sum(over_mu * weight, axis=2)
    moments = weight * mu * over_mu
    q = 0.5 * jnp.sum(moments, axis=(0, 2))
    return q, ahead - back, -0.5 * jnp.sum(depth * moments * over_mu * over_mu, axis=(0, 2))


def _between_singularities(n: jax.Array, k: jax.Array, x: jax.Array) -> jax.Array:
    """Return Im tau halfway between the integrand's singularities on either side of the real axis, (2, x).

    They are Fresnel's, at pi/2, and zeros of (1 + i x mu)^2 + k^2 (1 - mu^2), where mu is that of the cone's sheet.
    """
    square = k * k + x * x
    split = k * square_root(1.0 + square)
    mu = jnp.stack([(1j * x + split) / square, (1j * x - split) / square])
    outside = n * square_root(1.0 - mu * mu)
    theta = -1j * logarithm(1j * outside + square_root(1.0 - outside * outside))
    share = jnp.stack([theta, -theta, np.pi - theta, np.pi + theta]) * (2.0 / np.pi)
    tau = logarithm(share / (1.0 - share)).imag
    known = mu.real > 0.0
    above = jnp.where(known & (tau > 0.0), jnp.minimum(tau, 0.5 * np.pi), 0.5 * np.pi)
    below = jnp.where(known & (tau < 0.0), jnp.maximum(tau, -0.5 * np.pi), -0.5 * np.pi)
    return 0.5 * (jnp.min(above, axis=(0, 1)) + jnp.max(below, axis=(0, 1)))


def _cone(n: jax.Array, k: jax.Array, angles: int) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Return mu, sine and weight of the cone's nodes along the paths, for k = |k|: each complex128 (paths, angles).

    The weights have Fresnel's transmittance and dmu in them.
    """
    first = FIRST_TAU - jnp.log1p(k)
    cosine = jnp.sqrt((n - 1.0) * (n + 1.0)) / n  # of the critical angle
    last = LAST_TAU - jnp.log(jax.lax.stop_gradient(cosine))
    step = (last - first) / (angles - 1)
    tau = first + step * np.arange(angles) + 1j * SLOPES[:, None]
    decay = jnp.exp(-tau)
    share = 1.0 / (1.0 + decay)
    theta, rest = 0.5 * np.pi * share, 0.5 * np.pi * decay * share
    sine, outside = jnp.sin(theta), jnp.sin(rest)
    mu = square_root(cosine**2 + (outside / n) ** 2)
    passes = 2.0 * n * mu * outside * ((outside + n * mu) ** -2 + (mu + n * outside) ** -2)
    weight = passes * sine * outside / (n * n * mu) * theta * decay * share * step
    # Geometric series beyond the ends, where the integrand goes as e^{2 tau} and as e^{-3 tau}.
    ends = jnp.ones(angles).at[0].set(-1.0 / jnp.expm1(-2.0 * step)).at[-1].set(-1.0 / jnp.expm1(-3.0 * step))
    return mu, sine / n, weight * ends


def _y_nodes(n: jax.Array, k: jax.Array, count: int) -> tuple[jax.Array, jax.Array]:
    """Return y and dy of x = y e^{i pi/4}, for k = |k|: midpoints of a variable that is odd in y."""
    cosine = jnp.sqrt((n - 1.0) * (n + 1.0)) / n
    edge, width = k / (n * cosine), 1.0 / cosine
    scale = jnp.minimum(1.0, k)

    def variable(y: jax.Array) -> jax.Array:
        return jnp.arcsinh(y / scale) + 0.5 * (jnp.arcsinh((y - edge) / width) + jnp.arcsinh((y + edge) / width))

    def halve(_: int, between: tuple[jax.Array, jax.Array]) -> tuple[jax.Array, jax.Array]:
        low, high = between
        middle = 0.5 * (low + high)
        below = variable(scale * jnp.sinh(middle)) < levels
        return jnp.where(below, middle, low), jnp.where(below, high, middle)

    last = FARTHEST_X * (1.0 + k)
    step = variable(last) / count
    levels = step * (np.arange(count) + 0.5)
    top = jnp.full(count, jnp.arcsinh(last / scale))
    low, high = jax.lax.fori_loop(0, BISECTIONS, halve, (jnp.zeros(count), top))
    y = scale * jnp.sinh(0.5 * (low + high))
    sides = ((y - edge) ** 2 + width**2) ** -0.5 + ((y + edge) ** 2 + width**2) ** -0.5
    return y, step / ((y * y + scale**2) ** -0.5 + 0.5 * sides)
