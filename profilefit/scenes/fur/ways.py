"""Techniques of fur in layers, and their errors toward rays of one angle: the least layers to an error."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from functools import lru_cache
from typing import NamedTuple

import numpy as np

from mcml_sim.media.arrays import Floats, is_number, require
from profilefit.scenes.fur.law import LEAST_X, MOST_X, best_exponent
from profilefit.scenes.fur.truth import Patch, by_shells, by_slabs, cast, rays

MOST = 256  # layers of a picture
LEAST_SHARE = 1e-3  # of a goal, that an error of 0 is taken for


class LayerTechnique(NamedTuple):
    """Technique by shells of a threshold's exponent, or by swept slabs that test some of the nearest strands each.

    exponent  of shells; None is the one that is fitted to N r0 / L;  tested  0 of shells
    walked    in even steps along a ray, as many as layers where its way over the skin is a strand's length
    """

    name: str
    exponent: float | None = None
    tested: int = 0
    walked: bool = False

    def exponent_of(self, layers: int, slender: float) -> float:
        """Return p of N shells, L / r0 of the strands; below the fitted range that of its end, above it 1."""
        if self.exponent is not None:
            return self.exponent
        x = layers / slender
        return 1.0 if x > MOST_X else float(best_exponent(max(x, LEAST_X)))


LINEAR, QUADRATIC, FITTED = LayerTechnique("linear", 1.0), LayerTechnique("quadratic", 2.0), LayerTechnique("fitted")
SWEPT, SWEPT_TWO = LayerTechnique("swept", tested=1), LayerTechnique("swept, two strands", tested=2)
WAYS = (LINEAR, QUADRATIC, FITTED, SWEPT, SWEPT_TWO)
WALKED = LayerTechnique("walked", tested=2, walked=True)
OF_PICTURES = (*WAYS, WALKED)  # toward one angle, steps are layers of another number


@dataclass(frozen=True, eq=False)
class FurTrial:
    """Rays at one angle to the normal, start (n, 2) where they pass the tips, and the heights of their first hits."""

    patch: Patch
    theta: float
    start: Floats
    true: Floats = field(init=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "true", cast(self.patch, self.theta, self.start))

    @lru_cache  # noqa: B019, a trial lives as long as what it is asked for
    def error(self, way: LayerTechnique, layers: int) -> float:
        """Return the root mean square of the errors of first hits' heights over the length, by so many layers [-]."""
        patch = self.patch
        if way.walked:
            layers = max(int(np.ceil(layers * np.hypot(np.tan(self.theta) - patch.lean[0], patch.lean[1]))), 1)
        if way.tested:
            heights = by_slabs(patch, self.theta, self.start, layers, min(way.tested, len(patch.feet)))
        else:
            exponent = way.exponent_of(layers, patch.length / patch.radius)
            heights = by_shells(patch, self.theta, self.start, layers, exponent)
        return float(np.sqrt(np.mean((heights - self.true) ** 2)) / patch.length)


def trial(patch: Patch, theta: float, count: int, seed: int = 0) -> FurTrial:
    """Return so many rays, anywhere on the patch."""
    return FurTrial(patch, theta, rays(patch, count, seed))


def error_of(trials: Sequence[FurTrial], way: LayerTechnique, layers: int) -> float:
    """Return the root mean square over trials of as many rays each [-]."""
    return float(np.sqrt(np.mean([one.error(way, layers) ** 2 for one in trials])))


def least_layers(error: Callable[[int], float], goal: float, most: int = MOST, coarse: int = MOST + 1) -> int | None:
    """Return the fewest layers whose error is within a goal, to one in `coarse`; None if no number up to `most` is.

    By doubling, and then where a power of N through both ends has it: where an error rises again with N, as that of
    quadratic shells does, the first place. InputError on a goal that is not > 0.
    """
    require(is_number(goal) and goal > 0, "goal", "a number > 0", goal)
    low, high = 0, 1
    before, after = np.inf, error(high)
    while after > goal:
        if high >= most:
            return None
        low, high, before = high, min(2 * high, most), after
        after = error(high)
    while high - low > (step := 1 + high // coarse):
        share = np.log(before / goal) / np.log(before / max(after, LEAST_SHARE * goal))
        middle = min(max(int(np.ceil(low * (high / low) ** share)), low + step), high - step)
        found = error(middle)
        low, high, before, after = (low, middle, before, found) if found <= goal else (middle, high, found, after)
    return high
