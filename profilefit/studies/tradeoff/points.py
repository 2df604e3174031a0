"""Cost and error of methods, each with its spread; and the front, the methods that no other beats."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import ArrayLike

SPREAD = 16.0, 84.0  # percentiles, one standard deviation of a normal spread on either side
FRONT, TIED, BEATEN = "front", "tied", "beaten"


@dataclass(frozen=True)
class WithSpread:
    """A number and the ends of its spread; all three equal where it is known without error."""

    value: float
    low: float
    high: float

    @classmethod
    def of(cls, values: ArrayLike) -> WithSpread:
        """Return median of repeats, and where the middle 68 % of them lie."""
        low, middle, high = np.percentile(np.asarray(values, float), [SPREAD[0], 50.0, SPREAD[1]])
        return cls(float(middle), float(low), float(high))

    @classmethod
    def exactly(cls, value: float) -> WithSpread:
        """Return a number that is known without error."""
        return cls(float(value), float(value), float(value))

    def is_below(self, other: WithSpread) -> bool:
        """Return whether it is below another by more than the spread of both."""
        return self.high < other.low


@dataclass(frozen=True)
class Point:
    """One method at one setting.

    panel   the chart it belongs to;  method, label  its line there, and what distinguishes it from others of that line
    cost    of one answer, in the panel's unit
    error   in the panel's unit, of the middle: mean or root mean square;  worst  the largest, None where there is one
            error only
    facts   what else is known, by column name
    """

    panel: str
    method: str
    label: str
    cost: WithSpread
    error: WithSpread
    worst: WithSpread | None = None
    facts: Mapping[str, float | int | str] = field(default_factory=dict)

    @property
    def errors(self) -> tuple[WithSpread, ...]:
        return (self.error,) if self.worst is None else (self.error, self.worst)


@dataclass(frozen=True)
class Panel:
    """Points that can be compared: a name for files, a title, and what the axes mean, with units in brackets."""

    name: str
    title: str
    cost: str
    error: str
    points: tuple[Point, ...]
    joined: bool = False
    """Whether points of one method are one line: the same method with more effort."""


@dataclass(frozen=True)
class TradeoffPart:
    """All that one part of the measurement found; `notes` say what was left out, and what is not in the times."""

    name: str
    title: str
    panels: tuple[Panel, ...]
    notes: tuple[str, ...]

    @property
    def points(self) -> tuple[Point, ...]:
        return tuple(point for panel in self.panels for point in panel.points)


def photons_text(number: int) -> str:
    """Return the number of photons as people write it, for example 1e5 photons."""
    return f"{number:.0e}".replace("e+0", "e") + " photons"


def standings(points: Sequence[Point]) -> list[str]:
    """Return where each point stands among those of one panel.

    beaten  another is better by more than the spread of both, in cost as well as in every error
    tied    another is so in one of them, and in the other not worse by more than the spread: nothing measured speaks
            for this point, but a quieter machine might
    front   none of this: nobody is known to be better in one without being worse in the other
    Ties are not transitive, so that points may tie each other in a ring and leave no front: then all of them are it.
    """
    places = [_standing(point, points) for point in points]
    return places if FRONT in places else [FRONT if one == TIED else one for one in places]


def front(points: Sequence[Point]) -> list[int]:
    """Return the points on the front, cheapest first."""
    best = [i for i, standing in enumerate(standings(points)) if standing == FRONT]
    return sorted(best, key=lambda i: (points[i].cost.value, points[i].error.value))


def _standing(point: Point, among: Sequence[Point]) -> str:
    rivals = [other for other in among if other is not point]
    cheaper = [other.cost.is_below(point.cost) for other in rivals]
    nearer = [all(a.is_below(b) for a, b in zip(other.errors, point.errors, strict=False)) for other in rivals]
    if any(c and n for c, n in zip(cheaper, nearer, strict=True)):
        return BEATEN
    for other, c, n in zip(rivals, cheaper, nearer, strict=True):
        farther = any(b.is_below(a) for a, b in zip(other.errors, point.errors, strict=False))
        if (c and not farther) or (n and not point.cost.is_below(other.cost)):
            return TIED
    return FRONT
