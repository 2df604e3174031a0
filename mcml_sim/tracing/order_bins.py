"""Bins of scattering order: exact where orders matter one by one, geometric beyond.

Every order to 256 has its own bin; then 64 bins an octave to the last order. All powers of two are bin edges, so the
roulette weight is constant in a bin. What alpha^n is inside a bin that holds several orders is taken as its mean
under the density n^-3/2 of a half space's long paths. Where the density is n^p instead, that mean is off by the
share |p + 3/2| n |ln alpha| 1.6e-5 of itself, which is never more than 6e-6 |p + 3/2| of a photon.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from mcml_sim.tracing.isotropic_event import MAX_ORDER, roulette_weight

Floats = NDArray[np.float64]

LAST_EXACT = 256
BINS_PER_OCTAVE = 64
LONG_PATHS = -1.5  # exponent of the order's density in a conservative half space


def _last_orders() -> NDArray[np.int64]:
    steps = np.arange(1, 1 + round(BINS_PER_OCTAVE * np.log2(MAX_ORDER / LAST_EXACT)))
    geometric = np.rint(LAST_EXACT * 2.0 ** (steps / BINS_PER_OCTAVE)).astype(np.int64)
    return np.concatenate([np.arange(1, LAST_EXACT + 1), geometric])


ORDERS = np.arange(1, MAX_ORDER + 1)
LAST_ORDERS = _last_orders()
"""Highest order in each bin, int64 (bins,)."""
FIRST_ORDERS = np.concatenate([[1], LAST_ORDERS[:-1] + 1])
"""Lowest order in each bin, int64 (bins,)."""
BIN_OF_ORDER = np.repeat(np.arange(len(LAST_ORDERS)), LAST_ORDERS - FIRST_ORDERS + 1)
"""Bin of order n at index n - 1, (MAX_ORDER,)."""


def bin_mean(values: Floats, exponent: float = LONG_PATHS) -> Floats:
    """Mean in each bin, under the density n^exponent, of values at every order: (..., MAX_ORDER) -> (..., bins)."""
    density = ORDERS**exponent
    starts = FIRST_ORDERS - 1
    return np.add.reduceat(values * density, starts, axis=-1) / np.add.reduceat(density, starts)


MEAN_ORDERS = bin_mean(ORDERS.astype(float))
"""Representative order of each bin, float64 (bins,)."""
ROULETTE_WEIGHTS = roulette_weight(LAST_ORDERS)
"""What one photon of each bin counts for, int64 (bins,)."""


def weights(alpha: Floats) -> Floats:
    """What a photon of each bin adds to the reflectance at albedo alpha: (...) -> (..., bins)."""
    return ROULETTE_WEIGHTS * bin_mean(alpha[..., None] ** ORDERS)


def weight_derivatives(alpha: Floats) -> Floats:
    """d weights / d alpha: (...) -> (..., bins)."""
    return ROULETTE_WEIGHTS * bin_mean(ORDERS * alpha[..., None] ** (ORDERS - 1))
