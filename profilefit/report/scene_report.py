"""Pictures of a scene, and its error and cost in lines and as data."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import Any

import numpy as np
from matplotlib import colormaps, image
from matplotlib.axes import Axes
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from numpy.typing import NDArray

from profilefit.report.figures.canvas import BLUE, DPI, canvas, plain_log, styled
from profilefit.report.tables.cells import significant
from profilefit.scenes.stage.judge import ChartPoint, RenderResult, SceneImage
from profilefit.scenes.stage.light.environment import Environment

LAST = 0.99  # share of the pixels that the map's colours resolve; the rest is as bright as the last of them
NOWHERE = "#BBBBBB"  # where no error is measured
# Comparison: its width, pictures side by side, and the height of a label [pixels]; pixels per inch; sizes of letters.
WIDE, COLUMNS, LABEL, SCREEN, LARGE, SMALL = 1920, 3, 76, 100, 17.0, 15.0

ENDS = ("", "-truth", "-error", "-comparison", "-chart")  # of names of pictures


def scene_figures(drawn: SceneImage, device: str) -> dict[str, bytes]:
    """Return PNG files by the ends of their names, in `ENDS`: all but the picture where there is a reference."""
    files = {"": _png(image.imsave, drawn.picture)}
    if isinstance(drawn, RenderResult):
        files |= {"-truth": _png(image.imsave, drawn.truth), "-error": _error_map(drawn)}
        files["-comparison"] = _comparison(drawn, device)
        if len(drawn.chart) > 1:
            files["-chart"] = _chart(drawn.chart, device)
    return files


def _png(write: Callable[..., Any], *arguments: Any, **options: Any) -> bytes:
    write(file := io.BytesIO(), *arguments, format="png", **options)
    return file.getvalue()


@styled
def _error_map(drawn: RenderResult) -> bytes:
    rows, columns = drawn.error.shape
    figure = canvas(0.4 + 5.6 * rows / columns, 7.0)
    ax = figure.subplots()
    ax.grid(False)
    ax.set(xticks=[], yticks=[], facecolor=NOWHERE)
    colours = colormaps["inferno"].with_extremes(bad=NOWHERE)
    most = float(np.nanquantile(drawn.error, LAST))
    shown = ax.imshow(drawn.error, cmap=colours, vmin=0.0, vmax=most or 1.0, interpolation="nearest")
    bar = figure.colorbar(shown, ax=ax, extend="max", pad=0.02)
    bar.set_label(f"error of {drawn.of} over its mean [-]")
    point = drawn.point
    ax.set_title(f"{point.label}, {point.samples} samples: root mean square {point.rmse:.3g}")
    return _png(figure.savefig, dpi=DPI)


@styled
def _comparison(drawn: RenderResult, device: str) -> bytes:
    """Draw the picture, the reference, the error and rivals on a page of `WIDE` pixels."""
    rows, columns = drawn.picture.shape[:2]
    across = WIDE // COLUMNS
    height = 2 * (round(across * rows / columns) + LABEL)
    figure = canvas(height / SCREEN, WIDE / SCREEN)
    grid = figure.subplots(2, COLUMNS)
    figure.set_layout_engine("none")
    panels = [
        (drawn.picture, _label(drawn.point)),
        (drawn.truth, f"reference\n{drawn.truth.shape[1]} x {drawn.truth.shape[0]} pixels"),
        *((one.picture, _label(one.point)) for one in drawn.rivals),
    ]
    places = [(0, 0), (0, 1), (1, 0), (1, 1)]
    for ax in grid.ravel():
        ax.set_axis_off()
    for (row, column), (picture, label) in zip(places, panels, strict=False):
        _panel(grid[row, column], picture, label)
    colours = colormaps["inferno"].with_extremes(bad=NOWHERE)
    most = float(np.nanquantile(drawn.error, LAST)) or 1.0
    shown = colours(drawn.error / most)
    shown[np.isnan(drawn.error)] = colours.get_bad()
    _panel(grid[0, 2], shown, "error of the first picture\nby pixel, on the scale below")
    gap = LABEL / height
    for row in range(2):
        for column in range(COLUMNS):
            grid[row, column].set_position((column / COLUMNS, 0.5 * (1 - row), 0.995 / COLUMNS, 0.5 - gap))
    bar = figure.add_axes((2.0 / COLUMNS + 0.03, 0.36, 1.0 / COLUMNS - 0.06, 0.025))
    figure.colorbar(ScalarMappable(Normalize(0.0, 100.0 * most), colours), bar, orientation="horizontal", extend="max")
    bar.tick_params(labelsize=SMALL)
    bar.set_xlabel(f"error of {drawn.of}, over its mean [%]", fontsize=SMALL)
    said = "Errors in labels are root mean squares\nover all pixels that are judged.\n"
    said += f"Times are of the passes,\nat the size of the reference,\non {device.partition(' (')[0]}."
    figure.text(2.0 / COLUMNS + 0.03, 0.24, said, fontsize=SMALL, va="top")
    return _png(figure.savefig, dpi=SCREEN)


def _panel(ax: Axes, picture: NDArray[Any], label: str) -> None:
    ax.imshow(picture, interpolation="antialiased", aspect="auto")
    ax.set_title(label, fontsize=LARGE, pad=6.0, linespacing=1.25)


def _label(point: ChartPoint) -> str:
    error, time = significant(100.0 * point.rmse), float(f"{median(point.milliseconds):.2g}")
    return f"{point.label}, {point.samples} samples\nerror {error} %, {time:g} ms"


@styled
def _chart(points: Sequence[ChartPoint], device: str) -> bytes:
    figure = canvas(3.4, 7.0)
    by_samples, by_time = figure.subplots(1, 2, sharey=True)
    error = [one.rmse for one in points]
    least = np.array([min(one.milliseconds) for one in points])
    most = np.array([max(one.milliseconds) for one in points])
    style = {"color": BLUE, "marker": "o", "markersize": 4.5}
    samples = [one.samples for one in points]
    by_samples.plot(samples, error, **style)
    by_time.errorbar(least, error, xerr=(0.0 * least, most - least), capsize=2, elinewidth=0.8, **style)
    for ax in (by_samples, by_time):
        ax.set(xscale="log", yscale="log")
    plain_log(by_samples.yaxis)
    plain_log(by_time.xaxis)
    by_samples.set_ylabel("root mean square error / mean [-]")
    by_samples.set_xlabel("samples of a pixel [-]")
    by_samples.set_xticks(samples, [str(number) for number in samples])
    by_samples.minorticks_off()
    by_time.set_xlabel("least time of its passes, and up to the most [ms]")
    figure.suptitle(f"{points[0].label}, on {device}", fontsize=9.0)
    return _png(figure.savefig, dpi=DPI)


def scene_lines(drawn: SceneImage, device: str) -> Iterator[str]:
    """Yield what is printed: a line for each number of samples and each rival, a whole frame, and the reference."""
    judged = drawn if isinstance(drawn, RenderResult) else None
    for point in (*judged.chart, *(one.point for one in judged.rivals)) if judged else ():
        what = f"{point.label}, {point.samples} samples"
        yield f"{what}: error {point.rmse:.3g}, {_times(point.milliseconds)} for its passes"
    yield f"a whole frame by {drawn.label} with {drawn.samples} samples: {_times(drawn.frame)}"
    for name, times in drawn.passes.items():
        yield f"  {name}: {_times(times)}"
    if judged is None:
        yield f"times are of {device}"
        return
    half, most, rms = judged.truth_error
    values = f"{half:.1e} at half of the pixels, {most:.1e} at nine in ten, rms {rms:.1e}"
    yield f"error of the reference: {values if np.isfinite(rms) else 'not known'}"
    (rows, columns), (tall, wide) = judged.truth.shape[:2], judged.picture.shape[:2]
    is_even = tall % rows == wide % columns == 0 and tall // rows == wide // columns
    size = f"{columns} x {rows} pixels{'' if is_even else f' ({wide} x {tall} over reference_pixel, rounded)'}"
    yield f"errors, at {size}, are root mean squares of {judged.of}, over its mean"
    yield f"times are of {device}"


def sky_line(sky: Environment) -> str:
    """Return the line with the error of an environment's harmonics."""
    rms, most = (significant(100.0 * one) for one in sky.error)
    return f"irradiance of the environment by nine harmonics: error {rms} % rms, {most} % at most, over its mean"


def content(drawn: SceneImage, device: str) -> dict[str, Any]:
    """Return the numbers for --json and a file: errors over the mean of the reference [-], times in ms."""
    whole = {"device": device, "technique": drawn.label, "samples": drawn.samples}
    whole["frame_milliseconds"] = _spread(drawn.frame)
    whole |= {"passes": {name: _spread(times) for name, times in drawn.passes.items()}} if drawn.passes else {}
    if not isinstance(drawn, RenderResult):
        return whole
    return {
        **whole,
        **_point(drawn.point),
        "truth_error": drawn.truth_error._asdict(),
        "chart": [_point(one) for one in drawn.chart],
        "rivals": [_point(one.point) for one in drawn.rivals],
    }


def _point(point: ChartPoint) -> dict[str, Any]:
    times = _spread(point.milliseconds)
    return {"technique": point.label, "samples": point.samples, "rmse": point.rmse, "milliseconds": times}


def _spread(times: Sequence[float]) -> dict[str, float]:
    return {"least": min(times), "median": median(times), "most": max(times)}


def _times(times: Sequence[float]) -> str:
    return f"{median(times):.3g} ms ({min(times):.3g} to {max(times):.3g})"
