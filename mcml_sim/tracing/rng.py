"""Random words as a pure function of (seed, batch, photon, event): no state, so no order to keep.

The generators are pcg4d and pcg3d (Jarzynski & Olano, Hash functions for GPU rendering, JCGT 9(3), 2020), each with
one more xor-shift at its end. Without that the low output bits never see the high input bits; with it every input bit
flips every output bit with probability 1/2. All steps are invertible, so within a batch no two events share all words.
"""

from __future__ import annotations

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

MULTIPLIER, INCREMENT = 1664525, 1013904223  # Numerical Recipes' LCG, as in pcg4d
BELOW_ONE = 1 - 2.0**-24  # the largest float32 below 1
LARGEST_WORD = 2.0**32 - 2.0**8  # the largest float32 below 2^32
# -ln(1 - y/2) = y P(y) on 0 <= y <= 1: minimax polynomial by linear programming, relative error 1.5e-7.
LOGARITHM = (
    0.4999999403953552,
    0.12500913441181183,
    0.041482824832201004,
    0.017015652731060982,
    0.0011881014797836542,
    0.012272297404706478,
    -0.008449492044746876,
    0.004628629889339209,
)


def batch_key(seed: int, batch: int) -> NDArray[np.uint32]:
    """Return four key words for one batch of one seed, mixed on the host so that neighbouring seeds share nothing."""
    return np.random.SeedSequence(seed, spawn_key=(batch,)).generate_state(4, np.uint32).astype(np.uint32)


def draw(key: Array, photon: Array, event: Array) -> tuple[Array, Array, Array, Array]:
    """Return four independent uint32 words for each (photon, event), uint32 arrays of one shape; `key` is uint32[4]."""
    words = (photon + key[0], event + key[1], key[2], key[3])
    x, y, z, w = (v * jnp.uint32(MULTIPLIER) + jnp.uint32(INCREMENT) for v in words)
    for _ in range(2):
        x = x + y * w
        y = y + z * x
        z = z + x * y
        w = w + y * z
        x, y, z, w = (word ^ (word >> 16) for word in (x, y, z, w))
    return x, y, z, w


def draw_three(key: Array, photon: Array, event: Array) -> tuple[Array, Array, Array]:
    """Return three independent uint32 words for each (photon, event), a fifth cheaper than four; key[:3] counts."""
    x, y, z = (v * jnp.uint32(MULTIPLIER) + jnp.uint32(INCREMENT) for v in (photon + key[0], event + key[1], key[2]))
    z = z | jnp.uint32(1)  # the one word that no event changes: odd, or its first product would lose some of `event`
    for _ in range(2):
        x = x + y * z
        y = y + z * x
        z = z + x * y
        x, y, z = (word ^ (word >> 16) for word in (x, y, z))
    return x, y, z


def uniform(words: Array) -> Array:
    """Return float32 in (0, 1): 24 bits everywhere and steps of 2^-32 near 0, so -log(u) reaches 22.9, not 16."""
    return jnp.minimum((words.astype(jnp.float32) + 0.5) * jnp.float32(2.0**-32), jnp.float32(BELOW_ONE))


def exponential(words: Array) -> Array:
    """Return -ln of uniforms that have 31 bits near 0: float32 in (0, 22.2), relative error below 4e-7.

    A word is 2^(32 - k) (1 - y/2), so its logarithm is a multiple of ln 2 and a polynomial: half the work of a general
    logarithm, which XLA takes care to get right for negative and infinite numbers too.
    """
    number = jnp.minimum((words | jnp.uint32(1)).astype(jnp.float32), jnp.float32(LARGEST_WORD))
    bits = lax.bitcast_convert_type(number, jnp.int32)
    zeros = (158 - (bits >> 23)).astype(jnp.float32)
    y = 2 - lax.bitcast_convert_type((bits & 0x7FFFFF) | 0x3F800000, jnp.float32)
    return polynomial(LOGARITHM, y) * y + zeros * jnp.float32(np.log(2))


def polynomial(coefficients: tuple[float, ...], x: Array) -> Array:
    """Return a polynomial of rising coefficients, in float32."""
    value = jnp.float32(coefficients[-1])
    for coefficient in coefficients[-2::-1]:
        value = value * x + jnp.float32(coefficient)
    return value


def symmetric(words: Array) -> Array:
    """Return float32 in [-1, 1], never 0, with steps of 2^-31 near 0."""
    signed = lax.bitcast_convert_type(words, jnp.int32)
    return (signed.astype(jnp.float32) + 0.5) * jnp.float32(2.0**-31)
