"""Bins into which light is sorted: distance from the beam, depth, and exit angle."""

from __future__ import annotations

import hashlib
import math
import operator
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mcml_sim.errors import InputError
from mcml_sim.media.arrays import Floats, is_number, require

MAX_BINS = 65_536  # along one axis
# Float32 places are 1.2e-7 of themselves apart; this much of its photons (1 %) a bin may gain or lose by that.
NARROWEST_BIN = 1e-5
MAX_CELLS = 2**21  # bins of a table in two directions; the tracer holds eight tables of doubles for each thread
SHORTEST, LONGEST = 1e-30, 1e30  # well inside the range of float32 [length]


@dataclass(frozen=True, init=False, eq=False, repr=False)
class Grid:
    """Cylindrical bins around the beam, in any one unit of length; what falls beyond a last edge is the overflow.

    Grid(dr, nr)                 `nr` rings of equal width `dr`, as in MCML
    Grid(dr, nr, dz, nz, na=na)  also `nz` depths of equal width `dz`, and `na` exit angles between 0 and pi/2
    Grid.from_edges(r=edges)     any rising edges that start at 0; z and na as well

    A bin holds lower edge <= x < upper edge. Grids with equal edges are equal. InputError on anything else.
    """

    r_edges: Floats
    """Edges of the rings [length], float64 (rings + 1,), read-only."""
    z_edges: Floats | None
    """Edges of the depths [length], float64 (depths + 1,), read-only; None if depth is not resolved."""
    a_edges: Floats | None
    """Edges of the exit angles to the surface's normal [rad], float64 (na + 1,), 0 ... pi/2; None if not resolved."""

    def __init__(
        self, dr: float, nr: int, dz: float | None = None, nz: int | None = None, na: int | None = None
    ) -> None:
        if (dz is None) != (nz is None):
            raise InputError(f"dz and nz must be given together, got dz = {dz!r} and nz = {nz!r}")
        r_edges = _even_edges("r", dr, nr)
        z_edges = None if dz is None or nz is None else _even_edges("z", dz, nz)
        self._set_edges(r_edges, z_edges, _angle_edges(na))

    @classmethod
    def from_edges(cls, *, r: ArrayLike, z: ArrayLike | None = None, na: int | None = None) -> Grid:
        """Return rings (and depths) between any rising edges [length], the first of them 0; `na` even angles."""
        grid = object.__new__(cls)
        grid._set_edges(_checked_edges("r", r), None if z is None else _checked_edges("z", z), _angle_edges(na))
        return grid

    @property
    def rings(self) -> int:
        """Number of rings, without the overflow."""
        return len(self.r_edges) - 1

    @property
    def depths(self) -> int:
        """Number of depth bins, without the overflow; 0 if depth is not resolved."""
        return 0 if self.z_edges is None else len(self.z_edges) - 1

    @property
    def angles(self) -> int:
        """Number of angle bins; 0 if angles are not resolved."""
        return 0 if self.a_edges is None else len(self.a_edges) - 1

    @property
    def r_areas(self) -> Floats:
        """Areas of the rings [length^2], float64 (rings,)."""
        lower, upper = self.r_edges[:-1], self.r_edges[1:]
        return np.pi * (upper - lower) * (upper + lower)

    @property
    def z_widths(self) -> Floats:
        """Widths of the depth bins [length], float64 (depths,)."""
        if self.z_edges is None:
            raise InputError("this grid resolves no depths, give it dz and nz")
        return np.diff(self.z_edges)

    @property
    def solid_angles(self) -> Floats:
        """Solid angles of the angle bins, 2 pi (cos lower - cos upper) [sr], float64 (angles,)."""
        if self.a_edges is None:
            raise InputError("this grid resolves no angles, give it na")
        lower, upper = self.a_edges[:-1], self.a_edges[1:]
        return 4 * np.pi * np.sin((lower + upper) / 2) * np.sin((upper - lower) / 2)

    @property
    def digest(self) -> str:
        """Hexadecimal SHA-256 of the edges: equal exactly where all edges are."""
        digest = hashlib.sha256(self.r_edges.astype("<f8").tobytes())
        for name, edges in ((b"z", self.z_edges), (b"a", self.a_edges)):
            if edges is not None:
                digest.update(name + edges.astype("<f8").tobytes())
        return digest.hexdigest()

    def __eq__(self, other: object) -> bool:
        return isinstance(other, Grid) and self.digest == other.digest

    def __hash__(self) -> int:
        return hash(self.digest)

    def __repr__(self) -> str:
        z = "" if self.z_edges is None else f", {self.depths} depths to z = {self.z_edges[-1]:g}"
        a = "" if self.a_edges is None else f", {self.angles} angles"
        return f"Grid({self.rings} annuli to r = {self.r_edges[-1]:g}{z}{a}, {self.digest[:8]})"

    def _set_edges(self, r_edges: Floats, z_edges: Floats | None, a_edges: Floats | None) -> None:
        for name, edges in (("r_edges", r_edges), ("z_edges", z_edges), ("a_edges", a_edges)):
            if edges is not None:
                edges.setflags(write=False)
            object.__setattr__(self, name, edges)


def _even_edges(axis: str, width: float, number: int) -> Floats:
    require(is_number(width) and math.isfinite(width) and width > 0, f"d{axis}", "a width > 0 of the bins", width)
    return width * np.arange(_checked_number(f"n{axis}", number) + 1, dtype=np.float64)


def _angle_edges(na: int | None) -> Floats | None:
    return None if na is None else np.linspace(0.0, np.pi / 2, _checked_number("na", na) + 1)


def _checked_number(name: str, value: int) -> int:
    try:
        number = operator.index(value)
    except TypeError:
        number = 0
    is_count = not isinstance(value, bool) and 1 <= number <= MAX_BINS
    require(is_count, name, f"a whole number of bins from 1 to {MAX_BINS}", value)
    return number


def _checked_edges(axis: str, values: ArrayLike) -> Floats:
    try:
        edges = np.array(values, dtype=np.float64)
    except (TypeError, ValueError):
        raise InputError(f"{axis} must be numbers, the edges of the bins, got {values!r}") from None
    if edges.ndim != 1 or not 2 <= edges.size <= MAX_BINS + 1:
        raise InputError(f"{axis} must be a list of 2 to {MAX_BINS + 1} edges, got an array of shape {edges.shape}")
    if not np.all(np.isfinite(edges)):
        raise InputError(f"{axis} must be finite edges, got {edges[~np.isfinite(edges)][0]:g} among them")
    if edges[0] != 0:
        raise InputError(f"{axis} must start at 0, the beam's entry, got a first edge of {edges[0]:g}")
    if not np.all(np.diff(edges) > 0):
        at = int(np.argmin(np.diff(edges) > 0))
        raise InputError(f"{axis} must rise, got {edges[at + 1]:g} after {edges[at]:g}")
    return edges + 0.0


def require_resolved(grid: Grid) -> None:
    """Raise InputError unless `grid` is one, whose bins hold many float32 places each."""
    require(isinstance(grid, Grid), "grid", "a mcml_sim.Grid", grid)
    for across, number in (("depths", grid.depths), ("angles", grid.angles)):
        if grid.rings * number > MAX_CELLS:
            raise InputError(f"grid must have at most {MAX_CELLS} bins, got {grid.rings} annuli x {number} {across}")
    for name, edges in (("annuli", grid.r_edges), ("depths", grid.z_edges)):
        if edges is None:
            continue
        lower, upper = edges[:-1], edges[1:]
        narrow = upper - lower < NARROWEST_BIN * upper
        if np.any(narrow):
            at = int(np.argmax(narrow))
            raise InputError(
                f"grid must have {name} wider than {NARROWEST_BIN:g} of their place, which single precision resolves, "
                f"got one from {float(lower[at])!r} to {float(upper[at])!r}"
            )
        if upper[0] < SHORTEST or upper[-1] > LONGEST:
            got = f"{upper[0]:g} to {upper[-1]:g} of {name}"
            raise InputError(f"grid must have edges from {SHORTEST:g} to {LONGEST:g}, got {got}")
