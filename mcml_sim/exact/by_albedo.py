"""Functions of an albedo's transform on arrays of radii and albedos of any shape: numpy's, or jax's.

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
from mcml_sim.exact.transform import STANDARD, Rule, Transform
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import ILLUMINATIONS, Setting, is_traced

Kernel = Callable[[Transform, jax.Array, jax.Array], jax.Array]
"""(transform, alpha, x) -> the quantity wanted, at radii or shares x of any shape, of one albedo."""

Each = Callable[[jax.Array, "Surface"], jax.Array]
"""(alpha, surface) -> the quantity wanted, of one albedo."""

BLOCK = 64


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
