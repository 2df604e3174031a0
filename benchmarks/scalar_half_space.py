"""Scalar yardstick (`profilefit.studies.tradeoff.scalar`), compiled by numba, and a twin with squares."""

# ruff: noqa: NPY002 - numba compiles numpy's old generator (Mersenne Twister) into the loop; it would call the new one

from __future__ import annotations

import math

import numba as nb
import numpy as np
from numpy.typing import NDArray

from profilefit.studies.tradeoff import scalar
from profilefit.studies.tradeoff.scalar import ROULETTE_CHANCE, WEIGHT_THRESHOLD

Floats = NDArray[np.float64]

trace = nb.njit(error_model="numpy")(scalar.trace)


def squares(seed: int, photons: int, mu_a: float, mu_s: float, r_edges: Floats) -> tuple[Floats, Floats]:
    """Return weights and squared weights of what leaves by ring, each (rings + 1,), the last beyond the last edge."""
    sums = np.zeros((2, r_edges.size))
    _trace_squares(seed, photons, mu_a, mu_s, r_edges, sums)
    return sums[0], sums[1]


@nb.njit(error_model="numpy")  # as in C, no checks of divisors
def _trace_squares(seed: int, photons: int, mu_a: float, mu_s: float, r_edges: Floats, sums: Floats) -> None:
    """Trace the photons of `trace`, with rings between any edges and with squares: slower, to learn variances."""
    np.random.seed(seed)
    mu_t = mu_a + mu_s
    for _ in range(photons):
        x, y, z = 0.0, 0.0, 0.0
        ux, uy, uz = 0.0, 0.0, 1.0
        weight = 1.0
        while True:
            step = -math.log(1.0 - np.random.random()) / mu_t
            if z + uz * step < 0.0:
                x -= ux * z / uz
                y -= uy * z / uz
                ring = np.searchsorted(r_edges, math.sqrt(x * x + y * y), side="right") - 1
                sums[0, ring] += weight
                sums[1, ring] += weight * weight
                break
            x, y, z = x + ux * step, y + uy * step, z + uz * step
            weight *= mu_s / mu_t
            uz = 2.0 * np.random.random() - 1.0
            sine = math.sqrt(1.0 - uz * uz)
            angle = 2.0 * math.pi * np.random.random()
            ux, uy = sine * math.cos(angle), sine * math.sin(angle)
            if weight < WEIGHT_THRESHOLD:
                if np.random.random() >= ROULETTE_CHANCE:
                    break
                weight /= ROULETTE_CHANCE
