"""One event of photons in a conservative half space of any surface, phase function and light.

All is symmetric around the beam and under mirrors through it, so a photon is its distance `rho` from the beam, its
depth `z`, and the direction of its flight in the frame (outwards, around, down) at its place; the component around
is the square root of what the other two leave. Lengths are in mean free paths [mfp], all float32. Nothing is
absorbed: each photon leaves with its order n, the number of its scatterings, and its share of the reflectance at albedo
alpha is alpha^n (applied afterwards, to every alpha at once). A surface that reflects from inside mirrors the flight:
the depth becomes its absolute value, and where around the beam the photon gets stays the same. Where the surface does
not refract and scattering forgets the direction, rho and z are all a photon needs, and events are faster.

Russian roulette is played in scattering order: at certain orders, the `stops`, half the photons that are still inside
end there, and the others count twice. How many tosses a photon wins is known when it enters: it is the number of
leading zeros of a random word. So a photon carries the order at which it will be stopped, and no event tosses.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from mcml_sim.media.medium import fresnel
from mcml_sim.media.phase import Isotropic, Phase
from mcml_sim.media.setting import Setting
from mcml_sim.tracing import pool, rng

PHASE = Isotropic()
STOPPED = 0.5  # what a photon that was stopped inside is deeper outside than one that left
UNROLLED = 4  # matched events in one go: 1 is slower by 13 %, 16 is faster by 7 % and compiles for twice as long
GPU_UNROLLED = 16  # measured on an H100: 4 take twice as long

# sin(pi v) = v P(v^2) on |v| <= 1/2: minimax polynomial of (1 - 2^-22) sin(pi v) by linear programming, error 3.4e-9.
# The factor keeps |value| <= 1 whatever the rounding; with it and float32 the total error is below 5e-7.
SINE = (3.141591787338257, -5.167705535888672, 2.5500307083129883, -0.5980450510978699, 0.07722011208534241)
# Directions of entering diffuse light come from a table, linear between so many even steps of the cube root of the
# probability, by which it is smooth at grazing incidence too: within 2e-6 of the exact cosine.
STEPS = 4096


class OrderLanes(NamedTuple):
    """Photons in flight, arrays of one shape (lanes,)."""

    place: Array
    """Complex rho + i z, distance from the beam and depth [mfp], complex64; -z counts events once the photon has ended
    since it was last looked at, and half an event more if it was stopped inside."""
    direction: Array | None  # outwards + i down of the flight that ended here, complex64; None if forgotten
    order: Array  # number of scatterings so far, int32
    last: Array  # order at which the photon will be stopped if it is still inside, int32
    photon: Array  # number of the photon in its batch, uint32

    @property
    def ended(self) -> Array:
        """True where the photon has left or was stopped."""
        return self.place.imag < 0

    @property
    def stopped(self) -> Array:
        """True where the photon was stopped inside, among those that have ended."""
        return self.place.imag != jnp.floor(self.place.imag)


class HalfSpace(NamedTuple):
    """Setting for the kernel: arrays, so that no other setting makes it compile again."""

    n: Array
    phase: Phase
    entry: Array  # cosines of the light that has entered, to the normal and inside; see `entry_cosines`, (STEPS + 1,)


def half_space(setting: Setting) -> HalfSpace:
    """Return the arrays of a setting for the kernel."""
    return HalfSpace(jnp.float32(setting.n), setting.scattering.for_kernel(), jnp.asarray(entry_cosines(setting)))


def enter(
    key: Array, photon: Array, stops: Array, where: HalfSpace | None = None, illumination: str = "searchlight"
) -> OrderLanes:
    """Return photons at the place of their first scattering; `stops` rise, int32 (at most 32,).

    `where` is the half space and its light, by default matched and isotropic under this `illumination`. A searchlight
    comes straight down. Diffuse light comes from all sides alike, so outside the square of its cosine to the surface's
    normal is uniform; all of it falls on the one point rho = 0.
    """
    event = jnp.zeros_like(photon)
    direction: Array | None = None
    if where is None:
        toss_word, path_word, square_word = rng.draw_three(key, photon, event)
        path = rng.exponential(path_word)
        place = lax.complex(jnp.zeros_like(path), path)
        if illumination == "diffuse":
            square = rng.uniform(square_word)
            place = lax.complex(path * jnp.sqrt(1 - square), path * jnp.sqrt(square))
    else:
        toss_word, path_word, entry_word, _ = rng.draw(key, photon, event)
        cosine = entering_cosine(rng.uniform(entry_word), where.entry)
        sine = jnp.sqrt((1 - cosine) * (1 + cosine))
        path = rng.exponential(path_word)
        place = lax.complex(path * sine, path * cosine)
        # Outwards is where the light goes; straight down that is any direction.
        direction = lax.complex(sine, cosine)
    order = stops[jnp.minimum(lax.clz(toss_word).astype(jnp.int32), len(stops) - 1)]  # each leading zero is a toss won
    return OrderLanes(place, direction, event.astype(jnp.int32), order, photon)


def fly(key: Array, lanes: OrderLanes, events: int, where: HalfSpace | None = None) -> OrderLanes:
    """Scatter every photon up to `events` times, until it ends; those that have ended stay where they are."""
    if where is None:
        unrolled = min(events, UNROLLED if pool.on_cpu() else GPU_UNROLLED)
        place = lax.fori_loop(0, events, lambda at, place: scatter(key, lanes, place, at), lanes.place, unroll=unrolled)
        return landed(lanes, place, events)
    first, left = lanes.order.astype(jnp.uint32) + 1, lanes.last - lanes.order

    def event(number: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        words = rng.draw(key, lanes.photon, first + number.astype(jnp.uint32))
        return _scattered(*state, words, number + 1, left, where)

    place, direction = lax.fori_loop(0, events, event, (lanes.place, lanes.direction))
    return landed(lanes._replace(direction=direction), place, events)


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
    """Return lanes after `events` scatterings that led to `place`, or that ended before."""
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


def _scattered(
    place: Array,
    direction: Array,
    words: tuple[Array, Array, Array, Array],
    number: Array,
    left: Array,
    where: HalfSpace,
) -> tuple[Array, Array]:
    """Return places and directions after one more scattering and flight, as in `scatter`."""
    cosine_word, path_word, azimuth_word, surface_word = words
    outwards, around, down = _deflected(direction, cosine_word, azimuth_word, surface_word, where.phase)
    path = rng.exponential(path_word)
    z = place.imag + path * down
    reflectance, _ = fresnel(where.n, jnp.float32(1), jnp.abs(down))
    above = z < 0
    leaves = above & (rng.uniform(surface_word) >= reflectance)
    path = jnp.where(leaves, -place.imag / down, path)
    along, across = place.real + path * outwards, path * around
    rho = jnp.sqrt(along * along + across * across)
    outwards = jnp.where(rho > 0, (outwards * along + around * across) / rho, outwards)
    out = -number.astype(jnp.float32)
    z = jnp.where(leaves, out, jnp.where(left == number, out - STOPPED, jnp.abs(z)))
    place = jnp.where(place.imag < 0, place, lax.complex(rho, z))
    return place, lax.complex(outwards, jnp.where(above, -down, down))


def _deflected(
    direction: Array, cosine_word: Array, azimuth_word: Array, sign_word: Array, phase: Phase
) -> tuple[Array, Array, Array]:
    """Return the components outwards, around and down after a scattering.

    In the frame of Duff et al., Building an orthonormal basis, revisited, JCGT 6(1), 2017: no direction is special.
    """
    below_one, above_minus_one = phase.deflection(rng.symmetric(cosine_word))
    sine = jnp.sqrt(below_one * above_minus_one)
    x = azimuth_cosine(azimuth_word)
    half = jnp.sqrt((1 - x) * (1 + x))
    y = jnp.where(sign_word & 1 == 1, half, -half)
    r, z = direction.real, direction.imag
    t = jnp.sqrt(jnp.maximum(1 - r * r - z * z, 0))
    sign = jnp.where(z < 0, jnp.float32(-1), jnp.float32(1))
    a = -1 / (sign + z)
    b = r * t * a
    cosine = 1 - below_one
    outwards = cosine * r + sine * (x * (1 + sign * a * r * r) + y * b)
    around = cosine * t + sine * (x * sign * b + y * (sign + a * t * t))
    down = cosine * z - sine * (x * sign * r + y * t)
    return outwards, around, down


def entering_cosine(xi: Array, entry: Array) -> Array:
    """Return the cosine of the light that has entered, at the share xi in (0, 1) of it."""
    at = jnp.cbrt(xi) * jnp.float32(STEPS)
    step = jnp.minimum(at.astype(jnp.int32), STEPS - 1)
    lower, upper = entry[step], entry[step + 1]
    return lower + (upper - lower) * (at - step.astype(jnp.float32))


def entry_cosines(setting: Setting) -> NDArray[np.float32]:
    """Return cosines inside at even steps of the cube root of probability, float32 (STEPS + 1,).

    Diffuse light that has entered has the density 2 mu T(mu) there, T being the transmittance of the surface, which
    is the same from inside as from outside; beyond the critical angle there is none.
    """
    if setting.illumination == "searchlight":
        return np.ones(STEPS + 1, np.float32)
    critical = np.sqrt(max(1 - 1 / setting.n**2, 0.0))
    mu = critical + (1 - critical) * np.linspace(0, 1, 2**17 + 1) ** 2
    middle = (mu[1:] + mu[:-1]) / 2
    light = (1 - fresnel(setting.n, 1.0, middle)[0]) * np.diff(mu**2)
    cdf = np.concatenate([[0.0], np.cumsum(light)])
    return np.interp(np.linspace(0, 1, STEPS + 1) ** 3 * cdf[-1], cdf, mu).astype(np.float32)
