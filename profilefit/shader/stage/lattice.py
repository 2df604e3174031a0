"""Even points for any number of samples, and the least shifts that take them everywhere.

A lattice of n points on the unit torus, (i a / n, (i + 1/2) / n) modulo 1, with the a for which the closest two are
farthest apart (Korobov's form). A shift by a random point of one cell of it is as good as one by a random point of the
torus (Cranley and Patterson): the same sets come out. But the error changes slowly over a cell, and shifts that are
spread like blue noise then spread the error so, too.
"""

from __future__ import annotations

from functools import cache
from math import gcd
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
WRAPS = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 1, 2)


class Lattice(NamedTuple):
    """a the generator; cell (2, 2) its two edges, the short one first, as rows of (xi, angle / 2 pi)."""

    generator: int
    cell: Floats


@cache
def best(samples: int) -> Lattice:
    """The lattice of n points whose shortest difference is the longest."""
    candidates = [a for a in range(1, samples + 1) if gcd(a, samples) == 1]
    cells = [_cell(a, samples) for a in candidates]
    chosen = int(np.argmax([np.linalg.norm(cell[0]) for cell in cells]))
    return Lattice(candidates[chosen], cells[chosen])


def points(samples: int) -> Floats:
    """(n, 2) xi and angle / 2 pi, before the shift."""
    i = np.arange(samples)
    return np.stack([i * best(samples).generator % samples / samples, (i + 0.5) / samples], axis=-1)


def _cell(generator: int, samples: int) -> Floats:
    """The shortest difference of two points, and the shortest that makes a cell of area 1 / n with it."""
    i = np.arange(samples)
    differences = (np.stack([i * generator % samples, i], axis=-1) / samples + WRAPS).reshape(-1, 2)
    length = np.linalg.norm(differences, axis=1)
    order = np.argsort(length, kind="stable")[1:]  # the first is 0
    first = differences[order[0]]
    area = np.abs(first[0] * differences[order, 1] - first[1] * differences[order, 0])
    second = differences[order[np.argmax(np.abs(area * samples - 1.0) < 1e-6)]]
    return np.stack([first, second])
