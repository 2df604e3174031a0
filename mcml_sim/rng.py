"""Random words as a pure function of (seed, batch, photon, event): no state, so no order to keep.

The generator is pcg4d (Jarzynski & Olano, Hash functions for GPU rendering, JCGT 9(3), 2020) with one more xor-shift
at its end. Without that the low output bits never see the high input bits; with it every input bit flips every
output bit with probability 1/2. All steps are invertible, so within a batch no two events share their four words.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

MULTIPLIER, INCREMENT = 1664525, 1013904223  # Numerical Recipes' LCG, as in pcg4d
BELOW_ONE = 1 - 2.0**-24  # the largest float32 below 1


def batch_key(seed: int, batch: int) -> NDArray[np.uint32]:
    """Four key words for one batch of one seed, mixed on the host so that neighbouring seeds share nothing."""
    return np.random.SeedSequence(seed, spawn_key=(batch,)).generate_state(4, np.uint32).astype(np.uint32)


def draw(key: Array, photon: Array, event: Array) -> tuple[Array, Array, Array, Array]:
    """Four independent uint32 words for each (photon, event); both are uint32 arrays of one shape, `key` uint32[4]."""
    x, y, z, w = (
        v * jnp.uint32(MULTIPLIER) + jnp.uint32(INCREMENT) for v in (photon + key[0], event + key[1], key[2], key[3])
    )
    x, y, z, w = _xor_shift(*_round(x, y, z, w))
    return _xor_shift(*_round(x, y, z, w))


def uniform(words: Array) -> Array:
    """float32 in (0, 1): 24 bits everywhere and steps of 2^-32 near 0, so -log(u) reaches 22.9, not 16."""
    return jnp.minimum((words.astype(jnp.float32) + 0.5) * jnp.float32(2.0**-32), jnp.float32(BELOW_ONE))


def symmetric(words: Array) -> Array:
    """float32 in [-1, 1], never 0, with steps of 2^-31 near 0."""
    signed = lax.bitcast_convert_type(words, jnp.int32)
    return (signed.astype(jnp.float32) + 0.5) * jnp.float32(2.0**-31)


def _round(x: Array, y: Array, z: Array, w: Array) -> tuple[Array, Array, Array, Array]:
    x = x + y * w
    y = y + z * x
    z = z + x * y
    w = w + y * z
    return x, y, z, w


def _xor_shift(x: Array, y: Array, z: Array, w: Array) -> tuple[Array, Array, Array, Array]:
    return x ^ (x >> 16), y ^ (y >> 16), z ^ (z >> 16), w ^ (w >> 16)
