"""The posterior of a fit's coordinates, by emcee over the compiled model.

Priors are flat in s = sqrt(1 - alpha), in ln l and in ln k: nothing is known of the units, and alpha may be 1. Errors
made from replicates share a scale that is itself an estimate: with that unknown the likelihood is Student's.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from profilefit.measured.fitting import Found
from profilefit.measured.model import FLOCK, U
from profilefit.measured.solving import FARTHEST_LN, FARTHEST_U
from profilefit.walking import Walk, walk

Floats = NDArray[np.float64]
KEPT = 4000
MAX_STEPS = 20_000
ROOM = 1.0  # in u beyond where a search may end: a fit at the edge has a density
WIDEST = 1.0  # spread of the first walkers in a coordinate that the data do not hold


def posterior(found: Found, seed: int = 0, max_steps: int = MAX_STEPS) -> Walk:
    """Walk over the free coordinates of a fit: samples (k, p)."""
    free, centre = list(found.question.free), found.point
    reach = np.full(centre.size, FARTHEST_LN)

    def log_density(points: Floats) -> Floats:
        full = np.repeat(centre[None], len(points), axis=0)
        full[:, free] = points
        inside = np.all(np.abs(full - centre)[:, U + 1 :] < reach[U + 1 :], axis=1) & (
            np.abs(full[:, U]) < FARTHEST_U + ROOM
        )
        rise = found.problem.costs(np.clip(full, centre - 3 * reach, centre + 3 * reach)) - found.minimum.cost
        value = likelihood(rise, len(free), found.data.pooled)
        if U in free:  # ds/du: what is flat in s
            value = value - np.logaddexp(0.0, full[:, U]) - np.logaddexp(0.0, -full[:, U])
        return np.where(inside & np.isfinite(value), value, -np.inf)

    spread = np.minimum(np.sqrt(np.diag(found.statistical)[free]), WIDEST)
    start = centre[free] + spread * np.random.default_rng(seed).standard_normal((FLOCK, len(free)))
    return walk(log_density, start, centre[free], seed, max_steps, KEPT)


def likelihood(rise: Floats, free: int, pooled: float) -> Floats:
    """ln likelihood (m,) where chi-square has risen by `rise` (m,): normal, or Student's in `free` coordinates."""
    if np.isinf(pooled):
        return -0.5 * rise
    return -0.5 * (pooled + free) * np.log1p(np.maximum(rise, 0.0) / pooled)


def points(found: Found, samples: Floats) -> Floats:
    """The coordinates (k, 3) of samples (k, p) of the free ones."""
    full = np.repeat(found.point[None], len(samples), axis=0)
    full[:, list(found.question.free)] = samples
    return full
