"""Pool of lanes that is kept full of photons, from the first of a batch to the exit of the last.

After a few events each lane whose photon has ended takes the next photon. When none is left to start, the pool is
drained through ever smaller pools, so no photon is dropped and the last long path does not occupy thousands of
lanes. Random words belong to (photon, event); where results belong to photons too, or add without rounding, the
number of lanes does not change a bit of the answer.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jax import Array, lax

BATCH_PHOTONS = 2**20
LANES = 4096  # measured on a Zen 4 core: 2048 are as fast, 8192 slower by 7 %
GPU_LANES = 65536  # measured on an H100: 4096 take two to four times as long, 262144 up to 1.4 times
DRAIN_POOLS = (8,)  # the pool shrinks to 1/8 of its lanes once; a further one to 1/64 is worth 2 % and compiles for 1 s
COLUMNS = 64  # of the table in which lanes are ranked
# To be given to jax.jit. A Zen 4 core gains a third by the width, and hardware without such vectors ignores it; the
# level is XLA's own, whatever a process has for other programs: lower ones trace six times as slowly.
COMPILER_OPTIONS = {"xla_cpu_prefer_vector_width": 512, "xla_backend_optimization_level": 3}

# Any NamedTuple of arrays (lanes,) that has `place`, `photon` and `ended`, as half_space_event.OrderLanes.
Lanes = Any
Results = TypeVar("Results")
Enter = Callable[[Array], Lanes]
Turn = Callable[[Lanes, Results], tuple[Lanes, Results]]


def on_cpu() -> bool:
    """Return whether jax computes on the processor, whose fastest ways are not those of a GPU."""
    return jax.default_backend() == "cpu"


def lanes() -> int:
    """Return how many photons are followed at once, by where jax computes."""
    return LANES if on_cpu() else GPU_LANES


def follow(enter: Enter, turn: Turn[Results], results: Results, photons: Array, lanes: int) -> Results:
    """Follow the photons 0 ... photons - 1 (int32) to their ends.

    Args:
        enter: photon numbers, uint32 (lanes,) -> lanes at their start.
        turn: flies all lanes some events on and adds what became of them to the results. A lane without a photon has
            ended, and its photon number is BATCH_PHOTONS: so an end is seen once.
        results: what the first turn adds to.
        photons: how many there are, int32.
        lanes: how many at once, a multiple of 64; it decides nothing but the speed.
    """

    def fill(pool: Lanes, started: Array) -> tuple[Lanes, Array]:
        """Give each ended lane the next photon, in the order of lanes, while there are any."""
        rank = ranks(pool.ended)
        photon = started + rank - 1
        takes = pool.ended & (photon < photons)
        fresh, idle = enter(photon.astype(jnp.uint32)), _emptied(pool)
        pool = jax.tree.map(lambda new, old: jnp.where(takes, new, old), fresh, idle)
        return pool, jnp.minimum(started + rank[-1], photons)

    def step(state: tuple[Lanes, Array, Results]) -> tuple[Lanes, Array, Results]:
        pool, results = turn(state[0], state[2])
        return *fill(pool, state[1]), results

    first = *fill(_idle(enter, lanes), jnp.int32(0)), results
    pool, _, results = lax.while_loop(lambda state: state[1] < photons, step, first)
    for smaller in (*(lanes // shrink for shrink in DRAIN_POOLS), 0):
        pool, results = _drain(turn, pool, results, smaller)
        pool = _shrunk(pool, _idle(enter, 1), smaller)
    return results


def _drain(turn: Turn[Results], pool: Lanes, results: Results, lanes: int) -> tuple[Lanes, Results]:
    """Turn until no more than so many photons are in flight."""

    def step(state: tuple[Lanes, Results]) -> tuple[Lanes, Results]:
        return turn(_emptied(state[0]), state[1])

    return lax.while_loop(lambda state: jnp.sum(~state[0].ended, dtype=jnp.int32) > lanes, step, (pool, results))


def _emptied(pool: Lanes) -> Lanes:
    """Return the lanes without photons that have ended, and were seen to."""
    return pool._replace(photon=jnp.where(pool.ended, jnp.uint32(BATCH_PHOTONS), pool.photon))


def _idle(enter: Enter, lanes: int) -> Lanes:
    shapes = jax.eval_shape(enter, jax.ShapeDtypeStruct((lanes,), jnp.uint32))
    empty = jax.tree.map(lambda leaf: jnp.zeros(leaf.shape, leaf.dtype), shapes)
    place, photon = jnp.full(lanes, -1j, jnp.complex64), jnp.full(lanes, BATCH_PHOTONS, jnp.uint32)
    return empty._replace(place=place, photon=photon)


def _shrunk(pool: Lanes, idle: Lanes, lanes: int) -> Lanes:
    """Return the photons in flight, moved to fewer lanes."""
    (places,) = jnp.nonzero(~pool.ended, size=lanes, fill_value=len(pool.place))
    return jax.tree.map(lambda leaf, none: jnp.append(leaf, none)[places], pool, idle)


def places(lanes: Lanes, photons: int) -> Array:
    """Return where the lanes write their results, int32: those that have just ended at their photons' numbers.

    The others write too, from `photons` on: a branch that no processor can foresee costs more, and a GPU that many
    lanes write to one place of lets them wait for one another.
    """
    own = photons + jnp.arange(len(lanes.photon), dtype=jnp.int32)
    return jnp.where(lanes.ended & (lanes.photon < photons), lanes.photon.astype(jnp.int32), own)


def ranks(flags: Array) -> Array:
    """Return the inclusive count of set flags, int32, along rows, then down columns: products with triangles of ones.

    On a processor `cumsum` takes so much longer that a third of all time would go into it.
    """
    if not on_cpu():
        return jnp.cumsum(flags, dtype=jnp.int32)
    rows = flags.reshape(-1, COLUMNS).astype(jnp.float32)
    within = jnp.dot(rows, jnp.triu(jnp.ones((COLUMNS, COLUMNS), jnp.float32)), precision="highest")
    total = within[:, -1]
    before = jnp.dot(total, jnp.triu(jnp.ones((len(total), len(total)), jnp.float32), 1), precision="highest")
    return (within + before[:, None]).reshape(-1).astype(jnp.int32)
