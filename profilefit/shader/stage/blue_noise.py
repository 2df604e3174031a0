"""A blue-noise texture by void and cluster: neighbouring pixels get shifts that differ, so that noise is fine-grained.

Source: R. Ulichney, The void-and-cluster method for dither array generation, Proc. SPIE 1913, 1993.
"""

from __future__ import annotations

from functools import cache

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Place = tuple[int, int]
SIDE = 64
SIGMA = 1.5  # of the Gaussian that says how crowded a place is [pixels]; Ulichney's
STARTING_SHARE = 0.1  # of all pixels, in the pattern that is first made even


@cache
def shifts(side: int = SIDE, seed: int = 1) -> NDArray[np.float32]:
    """(side, side, 2) numbers in (0, 1), two independent tiles whose every level is blue: shifts of xi and of angle."""
    tiles = [(ranks(side, seed + channel) + 0.5) / side**2 for channel in range(2)]
    return np.stack(tiles, axis=-1).astype(np.float32)


def ranks(side: int, seed: int) -> NDArray[np.int64]:
    """(side, side) every whole number in [0, side^2) once; those below any level are spread evenly. Periodic."""
    pattern = _evened(side, np.random.default_rng(seed))
    count = int(pattern.sum())
    order = np.zeros((side, side), np.int64)
    field = _Field(pattern)
    for rank in reversed(range(count)):
        order[field.turn(field.tightest())] = rank
    field = _Field(pattern)
    for rank in range(count, side * side):  # beyond half full, Ulichney's third phase comes to the same
        order[field.turn(field.widest())] = rank
    return order


class _Field:
    """How crowded each place is by the chosen ones, on a torus; a place chosen or dropped changes it at once."""

    def __init__(self, pattern: NDArray[np.bool_]):
        self.kernel = _crowding(len(pattern))
        self.chosen = np.zeros_like(pattern)
        self.value = np.zeros(pattern.shape)
        for row, column in np.argwhere(pattern).tolist():
            self.turn((row, column))

    def turn(self, place: Place) -> Place:
        """Chooses a place, or drops it."""
        sign = -1.0 if self.chosen[place] else 1.0
        self.value += sign * np.roll(self.kernel, place, (0, 1))
        self.chosen[place] = not self.chosen[place]
        return place

    def tightest(self) -> Place:
        """The chosen place that is most crowded."""
        return self._place(np.argmax(np.where(self.chosen, self.value, -np.inf)))

    def widest(self) -> Place:
        """The free place that is least crowded."""
        return self._place(np.argmin(np.where(self.chosen, np.inf, self.value)))

    def _place(self, index: np.intp) -> Place:
        row, column = np.unravel_index(index, self.value.shape)
        return int(row), int(column)


def _crowding(side: int) -> Floats:
    """What a place at the origin adds to each place of the torus."""
    distance = np.minimum(np.arange(side), side - np.arange(side))
    line = np.exp(-(distance**2) / (2.0 * SIGMA**2))
    return np.outer(line, line)


def _evened(side: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """A random pattern whose tightest cluster has gone to its widest void until that changes nothing."""
    pattern = np.zeros(side * side, bool)
    pattern[rng.choice(side * side, int(STARTING_SHARE * side**2), replace=False)] = True
    field = _Field(pattern.reshape(side, side))
    while True:
        cluster = field.turn(field.tightest())
        if field.turn(field.widest()) == cluster:
            return field.chosen
