"""One event of photons in a matched, isotropic, white half space, where (rho, z) is all a photon needs.

The surface does not refract and scattering forgets the direction, so a photon is its distance `rho` from the beam
and its depth `z`; where around the beam it is never matters. Lengths are in mean free paths [mfp], all float32.
Nothing is absorbed: each photon leaves with its order n, the number of its scatterings, and its share of the
reflectance at albedo alpha is alpha^n (applied afterwards, to every alpha at once).
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import ArrayLike, NDArray

from mcml_sim import rng

MAX_ORDER = 8192
# Each time the order doubles from here on, half the photons are dropped and the others count twice. Below 64 most of
# the reflectance is made; without roulette six sevenths of all events would go to the few photons beyond it.
FIRST_ROULETTE = 64
OUT, INSIDE = -1.0, -2.0  # "depths" of photons that left through the surface, and that were stopped

# sin(pi v) = v P(v^2) on |v| <= 1/2: minimax polynomial of (1 - 2^-22) sin(pi v) by linear programming, error 3.4e-9.
# The factor keeps |value| <= 1 whatever the rounding; with it and float32 the total error is below 5e-7.
SINE = (3.141591787338257, -5.167705535888672, 2.5500307083129883, -0.5980450510978699, 0.07722011208534241)


class Lanes(NamedTuple):
    """Photons in flight, arrays of one shape (lanes,)."""

    place: Array
    """rho + i z, distance from the beam and depth [mfp], complex64; z is `OUT` or `INSIDE` once it has ended."""
    order: Array
    """Scatterings so far, int32."""
    photon: Array
    """Number of the photon in its batch, uint32."""

    @property
    def ended(self) -> Array:
        """True where the photon has left or was stopped."""
        return self.place.imag < 0


def enter(key: Array, photon: Array) -> Lanes:
    """Photons at the place of their first scattering, straight below the beam."""
    event = jnp.zeros_like(photon)
    _, path_word, _, _ = rng.draw(key, photon, event)
    z = -jnp.log(rng.uniform(path_word))
    return Lanes(lax.complex(jnp.zeros_like(z), z), event.astype(jnp.int32), photon)


def scatter(key: Array, lanes: Lanes) -> Lanes:
    """Scatter every photon once and fly it to the next place, or out of the surface; ended ones stay as they are.

    The place is one complex number because XLA compiles one loop an output: two would draw all random words twice.
    """
    order = lanes.order + 1
    cosine_word, path_word, azimuth_word, _ = rng.draw(key, lanes.photon, order.astype(jnp.uint32))
    cosine = rng.symmetric(cosine_word)
    path = -jnp.log(rng.uniform(path_word))
    z = lanes.place.imag + path * cosine
    leaves = z < 0
    path = jnp.where(leaves, -lanes.place.imag / cosine, path)
    rho = displaced(lanes.place.real, path * jnp.sqrt((1 - cosine) * (1 + cosine)), azimuth_cosine(azimuth_word))
    stops = (order == MAX_ORDER) | (is_roulette(order) & loses_toss(cosine_word))
    z = jnp.where(leaves, jnp.float32(OUT), jnp.where(stops, jnp.float32(INSIDE), z))
    place = jnp.where(lanes.ended, lanes.place, lax.complex(rho, z))
    return Lanes(place, jnp.where(lanes.ended, lanes.order, order), lanes.photon)


def displaced(rho: Array, step: Array, cosine: Array) -> Array:
    """Distance from the beam after a horizontal `step` [mfp] at an angle of the given cosine to the radius."""
    along = rho + step * cosine
    return jnp.sqrt(along * along + step * step * ((1 - cosine) * (1 + cosine)))


def azimuth_cosine(words: Array) -> Array:
    """Cosine of an angle uniform in (0, pi), as the sine of one uniform in (-pi/2, pi/2): |value| <= 1."""
    v = rng.symmetric(words) * jnp.float32(0.5)
    square = v * v
    value = jnp.float32(SINE[-1])
    for coefficient in SINE[-2::-1]:
        value = value * square + jnp.float32(coefficient)
    return v * value


def is_roulette(order: Array) -> Array:
    """True where a photon that stays inside after this many scatterings must win a coin toss to go on."""
    return (order >= FIRST_ROULETTE) & (order & (order - 1) == 0) & (order < MAX_ORDER)


def loses_toss(words: Array) -> Array:
    """True for half of all words, by the lowest bit: `rng.symmetric` rounds it away unless its value is below 2^-7."""
    return words & 1 == 1


def roulette_weight(order: ArrayLike) -> NDArray[np.int64]:
    """How many photons one that leaves (or is cut) at this order stands for: 1 up to 64, 2 to 128, 4 to 256, ..."""
    return 2 ** np.ceil(np.log2(np.maximum(np.asarray(order) / FIRST_ROULETTE, 1))).astype(np.int64)
