"""Error of every law over samples and over time, against the exact answer, at one view."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from matplotlib.axes import Axes
from numpy.typing import NDArray

from benchmarks.render_figure import save
from benchmarks.render_laws import Contender
from benchmarks.render_view import Judged
from benchmarks.table import show
from profilefit.report.figures.canvas import canvas, legend_below, plain_log, styled

Floats = NDArray[np.float64]
COLOURS = 64  # of the chart
MEASURES = {"rmse": "RMSE / mean radiance [-]", "flip": "FLIP [-]"}


@dataclass(frozen=True)
class Measured:
    """Errors of one contender: samples (n,); rmse and flip (n, seeds) [-]; milliseconds of scattering (n, turns)."""

    samples: tuple[int, ...]
    rmse: Floats
    flip: Floats
    milliseconds: Floats

    def error(self, measure: str) -> tuple[Floats, Floats]:
        """Return the mean over the seeds and its standard error, both (n,); one seed has none, and the error is 0."""
        values = getattr(self, measure)
        seeds = values.shape[1]
        spread = values.std(axis=1, ddof=1) / np.sqrt(seeds) if seeds > 1 else np.zeros(len(values))
        return values.mean(axis=1), spread

    @property
    def time(self) -> Floats:
        """Least of the turns (n,) [ms]: what else the machine does only adds."""
        return self.milliseconds.min(axis=1)


def measured(
    judge: Judged, works: Mapping[str, Contender], samples: Sequence[int], seeds: int, turns: int
) -> dict[str, Measured]:
    """Measure errors seed by seed, then times in turns: what else the machine does hits all of them.

    The separable filter draws nothing: all its seeds would be the same picture, so it has one.
    """
    errors = {key: _errors(judge, one, samples, 1 if one.is_filter else seeds) for key, one in works.items()}
    times = {key: np.empty((len(samples), turns)) for key in works}
    for turn in range(turns):
        for row, number in enumerate(samples):
            for key, one in works.items():
                times[key][row, turn] = judge.stage.time(one.law, judge.mfp, one.drawn(number), repeats=1)[0]
    return {key: Measured(tuple(samples), *errors[key], times[key]) for key in works}


def _errors(judge: Judged, one: Contender, samples: Sequence[int], seeds: int) -> tuple[Floats, Floats]:
    """Return errors, (samples, seeds) each."""
    found = np.empty((2, len(samples), seeds))
    for row, number in enumerate(samples):
        for seed in range(seeds):
            exitance = judge.stage.scatter(one.law, judge.mfp, one.drawn(number, seed))
            found[:, row, seed] = judge.rmse(exitance), judge.flip(exitance)
    return found[0], found[1]


def report(title: str, works: Mapping[str, Contender], found: Mapping[str, Measured], over: str) -> None:
    """Print errors with their standard errors, and times with their ratios to `over` in the same turns."""
    samples = found[over].samples
    columns = ("law", *(str(n) for n in samples))
    for measure, what in MEASURES.items():
        rows = [(_name(key, works), *_cells(*one.error(measure))) for key, one in found.items()]
        show(f"{title}: {what} at samples", columns, rows)
    rows = [(_name(key, works), *_time_cells(one, found[over])) for key, one in found.items()]
    show(f"{title}: least ms of the scatter pass, and (median over {_name(over, works)})", columns, rows)


def _name(key: str, works: Mapping[str, Contender]) -> str:
    return key if "," in key else works[key].label


def _cells(mean: Floats, spread: Floats) -> list[str]:
    return [f"{m:.4f}" + (f" ±{s:.4f}" if s > 0 else "") for m, s in zip(mean, spread, strict=True)]


def _time_cells(one: Measured, yardstick: Measured) -> list[str]:
    ratio = np.median(one.milliseconds / yardstick.milliseconds, axis=1)
    return [f"{t:.1f} ({r:.2f})" for t, r in zip(one.time, ratio, strict=True)]


@styled
def draw(works: Mapping[str, Contender], found: Mapping[str, Measured], path: Path, device: str) -> None:
    """Draw both measures over samples and over ms; `path` ends in .png."""
    figure = canvas(8.0)
    axes = figure.subplots(len(MEASURES), 2, sharex="col", sharey="row")
    samples = next(iter(found.values())).samples
    for row, (measure, what) in zip(axes, MEASURES.items(), strict=True):
        for depth, (key, one) in enumerate(reversed(found.items())):
            for ax, x in zip(row, (np.array(samples, float), one.time), strict=True):
                _line(ax, x, *one.error(measure), works[key], 2.0 + 0.1 * depth)
        row[0].set_ylabel(what)
    for ax in axes.ravel():
        ax.set(xscale="log", yscale="log")
        plain_log(ax.yaxis)
    axes[-1, 0].set_xlabel("samples of a pixel (taps, for separable) [-]")
    axes[-1, 0].set_xticks(samples, [str(n) for n in samples])
    axes[-1, 0].minorticks_off()
    axes[-1, 1].set_xlabel(f"scatter pass on {device} [ms]")
    plain_log(axes[-1, 1].xaxis)
    legend_below(figure, list(axes.ravel()))
    save(figure, path, COLOURS)


def _line(ax: Axes, x: Floats, mean: Floats, spread: Floats, one: Contender, depth: float) -> None:
    style = {"color": one.colour, "marker": one.marker, "linestyle": one.dashes, "markersize": one.size}
    ax.errorbar(
        x, mean, spread, label=one.label, capsize=2, elinewidth=0.8, markerfacecolor=one.face, zorder=depth, **style
    )


def as_json(found: Mapping[str, Measured]) -> dict[str, dict[str, list]]:
    names = ("samples", "rmse", "flip", "milliseconds")
    return {key: {name: np.asarray(getattr(one, name)).tolist() for name in names} for key, one in found.items()}
