"""Error over time, a point a law, and the front: the laws that no other beats in both."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

import numpy as np
from matplotlib import pyplot
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox
from numpy.typing import NDArray

COLOUR, FRONT = "#0072B2", "#D55E00"
DOTS, PIXELS = 150, 10.0  # of an inch; between a point and its label
# Where a label may stand about its point, in such steps, the nearest places first.
RIGHT, UP = (0.0, 1.0, 3.0, 6.0, 10.0, 15.0), (0.0, 1.5, 3.0, 5.0, 8.0, 11.0)
PLACES = sorted(
    {(a * x, b * y) for x in RIGHT for y in UP for a in (1, -1) for b in (1, -1) if x or y},
    key=lambda place: (np.hypot(*place), -place[0], -place[1]),
)


@dataclass(frozen=True)
class Point:
    """A law: its time over the yardstick's, and its mean and worst error."""

    label: str
    cost: float
    mean: float
    worst: float


def front(costs: Sequence[float], errors: Sequence[float]) -> list[int]:
    """The points that no other beats, cheapest first: none costs as little or less and errs as little or less.

    Of points that are equal in both the first counts.
    """
    least = np.inf
    found = []
    for i in sorted(range(len(costs)), key=lambda i: (costs[i], errors[i])):
        if errors[i] < least:
            least = errors[i]
            found.append(i)
    return found


def draw(panels: Mapping[str, Sequence[Point]], path: Path) -> None:
    """One panel beside the other; `path` ends in .png or .svg."""
    figure, all_axes = pyplot.subplots(
        1, len(panels), figsize=(6.2 * len(panels), 5.8), sharey=True, squeeze=False, dpi=DOTS
    )
    for axes, (title, points) in zip(all_axes[0], panels.items(), strict=True):
        _panel(axes, title, points)
    all_axes[0, 0].set_ylabel("relative error of $R_d$: mean (point) and worst (bar) over the albedos")
    figure.tight_layout()
    for axes, points in zip(all_axes[0], panels.values(), strict=True):
        _label(axes, points)
    figure.savefig(path)  # at the resolution that its labels were placed for
    pyplot.close(figure)


def _panel(axes: Axes, title: str, points: Sequence[Point]) -> None:
    costs, means, worsts = (np.array([getattr(p, name) for p in points]) for name in ("cost", "mean", "worst"))
    best = front(list(costs), list(worsts))
    style = {"color": FRONT, "lw": 1.5, "zorder": 1, "label": "front, by the worst error"}
    axes.plot(costs[best], worsts[best], drawstyle="steps-post", **style)
    axes.errorbar(
        costs, means, (np.zeros_like(means), worsts - means), fmt="o", color=COLOUR, ms=5, capsize=3, lw=1.2, zorder=2
    )
    axes.plot(costs[best], means[best], "s", color=FRONT, ms=7, zorder=3)
    axes.set_xscale("log")
    axes.set_yscale("log")
    axes.margins(x=0.25, y=0.12)
    axes.grid(alpha=0.25)
    axes.set_title(title, fontsize=11)
    axes.set_xlabel("time over normalized diffusion's")
    axes.legend(frameon=False, loc="lower right", fontsize=9)


def _label(axes: Axes, points: Sequence[Point]) -> None:
    """Labels beside their points, inside the axes, and not over each other, a point or a bar, where there is room."""
    renderer = axes.figure.canvas.get_renderer()  # type: ignore[attr-defined]
    inside = axes.get_window_extent(renderer)
    taken = [_bar(axes, point) for point in points] + _steps(axes, points)
    taken.append(axes.get_legend().get_window_extent(renderer))
    for point in points:
        note = axes.annotate(
            point.label,
            (point.cost, point.mean),
            PLACES[0],
            textcoords="offset pixels",
            fontsize=8,
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.8},
            arrowprops={"arrowstyle": "-", "color": "0.6", "lw": 0.6},
        )
        boxes = [_placed(note, place, renderer) for place in PLACES]
        best = int(np.argmin([_crowding(box, taken, inside) for box in boxes]))
        taken.append(_placed(note, PLACES[best], renderer))


def _bar(axes: Axes, point: Point) -> Bbox:
    ends: NDArray[np.float64] = axes.transData.transform([(point.cost, point.mean), (point.cost, point.worst)])
    (x, low), (_, high) = ends
    return Bbox.from_extents(x, low, x, high).padded(PIXELS / 2)


def _steps(axes: Axes, points: Sequence[Point]) -> list[Bbox]:
    """The front's line, as boxes."""
    best = [points[i] for i in front([p.cost for p in points], [p.worst for p in points])]
    corners = axes.transData.transform([(p.cost, p.worst) for p in best])
    found = []
    for (x, y), (next_x, next_y) in pairwise(corners):
        found.append(Bbox.from_extents(x, y - 1, next_x, y + 1))
        found.append(Bbox.from_extents(next_x - 1, next_y, next_x + 1, y))
    return found


def _placed(note: Annotation, place: tuple[float, float], renderer: RendererBase) -> Bbox:
    x, y = place
    note.set(position=(PIXELS * x, PIXELS * y))
    note.set(
        ha="left" if x > 0 else "right" if x < 0 else "center", va="bottom" if y > 0 else "top" if y < 0 else "center"
    )
    note.update_positions(renderer)
    return Text.get_window_extent(note, renderer).padded(3.0)  # an Annotation's own has its arrow, too


def _crowding(box: Bbox, taken: Sequence[Bbox], inside: Bbox) -> float:
    """Square pixels that a label would share with others, or have outside the axes."""
    shared = sum(_area(Bbox.intersection(box, other)) for other in taken)
    return shared + 10.0 * (_area(box) - _area(Bbox.intersection(box, inside)))


def _area(box: Bbox | None) -> float:
    return 0.0 if box is None else float(box.width * box.height)
