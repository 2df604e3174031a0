"""Where the paper cuts a profile off before fitting it: the walk of equation (6)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
# (end of stretch, stride) of the walk outward from r = 0, in the paper's length unit; 1 beyond the last.
STRIDES = ((0.5, 0.05), (1.0, 0.1), (2.0, 0.2), (5.0, 0.5))


def walk(last: float) -> Floats:
    """The radii that the walk visits, from 0 to the first beyond `last`."""
    radii = [0.0]
    begin = 0.0
    for end, stride in STRIDES:
        radii += [begin + stride * (i + 1) for i in range(round((end - begin) / stride))]
        begin = end
    radii += list(np.arange(begin + 1.0, last + 1.0))
    return np.array(radii)


def trimmed_radius(r: Floats, quantity: Floats, epsilon: float = 0.005) -> float:
    """r'_max of (6): the first r of the walk where `quantity` (n,) at ring centres `r` is at most epsilon its largest.

    The paper compares with the value at 0; R_d and r R_d are largest in the first rings, and r R_d is zero at r = 0
    itself, so the largest value stands for it. Returns the last ring's centre where the walk never gets that low.
    """
    steps = walk(float(r[-1]))
    steps = steps[steps <= r[-1]]
    low = np.interp(steps, r, quantity) <= epsilon * np.max(quantity)
    return float(steps[np.argmax(low)]) if low.any() else float(r[-1])
