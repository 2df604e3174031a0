"""One numbered batch of photons on one device, from the beam to the last exit.

A pool of lanes is kept full: after a few events each lane whose photon has ended writes how it ended to that
photon's own place and takes the next photon. When none is left to start, the pool is drained through ever smaller
pools, so no photon is dropped and the last long path does not occupy thousands of lanes. Since random words belong to
(photon, event), and results to photons, the number of lanes does not change a bit of the answer.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from mcml_sim import order_bins, rng
from mcml_sim.grid import Grid
from mcml_sim.isotropic import INSIDE, MAX_ORDER, OUT, Lanes, enter, scatter
from mcml_sim.tally import Counts

BATCH_PHOTONS = 2**20
# Measured on a 2-core AVX-512 machine; from 2048 to 8192 lanes and 8 to 14 events it is the same within 3 %.
LANES = 4096
EVENTS_PER_TURN = 12
DRAIN_POOLS = (8, 64)  # the pool shrinks to 1/8, then 1/64 of its lanes

ROULETTED, CUT = len(order_bins.LAST_ORDERS), len(order_bins.LAST_ORDERS) + 1
COLUMNS = CUT + 1


class Ends(NamedTuple):
    """How each photon of a batch ended, arrays (BATCH_PHOTONS,) by photon number."""

    rho: Array
    """Where, distance from the beam [mfp], float32."""
    order: Array
    """After n scatterings, int32: n out of the surface, -n inside (roulette, or cut at MAX_ORDER), 0 never started."""


def trace_batch(grid: Grid, seed: int, batch: int, photons: int, lanes: int = LANES) -> Counts:
    """Trace the first `photons` (<= BATCH_PHOTONS) photons of a batch; `lanes` is a multiple of 2048."""
    ends = trace(jnp.asarray(rng.batch_key(seed, batch)), jnp.int32(photons), lanes)
    histogram = np.asarray(_histogram(ends, jnp.asarray(single_edges(grid)), jnp.asarray(_columns()))).astype(np.int64)
    counts = Counts(
        exits=histogram[:, :ROULETTED],
        rouletted=int(histogram[:, ROULETTED].sum()),
        cut=int(histogram[:, CUT].sum()),
        started=photons,
    )
    counts.require_closed()
    return counts


@partial(jax.jit, static_argnames="lanes")
def trace(key: Array, photons: Array, lanes: int = LANES) -> Ends:
    """The ends of the first `photons` (int32) photons of the batch with this key (uint32[4])."""
    ends = Ends(jnp.zeros(BATCH_PHOTONS, jnp.float32), jnp.zeros(BATCH_PHOTONS, jnp.int32))

    def turn(state: tuple[Lanes, Array, Ends]) -> tuple[Lanes, Array, Ends]:
        pool, started, ends = state
        pool = _events(key, pool)
        ends = _record(ends, pool)
        return *_refill(key, photons, pool, started), ends

    first = *_refill(key, photons, _idle(lanes), jnp.int32(0)), ends
    pool, _, ends = lax.while_loop(lambda state: state[1] < photons, turn, first)
    return _drain(key, pool, ends)


def single_edges(grid: Grid) -> NDArray[np.float32]:
    """Edges rounded up to float32: a float32 radius is in the same ring by these as by the float64 ones."""
    edges = grid.r_edges.astype(np.float32)
    return np.where(edges < grid.r_edges, np.nextafter(edges, np.float32(np.inf)), edges)


def _idle(lanes: int) -> Lanes:
    """Lanes without a photon: their photon number is outside the batch, so what they record is dropped."""
    return Lanes(
        jnp.full(lanes, OUT * 1j, jnp.complex64),
        jnp.zeros(lanes, jnp.int32),
        jnp.full(lanes, BATCH_PHOTONS, jnp.uint32),
    )


def _events(key: Array, pool: Lanes) -> Lanes:
    return lax.fori_loop(0, EVENTS_PER_TURN, lambda _, lanes: scatter(key, lanes), pool)


def _record(ends: Ends, pool: Lanes) -> Ends:
    """Write the lanes that ended to their photons' places; writing one twice changes nothing."""
    place = jnp.where(pool.ended, pool.photon.astype(jnp.int32), BATCH_PHOTONS)
    order = jnp.where(pool.place.imag == INSIDE, -pool.order, pool.order)
    return Ends(ends.rho.at[place].set(pool.place.real, mode="drop"), ends.order.at[place].set(order, mode="drop"))


def _refill(key: Array, photons: Array, pool: Lanes, started: Array) -> tuple[Lanes, Array]:
    """Give each ended lane the next photon, in the order of lanes, while there are any."""
    rank = jnp.cumsum(pool.ended, dtype=jnp.int32)
    photon = started + rank - 1
    fresh = enter(key, photon.astype(jnp.uint32))
    takes = pool.ended & (photon < photons)
    pool = Lanes(*(jnp.where(takes, new, old) for new, old in zip(fresh, pool, strict=True)))
    return pool, jnp.minimum(started + rank[-1], photons)


def _drain(key: Array, pool: Lanes, ends: Ends) -> Ends:
    """Follow the photons still in flight to their ends, in ever smaller pools."""
    lanes = len(pool.order)
    for smaller in (*(lanes // shrink for shrink in DRAIN_POOLS), 0):
        pool = lax.while_loop(lambda p, n=smaller: _alive(p) > n, lambda p: _events(key, p), pool)  # type: ignore[misc]
        ends = _record(ends, pool)
        pool = _shrunk(pool, smaller)
    return ends


def _alive(pool: Lanes) -> Array:
    return jnp.sum(~pool.ended, dtype=jnp.int32)


def _shrunk(pool: Lanes, lanes: int) -> Lanes:
    """The photons in flight, moved to fewer lanes."""
    (places,) = jnp.nonzero(~pool.ended, size=lanes, fill_value=len(pool.order))
    return Lanes(*(jnp.append(a, idle)[places] for a, idle in zip(pool, _idle(1), strict=True)))


@jax.jit
def _histogram(ends: Ends, edges: Array, columns: Array) -> Array:
    """Count photons by ring (and beyond the last, in the last row) and column: int32 (rings + 1, COLUMNS)."""
    ring = jnp.searchsorted(edges[1:], ends.rho, side="right", method="scan_unrolled").astype(jnp.int32)
    size = len(edges) * COLUMNS
    cell = jnp.where(ends.order == 0, size, ring * COLUMNS + columns[ends.order + MAX_ORDER])
    return jnp.zeros(size, jnp.int32).at[cell].add(1, mode="drop").reshape(len(edges), COLUMNS)


def _columns() -> NDArray[np.int32]:
    """Column of the histogram for each end, at index order + MAX_ORDER."""
    columns = np.full(2 * MAX_ORDER + 1, ROULETTED, np.int32)
    columns[0] = CUT
    columns[MAX_ORDER + 1 :] = order_bins.BIN_OF_ORDER
    return columns
