"""Grids as the kernels need them: float32 edges in the run's own unit of length."""

from __future__ import annotations

from dataclasses import dataclass
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

    edges: Array
    """Edges but the first [length], float32 (bins,)."""
    per_length: Array
    """Bins in a unit of length, if all are equal, float32 ()."""
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
