"""Pictures side by side with the exact one, and how they differ from it, at one scale."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from matplotlib import colormaps
from matplotlib.axes import Axes
from numpy.typing import NDArray

from benchmarks.render_figure import save
from benchmarks.render_laws import Contender
from benchmarks.render_view import Judged, shown
from benchmarks.table import show
from profilefit.report.figures.canvas import canvas, styled
from profilefit.scenes.stage.pattern import MOST_SAMPLES, Sampling

Floats = NDArray[np.float64]
LUMINANCE = np.array([0.2126, 0.7152, 0.0722])  # of linear sRGB, ITU-R BT.709
COLOURS = 256  # of a file
SCALE, LEVELS = 0.2, 41  # of the maps: a difference over the mean luminance; odd, so that one level is about 0
STEPS = colormaps["RdBu_r"].resampled(LEVELS)
COLUMNS = ("hazard", "burley", "liang corrected", "liang", "separable")
EQUAL = 16  # samples of the pictures with as many each
RICH = 64  # samples of the hazard law whose time the others get
NEARLY, ROUNDS = 0.05, 8  # how equal a time is, and how often counts are mended for it


@dataclass(frozen=True)
class Shot:
    """Picture with its caption; exitance (h, w, 3), milliseconds of the scatter pass."""

    label: str
    exitance: Floats
    samples: int
    milliseconds: float
    unit: str = "samples"


def shots(judge: Judged, wanted: Sequence[tuple[Contender, int]], turns: int) -> list[Shot]:
    """Return a picture of each law with so many samples, and the least of its times, taken in turns."""
    found = []
    for (one, samples), time in zip(wanted, _least(judge, wanted, turns), strict=True):
        unit = "taps" if one.is_filter else "samples"
        exitance = judge.stage.scatter(one.law, judge.mfp, one.drawn(samples))
        found.append(Shot(one.label, exitance, samples, time, unit))
    return found


def _least(judge: Judged, wanted: Sequence[tuple[Contender, int]], turns: int) -> list[float]:
    """Return the least [ms]; what else the machine does only adds, and hits all of them."""
    times = [
        [judge.stage.time(one.law, judge.mfp, one.drawn(samples), repeats=1)[0] for one, samples in wanted]
        for _ in range(turns)
    ]
    return np.min(times, axis=0).tolist()


def laws(judge: Judged, works: Mapping[str, Contender], turns: int) -> list[list[Shot]]:
    """Return rows of shots: with equal samples, and in the time of RICH samples of the first."""
    chosen = [works[key] for key in COLUMNS]
    equal = [(one, EQUAL) for one in chosen]
    return [shots(judge, equal, 2 * turns), shots(judge, _in_equal_time(judge, chosen, turns), 2 * turns)]


def _in_equal_time(judge: Judged, chosen: Sequence[Contender], turns: int) -> list[tuple[Contender, int]]:
    """Return each law with as many samples as take the time of the first with RICH, to NEARLY, or the most."""
    counts = np.full(len(chosen), RICH)
    for _ in range(ROUNDS):
        times = np.array(_least(judge, list(zip(chosen, counts.tolist(), strict=True)), turns))
        better = np.clip(np.rint(counts * times[0] / times), 1, MOST_SAMPLES).astype(int)
        better[0] = RICH
        if np.all((np.abs(times / times[0] - 1.0) < NEARLY) | (better == counts)):
            break
        counts = better
    return list(zip(chosen, counts.tolist(), strict=True))


def seventeen(judge: Judged, works: Mapping[str, Contender], turns: int) -> list[list[Shot]]:
    """Draw figure 14 of Liang et al.: 17 samples, uniform against importance."""
    names = {"uniform": "uniform radii", "importance": "importance", "importance blue": "importance, blue noise"}
    wanted = [(replace(works["hazard"], sampling=Sampling(kind=kind), label=name), 17) for kind, name in names.items()]
    return [shots(judge, wanted, turns)]


def choices(judge: Judged, works: Mapping[str, Contender], turns: int) -> list[list[Shot]]:
    """Compare the law for diffuse light with that for searchlights; radii of the longest channel with a mixture."""
    mixture = replace(works["hazard"], sampling=Sampling(channels="mixture"), label="radii of a mixture")
    wanted = [
        (replace(works["hazard"], label="for diffuse light"), MOST_SAMPLES),
        (replace(works["searchlight"], label="for a searchlight"), MOST_SAMPLES),
        (replace(works["hazard"], label="radii of the longest"), EQUAL),
        (mixture, EQUAL),
    ]
    return [shots(judge, wanted, turns)]


@styled
def draw(judge: Judged, rows: Sequence[Sequence[Shot]], path: Path, titles: Sequence[str], device: str) -> None:
    """Draw each row of shots with its differences below; the exact picture stands before. `path` ends in .png."""
    columns = 1 + len(rows[0])
    side = 8.0 / max(columns, 4)
    figure = canvas(2 * len(rows) * (side + 0.30) + 0.35, width=side * columns + 0.1)
    axes = figure.subplots(2 * len(rows), columns, squeeze=False)
    for ax in axes.ravel():
        ax.set_axis_off()
    for pair, row, title in zip(axes.reshape(len(rows), 2, columns), rows, titles, strict=True):
        _picture(pair[0, 0], judge.reference, "exact")
        _note(pair[1, 0], title)
        for upper, lower, one in zip(pair[0, 1:], pair[1, 1:], row, strict=True):
            _picture(upper, one.exitance, f"{one.label}\n{one.samples} {one.unit}, {one.milliseconds:.0f} ms")
            mapped = _difference(lower, judge, one)
    bar = figure.colorbar(
        mapped, ax=axes[-1].tolist(), orientation="horizontal", fraction=0.05, aspect=90, pad=0.02, extend="both"
    )
    bar.set_label(f"luminance less that of the exact picture, over its mean [-]; times on {device}", fontsize=7)
    bar.ax.tick_params(labelsize=7)
    save(figure, path, COLOURS, (255 * STEPS(np.arange(LEVELS))[:, :3]).round().astype(int).tolist())


def _picture(ax: Axes, exitance: Floats, title: str) -> None:
    ax.imshow(shown(exitance), interpolation="nearest")
    ax.set_title(title, fontsize=7, pad=2)


def _difference(ax: Axes, judge: Judged, one: Shot):
    mean = float((judge.reference[judge.mask] @ LUMINANCE).mean())
    difference = np.where(judge.mask, (one.exitance - judge.reference) @ LUMINANCE, 0.0) / mean
    ax.set_title(f"RMSE {judge.rmse(one.exitance):.3f}, FLIP {judge.flip(one.exitance):.3f}", fontsize=7, pad=2)
    end = SCALE * LEVELS / (LEVELS - 1)
    return ax.imshow(difference[::-1], cmap=STEPS, vmin=-end, vmax=end, interpolation="nearest")


def _note(ax: Axes, text: str) -> None:
    ax.text(0.5, 0.5, text, ha="center", va="center", fontsize=8, transform=ax.transAxes)


def report(judge: Judged, rows: Sequence[Sequence[Shot]]) -> None:
    """Print the captions."""
    for row in rows:
        cells = [
            (
                one.label,
                str(one.samples),
                f"{one.milliseconds:.1f}",
                f"{judge.rmse(one.exitance):.4f}",
                f"{judge.flip(one.exitance):.4f}",
            )
            for one in row
        ]
        show("Pictures", ("law", "samples", "ms", "RMSE", "FLIP"), cells)


def as_json(judge: Judged, rows: Sequence[Sequence[Shot]]) -> list[list[dict]]:
    return [
        [
            {
                "label": one.label,
                "samples": one.samples,
                "milliseconds": one.milliseconds,
                "rmse": judge.rmse(one.exitance),
                "flip": judge.flip(one.exitance),
            }
            for one in row
        ]
        for row in rows
    ]
