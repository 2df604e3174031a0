"""Reflectance profile from its transform: the inverse Hankel transform, over jax.numpy.

    R_d(r) = (1/2 pi) int_0^inf k R^(k) J0(k r) dk
    int_0^r 2 pi r' R_d(r') dr' = r int_0^inf R^(k) J1(k r) dk

J is the real part of the Hankel function H^(1), which decays above the real axis. So k may run along the contour of
`transform`, where H0^(1)(z) = -(2i/pi) K0(-iz) and H1^(1)(z) = -(2/pi) K1(-iz): no zeros, no cancellation,
and full relative accuracy far into the exponential tail. On the way H1's pole at k = 0 is passed, which is all of the
energy, and leaves that beyond r. Lengths are in mean free paths; `x` is r in them.
"""

from __future__ import annotations

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim.exact.special_functions import bessel_k
from mcml_sim.exact.transform import NEAREST_RADIUS, NO_LIGHT, Transform

MAX_STEPS = 60  # of Newton's method, which takes twelve at most where xi < 1 - 1e-8
SETTLED = 4e-15  # of the logarithm of a share: its rounding


def profile(transform: Transform, alpha: jax.Array, x: jax.Array) -> jax.Array:
    """Return R_d [1/mfp^2] at radii x >= 0 of any shape; infinite at the source, 0 at infinity."""
    somewhere = jnp.where((x == 0.0) | (x == jnp.inf), 1.0, x)
    value = alpha * (ring_density(transform, somewhere) / (2.0 * np.pi * somewhere))
    return jnp.where(x == jnp.inf, 0.0, jnp.where((x == 0.0) & (alpha > 0.0), jnp.inf, jnp.where(x == 0.0, 0.0, value)))


def cdf(transform: Transform, x: jax.Array) -> jax.Array:
    """Return the share of the reflected energy that leaves within x, >= 0 and of any shape."""
    somewhere = jnp.where(x == jnp.inf, 1.0, x)
    within = 1.0 - _energy_beyond(transform, somewhere)
    return jnp.where(x == jnp.inf, 1.0, within * jnp.minimum(x / NEAREST_RADIUS, 1.0))


def ring_density(transform: Transform, x: jax.Array) -> jax.Array:
    """Return 2 pi x R_d(x) / alpha [1/mfp] at finite radii x >= 0 of any shape; 1/2 at the source."""
    inside = _solved(transform, x)
    # Nothing of A is left in the sum, nor of its derivative in alpha, which is infinite at alpha = 1.
    total = jax.lax.stop_gradient(transform.reflectance)
    rest = transform.value - (_concentrated(inside) * total)[..., None]
    waves = bessel_k(0, -1j * transform.k * inside[..., None])
    density = inside * jnp.sum((transform.weight * transform.k * (-2j / np.pi) * rest * waves).real, axis=-1)
    return jnp.maximum(density, 0.0) * (inside / jnp.maximum(x, inside)) ** 2


def radius_within(transform: Transform, xi: jax.Array) -> jax.Array:
    """Return the radius within which the share xi in [0, 1], of any shape, leaves.

    Newton's method for the logarithm of the share beyond. Where the surface does not refract, its slope falls from 1/2A
    at the source to kappa far away, so that from a point on the near side, such as the first, every step ends on that
    side and closer. Where it does, a step that leaves what is known to lie on either side goes halfway instead.
    """
    share = jnp.where(xi == 1.0, 0.0, xi)
    target = -jnp.log1p(-share)

    def excess(x: jax.Array) -> tuple[jax.Array, jax.Array]:
        beyond = jnp.maximum(_energy_beyond(transform, x), 1e-300)
        beyond = jnp.where(x < NEAREST_RADIUS, 1.0 - (1.0 - beyond) * x / NEAREST_RADIUS, beyond)
        return target + jnp.log(beyond), ring_density(transform, x) / (transform.reflectance * beyond)

    def is_far(state: tuple[jax.Array, ...]) -> jax.Array:
        step, x, change, _, _ = state
        return (step < MAX_STEPS) & jnp.any(jnp.abs(change) > 1e-13 * x)

    def improve(state: tuple[jax.Array, ...]) -> tuple[jax.Array, ...]:
        step, x, _, low, high = state
        error, slope = excess(x)
        low, high = jnp.where(error > 0.0, x, low), jnp.where(error < 0.0, x, high)
        newton = jnp.where(jnp.abs(error) > SETTLED, jnp.maximum(error / slope, -0.9 * x), 0.0)
        halved = jnp.where(high == jnp.inf, x, 0.5 * (low + high) - x)
        change = jnp.where((newton == 0.0) | ((x + newton > low) & (x + newton < high)), newton, halved)
        return step + 1, x + change, change, low, high

    first = 2.0 * transform.reflectance * target
    between = jnp.zeros_like(first), jnp.full_like(first, jnp.inf)
    start: tuple[jax.Array, ...] = (jnp.zeros((), int), first, first, *between)
    _, x, *_ = jax.lax.while_loop(is_far, improve, start)
    return jnp.where(xi == 1.0, jnp.inf, x)


def _energy_beyond(transform: Transform, x: jax.Array) -> jax.Array:
    """Return the share of the reflected energy beyond x, or beyond NEAREST_RADIUS if that is farther."""
    inside = _solved(transform, x)
    # Next to the derivative in alpha of A, infinite at alpha = 1, no other counts.
    conservative = transform.farthest < NO_LIGHT
    held = jax.tree.map(lambda leaf: jnp.where(conservative, jax.lax.stop_gradient(leaf), leaf), transform)
    here = _concentrated(inside)
    rest = held.value - (here * held.reflectance)[..., None]
    waves = bessel_k(1, -1j * held.k * inside[..., None])
    energy = inside * jnp.sum((held.weight * (2.0 / np.pi) * rest * waves).real, axis=-1)
    beyond = held.pole * (1.0 - here) + energy / held.reflectance
    beyond = jnp.clip(beyond, 0.0, 1.0) * inside / jnp.maximum(x, inside)
    return beyond + (1.0 - beyond) * (1.0 - held.reflectance / transform.reflectance)


def _concentrated(x: jax.Array) -> jax.Array:
    """Return the share of the energy that the sums take away at the source, where it adds nothing to R_d(x).

    Far away only what R^ has beside R^(0) counts, which the sum would else be left with as a small difference; near
    the source R^(0) would be the large part.
    """
    return x * x / (1.0 + x * x)


def _solved(transform: Transform, x: jax.Array) -> jax.Array:
    """Return the nearest radius that the contour reaches; at alpha = 1 light ends in R_d ~ x^-3."""
    return jnp.clip(x, NEAREST_RADIUS, transform.farthest)
