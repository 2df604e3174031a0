"""Error over time, both logarithmic, a chart a panel: every method with the spread of both, and the front."""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from textwrap import fill
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.transforms import Bbox

from profilefit.report.figures.canvas import (
    BLUE,
    DPI,
    GREEN,
    GREY,
    ORANGE,
    PURPLE,
    SKY,
    VERMILION,
    canvas,
    plain_log,
    save,
    styled,
)
from profilefit.report.figures.labels import Label, box_of, place_labels
from profilefit.studies.tradeoff.points import BEATEN, FRONT, TIED, Measured, Panel, Part, Point, front, standings

HEIGHT = 4.3  # of one panel [inch]
FEET = 0.8  # for legend and caption [inch]
SMALL, CAPTION_WIDTH = 6.5, 150  # size [pt] and letters of a line
LINES = (BLUE, GREEN, PURPLE, ORANGE, SKY)  # of methods with more than one effort
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
def tradeoff_figure(part: Part, caption: str, out: Path) -> list[Path]:
    """Draw a part's panels below each other; `caption` says which machine."""
    rows = len(part.panels)
    figure = canvas(HEIGHT * rows + FEET)
    figure.set_dpi(DPI)  # labels are placed for the pixels that they are saved with
    all_axes = figure.subplots(rows, 1, squeeze=False)[:, 0]
    for axes, panel in zip(all_axes, part.panels, strict=True):
        _draw(axes, panel)
    _feet(figure, part, caption)
    figure.draw_without_rendering()
    figure.set_layout_engine("none")
    for axes, panel in zip(all_axes, part.panels, strict=True):
        _label(axes, panel)
    return save(figure, out, f"tradeoff-{part.name}")


def _draw(axes: Axes, panel: Panel) -> None:
    axes.set(xscale="log", yscale="log", xlabel=panel.cost, ylabel=panel.error)
    axes.set_title(panel.title)
    colours = _colours(panel)
    for points in _lines(panel):
        axes.plot(*_xy(points), color=colours[points[0].method], lw=0.9, alpha=0.6, zorder=1)
    for point, standing in zip(panel.points, standings(panel.points), strict=True):
        _mark(axes, point, standing, colours[point.method] if panel.joined else _colour(standing))
    best = [panel.points[i] for i in front(panel.points)]
    axes.plot(*_xy(best), drawstyle="steps-post", color=VERMILION, lw=1.3, zorder=2)
    axes.margins(x=0.16, y=0.14)
    for axis, (low, high) in ((axes.xaxis, axes.get_xlim()), (axes.yaxis, axes.get_ylim())):
        if np.log10(high / low) < LEAST_DECADES:
            plain_log(axis)


def _mark(axes: Axes, point: Point, standing: str, colour: str) -> None:
    """The point, its spread in both directions, and a thin line to the worst error."""
    x, y = point.cost, point.error
    style: dict[str, Any] = {"color": colour, **MARKS[standing]}
    if standing == FRONT:
        style |= {"mec": VERMILION, "mew": 1.3}
    axes.errorbar(x.value, y.value, _spread(y), _spread(x), elinewidth=1.6, capsize=2.0, ls="none", **style)
    if point.worst is not None:
        axes.plot([x.value] * 2, [y.value, point.worst.value], color=colour, lw=0.7, zorder=2)
        axes.plot(x.value, point.worst.value, "_", color=colour, ms=6.0, mew=0.9, zorder=2)


def _spread(measured: Measured) -> list[list[float]]:
    return [[measured.value - measured.low], [measured.high - measured.value]]


def _label(axes: Axes, panel: Panel) -> None:
    taken = [box for point in panel.points for box in _boxes(axes, point)] + list(_steps(axes, panel))
    named: set[str] = set()
    labels = []
    for point in panel.points:
        labels.append(Label(_text(point, point.method not in named), point.cost.value, point.error.value))
        named.add(point.method)
    place_labels(axes, labels, taken)


def _text(point: Point, first: bool) -> str:
    """The method, and what tells it from others of its line; of the later ones only that."""
    effort = re.sub(r"\b(\d)e(\d+)\b", lambda m: _power(m[1], m[2]), point.label)
    method = point.method.replace("normalized diffusion, Xie", "Xie").replace("normalized diffusion", "norm. diffusion")
    return f"{method}: {effort}" if first and effort else effort or method


def _power(digit: str, exponent: str) -> str:
    return f"10$^{exponent}$" if digit == "1" else f"{digit}·10$^{exponent}$"


def _boxes(axes: Axes, point: Point) -> list[Bbox]:
    """Of the bars: no label should hide them."""
    x, y = point.cost, point.error
    top = y.high if point.worst is None else point.worst.value
    return [
        box_of(axes, [(x.low, y.value), (x.high, y.value)], 1.5),
        box_of(axes, [(x.value, y.low), (x.value, top)], 2.0),
    ]


def _steps(axes: Axes, panel: Panel) -> Iterator[Bbox]:
    """The front's line."""
    best = [panel.points[i] for i in front(panel.points)]
    for one, other in pairwise(best):
        (x, y), (next_x, next_y) = (one.cost.value, one.error.value), (other.cost.value, other.error.value)
        yield box_of(axes, [(x, y), (next_x, y)], 0.7)
        yield box_of(axes, [(next_x, y), (next_x, next_y)], 0.7)


def _feet(figure: Figure, part: Part, caption: str) -> None:
    """What the marks mean, and on which machine."""
    used = {standing for panel in part.panels for standing in standings(panel.points)}
    joined = any(panel.joined for panel in part.panels)
    handles = [_handle(standing, GREY if joined else _colour(standing)) for standing in MARKS if standing in used]
    spread = "thin: up to the worst; thick: middle 68 % of repeats"
    handles.append(Line2D([], [], color=GREY, marker="_", lw=0.7, label=spread))
    title = fill(caption, CAPTION_WIDTH)
    legend = figure.legend(handles=handles, loc="outside lower center", ncols=2, title=title, title_fontsize=SMALL)
    legend.get_title().set_color(GREY)


def _handle(standing: str, colour: str) -> Line2D:
    handle = Line2D([], [], color=colour, ls="none", label=MEANINGS[standing])
    handle.set(**{key: value for key, value in MARKS[standing].items() if key != "zorder"})
    if standing == FRONT:
        handle.set(color=VERMILION, ls="-", lw=1.3, mfc=colour, mec=VERMILION, mew=1.3)
    return handle


def _lines(panel: Panel) -> list[list[Point]]:
    if not panel.joined:
        return []
    return [[p for p in panel.points if p.method == method] for method in _methods(panel)]


def _methods(panel: Panel) -> list[str]:
    return list(dict.fromkeys(point.method for point in panel.points))


def _colours(panel: Panel) -> dict[str, str]:
    return {method: LINES[i % len(LINES)] for i, method in enumerate(_methods(panel))}


def _colour(standing: str) -> str:
    return BLUE if standing == BEATEN else VERMILION


def _xy(points: Sequence[Point]) -> tuple[list[float], list[float]]:
    return [p.cost.value for p in points], [p.error.value for p in points]
