"""A fit repeated on other energies of the same rings: many at once, as bootstrap and coverage need it."""

from __future__ import annotations

from typing import Any

import equinox as eqx
import jax
import numpy as np
from numpy.typing import NDArray

from profilefit.estimate import Fit, Problem
from profilefit.solver import solve_batch

Floats = NDArray[np.float64]
CHUNK = 100  # fits at once: a thousand Jacobians of a dozen constants do not fit into a cache


def refitted(fit: Fit, energy: Floats, start: Floats | None = None) -> tuple[Floats, NDArray[np.bool_]]:
    """Constants (k, p) of `fit` on other energies (k, m, n + 1), light beyond last, and whether each converged (k,).

    What counts in `fit` counts in all of them. `start` (p,) is where they begin, by default at the fit's own optimum.
    """
    begin = fit.solution.parameters if start is None else start
    parts = [_chunk(fit, energy[first : first + CHUNK], begin) for first in range(0, len(energy), CHUNK)]
    return np.concatenate([found for found, _ in parts]), np.concatenate([converged for _, converged in parts])


def whole_chunk(count: int) -> NDArray[np.intp]:
    """Rows that fill a chunk with `count` of them: always one shape, which compiles once."""
    return np.arange(CHUNK) % count


def _chunk(fit: Fit, energy: Floats, start: Floats) -> tuple[Floats, NDArray[np.bool_]]:
    starts = np.tile(start, (CHUNK, 1))
    data = _data(fit, energy[whole_chunk(len(energy))])
    solutions = solve_batch(Problem(fit.objective, fit.free), starts, data)[: len(energy)]
    return np.stack([one.parameters for one in solutions]), np.array([one.converged for one in solutions])


def _data(fit: Fit, energy: Floats) -> Any:
    """What `Problem` reads, once for each of `energy` (k, m, n + 1)."""
    data = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (len(energy), *np.shape(leaf))), (fit.law, fit.rings))
    return eqx.tree_at(lambda tree: (tree[1].energy, tree[1].beyond), data, (energy[..., :-1], energy[..., -1]))
