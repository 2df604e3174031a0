"""Figures of the sea: the scene by each kind beside its truth, and error over time."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from matplotlib import image

from benchmarks.render_figure import save
from profilefit.report.figures.canvas import BLUE, GREEN, VERMILION, canvas, plain_log, styled
from profilefit.scenes.sea.haze import BROADENED, KINDS, SCALED, SINGLE
from profilefit.scenes.sea.scene import SeaRender
from profilefit.scenes.stage.judge import to_srgb
from profilefit.studies.tradeoff.points import Panel

COLOURS = {BROADENED: BLUE, SCALED: GREEN, SINGLE: VERMILION}
LARGER = 3  # pixels of the figure that one of the picture has, along a side


def picture(found: SeaRender, path: Path) -> None:
    """Draw the truth, and the scene by each kind, two beside two."""
    judge, samples = found.judge, found.request.sampling.samples
    truth, *ways = (
        np.kron(to_srgb(one[::-1], judge.exposure), np.ones((LARGER, LARGER, 1), np.uint8))
        for one in (judge.reference, *(found.picture(kind, samples) for kind in KINDS))
    )
    top, bottom = (np.concatenate(row, axis=1) for row in ((truth, ways[0]), (ways[1], ways[2])))
    image.imsave(path, np.concatenate([top, bottom]))


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
