"""Discretisation: how far constants are from those of infinitely narrow rings.

A fit is repeated with rings two to six times as wide, made of the same photons. What falls with the square of the width
(a ring's middle in place of its average, a straight line in place of the cdf) is extrapolated to a width of zero
(Richardson, Phil. Trans. R. Soc. A 210, 1911). An objective that compares integrals over rings has nearly none.
"""

from __future__ import annotations

from collections.abc import Sequence

import equinox as eqx
import jax
import numpy as np
from numpy.typing import NDArray

from profilefit.estimate import JACKKNIFE_GROUPS, Fit, Problem, judged
from profilefit.objectives import Rings
from profilefit.solver import solve_batch

Floats = NDArray[np.float64]
# As many at once as the jackknife has groups: that solver is compiled already.
FACTORS = tuple(range(1, JACKKNIFE_GROUPS + 1))
TRUSTED = (2, 3)  # of which the error is made; wider rings show the order
ORDER = 2
# Width of a ring that holds nothing [of the next edge]: narrower than any other, wide enough to divide by.
NONE = 1e-9


def discretisation_error(fit: Fit) -> Floats:
    """Standard-error-like distance (p,) of the constants from those at no width; 0 for a fit that sees one ring.

    The larger of what rings twice and three times as wide extrapolate to. NaN where a fit fails.
    """
    if not fit.solution.converged:
        return np.full(len(fit.free), np.nan)
    if np.asarray(fit.rings.r_edges).size <= 2:
        return np.zeros(len(fit.free))
    moved = by_width(fit)
    off = [np.abs(moved[factor] - moved[1]) / (factor**ORDER - 1) for factor in TRUSTED]
    return np.asarray(np.max(off, axis=0))


def by_width(fit: Fit, factors: Sequence[int] = FACTORS) -> dict[int, Floats]:
    """Constants (p,) by how many rings are taken together; NaN where a fit fails."""
    problem = Problem(fit.objective, fit.free)
    wider = [widened(fit.rings, factor) for factor in factors]
    rings = jax.tree.map(lambda *leaves: np.stack([np.asarray(leaf) for leaf in leaves]), *wider)
    law = jax.tree.map(lambda leaf: np.broadcast_to(leaf, (len(factors), *np.shape(leaf))), fit.law)
    starts = np.tile(fit.solution.parameters, (len(factors), 1))
    found = [judged(one, fit.free) for one in solve_batch(problem, starts, (law, rings))]
    lost = np.full(len(fit.free), np.nan)
    return {k: one.parameters if one.converged else lost for k, one in zip(factors, found, strict=True)}


def widened(rings: Rings, factor: int) -> Rings:
    """`factor` rings taken together, in arrays of the same shape: the rings between hold nothing and do not count.

    A wide ring counts where all its parts do. The last one is as wide as the rings left over.
    """
    edges, energy, used = (np.asarray(part, float) for part in (rings.r_edges, rings.energy, rings.used))
    first = np.arange(0, energy.shape[1], factor)
    last = np.minimum(first + factor, energy.shape[1]) - 1
    whole, kept = np.zeros_like(energy), np.zeros_like(used)
    whole[:, last] = np.add.reduceat(energy, first, axis=1)
    kept[:, last] = np.minimum.reduceat(used, first, axis=1)
    moved = edges.copy()
    for start, end in zip(first, last, strict=True):
        step = NONE * max(edges[start], edges[1])
        moved[start : end + 1] = edges[start] + step * np.arange(end + 1 - start)
    return eqx.tree_at(lambda tree: (tree.r_edges, tree.energy, tree.used), rings, (moved, whole, kept))
