"""One event of photons in a matched, isotropic, conservative half space, where (rho, z) is all a photon needs.

The surface does not refract and scattering forgets the direction, so a photon is its distance `rho` from the beam
and its depth `z`; where around the beam it is never matters. Lengths are in mean free paths [mfp], all float32.
Nothing is absorbed: each photon leaves with its order n, the number of its scatterings, and its share of the
reflectance at albedo alpha is alpha^n (applied afterwards, to every alpha at once).

Russian roulette is played in scattering order: at certain orders, the `stops`, half the photons that are still inside
end there, and the others count twice. How many tosses a photon wins is known when it enters: it is the number of
leading zeros of a random word. So a photon carries the order at which it will be stopped, and no event tosses.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
from jax import Array, lax

from mcml_sim.media.phase import Isotropic
from mcml_sim.tracing import pool, rng

PHASE = Isotropic()
STOPPED = 0.5  # what a photon that was stopped inside is deeper outside than one that left
UNROLLED = 4  # events in one go: 1 is slower by 13 %, 16 is faster by 7 % and compiles for twice as long
GPU_UNROLLED = 16  # measured on an H100: 4 take twice as long

# sin(pi v) = v P(v^2) on |v| <= 1/2: minimax polynomial of (1 - 2^-22) sin(pi v) by linear programming, error 3.4e-9.
# The factor keeps |value| <= 1 whatever the rounding; with it and float32 the total error is below 5e-7.
SINE = (3.141591787338257, -5.167705535888672, 2.5500307083129883, -0.5980450510978699, 0.07722011208534241)


class OrderLanes(NamedTuple):
    """Photons in flight, arrays of one shape (lanes,)."""

    place: Array
    """Complex rho + i z, distance from the beam and depth [mfp], complex64; -z counts events once the photon has ended
    since it was last looked at, and half an event more if it was stopped inside."""
    direction: Array | None
    """Components outwards + i down of the flight that ended here, complex64; None where scattering forgets them."""
    order: Array
    """Number of scatterings so far, int32."""
    last: Array
    """Order at which the photon will be stopped if it is still inside, int32."""
    photon: Array
    """Number of the photon in its batch, uint32."""

    @property
    def ended(self) -> Array:
        """True where the photon has left or was stopped."""
        return self.place.imag < 0

    @property
    def stopped(self) -> Array:
        """True where the photon was stopped inside, among those that have ended."""
        return self.place.imag != jnp.floor(self.place.imag)


def enter(key: Array, photon: Array, stops: Array, illumination: str = "searchlight") -> OrderLanes:
    """Return photons at the place of their first scattering; `stops` rise, int32 (at most 32,).

    A searchlight comes straight down. Diffuse light comes from all sides alike, so the square of its cosine to the
    surface's normal is uniform; all of it falls on the one point rho = 0.
    """
    event = jnp.zeros_like(photon)
    toss_word, path_word, square_word = rng.draw_three(key, photon, event)
    path = rng.exponential(path_word)
    place = lax.complex(jnp.zeros_like(path), path)
    if illumination == "diffuse":
        square = rng.uniform(square_word)
        place = lax.complex(path * jnp.sqrt(1 - square), path * jnp.sqrt(square))
    return OrderLanes(place, None, event.astype(jnp.int32), stop(toss_word, stops), photon)


def stop(words: Array, stops: Array) -> Array:
    """Return the order at which each photon is stopped: each leading zero of its word is a toss won."""
    return stops[jnp.minimum(lax.clz(words).astype(jnp.int32), len(stops) - 1)]


def fly(key: Array, lanes: OrderLanes, events: int) -> OrderLanes:
    """Scatter every photon up to `events` times, until it ends; those that have ended stay where they are."""
    unrolled = min(events, UNROLLED if pool.on_cpu() else GPU_UNROLLED)
    place = lax.fori_loop(
        0, events, lambda number, place: scatter(key, lanes, place, number), lanes.place, unroll=unrolled
    )
    return landed(lanes, place, events)


def scatter(key: Array, lanes: OrderLanes, place: Array, number: Array) -> Array:
    """Return places after one more scattering and flight, where `number` of them (int32) led the lanes to `place`.

    XLA compiles one loop an output, and each would draw all random words again. So a place is one complex number, and
    nothing but it goes from event to event: where a photon has ended, its depth says how and after how many of these.
    """
    number = number.astype(jnp.int32) + 1  # a loop counts in int64 where x64 is on
    order = lanes.order + number
    cosine_word, path_word, azimuth_word = rng.draw_three(key, lanes.photon, order.astype(jnp.uint32))
    cosine = rng.symmetric(cosine_word)
    below_one, above_minus_one = PHASE.deflection(cosine)  # the cosine itself is v
    path = rng.exponential(path_word)
    z = place.imag + path * cosine
    leaves = z < 0
    path = jnp.where(leaves, -place.imag / cosine, path)
    rho = displaced(place.real, path, below_one * above_minus_one, azimuth_cosine(azimuth_word))
    out = -number.astype(jnp.float32)
    z = jnp.where(leaves, out, jnp.where(order == lanes.last, out - STOPPED, z))
    return jnp.where(place.imag < 0, place, lax.complex(rho, z))


def landed(lanes: OrderLanes, place: Array, events: int) -> OrderLanes:
    """Return lanes, of this or another event, after `events` scatterings that led to `place`, or that ended before."""
    done = jnp.where(place.imag < 0, (-place.imag).astype(jnp.int32), events)
    return lanes._replace(place=place, order=lanes.order + done)


def displaced(rho: Array, path: Array, sine_squared: Array, cosine: Array) -> Array:
    """Return the distance from the beam after a `path` [mfp], by squared sine to the depth and cosine to the radius."""
    along = rho + path * jnp.sqrt(sine_squared) * cosine
    return jnp.sqrt(along * along + path * path * sine_squared * ((1 - cosine) * (1 + cosine)))


def azimuth_cosine(words: Array) -> Array:
    """Return the cosine of an angle uniform in (0, pi), as the sine of one uniform in (-pi/2, pi/2): |value| <= 1."""
    v = rng.symmetric(words) * jnp.float32(0.5)
    return v * rng.polynomial(SINE, v * v)
