"""Layers that fur needs, by the way to draw them and the angle to the normal, from rays on random patches.

A number that just serves some rays may fail with others: what is found holds for the mean over patches with its noise.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field

import numpy as np

from profilefit.errors import InputError
from profilefit.scenes.fur.scene import FurRequest
from profilefit.scenes.fur.truth import random_patch
from profilefit.scenes.fur.ways import MOST, WAYS, FurTrial, LayerTechnique, least_layers, trial

ANGLES = (0, 30, 45, 60, 75, 85)  # of the view to the normal [degrees]
WORST = 75  # the layers of a picture are those of this angle: what a ball shows beyond is a rim of 3 % of its radius
# Of a layer, over that of shells, by the strands that it tests: `python -m benchmarks.fur --only cost`, in software.
COST = {0: 1.0, 1: 1.5, 2: 2.0}

STRANDS, MOST_STRANDS = 500, 1 << 15  # of a patch, at least and at most
WIDER = 1.2  # than a ray's way over the skin: it comes by no strand twice
PATCHES, RAYS = 24, 1000  # at most, and rays on each
WORK = 1200  # patches times layers, at most
FEWEST, CLEAR = 5, 4.0  # patches, and standard errors from the tolerance, after which no more are looked at
SAFE, FINE = 2.0, 0.08  # standard errors by which the mean must be within it; a share of it that is not worth more rays
COARSE = 20  # numbers of layers are found to one in so many
LEAST_TOLERANCE = 0.01  # of less, too few of the rays are wrong to tell how many
SLENDEREST = 100.0  # L / r0: rays are followed in steps of r0


@dataclass(frozen=True)
class FurNeed:
    """The least layers by angle [degrees] and way's name: None where more than `most` are needed.

    tolerance  rms error of the heights of first hits over the length [-];  angle  that a picture's layers are of
    """

    layers: Mapping[int, Mapping[str, int | None]]
    tolerance: float
    angle: int = WORST
    most: int = MOST

    def cheapest(self, angle: int) -> LayerTechnique | None:
        """Return the way of the least layers times cost at an angle; None if no way is within the tolerance there."""
        return cheapest(self.layers[angle])

    @property
    def way(self) -> LayerTechnique | None:
        """The cheapest of a picture."""
        return self.cheapest(self.angle)

    @property
    def count(self) -> int | None:
        """Number of layers of that way."""
        return None if self.way is None else self.layers[self.angle][self.way.name]


def cheapest(layers: Mapping[str, int | None]) -> LayerTechnique | None:
    """Return the way whose layers, by its name, cost the least together; None if none has any."""
    costs = {way: count * COST[way.tested] for way in WAYS if (count := layers[way.name]) is not None}
    return min(costs, key=lambda way: costs[way], default=None)


@dataclass(frozen=True, eq=False)
class RandomFur:
    """Upright strands, seen at an angle to the normal [rad]: patches of them, made as they are asked for.

    density  of strands [1/length^2];  radius, length  of one
    """

    density: float
    radius: float
    length: float
    theta: float
    seed: int = 0
    _made: list[FurTrial] = field(init=False, default_factory=list)

    @property
    def side(self) -> float:
        """Side of a patch. Where it has its most strands a ray may come to its end, but hardly ever unseen."""
        way = WIDER * self.length * float(np.tan(self.theta))
        least, most = (float(np.sqrt(count / self.density)) for count in (STRANDS, MOST_STRANDS))
        return min(max(way, least), most)

    def trial(self, number: int) -> FurTrial:
        """Return rays on one of the patches."""
        while len(self._made) <= number:
            one = 1000 * self.seed + len(self._made)
            patch = random_patch(self.density, self.radius, self.length, self.side, one)
            self._made.append(trial(patch, self.theta, RAYS, one))
        return self._made[number]

    def largest(self, way: LayerTechnique, layers: int, goal: float) -> float:
        """Return an upper limit of the mean square of so many layers' errors, by as many patches as decide on a goal.

        Of all rays, with a chance of some 98 %.
        """
        squares: list[float] = []
        mean, noise = 0.0, np.inf
        for number in range(max(min(PATCHES, WORK // layers), FEWEST)):
            squares.append(self.trial(number).error(way, layers) ** 2)
            if len(squares) >= FEWEST:
                mean, noise = float(np.mean(squares)), float(np.std(squares, ddof=1)) / len(squares) ** 0.5
                if abs(mean - goal) > CLEAR * noise or SAFE * noise < FINE * goal:
                    break
        return mean + SAFE * noise

    def least_layers(self, way: LayerTechnique, tolerance: float) -> int | None:
        """Return the fewest layers that hold, to one in `COARSE`; None if no number up to `MOST` does."""
        goal = tolerance**2
        return least_layers(lambda layers: self.largest(way, layers, goal), goal, MOST, COARSE)


def fur_need(of: FurRequest, angles: Iterable[int] = ANGLES) -> FurNeed:
    """Return what a file's strands need, upright on a flat skin.

    angles  [degrees], in [0, 90), `WORST` among them

    Strands that lean by f along the view's way over the skin are as upright ones seen at the tangent |tan(theta) - f|.
    """
    strands, tolerance, rays = of.fur, of.technique.tolerance, "where layers are chosen by rays, got"
    if tolerance < LEAST_TOLERANCE:
        least = f"{of.file}: [technique] tolerance must be at least {LEAST_TOLERANCE:g}"
        raise InputError(f"{least} {rays} {tolerance:g}")
    if strands.length > (longest := SLENDEREST * strands.radius):
        most = f"{of.file}: [fur] length must be at most {SLENDEREST:g} times the radius, {longest:g} mm,"
        raise InputError(f"{most} {rays} {strands.length:g}")
    layers: dict[int, dict[str, int | None]] = {}
    for angle in angles:
        fur = RandomFur(strands.density, strands.radius, strands.length, float(np.radians(angle)), strands.seed)
        layers[angle] = {way.name: fur.least_layers(way, tolerance) for way in WAYS}
    return FurNeed(layers, tolerance)
