"""Functions of `mcml_sim.exact` for a half space that scatters forwards, from the table: arrays in, arrays out.

Albedos and radii are those of the medium itself, radii in mean free paths. Arguments are float64 arrays of one shape,
after broadcasting, of numpy or of jax, and so are the answers.
"""

from __future__ import annotations

from functools import partial
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array

from mcml_sim.exact.anisotropic.forward_table import light
from mcml_sim.exact.by_albedo import BLOCK, blocks
from mcml_sim.exact.compiled import filter_jit
from mcml_sim.exact.light import ExactLight, reduced
from mcml_sim.media.setting import Setting

# In l*: nearer than the first, 2 pi r R_d has its limit; the ends between which a share's radius lies.
NEAREST, FARTHEST = 1e-7, 1e30
SHORTEST, LONGEST, HALVINGS = 1e-12, 1e12, 64
FAR = 1e4
DARKEST, LEAST = 1e-200, 1e-300  # an albedo that stands for 0, whose shares are those next to it; of a density


def reflectance(alpha: Any, setting: Setting) -> Any:
    """Return A [-]."""
    return _called(_reflectance, light(setting), alpha, alpha)


def profile(x: Any, alpha: Any, setting: Setting, coarse: bool = False) -> Any:
    """Return R_d [1/mfp^2]; `coarse` as in `forward_table.curves`."""
    return _called(_profile, light(setting, coarse), x, alpha)


def cdf(x: Any, alpha: Any, setting: Setting) -> Any:
    """Return the share of the reflected energy within x [-]."""
    return _called(_cdf, light(setting), x, alpha)


def quantile(xi: Any, alpha: Any, setting: Setting) -> Any:
    """Return the radius within which that share leaves [mfp]."""
    return _called(_quantile, light(setting), xi, alpha)


def _called(function: Any, own: ExactLight, x: Any, alpha: Any) -> Any:
    """Call a function of jax arrays at once; of numpy's a block at a time, so that no shape of them compiles anew."""
    own = own.unlabelled
    if any(isinstance(value, jax.Array) for value in (x, alpha)):
        x, alpha = jnp.broadcast_arrays(x, alpha)
        values = _each(function, own, x.ravel(), alpha.ravel())
        return jnp.where(jnp.isnan(x + alpha), jnp.nan, values.reshape(x.shape))
    is_one = np.ndim(alpha) == 0
    x, albedos = np.broadcast_arrays(x, alpha)
    with jax.enable_x64(True), jax.core.eval_context():
        pairs = zip(blocks(x.ravel(), BLOCK), blocks(albedos.ravel(), BLOCK), strict=True)
        parts = [_each(function, own, jnp.asarray(some), jnp.asarray(alpha if is_one else of)) for some, of in pairs]
    return np.concatenate([np.empty(0), *parts])[: x.size].reshape(x.shape)


@filter_jit
def _each(function: Any, own: ExactLight, x: Array, alpha: Array) -> Array:
    """Call a function at each radius; what depends on the albedo alone is computed once where there is but one."""
    return jax.vmap(partial(function, own), in_axes=(0, None if alpha.ndim == 0 else 0))(x, alpha)


def _reflectance(own: ExactLight, _: Array, alpha: Array) -> Array:
    return own.total(reduced(alpha, own.g).alpha)


def _profile(own: ExactLight, x: Array, alpha: Array) -> Array:
    by, length = reduced(alpha, own.g)
    near = jnp.clip(x / length, NEAREST, FARTHEST)
    around = 2.0 * jnp.pi * jnp.where((x == 0.0) & (alpha == 0.0), 1.0, x) * length  # no light is none at the source
    return own.ring_density(near, by) / around


def _cdf(own: ExactLight, x: Array, alpha: Array) -> Array:
    by, length = reduced(alpha, own.g)
    return _within(own, x / length, by, _whole(own, by))


def _within(own: ExactLight, x: Array, alpha: Array, of: tuple[Array, Array, Array]) -> Array:
    """Return the share within x [l*], of reduced albedos; `of` as in `_whole`.

    It is the share in all light of their profile, from which A differs by the error of the table. Beyond FAR light
    falls off as that of a white medium, if there is any.
    """
    (far, whole, tail), alpha = of, jnp.maximum(alpha, DARKEST)
    return jnp.minimum((own.energy(jnp.minimum(x, far), alpha) + tail * (1.0 - far / jnp.maximum(x, far))) / whole, 1.0)


def _whole(own: ExactLight, alpha: Array) -> tuple[Array, Array, Array]:
    """Return how far there is light, or else FAR; all light of a profile, and that beyond."""
    alpha = jnp.maximum(alpha, DARKEST)
    far = jnp.minimum(FAR, jax.lax.stop_gradient(own.reach(alpha)))
    tail = far * own.ring_density(far, alpha)
    return far, own.energy(far, alpha) + tail, tail


def _quantile(own: ExactLight, xi: Array, alpha: Array) -> Array:
    by, length = reduced(alpha, own.g)
    low, high, of = jnp.log(SHORTEST), jnp.log(LONGEST), _whole(own, by)

    def halved(_: int, ends: tuple[Array, Array]) -> tuple[Array, Array]:
        low, high = ends
        middle = 0.5 * (low + high)
        beyond = _within(own, jnp.exp(middle), by, of) < xi
        return jnp.where(beyond, middle, low), jnp.where(beyond, high, middle)

    ends = jax.lax.fori_loop(0, HALVINGS, halved, (low, high))
    x = jax.lax.stop_gradient(jnp.where(xi == 1.0, 1.0, jnp.exp(0.5 * (ends[0] + ends[1]))))
    # One step of Newton's without its value, for the derivatives of the implicit function.
    density = own.ring_density(x, jnp.maximum(by, DARKEST)) / of[1]
    step = xi - _within(own, x, by, of)
    step = (step - jax.lax.stop_gradient(step)) / jax.lax.stop_gradient(jnp.maximum(density, LEAST))
    return length * jnp.where(xi == 1.0, jnp.inf, jnp.where(xi == 0.0, 0.0, x) + step)
