"""One event of photons in a conservative half space of any surface, phase function and light.

Its special case `isotropic_event` needs no directions.

All is symmetric around the beam and under mirrors through it, so a photon is its distance `rho` from the beam, its
depth `z`, and the direction of its flight in the frame (outwards, around, down) at its place; the component around
is the square root of what the other two leave. Lengths are in mean free paths [mfp], all float32. Nothing is
absorbed: each photon leaves with its order n, the number of its scatterings. A surface that reflects from inside
mirrors the flight: the depth becomes its absolute value, and where around the beam the photon gets stays the same.
"""

from __future__ import annotations

from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from mcml_sim.media import fresnel
from mcml_sim.media.phase import Phase
from mcml_sim.media.setting import Setting
from mcml_sim.tracing import rng
from mcml_sim.tracing.isotropic_event import STOPPED, OrderLanes, azimuth_cosine, landed, stop

# Directions of entering diffuse light come from a table, linear between so many even steps of the cube root of the
# probability, by which it is smooth at grazing incidence too: within 2e-6 of the exact cosine.
STEPS = 4096


class HalfSpace(NamedTuple):
    """Setting for the kernel: arrays, so that no other setting makes it compile again."""

    n: Array
    phase: Phase
    entry: Array
    """Cosines of the light that has entered, to the normal and inside; see `entry_cosines`, (STEPS + 1,)."""


def half_space(setting: Setting) -> HalfSpace:
    """Return the arrays of a setting for the kernel."""
    return HalfSpace(jnp.float32(setting.n), setting.scattering.for_kernel(), jnp.asarray(entry_cosines(setting)))


def enter(key: Array, photon: Array, stops: Array, where: HalfSpace) -> OrderLanes:
    """Return photons at the place of their first scattering; `stops` as in `isotropic_event.enter`."""
    event = jnp.zeros_like(photon)
    toss_word, path_word, entry_word, _ = rng.draw(key, photon, event)
    cosine = entering_cosine(rng.uniform(entry_word), where.entry)
    sine = jnp.sqrt((1 - cosine) * (1 + cosine))
    path = rng.exponential(path_word)
    place = lax.complex(path * sine, path * cosine)
    # Outwards is where the light goes; straight down that is any direction.
    direction = lax.complex(sine, cosine)
    return OrderLanes(place, direction, event.astype(jnp.int32), stop(toss_word, stops), photon)


def fly(key: Array, lanes: OrderLanes, events: int, where: HalfSpace) -> OrderLanes:
    """Scatter every photon up to `events` times, until it ends; those that have ended stay where they are."""
    first = lanes.order.astype(jnp.uint32) + 1
    left = lanes.last - lanes.order

    def event(number: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
        words = rng.draw(key, lanes.photon, first + number.astype(jnp.uint32))
        return _scattered(*state, words, number + 1, left, where)

    place, direction = lax.fori_loop(0, events, event, (lanes.place, lanes.direction))
    return landed(lanes._replace(direction=direction), place, events)


def _scattered(
    place: Array,
    direction: Array,
    words: tuple[Array, Array, Array, Array],
    number: Array,
    left: Array,
    where: HalfSpace,
) -> tuple[Array, Array]:
    """Return places and directions after one more scattering and flight, as in `isotropic_event.scatter`."""
    cosine_word, path_word, azimuth_word, surface_word = words
    outwards, around, down = _deflected(direction, cosine_word, azimuth_word, surface_word, where.phase)
    path = rng.exponential(path_word)
    z = place.imag + path * down
    reflectance, _ = fresnel.fresnel(where.n, jnp.float32(1), jnp.abs(down))
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
    light = (1 - fresnel.fresnel(setting.n, 1.0, middle)[0]) * np.diff(mu**2)
    cdf = np.concatenate([[0.0], np.cumsum(light)])
    return np.interp(np.linspace(0, 1, STEPS + 1) ** 3 * cdf[-1], cdf, mu).astype(np.float32)
