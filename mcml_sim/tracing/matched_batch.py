"""Batch of `simulate` in a matched, isotropic half space, where only the order decides a photon's weight.

A photon is traced as if nothing were absorbed: after n scatterings its weight is alpha^n, and twice that for each toss
of roulette it has won, which is a table of n. What it leaves behind at each place and takes out with it is looked up
there; only the deposits in (r, z) are made on the way.

On one core it traces 2.0 to 2.7 times as many photons a second as `layered_batch`, and 1.9 to 2.1 times as many where
depth is resolved (alpha = 0.9, `python benchmarks/tracer.py --only speed`).

All sums are over photons in the order of their numbers, or of whole multiples of 2^-32, so the number of lanes does
not change a bit. Places are float32: one within rounding of an edge may be counted on its other side.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from mcml_sim.media.arrays import Floats
from mcml_sim.media.grid import Grid
from mcml_sim.media.medium import Medium
from mcml_sim.tracing import half_space_event, orders_batch, pool, rng
from mcml_sim.tracing.deposits import Axis, Deposits, axis, groups
from mcml_sim.tracing.half_space_event import OrderLanes
from mcml_sim.tracing.orders_batch import Ends

# Where nothing is absorbed, 0.6 % of the light is still inside after this many scatterings; `cut` says so.
MAX_ORDER = 65_536
# Photons toss when their weight falls below this. Variance of the reflectance times the time it takes, measured at
# alpha = 0.5 ... 0.999: within 8 % of the least one here, 1.3 to 2 times that with MCML's threshold of 1e-4.
THRESHOLD = 0.3
# Beyond this order the weights may rise as sqrt(n). Where q_n is the light that leaves at order n and P_n what is still
# inside, a survival proportional to alpha^n sqrt(q_n / P_n) ~ alpha^n / sqrt(n) makes variance times time least.
LONG_PATH = 128
STOPS = 32  # as many tosses as a random word has bits
UNIT = 2.0**-32  # of the weights that are added on the way: int64 holds 2^31 of them, all visits where alpha = 1, 2^30
EVENTS_PER_TURN, VISITS_PER_TURN = 8, 6  # without deposits in (r, z), and with them: best at alpha = 0.9

MOST_GROUPS = 16  # of photons, whose spread gives the errors of what is absorbed; 32 take a fifth more time


@dataclass(frozen=True, eq=False)
class Weights:
    """Weights of a photon by order n = 0 ... MAX_ORDER; all arrays float64 (MAX_ORDER + 1,) but `stops`."""

    stops: NDArray[np.int32]  # orders at which half of those inside end, and the last at which all do, int32 (STOPS,)
    leaving: Floats  # weight of one that leaves after n scatterings
    visiting: Floats  # weight of one that arrives at its n-th place; 1 - alpha of it stays there
    absorbed: Floats  # weight left by a photon at its first n places

    @property
    def last(self) -> int:
        """Order at which photons are cut."""
        return int(self.stops[-1])


@lru_cache(maxsize=16)
def weights(alpha: float) -> Weights:
    """Return the roulette for an albedo, and the weights that follow from it."""
    order = np.arange(MAX_ORDER + 1)
    plain = alpha ** order.astype(np.float64)
    survival = np.minimum(plain / THRESHOLD, 1) * np.sqrt(LONG_PATH / np.maximum(order, LONG_PATH))
    # Orders where the survival falls below 1, 1/2, 1/4, ..., and a last one for all.
    below = np.argmax(survival < 0.5 ** np.arange(STOPS - 1)[:, None], axis=1)
    tosses = np.maximum(below[below > 0], 1)
    last = tosses[-1] + 1 if len(tosses) == STOPS - 1 else MAX_ORDER
    stops = np.concatenate([tosses, np.full(STOPS - len(tosses), last)]).astype(np.int32)
    won = np.searchsorted(stops[:-1], order)  # a photon that leaves or arrives at n has not tossed at n
    leaving = plain * 2.0**won
    visiting = np.concatenate([[0.0], plain[:-1] * 2.0 ** won[1:]])
    return Weights(stops, leaving, visiting, (1 - alpha) * np.cumsum(visiting))


def trace_batch(medium: Medium, grid: Grid, seed: int, batch: int, photons: int, lanes: int | None = None) -> Deposits:
    """Trace the first `photons` (<= BATCH_PHOTONS) photons of a batch; `lanes` is a multiple of 64 (`pool.lanes`).

    The medium's `is_matched_isotropic_half_space` must be true; its light comes straight down. Light that is absorbed
    gets its errors from groups of consecutive photons: 16 of them, or fewer where their tables would take more than
    64 MiB together, but no fewer than 8.
    """
    (layer,) = medium.layers
    lanes = lanes or pool.lanes()
    values = weights(layer.alpha)
    z = None if grid.z_edges is None else axis(grid.z_edges, layer.mfp)
    between: NDArray | list[float] = [] if grid.a_edges is None else np.cos(grid.a_edges[-2:0:-1])
    bins = MatchedBins(axis(grid.r_edges, layer.mfp), z, jnp.asarray(between, jnp.float32))
    key, number, stops = jnp.asarray(rng.batch_key(seed, batch)), jnp.int32(photons), jnp.asarray(values.stops)
    if grid.depths:
        with jax.enable_x64(True):
            visiting = jnp.asarray(np.rint(values.visiting / UNIT).astype(np.int64))
            ends, visits = _trace_visits(key, number, stops, visiting, bins, groups(grid, photons, MOST_GROUPS), lanes)
        visited = [np.asarray(part) for part in visits]
    else:
        ends = orders_batch.trace(key, number, stops, None, lanes, EVENTS_PER_TURN)
        visited = [np.zeros(shape) for shape in ((0, 0), (0, 0), (0,), (0,))]
    with jax.enable_x64(True):
        exits, orders = _counted(key, ends, jnp.asarray(values.leaving), bins)
    return deposited(np.asarray(exits), np.asarray(orders), values, photons, 1 - layer.alpha, visited)


class MatchedBins(NamedTuple):
    """Grid for the kernels."""

    r: Axis
    z: Axis | None
    cosines: Array  # cosines of the edges between angle bins, rising, float32 (angles - 1,), or empty


@partial(jax.jit, static_argnames=("parts", "lanes"), compiler_options=pool.COMPILER_OPTIONS)
def _trace_visits(
    key: Array, photons: Array, stops: Array, visiting: Array, bins: MatchedBins, parts: int, lanes: int
) -> tuple[Ends, tuple[Array, ...]]:
    """Return ends as `orders_batch.trace` does, and weight that arrived by ring and depth, by depth, and variances.

    `visiting` (MAX_ORDER + 1,) int64, in UNITs.
    """
    depths = cast("Axis", bins.z)
    shape = (parts, bins.r.bins + 1, depths.bins + 1)
    size = int(np.prod(shape))

    def turn(flying: OrderLanes, state: tuple[Array, Array]) -> tuple[OrderLanes, tuple[Array, Array]]:
        group = ((flying.photon.astype(jnp.float32) + 0.5) * (jnp.float32(parts) / photons)).astype(jnp.int32)
        first = jnp.minimum(group, parts - 1) * (size // parts)

        def event(number: Array, state: tuple[Array, Array]) -> tuple[Array, Array]:
            place, table = state
            depth = depths.index(place.imag)
            cell = first + bins.r.index(place.real) * shape[2] + depth
            weight = visiting.at[flying.order + number.astype(jnp.int32) + 1].get(mode="clip")
            # Those that have ended add nothing, somewhere: a branch that no processor can foresee costs more.
            weight = jnp.where(place.imag < 0, 0, weight)
            after = half_space_event.scatter(key, flying, place, number)
            return after, table.at[cell].add(weight, mode="promise_in_bounds")

        table, ends = state
        place, table = lax.fori_loop(0, VISITS_PER_TURN, event, (flying.place, table))
        flying = half_space_event.landed(flying, place, VISITS_PER_TURN)
        return flying, (table, orders_batch.recorded(ends, flying))

    state = jnp.zeros(size, jnp.int64), orders_batch.no_ends(lanes)
    table, ends = pool.follow(lambda photon: half_space_event.enter(key, photon, stops), turn, state, photons, lanes)
    by_group = table.reshape(shape) * UNIT
    return orders_batch.as_ends(ends), (*_summed(by_group), *_summed(by_group.sum(axis=1)))


def _summed(by_group: Array) -> tuple[Array, Array]:
    """Return the sum over groups, and its variance from their spread."""
    groups = len(by_group)
    if groups == 1:
        return by_group[0], jnp.full_like(by_group[0], jnp.inf)
    total, squares = by_group.sum(axis=0), jnp.sum(by_group * by_group, axis=0)
    return total, jnp.maximum(squares - total * total / groups, 0) * (groups / (groups - 1))


@jax.jit
def _counted(key: Array, ends: Ends, leaving: Array, bins: MatchedBins) -> tuple[Array, Array]:
    """Count weight that left, w + i w^2 by ring and angle, and photons by order + MAX_ORDER, int32 (2 MAX_ORDER + 1,).

    The direction in which a photon left is the last it drew, so it is drawn again.
    """
    cell, angles = bins.r.index(ends.rho), len(bins.cosines) + 1
    if angles > 1:
        photon = jnp.arange(len(ends.rho), dtype=jnp.uint32)
        word, _, _ = rng.draw_three(key, photon, jnp.abs(ends.order).astype(jnp.uint32))
        below = jnp.searchsorted(bins.cosines, jnp.abs(rng.symmetric(word)), side="left", method="scan_unrolled")
        cell = cell * angles + (angles - 1 - below.astype(jnp.int32))
    size = (bins.r.bins + 1) * angles
    weight = leaving.at[ends.order].get(mode="clip")
    exits = jnp.zeros(size, jnp.complex128)
    exits = exits.at[jnp.where(ends.order > 0, cell, size)].add(lax.complex(weight, weight * weight), mode="drop")
    started = (ends.order != 0).astype(jnp.int32)
    orders = jnp.zeros(2 * MAX_ORDER + 1, jnp.int32).at[ends.order + MAX_ORDER].add(started)
    return exits.reshape(-1, angles), orders


def deposited(
    exits: NDArray, orders: NDArray, values: Weights, photons: int, share: float, visited: list[NDArray]
) -> Deposits:
    """Return all sums of a batch; whatever does not depend on the place follows from the photons by order."""
    number = np.concatenate([orders[MAX_ORDER + 1 :], orders[MAX_ORDER - 1 :: -1]]).astype(np.float64)
    if number.sum() != photons:
        raise RuntimeError(f"photons were lost or made: {photons} started and {number.sum():.0f} ended")
    inside = np.where(np.arange(1, MAX_ORDER + 1) == values.last, values.leaving[1:], 0)
    left = np.concatenate([values.leaving[1:], inside])
    absorbed = np.tile(values.absorbed[1:], 2)
    accounted = left + absorbed
    cut = number[MAX_ORDER + values.last - 1] * values.leaving[values.last]
    nothing, rz, rz_variance, z, z_variance = np.zeros(exits.shape), *visited
    return Deposits(
        started=photons,
        reflected=exits.real.copy(),
        reflected_squares=exits.imag.copy(),
        transmitted=nothing,
        transmitted_squares=nothing,
        ballistic=np.zeros(()),
        ballistic_squares=np.zeros(()),
        absorbed=np.full(2, number @ absorbed),
        absorbed_squares=np.full(2, number @ absorbed**2),
        accounted=np.asarray(number @ accounted),
        accounted_squares=np.asarray(number @ accounted**2),
        cut=np.asarray(cut),
        absorbed_rz=rz * share,
        absorbed_rz_variance=rz_variance * share**2,
        absorbed_z=z * share,
        absorbed_z_variance=z_variance * share**2,
    )
