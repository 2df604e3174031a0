"""Direct labels beside points of a chart, where there is room: off each other, off points and bars, inside the axes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

STEP = 4.5  # from a point to the nearest place of its label [pt]
# Where a label may stand about its point, in such steps, the nearest places first.
RIGHT, UP = (0.0, 1.0, 3.0, 6.0, 10.0, 15.0, 21.0), (0.0, 1.5, 3.0, 5.0, 8.0, 11.0, 15.0)
PLACES = sorted(
    {(a * x, b * y) for x in RIGHT for y in UP for a in (1, -1) for b in (1, -1) if x or y},
    key=lambda place: (np.hypot(*place), -place[0], -place[1]),
)
DISTANCE = 0.02  # square pixels of overlap that a place may have rather than lie one square point farther away


@dataclass(frozen=True)
class Label:
    """A text, and the point (x, y) in data coordinates that it belongs to."""

    text: str
    x: float
    y: float


def place_labels(axes: Axes, labels: Sequence[Label], taken: Sequence[Bbox], size: float = 7.5) -> list[float]:
    """Write the labels; square pixels that each shares with others or has outside the axes, 0 where there was room.

    taken  boxes in pixels that should stay free, such as `box_of` of bars; the figure must be laid out already
    """
    renderer = renderer_of(axes)
    inside = axes.get_window_extent(renderer)
    occupied = [*taken, *(box_of(axes, [(one.x, one.y)], size / 2) for one in labels)]
    crowdings = []
    for one in labels:
        note = _note(axes, one, size)
        boxes = [_placed(note, place, renderer) for place in PLACES]
        costs = [_crowding(box, occupied, inside) for box in boxes]
        far = [DISTANCE * (STEP * np.hypot(*place)) ** 2 for place in PLACES]
        best = int(np.argmin(np.add(costs, far)))
        occupied.append(_placed(note, PLACES[best], renderer))
        crowdings.append(costs[best])
    return crowdings


def box_of(axes: Axes, points: Sequence[tuple[float, float]], around: float = 0.0) -> Bbox:
    """The box in pixels of points in data coordinates, so many points wider on all sides."""
    places = axes.transData.transform(np.asarray(points, float))
    margin = around * _pixels(axes)
    (x0, y0), (x1, y1) = places.min(axis=0) - margin, places.max(axis=0) + margin
    return Bbox.from_extents(x0, y0, x1, y1)


def renderer_of(axes: Axes) -> RendererBase:
    """What measures text on this figure's canvas."""
    return axes.figure.canvas.get_renderer()  # type: ignore[attr-defined]


def _pixels(axes: Axes) -> float:
    """Pixels of a point, 1/72 inch."""
    figure = axes.figure
    return (figure.dpi if isinstance(figure, Figure) else figure.figure.dpi) / 72.0


def _note(axes: Axes, label: Label, size: float) -> Annotation:
    return axes.annotate(
        label.text,
        (label.x, label.y),
        PLACES[0],
        textcoords="offset points",
        fontsize=size,
        annotation_clip=False,
        zorder=5,
        bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
        arrowprops={"arrowstyle": "-", "color": "0.6", "lw": 0.6, "shrinkA": 0.0, "shrinkB": 2.0},
    )


def _placed(note: Annotation, place: tuple[float, float], renderer: RendererBase) -> Bbox:
    x, y = place
    note.set(position=(STEP * x, STEP * y))
    note.set(
        ha="left" if x > 0 else "right" if x < 0 else "center", va="bottom" if y > 0 else "top" if y < 0 else "center"
    )
    note.update_positions(renderer)
    return Text.get_window_extent(note, renderer).padded(2.0)  # an Annotation's own has its arrow, too


def _crowding(box: Bbox, taken: Sequence[Bbox], inside: Bbox) -> float:
    """Square pixels that a label would share with others, or have outside the axes."""
    shared = sum(_area(Bbox.intersection(box, other)) for other in taken)
    return shared + 10.0 * (_area(box) - _area(Bbox.intersection(box, inside)))


def _area(box: Bbox | None) -> float:
    return 0.0 if box is None else float(box.width * box.height)
