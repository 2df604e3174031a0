"""The scalar yardstick: one photon at a time through a matched, isotropic half space, as MCML traces it.

The algorithm of Wang, Jacques & Zheng (Comput. Methods Programs Biomed. 47, 1995): a part of the photon's weight is
absorbed at each event, a light photon plays roulette, what leaves is counted by ring. A plain loop, which numba
compiles where the extra `benchmark` is installed; it shares no code with the tracer that it measures.
"""

# ruff: noqa: NPY002 - numba compiles numpy's old generator (Mersenne Twister) into the loop; it would call the new one

from __future__ import annotations

import math
from collections.abc import Callable
from functools import cache
from typing import Any

import numpy as np

from mcml_sim.media.arrays import Floats

WEIGHT_THRESHOLD, ROULETTE_CHANCE = 1e-4, 0.1  # MCML's
ABSENT = "needs numba: pip install numba"


def trace(
    seed: int,
    photons: int,
    mu_a: float,
    mu_s: float,
    dr: float,
    reflected: Floats,
    absorbed: Floats | None = None,
    dz: float = 1.0,
) -> tuple[int, float]:
    """Trace `photons` and add their weight to the tallies; number of events, and all weight absorbed.

    mu_a, mu_s  [1/length];  dr, dz  widths of the bins [length]; a last bin holds what falls beyond it too
    reflected   (nr,) weight that left
    absorbed    (nr, nz) weight absorbed by ring and depth; None to add up only the total
    """
    np.random.seed(seed)
    mu_t = mu_a + mu_s
    absorbed_share, mfp, rings_per_length, depths_per_length = mu_a / mu_t, 1 / mu_t, 1 / dr, 1 / dz
    last_ring = reflected.size - 1
    events, total = 0, 0.0
    for _ in range(photons):
        x, y, z = 0.0, 0.0, 0.0
        ux, uy, uz = 0.0, 0.0, 1.0
        weight = 1.0
        while True:
            events += 1
            step = -math.log(1.0 - np.random.random()) * mfp
            below = z + uz * step
            if below < 0.0:
                step = -z / uz
                x += ux * step
                y += uy * step
                reflected[min(int(math.sqrt(x * x + y * y) * rings_per_length), last_ring)] += weight
                break
            x += ux * step
            y += uy * step
            z = below
            drop = weight * absorbed_share
            weight -= drop
            if absorbed is None:
                total += drop
            else:
                ring = min(int(math.sqrt(x * x + y * y) * rings_per_length), last_ring)
                absorbed[ring, min(int(z * depths_per_length), absorbed.shape[1] - 1)] += drop
            uz = 2.0 * np.random.random() - 1.0
            sine = math.sqrt(1.0 - uz * uz)
            angle = 2.0 * math.pi * np.random.random()
            cosine = math.cos(angle)
            ux = sine * cosine
            uy = sine * math.copysign(math.sqrt(max(1.0 - cosine * cosine, 0.0)), math.pi - angle)
            if weight < WEIGHT_THRESHOLD:
                if np.random.random() >= ROULETTE_CHANCE:
                    break
                weight /= ROULETTE_CHANCE
    return events, total if absorbed is None else absorbed.sum()


@cache
def compiled(function: Callable[..., Any] = trace) -> Callable[..., Any] | None:
    """Return a plain loop as machine code, without checks of divisors, as in C; None where numba is not installed."""
    try:
        import numba
    except ImportError:
        return None
    return numba.njit(error_model="numpy")(function)
