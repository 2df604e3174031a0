"""Error over time, both logarithmic, a chart a panel: every method with the spread of both, and the front.

Labels stand beside their points, where there is room: off each other, off points and bars, inside the axes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backend_bases import RendererBase
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.text import Annotation, Text
from matplotlib.transforms import Bbox

from profilefit.report.figures import canvas as pen
from profilefit.report.figures.canvas import canvas, plain_log, save, styled
from profilefit.studies.tradeoff.points import BEATEN, FRONT, TIED, Panel, Point, TradeoffPart, front, standings

SIZE, STEP = 7.5, 4.5  # of a label, and from a point to its nearest place [pt]
# Where a label may stand about its point, in such steps, the nearest places first.
RIGHT, UP = (0.0, 1.0, 3.0, 6.0, 10.0, 15.0, 21.0), (0.0, 1.5, 3.0, 5.0, 8.0, 11.0, 15.0)
PLACES = sorted(
    {(a * x, b * y) for x in RIGHT for y in UP for a in (1, -1) for b in (1, -1) if x or y},
    key=lambda place: (np.hypot(*place), -place[0], -place[1]),
)
DISTANCE = 0.02  # square pixels of overlap that a place may have rather than lie one square point farther away


def place_labels(axes: Axes, labels: Sequence[tuple[str, float, float]], occupied: Sequence[Bbox]) -> list[float]:
    """Write the labels; square pixels that each shares with others or has outside the axes, 0 where there was room.

    labels    texts, each with the point (x, y) in data coordinates that it belongs to
    occupied  boxes in pixels that should stay free, such as `box_of` of bars; the figure must be laid out already
    """
    renderer = renderer_of(axes)
    inside = axes.get_window_extent(renderer)
    occupied = [*occupied, *(box_of(axes, [(x, y)], SIZE / 2) for _, x, y in labels)]
    crowdings = []
    for text, x, y in labels:
        note = axes.annotate(
            text,
            (x, y),
            PLACES[0],
            textcoords="offset points",
            fontsize=SIZE,
            annotation_clip=False,
            zorder=5,
            bbox={"boxstyle": "square,pad=0.1", "facecolor": "white", "edgecolor": "none", "alpha": 0.75},
            arrowprops={"arrowstyle": "-", "color": "0.6", "lw": 0.6, "shrinkA": 0.0, "shrinkB": 2.0},
        )
        costs = []  # square pixels that a label would share with others, or have outside the axes
        for box in (_placed(note, place, renderer) for place in PLACES):
            shared = sum(_area(Bbox.intersection(box, other)) for other in occupied)
            costs.append(shared + 10.0 * (_area(box) - _area(Bbox.intersection(box, inside))))
        far = [DISTANCE * (STEP * np.hypot(*place)) ** 2 for place in PLACES]
        best = int(np.argmin(np.add(costs, far)))
        occupied.append(_placed(note, PLACES[best], renderer))
        crowdings.append(costs[best])
    return crowdings


def box_of(axes: Axes, points: Sequence[tuple[float, float]], around: float = 0.0) -> Bbox:
    """Return the box in pixels of places in data coordinates, `around` points wider on all sides."""
    places, figure = axes.transData.transform(np.asarray(points, float)), axes.figure
    margin = around * (figure.dpi if isinstance(figure, Figure) else figure.figure.dpi) / pen.POINTS
    (x0, y0), (x1, y1) = places.min(axis=0) - margin, places.max(axis=0) + margin
    return Bbox.from_extents(x0, y0, x1, y1)


def renderer_of(axes: Axes) -> RendererBase:
    """Return the renderer that measures text on this figure's canvas."""
    return axes.figure.canvas.get_renderer()  # type: ignore[attr-defined]


def _placed(note: Annotation, place: tuple[float, float], renderer: RendererBase) -> Bbox:
    x, y = place
    ha = "left" if x > 0 else "right" if x < 0 else "center"
    va = "bottom" if y > 0 else "top" if y < 0 else "center"
    note.set(position=(STEP * x, STEP * y), ha=ha, va=va)
    note.update_positions(renderer)
    return Text.get_window_extent(note, renderer).padded(2.0)  # an Annotation's own has its arrow, too


def _area(box: Bbox | None) -> float:
    return 0.0 if box is None else float(box.width * box.height)


HEIGHT = 4.3  # of one panel [inch]
FEET = 0.8  # for legend and caption [inch]
SMALL, CAPTION_WIDTH = 6.5, 150  # size [pt] and letters of a line
LINES = (pen.BLUE, pen.GREEN, pen.PURPLE, pen.ORANGE, pen.SKY)  # of methods with more than one effort
LEAST_DECADES = 1.3  # an axis shorter than that has ticks at 1, 2 and 5
MARKS: dict[str, dict[str, Any]] = {
    FRONT: {"marker": "s", "ms": 6.0, "zorder": 4},
    TIED: {"marker": "s", "ms": 5.0, "mfc": "white", "zorder": 3},
    BEATEN: {"marker": "o", "ms": 4.0, "zorder": 3},
}
MEANINGS = {
    FRONT: "front: none is better in one, and no worse in the other",
    TIED: "tied with a better one within the spread",
    BEATEN: "beaten in both by more than the spread",
}


@styled
def tradeoff_figure(part: TradeoffPart, caption: str, out: Path) -> list[Path]:
    """Draw a part's panels below each other; `caption` says which machine."""
    rows = len(part.panels)
    figure = canvas(HEIGHT * rows + FEET)
    figure.set_dpi(pen.DPI)  # labels are placed for the pixels that they are saved with
    all_axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for axes, panel in zip(all_axes, part.panels, strict=True):
        draw(axes, panel, colours_of(part.points))
    used = {standing for panel in part.panels for standing in standings(panel.points)}
    joined = any(panel.joined for panel in part.panels)
    handles = []
    for standing in (standing for standing in MARKS if standing in used):
        colour = pen.GREY if joined else _colour(standing)
        handle = Line2D([], [], color=colour, ls="none", label=MEANINGS[standing])
        handle.set(**{key: value for key, value in MARKS[standing].items() if key != "zorder"})
        if standing == FRONT:
            handle.set(color=pen.VERMILION, ls="-", lw=1.3, mfc=colour, mec=pen.VERMILION, mew=1.3)
        handles.append(handle)
    spread = "thin: up to the worst; thick: middle 68 % of repeats"
    handles.append(Line2D([], [], color=pen.GREY, marker="_", lw=0.7, label=spread))
    title = fill(caption, CAPTION_WIDTH)
    legend = figure.legend(handles=handles, loc="outside lower center", ncols=2, title=title, title_fontsize=SMALL)
    legend.get_title().set_color(pen.GREY)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes, panel in zip(all_axes, part.panels, strict=True):
        occupied = list(_occupied(axes, panel))
        first = {point.method: point for point in reversed(panel.points)}
        texts = [text_of(point, first[point.method] is point) for point in panel.points]
        place_labels(axes, list(zip(texts, *_xy(panel.points), strict=True)), occupied)
    return save(figure, out, f"tradeoff-{part.name}")


def draw(axes: Axes, panel: Panel, colours: dict[str, str]) -> None:
    """Draw a panel; `colours` of its methods, the same in all of a part's panels."""
    axes.set(xscale="log", yscale="log", xlabel=panel.cost, ylabel=panel.error)
    axes.set_title(panel.title)
    for method in colours_of(panel.points) if panel.joined else ():
        points = [point for point in panel.points if point.method == method]
        axes.plot(*_xy(points), color=colours[method], lw=0.9, alpha=0.6, zorder=1)
    for point, standing in zip(panel.points, standings(panel.points), strict=True):
        _mark(axes, point, standing, colours[point.method] if panel.joined else _colour(standing))
    best = [panel.points[i] for i in front(panel.points)]
    axes.plot(*_xy(best), drawstyle="steps-post", color=pen.VERMILION, lw=1.3, zorder=2)
    axes.margins(x=0.16, y=0.14)
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        if np.log10(high / low) < LEAST_DECADES:
            plain_log(axis)


def _mark(axes: Axes, point: Point, standing: str, colour: str) -> None:
    """Draw the point, its spread in both directions, and a thin line to the worst error."""
    x, y = point.cost, point.error
    style: dict[str, Any] = {"color": colour, **MARKS[standing]}
    if standing == FRONT:
        style |= {"mec": pen.VERMILION, "mew": 1.3}
    of_x, of_y = ([[one.value - one.low], [one.high - one.value]] for one in (x, y))
    axes.errorbar(x.value, y.value, of_y, of_x, elinewidth=1.6, capsize=2.0, ls="none", **style)
    if point.worst is not None:
        axes.plot([x.value] * 2, [y.value, point.worst.value], color=colour, lw=0.7, zorder=2)
        axes.plot(x.value, point.worst.value, "_", color=colour, ms=6.0, mew=0.9, zorder=2)


def text_of(point: Point, first: bool) -> str:
    """Return the method, and what distinguishes it from others of its line; of the later ones only that."""
    effort = re.sub(r"\b(\d)e(\d+)\b", lambda m: f"{'' if m[1] == '1' else m[1] + '·'}10$^{m[2]}$", point.label)
    method = point.method.replace("normalized diffusion, Xie", "Xie").replace("normalized diffusion", "norm. diffusion")
    return f"{method}: {effort}" if first and effort else effort or method


def _occupied(axes: Axes, panel: Panel) -> Iterator[Bbox]:
    """Yield the boxes of points' bars and along the line of the front, which no label should hide."""
    for point in panel.points:
        cost, error = point.cost, point.error
        top = error.high if point.worst is None else point.worst.value
        yield box_of(axes, [(cost.low, error.value), (cost.high, error.value)], 1.5)
        yield box_of(axes, [(cost.value, error.low), (cost.value, top)], 2.0)
    best = [panel.points[i] for i in front(panel.points)]
    for (x, y), (next_x, next_y) in pairwise(zip(*_xy(best), strict=True)):
        yield box_of(axes, [(x, y), (next_x, y)], 0.7)
        yield box_of(axes, [(next_x, y), (next_x, next_y)], 0.7)


def colours_of(points: Sequence[Point]) -> dict[str, str]:
    """Return a colour by method, the same in all panels of a part."""
    return {method: LINES[i % len(LINES)] for i, method in enumerate(dict.fromkeys(point.method for point in points))}


def _colour(standing: str) -> str:
    return pen.BLUE if standing == BEATEN else pen.VERMILION


def _xy(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    return [p.cost.value for p in points], [p.error.value for p in points]
