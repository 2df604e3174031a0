"""One numbered batch of `simulate` in any layered medium, from the light's entry to the last end.

A turn is a few flights inside the layers, then one step across interfaces for the photons that wait there, then
roulette. What leaves, and what is absorbed by a layer, is kept by photon and added up in the order of their numbers at
the end; what is absorbed at a place is added up on the way, in whole units. So the number of lanes does not change a
bit. Places are float32: one within rounding of an edge may be counted on its other side.
"""

from __future__ import annotations

import math
from functools import partial
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array, lax

from mcml_sim.media.arrays import Floats
from mcml_sim.media.grid import Grid
from mcml_sim.media.medium import Medium
from mcml_sim.media.setting import Setting
from mcml_sim.tracing import deposits, half_space_event, layered_event, pool, rng
from mcml_sim.tracing.deposits import Axis, Deposits, axis, groups
from mcml_sim.tracing.layered_event import EVENTS_PER_TURN, FLIGHTS, SELECTED_LAYERS, LayeredLanes, Stack

BATCH_PHOTONS = 2**18
IDLE_SHARE = 0.25  # of the lanes that end before their places are filled again; from 0.15 to 0.3 it is the same
GROUPS = 32  # of photons at most, whose spread gives the errors of what is absorbed by ring and depth
# Sums on the way are int64 multiples of 2^-42, or of less if all layers absorb weakly: 2^18 photons of weight 1, each
# with 2^18 events at most, then stay below 2^61 units.
SUM_BITS, EVENT_BITS = 42, 18
BALLISTIC, INSIDE = -1.0, -2.0  # "radii" of light that was transmitted unscattered, and that was cut


class LayeredBins(NamedTuple):
    """Grid for the kernels."""

    r: Axis
    z: Axis
    cosines: Array  # cosines of the lower edges of the angles, falling from 1, float32 (angles,)
    groups_per_photon: Array  # groups of photons over photons, float32
    per_weight: Array  # units of the sums in a weight of 1, float64


class KernelShape(NamedTuple):
    """Properties that the kernels are compiled for, besides the shapes of their arrays."""

    groups: int  # number of groups of photons
    depths: bool  # whether depth is resolved
    lanes: int


class PhotonFates(NamedTuple):
    """Ends of the photons of a batch; by photon, then by lane for what is not needed."""

    exits: Array
    """Complex rho [length] + i weight, the weight negative below; rho may be BALLISTIC or INSIDE; 0 after roulette,
    complex64 (BATCH_PHOTONS + lanes,)."""
    cosines: Array  # cosines of the direction to the normal [-]; float32 like exits, or (1,) if angles are not resolved
    absorbed: tuple[Array, ...]  # weight left in each layer, or in all if they are many, float32, as exits
    by_layer: Array  # weight left by group in each layer, in units, int64 (groups * layers,), or (0,)
    by_cell: Array  # weight by group, ring and depth, in units, int64 (groups * (rings + 1) * (depths + 1),) or (0,)


def trace_batch(
    medium: Medium,
    grid: Grid,
    seed: int,
    batch: int,
    photons: int,
    lanes: int | None = None,
    illumination: str = "searchlight",
) -> Deposits:
    """Trace the first `photons` (<= BATCH_PHOTONS) photons of a batch; `lanes` is a multiple of 512 (`pool.lanes`).

    Photons enter with weight 1, below all specular reflection. Where they are a beam a first layer of clear glass is
    behind them then: `specular_reflectance` has counted what it sends back.
    """
    light = Setting(illumination, n=medium.layers[0].n / medium.n_above)
    diffuse = illumination == "diffuse"
    first = 1 if diffuse or medium.layers[0].mu_t > 0 else 2
    if first > len(medium.layers):
        # Of a single sheet of clear glass what is not reflected at once goes through.
        ballistic: dict[str, Floats] = {name: np.zeros(size) for name, size in deposits.shapes(grid, 1).items()}
        for name in ("started", "ballistic", "ballistic_squares", "accounted", "accounted_squares"):
            ballistic[name] = np.asarray(float(photons))
        return Deposits.from_arrays(ballistic, deposits.shapes(grid, 1))
    # Lengths are in the shortest free path, or in the whole thickness where all is clear.
    mu_t = max(layer.mu_t for layer in medium.layers)
    unit = 1 / mu_t if mu_t else sum(layer.thickness for layer in medium.layers)
    bins, shape = _bins(medium, grid, unit, photons, lanes or pool.lanes())
    key = jnp.asarray(rng.batch_key(seed, batch))
    entry = jnp.asarray(half_space_event.entry_cosines(light) if diffuse else np.zeros(0, np.float32))
    with jax.enable_x64(True):
        traced = trace(key, jnp.int32(photons), jnp.int32(first), entry, layered_event.stack(medium, unit), bins, shape)
    exits, sums, *tables = (np.asarray(part) for part in traced)
    by_layer, by_cell = (table / float(bins.per_weight) for table in tables)
    return _deposits(exits, sums, by_layer.reshape(shape.groups, -1), by_cell, photons, grid)


@partial(jax.jit, static_argnames="shape", compiler_options=pool.COMPILER_OPTIONS)
def trace(
    key: Array, photons: Array, first: Array, entry: Array, stack: Stack, bins: LayeredBins, shape: KernelShape
) -> tuple[Array, Array, Array, Array]:
    """Return the first `photons` (int32) photons of a batch: exits, sums, and what was left by layer and by cell.

    They start in the layer number `first` (int32); `entry` as in `layered_event.enter`.
    """
    go = photons > 0
    angles = len(bins.cosines) > 0
    followed = stack.layers if stack.layers <= SELECTED_LAYERS else 1
    cells = (bins.r.bins + 1) * (bins.z.bins + 1) if shape.depths else 0
    places = BATCH_PHOTONS + shape.lanes
    results = PhotonFates(
        exits=jnp.zeros(places, jnp.complex64),
        cosines=jnp.zeros(places if angles else 1, jnp.float32),
        absorbed=(jnp.zeros(places, jnp.float32),) * followed,
        by_layer=jnp.zeros(0 if followed == stack.layers else shape.groups * stack.layers, jnp.int64),
        by_cell=jnp.zeros(shape.groups * cells, jnp.int64),
    )

    def enter(numbers: Array) -> LayeredLanes:
        return layered_event.enter(key, numbers, first, entry, followed)

    def turn(lanes: LayeredLanes, results: PhotonFates) -> tuple[LayeredLanes, PhotonFates]:
        most = round((1 - IDLE_SHARE) * len(lanes.layer))

        def step(state: tuple[State, Array]) -> tuple[State, Array]:
            after = _turn(go, key, stack, bins, shape, state[0])
            return after, jnp.sum(~after[0].ended, dtype=jnp.int32) > most

        before = (lanes, results.by_layer, results.by_cell), jnp.bool_(True)
        (lanes, by_layer, by_cell), _ = lax.while_loop(lambda state: state[1], step, before)
        scattered = layered_event.is_scattered(lanes, entry)
        results = _recorded(results, lanes, scattered, stack.layers, angles)
        return lanes, results._replace(by_layer=by_layer, by_cell=by_cell)

    results = pool.follow(enter, turn, results, photons, shape.lanes)
    return _sorted(results, bins), _summed(results), results.by_layer, results.by_cell


State = tuple[LayeredLanes, Array, Array]


def _turn(go: Array, key: Array, stack: Stack, bins: LayeredBins, shape: KernelShape, state: State) -> State:
    """Return the lanes after flights, what they leave behind, the step across interfaces, and roulette."""
    lanes, by_layer, by_cell = state
    here = layered_event.optics(stack, lanes.layer)
    group = lanes.photon.astype(jnp.float32) * bins.groups_per_photon
    group = jnp.minimum(group, shape.groups - 1).astype(jnp.int32)

    def flight(number: Array, state: tuple[LayeredLanes, Array, Array]) -> tuple[LayeredLanes, Array, Array]:
        lanes, absorbed, by_cell = state
        after, left = layered_event.scatter(go, key, lanes, lanes.event + number, here, stack.others)
        if by_cell.size:
            top = layered_event.pick(stack.top, lanes.layer)
            cell, units = layered_event.staged(go, partial(_cell, bins), after.place, after.down, top, group, left)
            by_cell = by_cell.at[cell].add(units, mode="promise_in_bounds")
        return after, absorbed + left, by_cell

    begin = lanes, jnp.zeros_like(lanes.weight), by_cell
    lanes, left, by_cell = lax.fori_loop(jnp.uint32(0), jnp.uint32(FLIGHTS), flight, begin)
    if by_layer.size:
        cell = group * stack.layers + jnp.clip(lanes.layer - 1, 0, stack.layers - 1)
        by_layer = by_layer.at[cell].add(_units(left, bins), mode="promise_in_bounds")
    if len(lanes.absorbed) == 1:
        absorbed = (lanes.absorbed[0] + left,)
    else:
        absorbed = tuple(old + jnp.where(lanes.layer == at, left, 0) for at, old in enumerate(lanes.absorbed, start=1))
    lanes = layered_event.settle(go, key, stack, lanes, lanes.event + FLIGHTS)
    return lanes._replace(event=lanes.event + EVENTS_PER_TURN, absorbed=absorbed), by_layer, by_cell


def _cell(bins: LayeredBins, place: Array, down: Array, top: Array, group: Array, left: Array) -> tuple[Array, Array]:
    """Return the index into the table of groups, rings and depths, and what is left there, in units."""
    ring = bins.r.index(jnp.sqrt(place.real * place.real + place.imag * place.imag))
    depth = bins.z.index(top + down.real)
    return (group * (bins.r.bins + 1) + ring) * (bins.z.bins + 1) + depth, _units(left, bins)


def _units(left: Array, bins: LayeredBins) -> Array:
    return jnp.round(left.astype(jnp.float64) * bins.per_weight).astype(jnp.int64)


def _recorded(results: PhotonFates, lanes: LayeredLanes, scattered: Array, layers: int, angles: bool) -> PhotonFates:
    """Record the ends of the photons that have ended since the last time."""
    number = pool.places(lanes, BATCH_PHOTONS)
    transmitted = lanes.layer == layers + 1
    rho = jnp.sqrt(lanes.place.real * lanes.place.real + lanes.place.imag * lanes.place.imag)
    rho = jnp.where(transmitted & ~scattered, BALLISTIC, rho)
    rho = jnp.where(lanes.layer == layered_event.CUT, INSIDE, rho).astype(jnp.float32)
    weight = jnp.where(lanes.layer == layered_event.ROULETTED, 0, jnp.where(transmitted, lanes.weight, -lanes.weight))
    cosines = results.cosines
    if angles:
        cosines = _written(cosines, number, jnp.abs(lanes.down.imag))
    return results._replace(
        exits=_written(results.exits, number, lax.complex(rho, weight)),
        cosines=cosines,
        absorbed=tuple(_written(old, number, new) for old, new in zip(results.absorbed, lanes.absorbed, strict=True)),
    )


def _written(values: Array, number: Array, new: Array) -> Array:
    return values.at[number].set(new, mode="promise_in_bounds", unique_indices=True)


def _sorted(results: PhotonFates, bins: LayeredBins) -> Array:
    """Return weights and their squares by side (above, below), ring, angle, float64 (2, rings + 1, angles or 1, 2)."""
    rho, signed = results.exits.real[:BATCH_PHOTONS], results.exits.imag[:BATCH_PHOTONS]
    weight = jnp.where(rho >= 0, jnp.abs(signed), 0).astype(jnp.float64)
    cell = jnp.where(signed < 0, 1, 0) * (bins.r.bins + 1) + bins.r.index(rho)
    angles = len(bins.cosines) or 1
    if len(bins.cosines):
        # Edges fall from 1, so those above the cosine are counted.
        rising, values = -bins.cosines[1:], -results.cosines[:BATCH_PHOTONS]
        angle = jnp.searchsorted(rising, values, side="right", method="scan_unrolled")
        cell = cell * angles + angle.astype(jnp.int32)
    size = 2 * (bins.r.bins + 1) * angles
    sums = [jnp.zeros(size, jnp.float64).at[cell].add(w, mode="promise_in_bounds") for w in (weight, weight * weight)]
    return jnp.stack(sums, axis=-1).reshape(2, bins.r.bins + 1, angles, 2)


def _summed(results: PhotonFates) -> Array:
    """Return sums and sums of squares over photons, float64 (quantities, 2).

    Quantities: what was left in layers, in all of them, what is accounted for, ballistic, cut.
    """
    rho, weight = results.exits.real[:BATCH_PHOTONS], jnp.abs(results.exits.imag[:BATCH_PHOTONS]).astype(jnp.float64)
    by_layer = [values[:BATCH_PHOTONS].astype(jnp.float64) for values in results.absorbed]
    absorbed = sum(by_layer[1:], start=by_layer[0])
    ballistic, cut = (jnp.where(rho == where, weight, 0) for where in (BALLISTIC, INSIDE))
    quantities = jnp.stack([*by_layer, absorbed, absorbed + weight, ballistic, cut])
    return jnp.stack([quantities.sum(axis=1), jnp.sum(quantities * quantities, axis=1)], axis=1)


def _bins(medium: Medium, grid: Grid, unit: float, photons: int, lanes: int) -> tuple[LayeredBins, KernelShape]:
    parts = groups(grid, photons, GROUPS)
    z_edges = grid.z_edges if grid.z_edges is not None else np.array([0.0, 1.0])
    # The angles' lower edges.
    cosines = np.cos(grid.a_edges[:-1]) if grid.a_edges is not None else np.zeros(0)
    most = max(layer.mu_a / layer.mu_t if layer.mu_t else 0.0 for layer in medium.layers)
    # Binary digits of sums after the point.
    bits = SUM_BITS + max(0, math.floor(-math.log2(most)) - EVENT_BITS) if most else SUM_BITS
    with jax.enable_x64(True):
        bins = LayeredBins(
            axis(grid.r_edges, unit),
            axis(z_edges, unit),
            jnp.asarray(cosines, jnp.float32),
            jnp.float32(parts / photons),
            jnp.float64(2.0**bits),
        )
    return bins, KernelShape(parts, grid.depths > 0, lanes)


def _deposits(exits: Floats, sums: Floats, by_layer: Floats, by_cell: Floats, photons: int, grid: Grid) -> Deposits:
    *absorbed, total, accounted, ballistic, cut = sums
    if by_layer.size:
        # The sum of squares by photon has the variance of the groups' spread.
        absorbed = [(part.sum(), float(_variance(part)) + part.sum() ** 2 / photons) for part in by_layer.T]
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
    """Return the variance of the sum of independent, equally distributed groups, by spread: (groups, ...) -> (...)."""
    number = len(parts)
    return number * parts.var(axis=0, ddof=1) if number > 1 else np.full(parts.shape[1:], np.inf)
