"""Figures of the heart: error over time at each size, error over texel and view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from benchmarks.render_figure import save
from profilefit.report.figures.canvas import BLUE, GREEN, GREY, VERMILION, canvas, plain_log, styled
from profilefit.scenes.stage.judge import ChartPoint

COLOURS = {"split": BLUE, "texture": VERMILION, "screen": GREEN, "none": GREY}


@styled
def cost_figure(of_size: Mapping[tuple[int, int], Mapping[str, Sequence[ChartPoint]]], device: str, path: Path) -> None:
    """Draw a panel per size: each way with its samples, bars from the least time to the most; the front in grey."""
    figure = canvas(3.1, 2.6 * len(of_size))
    panels = figure.subplots(1, len(of_size), sharey=True, squeeze=False)[0]
    for ax, (size, ways) in zip(panels, of_size.items(), strict=True):
        every = sorted((min(one.milliseconds), one.rmse) for some in ways.values() for one in some)
        best = [point for number, point in enumerate(every) if all(point[1] < other[1] for other in every[:number])]
        ax.plot(*zip(*best, strict=True), color="#CCCCCC", linewidth=4.0, zorder=0)
        for kind, points in ways.items():
            least, most = (np.array([of(one.milliseconds) for one in points]) for of in (min, max))
            error = [one.rmse for one in points]
            style = {"color": COLOURS[kind], "marker": "o", "markersize": 4.0, "capsize": 2, "elinewidth": 0.8}
            ax.errorbar(least, error, xerr=(0.0 * least, most - least), label=kind, **style)
            for one, x in zip(points, least, strict=True):
                if len(points) > 1:
                    ax.annotate(str(one.samples), (x, one.rmse), (0, 4), textcoords="offset points", fontsize=7.0)
        ax.set(xscale="log", yscale="log", title=f"{size[0]} x {size[1]}", xlabel="ms of its passes")
        plain_log(ax.xaxis)
        plain_log(ax.yaxis)
    panels[0].set_ylabel("root mean square error / mean [-]")
    panels[0].legend(loc="lower left")
    figure.suptitle(f"A heart by each way, samples beside points, on {device}", fontsize=9.0)
    save(figure, path, 64)


@styled
def map_figure(errors: Mapping[str, np.ndarray], texels: Sequence[float], views: Sequence[float], path: Path) -> None:
    """Draw errors of each way over texel and view, the least of a cell in bold."""
    figure = canvas(2.8, 3.2 * len(errors))
    least = np.min(np.stack(list(errors.values())), axis=0)
    top = max(float(one.max()) for one in errors.values())
    panels = figure.subplots(1, len(errors), sharey=True, squeeze=False)[0]
    for ax, (kind, found) in zip(panels, errors.items(), strict=True):
        ax.grid(False)
        shown = ax.imshow(found, cmap="viridis_r", vmin=0.0, vmax=top, aspect="auto", origin="lower")
        for row in range(len(texels)):
            for column in range(len(views)):
                value = found[row, column]
                weight = "bold" if value <= least[row, column] else "normal"
                colour = "white" if value > 0.5 * top else "black"
                ax.text(
                    column, row, f"{value:.3f}", ha="center", va="center", color=colour, fontweight=weight, fontsize=8
                )
        ax.set_xticks(range(len(views)), [f"{one:g}" for one in views])
        ax.set_yticks(range(len(texels)), [f"{one:g}" for one in texels])
        ax.set(title=kind, xlabel="view from the front [degrees]")
    panels[0].set_ylabel("texel [mm]")
    figure.colorbar(shown, ax=panels.tolist(), label="root mean square error / mean [-]")
    save(figure, path, 128)
