"""One numbered batch of `simulate` in any layered medium, from the beam to the last end.

A turn is a few flights inside the layers, then one step across interfaces for the photons that wait there, then
roulette. What leaves is kept by photon and sorted into bins at the end; what is absorbed is added up on the way, in
multiples of 2^-30 or 2^-38, which float64 adds without rounding. So the number of lanes does not change a bit.
Places are float32: one within rounding of an edge may be counted on its other side.
"""

from __future__ import annotations

from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax
from numpy.typing import NDArray

from mcml_sim import deposits, photon, pool, rng
from mcml_sim.bins import Axis, axis, groups
from mcml_sim.deposits import Deposits
from mcml_sim.grid import Grid
from mcml_sim.medium import Medium
from mcml_sim.photon import CUT, EVENTS_PER_TURN, FLIGHTS, REFLECTED, ROULETTED, SELECTED_LAYERS, Lanes, Stack

Floats = NDArray[np.float64]

BATCH_PHOTONS = 2**18
LANES = 4096
IDLE_SHARE = 0.25  # of the lanes that end before their places are filled again; from 0.15 to 0.3 it is the same
GROUPS = 32  # of photons at most, whose spread gives the errors of what is absorbed by ring and depth
COLUMNS = 64  # in which sums over lanes are kept, so that they are vectors
SUM_BITS, TABLE_BITS = 30, 38  # float64 adds multiples of 2^-30 up to 2^23, of 2^-38 up to 2^15, without rounding


class Bins(NamedTuple):
    """A grid as the kernels want it."""

    r: Axis
    z: Axis
    cosines: Array
    """Cosines of the edges between angles, falling, float32 (angles - 1,)."""
    groups_per_photon: Array
    """Groups of photons over photons, float32."""


class Shape(NamedTuple):
    """What the kernels are compiled for, besides the shapes of their arrays."""

    groups: int
    """Groups of photons; 0 if depth is not resolved."""
    lanes: int


class Results(NamedTuple):
    """What became of the photons of a batch."""

    exits: Array
    """Of each photon, rho [length] + i weight, the weight negative below; 0 if it did not leave, complex64."""
    cosines: Array
    """Of its direction to the normal [-]; float32 (BATCH_PHOTONS,), or (1,) if angles are not resolved."""
    sums: Array
    """Of the quantities of `_quantities` and their squares, float64 (quantities, 2, COLUMNS)."""
    by_layer: Array
    """What each group left in each layer, float64 (groups * layers,), or (0,) if photons know it."""
    by_cell: Array
    """What each group left in each ring and depth, float64 (groups * (rings + 1) * (depths + 1),) or (0,)."""


def trace_batch(medium: Medium, grid: Grid, seed: int, batch: int, photons: int, lanes: int = LANES) -> Deposits:
    """Trace the first `photons` (<= BATCH_PHOTONS) photons of a batch; `lanes` is a multiple of 512.

    Photons enter with weight 1, below all specular reflection. A first layer of clear glass is behind them then:
    `optics.specular_reflectance` has counted what it sends back.
    """
    first = 1 if medium.layers[0].mu_t > 0 else 2
    if first > len(medium.layers):
        return _all_ballistic(grid, photons)
    unit = _unit(medium)
    bins, shape = _bins(grid, unit, photons, lanes)
    key = jnp.asarray(rng.batch_key(seed, batch))
    with jax.enable_x64(True):
        found = trace(key, jnp.int32(photons), jnp.int32(first), photon.stack(medium, unit), bins, shape)
    exits, sums, by_layer, by_cell = (np.asarray(part) for part in found)
    return _deposits(exits, sums, by_layer, by_cell, photons, len(medium.layers), grid)


@partial(jax.jit, static_argnames="shape", compiler_options=pool.COMPILER_OPTIONS)
def trace(
    key: Array, photons: Array, first: Array, stack: Stack, bins: Bins, shape: Shape
) -> tuple[Array, Array, Array, Array]:
    """The first `photons` (int32) photons of a batch: exits, sums, and what was left by layer and by cell.

    They start in the layer number `first` (int32).
    """
    go = photons > 0
    angles = len(bins.cosines) > 0
    followed = stack.layers if stack.layers <= SELECTED_LAYERS else 1
    cells = shape.groups * (bins.r.bins + 1) * (bins.z.bins + 1)
    results = Results(
        exits=jnp.zeros(BATCH_PHOTONS, jnp.complex64),
        cosines=jnp.zeros(BATCH_PHOTONS if angles else 1, jnp.float32),
        sums=jnp.zeros((followed + 4, 2, COLUMNS), jnp.float64),
        by_layer=jnp.zeros(0 if followed == stack.layers else GROUPS * stack.layers, jnp.float64),
        by_cell=jnp.zeros(cells, jnp.float64),
    )

    def enter(numbers: Array) -> Lanes:
        return photon.enter(numbers, first, followed)

    def turn(lanes: Lanes, results: Results) -> tuple[Lanes, Results]:
        most = round((1 - IDLE_SHARE) * len(lanes.layer))

        def step(state: tuple[State, Array]) -> tuple[State, Array]:
            after = _turn(go, key, stack, bins, shape, state[0])
            return after, jnp.sum(~after[0].ended, dtype=jnp.int32) > most

        before = (lanes, results.by_layer, results.by_cell), jnp.bool_(True)
        (lanes, by_layer, by_cell), _ = lax.while_loop(lambda state: state[1], step, before)
        return lanes, _recorded(results, lanes, stack.layers, angles)._replace(by_layer=by_layer, by_cell=by_cell)

    results = pool.follow(enter, turn, results, photons, shape.lanes)
    exits = _histogram(results, bins)
    return exits, results.sums.sum(axis=-1), results.by_layer, results.by_cell


State = tuple[Lanes, Array, Array]


def _turn(go: Array, key: Array, stack: Stack, bins: Bins, shape: Shape, state: State) -> State:
    """Flights, what they leave behind, the step across interfaces, and roulette."""
    lanes, by_layer, by_cell = state
    here, before = photon.material(stack, lanes.layer), lanes.weight
    group = _group(lanes, bins, shape.groups or GROUPS)

    def flight(number: Array, state: tuple[Lanes, Array]) -> tuple[Lanes, Array]:
        lanes, by_cell = state
        after, paths = photon.scatter(go, key, lanes, lanes.event + number, here)
        if by_cell.size:
            left = jnp.where(paths > 0, lanes.weight - after.weight, 0)
            top = photon.pick(stack.top, lanes.layer)
            cell, left = photon.staged(go, partial(_cell, bins), after.place, after.down, top, group, left)
            by_cell = by_cell.at[cell].add(left, mode="promise_in_bounds")
        return after, by_cell

    lanes, by_cell = lax.fori_loop(jnp.uint32(0), jnp.uint32(FLIGHTS), flight, (lanes, by_cell))
    left = before - jnp.abs(lanes.weight)
    left = jnp.where(before > 0, left, 0)
    if by_layer.size:
        cell = group * stack.layers + jnp.clip(lanes.layer - 1, 0, stack.layers - 1)
        by_layer = by_layer.at[cell].add(_rounded(left, TABLE_BITS), mode="promise_in_bounds")
        absorbed = (lanes.absorbed[0] + left,)
    elif len(lanes.absorbed) == 1:
        absorbed = (lanes.absorbed[0] + left,)
    else:
        absorbed = tuple(
            old + jnp.where(lanes.layer == number, left, 0) for number, old in enumerate(lanes.absorbed, start=1)
        )
    lanes = photon.settle(go, key, stack, lanes, lanes.event + FLIGHTS)
    return lanes._replace(event=lanes.event + EVENTS_PER_TURN, absorbed=absorbed), by_layer, by_cell


def _group(lanes: Lanes, bins: Bins, parts: int) -> Array:
    """Group of each photon, int32."""
    return jnp.minimum(lanes.photon.astype(jnp.float32) * bins.groups_per_photon, parts - 1).astype(jnp.int32)


def _cell(bins: Bins, place: Array, down: Array, top: Array, group: Array, left: Array) -> tuple[Array, Array]:
    """Index into the table of groups, rings and depths, and what is left there."""
    ring = bins.r.index(jnp.sqrt(place.real * place.real + place.imag * place.imag))
    depth = bins.z.index(top + down.real)
    return (group * (bins.r.bins + 1) + ring) * (bins.z.bins + 1) + depth, _rounded(left, TABLE_BITS)


def _rounded(weights: Array, bits: int) -> Array:
    """float64 multiples of 2^-bits, which is the spacing of float64 at 2^(52 - bits)."""
    large = jnp.float64(1.5 * 2.0 ** (52 - bits))
    return (weights.astype(jnp.float64) + large) - large


def _quantities(lanes: Lanes, layers: int) -> tuple[Array, ...]:
    """Of photons that have ended: weight left in layers, in all of them, accounted for, ballistic, cut."""
    weight = -lanes.weight
    absorbed = sum(lanes.absorbed[1:], start=lanes.absorbed[0])
    accounted = absorbed + jnp.where(lanes.layer == ROULETTED, 0, weight)
    transmitted = lanes.layer == layers + 1
    ballistic = jnp.where(transmitted & ~photon.is_scattered(lanes), weight, 0)
    cut = jnp.where(lanes.layer == CUT, weight, 0)
    return (*lanes.absorbed, absorbed, accounted, ballistic, cut)


def _recorded(results: Results, lanes: Lanes, layers: int, angles: bool) -> Results:
    """Add what became of the photons that have ended since the last time."""
    counts = lanes.ended & (lanes.photon < BATCH_PHOTONS)
    values = [jnp.where(counts, value, 0).reshape(-1, COLUMNS) for value in _quantities(lanes, layers)]
    rounded = [[_rounded(value, SUM_BITS), _rounded(value * value, SUM_BITS)] for value in values]
    sums = results.sums + jnp.stack([jnp.stack([v.sum(axis=0) for v in pair]) for pair in rounded])
    transmitted = (lanes.layer == layers + 1) & photon.is_scattered(lanes)
    leaves = counts & (transmitted | (lanes.layer == REFLECTED))
    number = jnp.where(leaves, lanes.photon.astype(jnp.int32), BATCH_PHOTONS)
    rho = jnp.sqrt(lanes.place.real * lanes.place.real + lanes.place.imag * lanes.place.imag)
    exit_ = lax.complex(rho, jnp.where(transmitted, lanes.weight, -lanes.weight))
    cosines = results.cosines
    if angles:
        cosines = cosines.at[number].set(jnp.abs(lanes.down.imag), mode="drop")
    return results._replace(exits=results.exits.at[number].set(exit_, mode="drop"), cosines=cosines, sums=sums)


def _histogram(results: Results, bins: Bins) -> Array:
    """Weights and squared weights by side (above, below), ring and angle, float64 (2, rings + 1, angles or 1, 2)."""
    weight = results.exits.imag
    cell = jnp.where(weight < 0, 1, 0) * (bins.r.bins + 1) + bins.r.index(results.exits.real)
    angles = len(bins.cosines) or 1
    if len(bins.cosines):
        # Edges fall from 1, so those above the cosine are counted.
        angle = jnp.searchsorted(-bins.cosines[1:], -results.cosines, side="right", method="scan_unrolled")
        cell = cell * angles + angle.astype(jnp.int32)
    rounded = _rounded(jnp.abs(weight), SUM_BITS), _rounded(weight * weight, SUM_BITS)
    size = 2 * (bins.r.bins + 1) * angles
    sums = [jnp.zeros(size, jnp.float64).at[cell].add(values, mode="promise_in_bounds") for values in rounded]
    return jnp.stack(sums, axis=-1).reshape(2, bins.r.bins + 1, angles, 2)


def _unit(medium: Medium) -> float:
    """A length of the medium's own: its shortest free path, or its thickness if it is all clear."""
    mu_t = max(layer.mu_t for layer in medium.layers)
    return 1 / mu_t if mu_t else sum(layer.thickness for layer in medium.layers)


def _bins(grid: Grid, unit: float, photons: int, lanes: int) -> tuple[Bins, Shape]:
    parts = groups(grid, photons, GROUPS) if grid.depths else 0
    z_edges = grid.z_edges if grid.z_edges is not None else np.array([0.0, 1.0])
    # The angles' lower edges.
    cosines = np.cos(grid.a_edges[:-1]) if grid.a_edges is not None else np.zeros(0)
    bins = Bins(
        axis(grid.r_edges, unit),
        axis(z_edges, unit),
        jnp.asarray(cosines, jnp.float32),
        jnp.float32((parts or GROUPS) / photons),
    )
    return bins, Shape(parts, lanes)


def _deposits(
    exits: Floats, sums: Floats, by_layer: Floats, by_cell: Floats, photons: int, layers: int, grid: Grid
) -> Deposits:
    *absorbed, total, accounted, ballistic, cut = sums
    if by_layer.size:
        absorbed = [_with_squares(values, photons) for values in by_layer.reshape(GROUPS, layers).T]
    in_layers = np.array([*absorbed, total])
    rz = by_cell.reshape(-1, grid.rings + 1, grid.depths + 1) if grid.depths else np.zeros((1, 0, 0))
    z = rz.sum(axis=1)
    return Deposits(
        started=photons,
        reflected=exits[0, :, :, 0],
        reflected_squares=exits[0, :, :, 1],
        transmitted=exits[1, :, :, 0],
        transmitted_squares=exits[1, :, :, 1],
        ballistic=ballistic[0],
        ballistic_squares=ballistic[1],
        absorbed=in_layers[:, 0],
        absorbed_squares=in_layers[:, 1],
        accounted=accounted[0],
        accounted_squares=accounted[1],
        cut=cut[0],
        absorbed_rz=rz.sum(axis=0),
        absorbed_rz_variance=_variance(rz),
        absorbed_z=z.sum(axis=0),
        absorbed_z_variance=_variance(z),
    )


def _variance(parts: Floats) -> Floats:
    """Of the sum of independent, equally distributed groups, by their spread: (groups, ...) -> (...)."""
    number = len(parts)
    return number * parts.var(axis=0, ddof=1) if number > 1 else np.zeros(parts.shape[1:])


def _with_squares(parts: Floats, photons: int) -> tuple[float, float]:
    """Sum, and the sum of squares by photon that has the variance of the groups' spread."""
    total = parts.sum()
    return total, float(_variance(parts)) + total**2 / photons


def _all_ballistic(grid: Grid, photons: int) -> Deposits:
    """A single sheet of clear glass: what is not reflected at once goes through."""
    sums: dict[str, Floats] = {name: np.zeros(shape) for name, shape in deposits.shapes(grid, 1).items()}
    for name in ("started", "ballistic", "ballistic_squares", "accounted", "accounted_squares"):
        sums[name] = np.asarray(float(photons))
    return Deposits.from_arrays(sums, deposits.shapes(grid, 1))
