"""Reflectance profile from its transform, on arrays of radii and albedos of any shape: numpy's, or jax's.

The inverse Hankel transform, lengths in mean free paths, `x` for r:

    R_d(r) = (1/2 pi) int_0^inf k R^(k) J0(k r) dk
    int_0^r 2 pi r' R_d(r') dr' = r int_0^inf R^(k) J1(k r) dk

J is the real part of the Hankel function H^(1), which decays above the real axis. So k may run along the contour of
`transform`, where H0^(1)(z) = -(2i/pi) K0(-iz) and H1^(1)(z) = -(2/pi) K1(-iz): no zeros, no cancellation,
and full relative accuracy far into the exponential tail. On the way H1's pole at k = 0 is passed, which is all of the
energy, and leaves that beyond r.

Numpy arrays go through compiled code a block at a time, so that no shape of them compiles anew, and an albedo's
transform is kept. Jax arrays may be traced: nothing is known of them but their shape.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache, partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from mcml_sim.exact import refracting, transform
from mcml_sim.exact.compiled import jit
from mcml_sim.exact.special_functions import bessel_k
from mcml_sim.exact.transform import NEAREST_RADIUS, NO_LIGHT, STANDARD, Rule, Transform
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import ILLUMINATIONS, Setting, is_traced

Kernel = Callable[[Transform, jax.Array, jax.Array], jax.Array]
"""(transform, alpha, x) -> the quantity wanted, at radii or shares x of any shape, of one albedo."""

Each = Callable[[jax.Array, "Surface"], jax.Array]
"""(alpha, surface) -> the quantity wanted, of one albedo."""

BLOCK = 64
MAX_STEPS = 60  # of Newton's method, which takes twelve at most where xi < 1 - 1e-8
SETTLED = 4e-15  # of the logarithm of a share: its rounding

Surface = refracting.Table | None
"""The table of a surface that refracts; None of one that does not."""


def by_alpha(kernel: Kernel, x: Any, alpha: Any, setting: Setting, rule: Rule = STANDARD) -> Any:
    """Return the kernel on x broadcast against alpha, float64 arrays; a jax array if one of them or n is."""
    if any(isinstance(value, jax.Array) for value in (x, alpha, setting.n)):
        return _traced(kernel, jnp.asarray(x), jnp.asarray(alpha), surface(setting, rule), setting.illumination, rule)
    x, alpha = np.broadcast_arrays(x, alpha)
    out = np.empty(x.shape)
    # Worked out at once, even where the caller is being traced: what is kept must hold no tracer of JAX.
    with jax.enable_x64(True), jax.core.eval_context():
        started = []  # all, before the first is waited for
        for value in np.unique(alpha):
            here = alpha == value
            solved = _transform(float(value), setting, rule)
            started.append((here, [_of_block(kernel, solved, value, block) for block in blocks(x[here])]))
        for here, parts in started:
            out[here] = np.concatenate(parts)[: np.count_nonzero(here)]
    return out


def elementwise(function: Each, alpha: Any, of: Surface = None) -> Any:
    """Return `function` of each albedo by itself, a float64 array."""
    if any(isinstance(leaf, jax.Array) for leaf in (alpha, *jax.tree.leaves(of))):
        return _traced_each(function, jnp.asarray(alpha), of)
    with jax.enable_x64(True), jax.core.eval_context():
        parts = [_each(function, block, of) for block in blocks(alpha.ravel())]
        return np.concatenate([np.empty(0), *parts])[: alpha.size].reshape(alpha.shape)


def forget() -> None:
    """Forget all transforms that were kept."""
    _transform.cache_clear()


def surface(setting: Setting, rule: Rule = STANDARD) -> Surface:
    """Return the surface for `solve`; makes a table where there is none."""
    if is_traced(setting.n):
        return refracting.traced_table(jnp.asarray(setting.n), rule)
    return None if setting.n == 1.0 else refracting.kept_table(float(setting.n), rule)


def solve(alpha: jax.Array, of: Surface, illumination: str, rule: Rule = STANDARD) -> Transform:
    """Return the transform of one albedo, a float64 scalar in [0, 1]."""
    if of is None:
        return transform.solve(alpha, illumination, rule)
    return refracting.transform(of, alpha, ILLUMINATIONS.index(illumination), rule)


def total(alpha: jax.Array, of: Surface, illumination: str, rule: Rule = STANDARD) -> jax.Array:
    """Return A / alpha of one albedo."""
    if of is None:
        return transform.reflectance_over_alpha(alpha, illumination, rule)
    return refracting.total(of, alpha, ILLUMINATIONS.index(illumination))


@lru_cache(maxsize=512)
def _transform(alpha: float, setting: Setting, rule: Rule) -> Transform:
    return _solve(np.float64(alpha), surface(setting, rule), setting.illumination, rule)


_solve = jit(solve, static_argnums=(2, 3))


@partial(jit, static_argnums=0)
def _of_block(kernel: Kernel, transform: Transform, alpha: jax.Array, x: jax.Array) -> jax.Array:
    return kernel(transform, alpha, x)


@partial(jit, static_argnums=0)
def _each(function: Each, alpha: jax.Array, of: Surface) -> jax.Array:
    return jax.vmap(function, in_axes=(0, None))(alpha, of)


def blocks(x: Floats, size: int = BLOCK) -> list[Floats]:
    """Return pieces of x (n,) of one length, the last one filled up with its last number."""
    full = np.pad(x, (0, -x.size % size), mode="edge") if x.size else x
    return list(full.reshape(-1, size))


@partial(jit, static_argnums=(0, 4, 5))
def _traced(kernel: Kernel, x: jax.Array, alpha: jax.Array, of: Surface, illumination: str, rule: Rule) -> jax.Array:
    shape = jnp.broadcast_shapes(x.shape, alpha.shape)
    albedos = alpha.ravel()
    transforms = _map(lambda a: solve(a, of, illumination, rule), albedos, at_once=1)
    owner = np.broadcast_to(np.arange(albedos.size).reshape(alpha.shape), shape).ravel()

    def of_pair(pair: tuple[jax.Array, jax.Array]) -> jax.Array:
        own, at = pair
        value = kernel(jax.tree.map(lambda leaf: leaf[own], transforms), albedos[own], at)
        return jnp.where(jnp.isnan(at + albedos[own]), jnp.nan, value)

    return _map(of_pair, (jnp.asarray(owner), jnp.broadcast_to(x, shape).ravel()), at_once=BLOCK).reshape(shape)


@partial(jit, static_argnums=0)
def _traced_each(function: Each, alpha: jax.Array, of: Surface) -> jax.Array:
    return _map(lambda albedo: function(albedo, of), alpha.ravel(), at_once=BLOCK).reshape(alpha.shape)


def _map(function: Callable, arguments: Any, at_once: int) -> Any:
    """Map a function over at most so many at a time (vmap); what fills the last ones up is cut off."""
    size = jax.tree.leaves(arguments)[0].size
    if size <= at_once:
        return jax.vmap(function)(arguments)
    fill = -size % at_once
    full = jax.tree.map(lambda leaf: jnp.pad(leaf, (0, fill), mode="edge"), arguments)
    mapped = jax.lax.map(function, full, batch_size=at_once)
    return jax.tree.map(lambda leaf: leaf[:size], mapped)


def profile(transform: Transform, alpha: jax.Array, x: jax.Array) -> jax.Array:
    """Return R_d [1/mfp^2] at radii x >= 0 of any shape; infinite at the source, 0 at infinity."""
    somewhere = jnp.where((x == 0.0) | (x == jnp.inf), 1.0, x)
    value = alpha * (ring_density(transform, somewhere) / (2.0 * np.pi * somewhere))
    return jnp.where(x == jnp.inf, 0.0, jnp.where((x == 0.0) & (alpha > 0.0), jnp.inf, jnp.where(x == 0.0, 0.0, value)))


def cdf(transform: Transform, alpha: jax.Array, x: jax.Array) -> jax.Array:
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


def radius_within(transform: Transform, alpha: jax.Array, xi: jax.Array) -> jax.Array:
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
