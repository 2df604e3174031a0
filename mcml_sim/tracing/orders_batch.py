"""Batch of the order-resolved run on one device: where each photon left, and after how many scatterings."""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mcml_sim.media.grid import Grid
from mcml_sim.media.setting import SEARCHLIGHT, Setting
from mcml_sim.tracing import half_space_event, order_bins, pool, rng
from mcml_sim.tracing.deposits import rounded_up
from mcml_sim.tracing.pool import BATCH_PHOTONS

EVENTS_PER_TURN = 16  # 8 are slower by 9 %, 32 by 8 %


class Ends(NamedTuple):
    """Ends of the photons of a batch, arrays (BATCH_PHOTONS,) by photon number."""

    rho: Array  # distance from the beam [mfp], float32
    order: Array  # scatterings n, int32: n of one that left, -n of one that ended inside, 0 of one never started


def trace_batch(
    grid: Grid, seed: int, batch: int, photons: int, lanes: int | None = None, setting: Setting = SEARCHLIGHT
) -> order_bins.Counts:
    """Trace the first `photons` (<= BATCH_PHOTONS) photons of a batch; `lanes` is a multiple of 64 (`pool.lanes`).

    Lengths of the grid are in units of 1 / (mu_s + mu_a). Where the surface does not refract and scattering is
    isotropic, the kernel is the one that needs no directions.
    """
    bins = order_bins.bins_of(setting)
    key, number, stops = jnp.asarray(rng.batch_key(seed, batch)), jnp.int32(photons), jnp.asarray(bins.stops)
    if setting.is_matched_isotropic:
        ends = trace(key, number, stops, None, lanes, illumination=setting.illumination)
    else:
        ends = trace(key, number, stops, half_space_event.half_space(setting), lanes)
    # The histogram's column for each end, at index order + max_order: bins, then roulette, then the cut.
    columns = np.full(2 * bins.max_order + 1, bins.last_orders.size, np.int32)
    columns[0] = bins.last_orders.size + 1
    columns[bins.max_order + 1 :] = bins.bin_of_order
    edges, count = jnp.asarray(rounded_up(grid.r_edges)), bins.last_orders.size + 2
    cells = np.asarray(histogram(ends, edges, jnp.asarray(columns), count)).astype(np.int64)
    rouletted, cut = (int(cells[:, column].sum()) for column in (-2, -1))
    counts = order_bins.Counts(cells[:, :-2], rouletted, cut, started=photons)
    counts.require_closed()
    return counts


@partial(jax.jit, static_argnames=("lanes", "events", "illumination"), compiler_options=pool.COMPILER_OPTIONS)
def trace(
    key: Array,
    photons: Array,
    stops: Array,
    where: half_space_event.HalfSpace | None = None,
    lanes: int | None = None,
    events: int = EVENTS_PER_TURN,
    illumination: str = "searchlight",
) -> Ends:
    """Return the ends of the first `photons` (int32) photons of the batch with this key (uint32[4]).

    `where` is the half space and its light, by default matched and isotropic under this `illumination`. `stops` as in
    `half_space_event.enter`, the last of them at most 2^24. The number of lanes, and that of events in a turn, decide
    nothing but the speed.
    """
    lanes = lanes or pool.lanes()

    def enter(photon: Array) -> half_space_event.OrderLanes:
        return half_space_event.enter(key, photon, stops, where, illumination)

    def turn(flying: half_space_event.OrderLanes, ends: Array) -> tuple[half_space_event.OrderLanes, Array]:
        flying = half_space_event.fly(key, flying, events, where)
        return flying, recorded(ends, flying)

    return as_ends(pool.follow(enter, turn, no_ends(lanes), photons, lanes))


def no_ends(lanes: int) -> Array:
    """Return rho + i order of photons never started, and of idle lanes, complex64 (BATCH_PHOTONS + lanes,)."""
    return jnp.zeros(BATCH_PHOTONS + lanes, jnp.complex64)


def as_ends(ends: Array) -> Ends:
    """Return the parts of rho + i order of all photons."""
    ends = ends[:BATCH_PHOTONS]
    return Ends(ends.real, ends.imag.astype(jnp.int32))


def recorded(ends: Array, lanes: half_space_event.OrderLanes) -> Array:
    """Write the lanes that ended to their photons' places, rho + i order."""
    place = pool.places(lanes, BATCH_PHOTONS)
    order = jnp.where(lanes.stopped, -lanes.order, lanes.order)
    end = lax.complex(lanes.place.real, order.astype(jnp.float32))
    return ends.at[place].set(end, mode="promise_in_bounds", unique_indices=True)


@partial(jax.jit, static_argnames="count")
def histogram(ends: Ends, edges: Array, columns: Array, count: int) -> Array:
    """Count photons by ring (and beyond the last, in the last row) and column: int32 (rings + 1, count)."""
    ring = jnp.searchsorted(edges[1:], ends.rho, side="right", method="scan_unrolled").astype(jnp.int32)
    size = len(edges) * count
    cell = jnp.where(ends.order == 0, size, ring * count + columns[ends.order + len(columns) // 2])
    return jnp.zeros(size, jnp.int32).at[cell].add(1, mode="drop").reshape(len(edges), count)
