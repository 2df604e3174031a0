"""Figure of the sea: error over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from benchmarks.render_figure import save
from profilefit.report.figures.canvas import BLUE, GREEN, VERMILION, canvas, plain_log, styled
from profilefit.scenes.sea.haze import BROADENED, KINDS, SCALED, SINGLE
from profilefit.studies.tradeoff.points import Panel

COLOURS = {BROADENED: BLUE, SCALED: GREEN, SINGLE: VERMILION}


@styled
def cost_figure(view: Panel, device: str, path: Path) -> None:
    """Draw each kind over the time of its view, bars over the middle of the turns, samples beside the points."""
    figure = canvas(3.1, 5.0)
    ax = figure.subplots()
    for kind in KINDS:
        points = [one for one in view.points if one.method == kind]
        time, low, high = (np.array([getattr(one.cost, at) for one in points]) for at in ("value", "low", "high"))
        error = [one.error.value for one in points]
        style = {"color": COLOURS[kind], "marker": "o", "markersize": 4.0, "capsize": 2, "elinewidth": 0.8}
        ax.errorbar(time, error, xerr=(time - low, high - time), label=kind, **style)
        for one, x, y in zip(points, time, error, strict=True):
            ax.annotate(one.label, (x, y), (0, 4), textcoords="offset points", fontsize=7.0)
    ax.set(xscale="log", yscale="log", xlabel="ms of the view", ylabel="root mean square error / mean [-]")
    plain_log(ax.xaxis)
    plain_log(ax.yaxis)
    ax.legend()
    figure.suptitle(f"The sea by each kind, samples beside points, on {device.partition(' (')[0]}", fontsize=9.0)
    save(figure, path, 64)
