"""Published filter of caustic maps, which blurs by a size that depends on a pixel's brightness."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import correlate1d

from mcml_sim.media.arrays import checked_numbers
from profilefit.errors import InputError

Floats = NDArray[np.float64]
SIZES = (7, 5, 3)  # pixels of a side, from dark to bright (Li et al., J. Image Graphics 16(8), 2011)
# Neither limits nor sigma are printed: these are ours.
LIMITS = (0.8, 1.6)  # of the mean, between dark, middling and bright


def sigma(size: int) -> float:
    """Return sigma of a Gaussian over so many pixels: 0.3 ((size - 1) / 2 - 1) + 0.8, as OpenCV's getGaussianKernel."""
    return 0.3 * (0.5 * (size - 1) - 1.0) + 0.8


def adaptive_filter(light: ArrayLike, scatter: bool = False) -> Floats:
    """Return a map (rows, columns) that repeats, blurred by 7x7 where it is dark, 5x5, and 3x3 where it is bright.

    scatter  False: each pixel gathers by its own size, as published: not all light is taken up as often as it is there.
             True: each spreads by its own size, and none is lost
    """
    array = checked_numbers("light", light, "finite numbers (rows, columns)")
    if array.ndim != 2 or not np.all(np.isfinite(array)):
        raise InputError(f"light must be finite numbers (rows, columns), got shape {array.shape}")
    bound = [-np.inf, *(limit * float(array.mean()) for limit in LIMITS), np.inf]
    found = np.zeros_like(array)
    for size, low, high in zip(SIZES, bound[:-1], bound[1:], strict=True):
        own = (array >= low) & (array < high)
        weights = np.exp(-0.5 * (np.arange(size) - size // 2) ** 2 / sigma(size) ** 2)
        weights /= weights.sum()
        spread = array * own if scatter else array
        for axis in (0, 1):
            spread = correlate1d(spread, weights, axis, mode="wrap")
        found += spread if scatter else spread * own
    return found
