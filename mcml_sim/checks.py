"""What media and simulations ask of their arguments alike."""

from __future__ import annotations

import math
import operator
import os
from pathlib import Path
from typing import TypeGuard

import numpy as np

from mcml_sim.errors import InputError
from mcml_sim.grid import Grid

MAX_PHOTONS = 10**13  # weeks on the largest machines; more is a slip of the pen
MAX_WORKERS = 4096
# Float32 places are 1.2e-7 of themselves apart; this much of its photons (1 %) a bin may gain or lose by that.
NARROWEST_BIN = 1e-5
MAX_CELLS = 2**21  # bins of a table in two directions; the tracer holds eight tables of doubles for each thread
SHORTEST, LONGEST = 1e-30, 1e30  # well inside the range of float32 [length]


def is_number(value: object) -> TypeGuard[float]:
    """True of a real number, infinite ones included; neither of nan nor of True."""
    kinds = (int, float, np.integer, np.floating)
    return isinstance(value, kinds) and not isinstance(value, bool) and not math.isnan(value)


def checked_whole(name: str, number: object, lowest: int, highest: int | None = None) -> int:
    """A whole number, 1e6 included; InputError on anything else."""
    accepted = f"a whole number >= {lowest}" + (f" and <= {highest:g}" if highest else "")
    try:
        whole = int(number) if isinstance(number, float) and number.is_integer() else operator.index(number)  # type: ignore[arg-type]
    except TypeError:
        raise InputError(f"{name} must be {accepted}, got {number!r}") from None
    if isinstance(number, bool) or whole < lowest or (highest is not None and whole > highest):
        raise InputError(f"{name} must be {accepted}, got {number!r}")
    return whole


def checked_workers(workers: int | None, scheduler: str | None = None) -> int | None:
    """A number of threads, or None for one a core; a scheduler has workers of its own."""
    if workers is not None and scheduler is not None:
        raise InputError(f"workers must be None where a scheduler is given, whose workers they are, got {workers!r}")
    return None if workers is None else checked_whole("workers", workers, lowest=1, highest=MAX_WORKERS)


def checked_folder(store: str | os.PathLike[str] | None) -> Path | None:
    """The folder of a store, or None."""
    if store is not None and not isinstance(store, (str, os.PathLike)):
        raise InputError(f"store must be the path of a folder, got {store!r}")
    return None if store is None else Path(store)


def require_resolved(grid: Grid) -> None:
    """InputError unless `grid` is one, whose bins hold many float32 places each."""
    if not isinstance(grid, Grid):
        raise InputError(f"grid must be a mcml_sim.Grid, got {grid!r}")
    for across, number in (("depths", grid.depths), ("angles", grid.angles)):
        if grid.rings * number > MAX_CELLS:
            raise InputError(f"grid must have at most {MAX_CELLS} bins, got {grid.rings} rings x {number} {across}")
    for name, edges in (("rings", grid.r_edges), ("depths", grid.z_edges)):
        if edges is not None:
            _require_resolved(name, edges)


def _require_resolved(name: str, edges: np.ndarray) -> None:
    lower, upper = edges[:-1], edges[1:]
    narrow = upper - lower < NARROWEST_BIN * upper
    if np.any(narrow):
        at = int(np.argmax(narrow))
        raise InputError(
            f"grid must have {name} wider than {NARROWEST_BIN:g} of their place, which single precision resolves, "
            f"got one from {float(lower[at])!r} to {float(upper[at])!r}"
        )
    if upper[0] < SHORTEST or upper[-1] > LONGEST:
        raise InputError(
            f"grid must have edges from {SHORTEST:g} to {LONGEST:g}, got {upper[0]:g} to {upper[-1]:g} of {name}"
        )
