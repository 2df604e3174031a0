"""Samples of pixels: how many, by which map, for which channel; one lattice for all, shifted by blue noise.

A lattice of n points on the unit torus, (i a / n, (i + 1/2) / n) modulo 1, with the a for which the closest two are
farthest apart (Korobov's form). A shift by a random point of one cell of it is as good as one by a random point of the
torus (Cranley and Patterson): the same sets come out. But the error changes slowly over a cell, and shifts that are
spread like blue noise then spread the error so, too.

The shifts are a texture by void and cluster (R. Ulichney, The void-and-cluster method for dither array generation,
Proc. SPIE 1913, 1993): neighbouring pixels get shifts that differ, so that noise is fine-grained.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache
from math import gcd
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.arrays import Floats, checked_whole, require

WRAPS = np.stack(np.meshgrid([-1, 0, 1], [-1, 0, 1]), axis=-1).reshape(-1, 1, 2)
KINDS = ("uniform", "importance", "importance blue")
CHANNELS = ("longest", "mixture")
MOST_SAMPLES = 256
MOST_SEED = 2**31 - 1


@dataclass(frozen=True)
class Sampling:
    """Samples of a pixel: how the points of a lattice (`best`), shifted as a whole, become radii and angles.

    Noise on a step edge, alpha 0.8, within 4 mfp, with 16 and 64 points: 0.037 and 0.011; a Fibonacci lattice's 0.035
    and 0.012, Hammersley's set 0.036 and 0.012, the R2 sequence 0.038 and 0.014, Sobol's 0.050 and 0.014, random points
    0.066 and 0.032. This one takes any n, one multiplication a point, and only it turns blue shifts into blue errors.

    samples   of a pixel, 1 ... 256; of the separable filter, taps of each of its two passes
    kind      "uniform", radius uniform up to 99.5 % of the energy of the longest channel; "importance", the law's own
              map; both shifted by white noise; "importance blue", the same map shifted by blue noise
    channels  "longest", all radii from the channel of the longest mfp; "mixture", sample i from channel i mod 3 (the
              longest first), weighted by the mean of the three densities
    area      a sample stands for the surface that it shows: it lies where its ray meets the plane of the pixel hit, and
              weighs 1 / |n.v|, at most 20. Off: it lies at the depth of that pixel, as in Liang et al., (22)
    seed      of the shifts
    """

    samples: int = 16
    kind: str = "importance blue"
    channels: str = "longest"
    area: bool = True
    seed: int = 0

    def __post_init__(self) -> None:
        checked_whole("samples", self.samples, 1, MOST_SAMPLES)
        checked_whole("seed", self.seed, 0, MOST_SEED)
        for name, accepted in (("kind", KINDS), ("channels", CHANNELS)):
            require(getattr(self, name) in accepted, name, f"one of {', '.join(accepted)}", getattr(self, name))
        require(isinstance(self.area, bool), "area", "True or False", self.area)


class Lattice(NamedTuple):
    """Lattice of generator a; cell (2, 2) its two edges, the short one first, as rows of (xi, angle / 2 pi)."""

    generator: int
    cell: Floats


@cache
def best(samples: int) -> Lattice:
    """Return the lattice of n points whose shortest difference is the longest."""
    candidates = [a for a in range(1, samples + 1) if gcd(a, samples) == 1]
    cells = [_cell(a, samples) for a in candidates]
    chosen = int(np.argmax([np.linalg.norm(cell[0]) for cell in cells]))
    return Lattice(candidates[chosen], cells[chosen])


def points(samples: int) -> Floats:
    """Return (n, 2) xi and angle / 2 pi, before the shift."""
    i = np.arange(samples)
    return np.stack([i * best(samples).generator % samples / samples, (i + 0.5) / samples], axis=-1)


def _cell(generator: int, samples: int) -> Floats:
    """Return the shortest difference of two points, and the shortest that makes a cell of area 1 / n with it."""
    i = np.arange(samples)
    differences = (np.stack([i * generator % samples, i], axis=-1) / samples + WRAPS).reshape(-1, 2)
    length = np.linalg.norm(differences, axis=1)
    order = np.argsort(length, kind="stable")[1:]  # the first is 0
    first = differences[order[0]]
    area = np.abs(first[0] * differences[order, 1] - first[1] * differences[order, 0])
    second = differences[order[np.argmax(np.abs(area * samples - 1.0) < 1e-6)]]
    return np.stack([first, second])


Place = tuple[int, int]
SIDE = 64
SIGMA = 1.5  # of the Gaussian that says how crowded a place is [pixels]; Ulichney's
STARTING_SHARE = 0.1  # of all pixels, in the pattern that is first made even


@cache
def shifts(side: int = SIDE, seed: int = 1) -> NDArray[np.float32]:
    """Return (side, side, 2) in (0, 1), two independent tiles whose every level is blue: shifts of xi and of angle."""
    tiles = [(ranks(side, seed + channel) + 0.5) / side**2 for channel in range(2)]
    return np.stack(tiles, axis=-1).astype(np.float32)


def ranks(side: int, seed: int) -> NDArray[np.int64]:
    """Return (side, side) every whole number in [0, side^2) once; those below any level are spread evenly. Periodic."""
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
    """Crowding of each place by the chosen ones, on a torus; a place chosen or dropped changes it at once."""

    def __init__(self, pattern: NDArray[np.bool_]):
        distance = np.minimum(np.arange(len(pattern)), len(pattern) - np.arange(len(pattern)))
        line = np.exp(-(distance**2) / (2.0 * SIGMA**2))
        self.kernel = np.outer(line, line)  # what a place at the origin adds to each place of the torus
        self.chosen = np.zeros_like(pattern)
        self.value = np.zeros(pattern.shape)
        for row, column in np.argwhere(pattern).tolist():
            self.turn((row, column))

    def turn(self, place: Place) -> Place:
        """Choose a place, or drop it."""
        sign = -1.0 if self.chosen[place] else 1.0
        self.value += sign * np.roll(self.kernel, place, (0, 1))
        self.chosen[place] = not self.chosen[place]
        return place

    def tightest(self) -> Place:
        """Return the chosen place that is most crowded."""
        return self._place(np.argmax(np.where(self.chosen, self.value, -np.inf)))

    def widest(self) -> Place:
        """Return the free place that is least crowded."""
        return self._place(np.argmin(np.where(self.chosen, np.inf, self.value)))

    def _place(self, index: np.intp) -> Place:
        row, column = np.unravel_index(index, self.value.shape)
        return int(row), int(column)


def _evened(side: int, rng: np.random.Generator) -> NDArray[np.bool_]:
    """Return a random pattern whose tightest cluster has gone to its widest void until that changes nothing."""
    pattern = np.zeros(side * side, bool)
    pattern[rng.choice(side * side, int(STARTING_SHARE * side**2), replace=False)] = True
    field = _Field(pattern.reshape(side, side))
    while True:
        cluster = field.turn(field.tightest())
        if field.turn(field.widest()) == cluster:
            return field.chosen
