"""Weight of photons by where it went: bins as the kernels need them, and the sums of one or more batches, which add."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, fields
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import NDArray

from mcml_sim.media.arrays import Floats
from mcml_sim.media.grid import Grid

FEWEST_GROUPS = 8
FEWEST_IN_GROUP = 64  # photons: groups differ by one, which must not show in their spread
TABLE_BYTES = 2**26  # for the tables of all groups


@partial(jax.tree_util.register_dataclass, data_fields=["edges", "per_length"], meta_fields=["bins", "even"])
@dataclass(frozen=True)
class Axis:
    """Bins of one coordinate; what is beyond them has the number `bins`."""

    edges: Array  # edges but the first [length], float32 (bins,)
    per_length: Array  # bins in a unit of length, if all are equal, float32 ()
    bins: int
    even: bool

    def index(self, values: Array) -> Array:
        """Return bins of values, int32; even ones by a product, which may round across an edge."""
        if self.even:
            return jnp.clip(values * self.per_length, 0, jnp.float32(self.bins)).astype(jnp.int32)
        return jnp.searchsorted(self.edges, values, side="right", method="scan_unrolled").astype(jnp.int32)


def axis(edges: Floats, unit: float) -> Axis:
    """Return bins between edges that start at 0, where `unit` is the kernel's unit of length."""
    even = np.array_equal(edges, edges[1] * np.arange(len(edges)))
    return Axis(jnp.asarray(rounded_up(edges[1:] / unit)), jnp.float32(unit / edges[1]), len(edges) - 1, even)


def rounded_up(values: Floats) -> NDArray[np.float32]:
    """Return the smallest float32 that are not below these: float32 places are in the same bins by both."""
    nearest = values.astype(np.float32)
    return np.where(nearest < values, np.nextafter(nearest, np.float32(np.inf)), nearest)


def groups(grid: Grid, photons: int, most: int) -> int:
    """Return into how many groups photons are divided, whose spread gives the errors of absorption by ring and depth.

    Fewer than `most` if their tables would take more than 64 MiB, or if there are few photons; one has no spread.
    """
    table = 8 * (grid.rings + 1) * (grid.depths + 1)
    return min(max(photons // FEWEST_IN_GROUP, 1), max(FEWEST_GROUPS, min(most, TABLE_BYTES // table)))


@dataclass(frozen=True, eq=False)
class Deposits:
    """Weight of photons that entered with weight 1 each, in float64.

    A photon leaves at most once, so for what leaves, `..._squares` (the sum of squared weights) gives variances of a
    bin and of any union of bins. It is absorbed at many places, so there the variance comes from the spread between
    groups of photons: `..._variance` estimates the variance of the sum beside it.
    """

    started: int  # number of photons
    reflected: Floats  # weight out of the top, by ring (the last row: beyond) and angle, (rings + 1, angles or 1)
    reflected_squares: Floats
    transmitted: Floats  # weight out of the bottom that was scattered, like `reflected`
    transmitted_squares: Floats
    ballistic: Floats  # weight out of the bottom that was never scattered, ()
    ballistic_squares: Floats
    absorbed: Floats  # weight absorbed by each layer, and by all of them together in the last entry, (layers + 1,)
    absorbed_squares: Floats  # squares of what one photon left in each layer, and in all
    accounted: Floats  # weight that left, was absorbed, or was cut, (): `started` but for roulette's luck
    accounted_squares: Floats
    cut: Floats  # weight still inside at the last event allowed, ()
    absorbed_rz: Floats  # weight absorbed by ring and depth, overflows last, (rings + 1, depths + 1); or (0, 0)
    absorbed_rz_variance: Floats
    absorbed_z: Floats  # weight absorbed by depth, (depths + 1,) or (0,)
    absorbed_z_variance: Floats

    def __add__(self, other: Deposits) -> Deposits:
        return Deposits(*(getattr(self, f.name) + getattr(other, f.name) for f in fields(self)))

    def arrays(self) -> dict[str, NDArray]:
        """Return all sums by name, as a store keeps them."""
        return {field.name: np.asarray(getattr(self, field.name)) for field in fields(self)}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray], shapes: Mapping[str, tuple[int, ...]]) -> Deposits:
        """Return the sums of `arrays`; ValueError if one is missing, no sum, or has another shape than in `shapes`."""
        for name, shape in shapes.items():
            if name not in arrays:
                raise ValueError(f"{name} is missing")
            if arrays[name].shape != shape:
                raise ValueError(f"{name} has shape {arrays[name].shape}, not {shape}")
            # A variance is infinite where one group of photons is all there is.
            if not np.all(np.isfinite(arrays[name]) | (name.endswith("_variance") & (arrays[name] == np.inf))):
                raise ValueError(f"{name} is no sum over photons")
        values = {name: np.asarray(arrays[name], np.float64) for name in shapes if name != "started"}
        return cls(started=int(arrays["started"]), **values)


def shapes(grid: Grid, layers: int) -> dict[str, tuple[int, ...]]:
    """Return the shape of every field of Deposits for a grid and a number of layers."""
    exits = (grid.rings + 1, max(grid.angles, 1))
    rz = (grid.rings + 1, grid.depths + 1) if grid.depths else (0, 0)
    z = (grid.depths + 1,) if grid.depths else (0,)
    by_name = {"reflected": exits, "transmitted": exits, "ballistic": (), "absorbed": (layers + 1,), "accounted": ()}
    moments = {name + end: shape for name, shape in by_name.items() for end in ("", "_squares")}
    spreads = {"absorbed_rz": rz, "absorbed_rz_variance": rz, "absorbed_z": z, "absorbed_z_variance": z}
    return {"started": (), "cut": (), **moments, **spreads}
