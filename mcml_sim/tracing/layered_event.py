"""Event of photons in a layered medium: they fly, are absorbed in part and scattered, and meet interfaces.

A lane is one photon in flight. Its depth is counted from the top of its layer, so a thin layer deep down is as precise
as one at the surface. Lengths are in any one unit, all numbers float32.

A photon that would fly beyond its layer waits (a negative weight says so) until `settle` takes it to the interface.
There it starts on a new free path: what is left of an exponential path is again exponential, whatever was flown, so
nothing has to be carried from one layer into the next.

XLA's CPU backend compiles one loop an output and repeats in each of them all that it depends on. So numbers go in
pairs, as one complex array, and what several arrays need is `staged`.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mcml_sim.media.medium import Medium, fresnel
from mcml_sim.media.phase import HenyeyGreenstein, Phase
from mcml_sim.tracing import pool, rng
from mcml_sim.tracing.half_space_event import entering_cosine

FLIGHTS = 5  # measured on the three-layer sample: from 4 to 7 it is the same within 3 %
EVENTS_PER_TURN = FLIGHTS + 1  # the last one is the step across interfaces

# A photon of less weight goes on by a chance of CHANCE_IN_256 / 256. Variance times time, measured on the three-layer
# sample, is 0.79 of that with MCML's 1e-4 and 0.1: for R, T, absorption by layer and by depth, and rings alike.
THRESHOLD, CHANCE_IN_256 = 0.2, 128
# Each time the number of events doubles from here on, half the photons end and the others count twice, so that
# conservative media end too; at the last count what is left is cut. Variance times time of strongly forward, nearly
# conservative media (n 1.37, g 0.9, albedo 0.9999) is a fifth of that with a first toss at 512.
FIRST_TOSS, MAX_EVENTS = 2**13, 2**18

FARTHEST = 1e30  # free path in clear glass, in units of length: finite, so that no product of it is NaN
SELECTED_LAYERS = 8  # up to here a chain of selects is faster than a gather
ENTRY_EVENT = 2**32 - 1  # whose random words say where diffuse light comes from: no photon has so many events
BACK, ON = -1.0, -2.0  # instead of n1 / n2: of a photon that roulette ends unless it leaves, whether it passes
REFLECTED, ROULETTED, CUT = 0, -1, -2  # "layers" of photons that ended; transmitted ones are below the last layer

# sin(pi v) = v P(v^2) and cos(pi v) = P(v^2) on |v| <= 1/2, minimax by linear programming: errors 6.4e-8 and 4.4e-8.
SINE = (3.1415927410125732, -5.167712211608887, 2.5501112937927246, -0.5984628200531006, 0.07794344425201416)
COSINE = (1.0, -4.934802055358887, 4.058711528778076, -1.3352385759353638, 0.23506110906600952, -0.024593813344836235)


class Stack(NamedTuple):
    """Medium as float32 arrays by layer, (layers,)."""

    thickness: Array  # thickness [length]
    top: Array  # depth of the layer's upper interface [length]
    mfp: Array  # mean free path [length], FARTHEST in clear glass
    absorbs: Array  # 1 - alpha = mu_a / mu_t [-], kept apart: a difference loses the digits of weak absorption
    phase: Phase  # phase function of Henyey and Greenstein, its g by layer
    others: tuple[Phase | None, ...]  # of layers that have another phase function; None is no array
    n: Array  # refractive indices [-], (layers + 2,): those above and below are first and last

    @property
    def layers(self) -> int:
        """Number of layers, without what is above and below."""
        return len(self.mfp)


class LayeredLanes(NamedTuple):
    """Photons in flight, arrays (lanes,)."""

    place: Array  # complex x + i y [length], complex64
    down: Array  # depth below the top of the layer [length], and i times the cosine to the axis [-], complex64
    heading: Array  # other cosines of the direction, ux + i uy [-], complex64
    weight: Array  # weight left of the photon [-], negative while it waits at an interface and once it has ended
    layer: Array
    """Number of the layer it is in, from 1, int32; once it has ended REFLECTED, ROULETTED, CUT or, if it was
    transmitted, one more than there are layers."""
    event: Array  # number of events so far, waiting included, uint32
    photon: Array  # number of the photon in its batch, uint32
    absorbed: tuple[Array, ...]  # weight left in each of the layers that are followed, or in all of them [-]

    @property
    def ended(self) -> Array:
        """True, between turns, where the photon has left or was stopped, or there is none."""
        return self.weight <= 0


def stack(medium: Medium, unit: float) -> Stack:
    """Return the arrays of a medium, lengths in `unit`."""
    layers = medium.layers
    columns = {
        "thickness": [layer.thickness / unit for layer in layers],
        "top": medium.z_edges[:-1] / unit,
        "mfp": [min(1 / layer.mu_t / unit, FARTHEST) if layer.mu_t else FARTHEST for layer in layers],
        "absorbs": [layer.mu_a / layer.mu_t if layer.mu_t else 0.0 for layer in layers],
        "g": [layer.g if layer.mu_s else 0.0 for layer in layers],
        "n": [medium.n_above, *(layer.n for layer in layers), medium.n_below],
    }
    arrays = {name: jnp.asarray(np.asarray(values, np.float32)) for name, values in columns.items()}
    others = tuple(layer.phase.for_kernel() if layer.phase and layer.mu_s else None for layer in layers)
    return Stack(phase=HenyeyGreenstein(arrays.pop("g")), others=others, **arrays)


def enter(key: Array, photon: Array, first: Array, entry: Array, followed: int) -> LayeredLanes:
    """Return photons on their way down from the top of the layer `first`, not scattered yet.

    They go straight down, or, where `entry` is no empty array but `half_space_event.entry_cosines`, in the plane y = 0
    with those cosines: nothing is resolved by azimuth. What they leave behind is followed in that many layers one by
    one; see LayeredLanes.absorbed.
    """
    zero = jnp.zeros(photon.shape, jnp.complex64)
    down, heading = zero + jnp.complex64(1j), zero
    if len(entry):
        word, _, _ = rng.draw_three(key, photon, jnp.full_like(photon, ENTRY_EVENT))
        cosine = entering_cosine(rng.uniform(word), entry)
        down = lax.complex(jnp.zeros_like(cosine), cosine)
        heading = lax.complex(jnp.sqrt((1 - cosine) * (1 + cosine)), jnp.zeros_like(cosine))
    return LayeredLanes(
        place=zero,
        down=down,
        heading=heading,
        weight=jnp.ones(photon.shape, jnp.float32),
        layer=jnp.full(photon.shape, first, jnp.int32),
        event=jnp.zeros_like(photon),
        photon=photon,
        absorbed=(jnp.zeros(photon.shape, jnp.float32),) * followed,
    )


def inside(layer: Array, layers: int | Array) -> Array:
    """Return True where a photon has not ended."""
    return (layer > 0) & (layer <= layers)


def is_scattered(lanes: LayeredLanes, entry: Array) -> Array:
    """Return False where a photon is still on the line of the beam, or in its plane of entry; `entry` as in `enter`."""
    if len(entry):
        return (lanes.heading.imag != 0) | (lanes.place.imag != 0)
    return (lanes.heading != 0) | (lanes.place != 0)


def staged(go: Array, make: Callable[..., Any], *arrays: Any) -> Any:
    """Return make(*arrays), computed once and kept: `go` is True, which XLA cannot know when it compiles."""
    if not pool.on_cpu():
        return make(*arrays)
    shapes = jax.eval_shape(make, *arrays)
    return lax.cond(go, make, lambda *_: jax.tree.map(lambda s: jnp.zeros(s.shape, s.dtype), shapes), *arrays)


class LayerOptics(NamedTuple):
    """Properties of each photon's layer, arrays (lanes,); see Stack."""

    thickness: Array
    mfp: Array
    absorbs: Array
    phase: Phase


def optics(stack: Stack, layer: Array) -> LayerOptics:
    """Return the optical properties of each photon's layer."""
    everywhere = LayerOptics(stack.thickness, stack.mfp, stack.absorbs, stack.phase)
    return jax.tree.map(lambda values: pick(values, layer), everywhere)


def scatter(
    go: Array, key: Array, lanes: LayeredLanes, event: Array, here: LayerOptics, others: tuple[Phase | None, ...] = ()
) -> tuple[LayeredLanes, Array]:
    """Fly each photon to its next interaction, absorb a share of it and scatter the rest; or let it wait.

    Also returns what is absorbed. `go` as in `staged`, `others` as in `Stack`.
    """
    paths = staged(go, _paths, key, lanes.down, lanes.weight, lanes.photon, event, here.thickness, here.mfp)
    turns = staged(go, _turns, key, lanes.photon, event, here.phase, lanes.layer, others)
    aside = staged(go, _aside, turns)
    moves, cosine, uz = paths > 0, 1 - turns.real, lanes.down.imag
    upright = jnp.abs(uz)
    left = jnp.where(moves, lanes.weight * here.absorbs, 0)
    # The frame of Duff et al. (Building an orthonormal basis, revisited, JCGT 6(1), 2017), mirrored where uz < 0.
    tilt = aside.real * lanes.heading.real + aside.imag * lanes.heading.imag
    along = cosine - tilt / (1 + upright)
    uz_after = (cosine * upright - tilt) * jnp.copysign(jnp.float32(1), uz)
    after = lanes._replace(
        place=lanes.place + lax.complex(paths * lanes.heading.real, paths * lanes.heading.imag),
        down=lax.complex(lanes.down.real + paths * uz, jnp.where(moves, uz_after, uz)),
        heading=jnp.where(
            moves,
            lax.complex(aside.real + lanes.heading.real * along, aside.imag + lanes.heading.imag * along),
            lanes.heading,
        ),
        weight=jnp.where(moves, lanes.weight - left, -jnp.abs(lanes.weight)),
    )
    return after, left


def settle(go: Array, key: Array, stack: Stack, lanes: LayeredLanes, event: Array) -> LayeredLanes:
    """Take the waiting photons to their interface, and through it or back from it; then roulette for all."""
    layers, thickness = stack.layers, pick(stack.thickness, lanes.layer)
    waits = (lanes.weight < 0) & inside(lanes.layer, layers)
    outcome = staged(go, _at_interface, key, stack.n, lanes, event, waits)
    layer = staged(go, _next_layer, jnp.int32(layers), lanes, event, outcome)
    uz = lanes.down.imag
    path = jnp.where(waits, (jnp.where(uz > 0, thickness, 0) - lanes.down.real) / uz, 0)
    z = jnp.where(outcome.real > 0, 0, pick(stack.thickness, layer))
    bend = _renormalising(lanes, layers) * jnp.where(outcome.imag > 0, outcome.imag, 1)
    weight = jnp.abs(lanes.weight)
    # Photons that one which survived roulette stands for.
    odds = jnp.where(weight < THRESHOLD, jnp.float32(256 / CHANCE_IN_256), 1)
    odds = odds * jnp.where(is_late(event), jnp.float32(2), 1)
    return lanes._replace(
        place=lanes.place + lax.complex(path * lanes.heading.real, path * lanes.heading.imag),
        down=lax.complex(jnp.where(waits, z, lanes.down.real), outcome.real),
        heading=lax.complex(lanes.heading.real * bend, lanes.heading.imag * bend),
        weight=jnp.where(inside(layer, layers), weight * odds, -weight),
        layer=layer,
    )


def azimuth(v: Array) -> tuple[Array, Array]:
    """Return cosine and sine of pi v for v in [-1, 1], by the half angle."""
    half = v * jnp.float32(0.5)
    square = half * half
    sine, cosine = half * rng.polynomial(SINE, square), rng.polynomial(COSINE, square)
    return (cosine - sine) * (cosine + sine), 2 * sine * cosine


def pick(values: Array, layer: Array) -> Array:
    """Return values[layer - 1], with any of the values for a photon that has ended."""
    if len(values) > SELECTED_LAYERS:
        return values[jnp.clip(layer - 1, 0, len(values) - 1)]
    picked = jnp.broadcast_to(values[0], layer.shape)
    for index in range(1, len(values)):
        picked = jnp.where(layer > index, values[index], picked)
    return picked


def _paths(key: Array, down: Array, weight: Array, photon: Array, event: Array, thickness: Array, mfp: Array) -> Array:
    """Return the free path [length]; 0 for photons that do not fly, or would fly beyond their layer."""
    word, _, _ = rng.draw_three(key, photon, event)
    path = rng.exponential(word) * mfp
    z = down.real + path * down.imag
    return jnp.where((weight > 0) & (z >= 0) & (z <= thickness), path, 0)


def _turns(
    key: Array, photon: Array, event: Array, phase: Phase, layer: Array, others: tuple[Phase | None, ...]
) -> Array:
    """Return 1 - cosine of the scattering angle, and i times the azimuth / pi."""
    _, cosine_word, azimuth_word = rng.draw_three(key, photon, event)
    v = rng.symmetric(cosine_word)
    below_one, _ = phase.deflection(v)
    for number, other in enumerate(others, start=1):
        if other is not None:
            below_one = jnp.where(layer == number, other.deflection(v)[0], below_one)
    return lax.complex(below_one, rng.symmetric(azimuth_word))


def _aside(turns: Array) -> Array:
    """Return the components of the new direction at right angles to the old one."""
    sine = jnp.sqrt(turns.real * (2 - turns.real))
    cos_azimuth, sin_azimuth = azimuth(turns.imag)
    return lax.complex(sine * cos_azimuth, sine * sin_azimuth)


def _at_interface(key: Array, n: Array, lanes: LayeredLanes, event: Array, waits: Array) -> Array:
    """Return uz afterwards, and i n1 / n2 where a photon passes, 0 elsewhere; BACK or ON where roulette ends it."""
    toss, coin, _ = rng.draw_three(key, lanes.photon, event)
    uz = lanes.down.imag * _renormalising(lanes, len(n) - 2)
    n1 = pick(n[1:-1], lanes.layer)
    n2 = jnp.where(uz > 0, pick(n[2:], lanes.layer), pick(n[:-2], lanes.layer))
    reflectance, cosine = fresnel(n1, n2, jnp.minimum(jnp.abs(uz), 1))
    passes = waits & (rng.uniform(toss) >= reflectance)
    uz_after = jnp.where(passes, jnp.copysign(cosine, uz), jnp.where(waits, -uz, uz))
    weight = jnp.abs(lanes.weight)
    limit = jnp.where(weight < THRESHOLD, CHANCE_IN_256, 256) >> is_late(event).astype(jnp.int32)
    loses = ((coin & 255).astype(jnp.int32) >= limit) | (weight == 0)
    bend = jnp.where(passes, n1 / n2, 0)
    return lax.complex(uz_after, jnp.where(loses, jnp.where(passes, ON, BACK), bend).astype(jnp.float32))


def _next_layer(layers: Array, lanes: LayeredLanes, event: Array, outcome: Array) -> Array:
    passes = (outcome.imag > 0) | (outcome.imag == ON)
    step = jnp.where(passes, jnp.where(outcome.real > 0, 1, -1), 0)
    layer = lanes.layer + step.astype(jnp.int32)
    stays = inside(layer, layers)
    stops = jnp.where(stays & (event >= MAX_EVENTS), CUT, layer)
    return jnp.where(stays & (outcome.imag < 0), ROULETTED, stops).astype(jnp.int32)


def is_late(event: Array) -> Array:
    """Return True in turns in which the number of events passes a power of two >= FIRST_TOSS, before MAX_EVENTS."""
    before = event - EVENTS_PER_TURN
    return (event >= FIRST_TOSS) & (event < MAX_EVENTS) & (event ^ before > before)


def _renormalising(lanes: LayeredLanes, layers: int) -> Array:
    """Return 1 / length of the direction, to first order: rounding lets it drift by 1e-7 an event. 1 after the end."""
    ux, uy, uz = lanes.heading.real, lanes.heading.imag, lanes.down.imag
    return jnp.where(inside(lanes.layer, layers), 1.5 - 0.5 * (ux * ux + uy * uy + uz * uz), 1)
