"""The rings into which light is sorted by its distance from the beam."""

from __future__ import annotations

import hashlib
import operator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.errors import InputError

MAX_RINGS = 65_536


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Grid:
    """Rings around the beam, in any one unit of length; what falls beyond the last edge is the overflow.

    Grid(dr, nr)              `nr` rings of equal width `dr`, as in MCML
    Grid.from_edges(r=edges)  any rising edges that start at 0

    A ring holds lower edge <= r < upper edge. Grids with equal edges are equal. InputError on anything else.
    """

    r_edges: NDArray[np.float64]
    """Edges [length], float64 (rings + 1,), read-only."""

    def __init__(self, dr: float, nr: int) -> None:
        _require_width(dr)
        self._set_edges(dr * np.arange(_checked_number(nr) + 1, dtype=np.float64))

    @classmethod
    def from_edges(cls, *, r: ArrayLike) -> Grid:
        """Rings between any rising edges [length], the first of them 0."""
        grid = object.__new__(cls)
        grid._set_edges(_checked_edges(r))
        return grid

    @property
    def rings(self) -> int:
        """Number of rings, without the overflow."""
        return len(self.r_edges) - 1

    @property
    def r_areas(self) -> NDArray[np.float64]:
        """Areas of the rings [length^2], float64 (rings,)."""
        lower, upper = self.r_edges[:-1], self.r_edges[1:]
        return np.pi * (upper - lower) * (upper + lower)

    @property
    def digest(self) -> str:
        """Hexadecimal SHA-256 of the edges: equal exactly where all edges are."""
        return hashlib.sha256(self.r_edges.astype("<f8").tobytes()).hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Grid) and np.array_equal(self.r_edges, other.r_edges)

    def __hash__(self) -> int:
        return hash(self.r_edges.tobytes())

    def __repr__(self) -> str:
        return f"Grid({self.rings} rings to r = {self.r_edges[-1]:g}, {self.digest[:8]})"

    def _set_edges(self, edges: NDArray[np.float64]) -> None:
        edges.setflags(write=False)
        object.__setattr__(self, "r_edges", edges)


def _require_width(dr: float) -> None:
    if not (isinstance(dr, (int, float, np.number)) and not isinstance(dr, bool) and np.isfinite(dr) and dr > 0):
        raise InputError(f"dr must be a ring width > 0, got {dr!r}")


def _checked_number(nr: int) -> int:
    try:
        number = operator.index(nr)
    except TypeError:
        number = 0
    if isinstance(nr, bool) or not 1 <= number <= MAX_RINGS:
        raise InputError(f"nr must be a whole number of rings from 1 to {MAX_RINGS}, got {nr!r}")
    return number


def _checked_edges(r: ArrayLike) -> NDArray[np.float64]:
    try:
        edges = np.array(r, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"r must be numbers, the edges of the rings, got {r!r}") from None
    if edges.ndim != 1 or not 2 <= edges.size <= MAX_RINGS + 1:
        raise InputError(f"r must be a list of 2 to {MAX_RINGS + 1} edges, got an array of shape {edges.shape}")
    if not np.all(np.isfinite(edges)):
        raise InputError(f"r must be finite edges, got {edges[~np.isfinite(edges)][0]:g} among them")
    if edges[0] != 0:
        raise InputError(f"r must start at 0, the beam, got a first edge of {edges[0]:g}")
    if not np.all(np.diff(edges) > 0):
        at = int(np.argmin(np.diff(edges) > 0))
        raise InputError(f"r must rise, got {edges[at + 1]:g} after {edges[at]:g}")
    return edges + 0.0
