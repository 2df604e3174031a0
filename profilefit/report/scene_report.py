"""Pictures of a scene, and its error and cost in lines and as data."""

from __future__ import annotations

import io
from collections.abc import Callable, Iterator, Sequence
from statistics import median
from typing import Any

import numpy as np
from matplotlib import colormaps, image

from profilefit.report.figures.canvas import BLUE, DPI, canvas, plain_log, styled
from profilefit.scenes.stage.judge import ChartPoint, RenderResult

LAST = 0.99  # share of the pixels that the map's colours resolve; the rest is as bright as the last of them
NOWHERE = "#BBBBBB"  # where no error is measured


def scene_figures(drawn: RenderResult, device: str) -> dict[str, bytes]:
    """Return PNG files by the ends of their names: "" the picture, "-truth", "-error", and "-chart"."""
    pictures = {"": drawn.picture, "-truth": drawn.truth}
    files = {end: _png(image.imsave, picture) for end, picture in pictures.items()} | {"-error": _error_map(drawn)}
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


def scene_lines(drawn: RenderResult, device: str) -> Iterator[str]:
    """Yield what is printed: a line for each number of samples, then a whole frame, and the error of the reference."""
    for point in drawn.chart:
        what = f"{point.label}, {point.samples} samples"
        yield f"{what}: error {point.rmse:.3g}, {_times(point.milliseconds)} for its passes"
    yield f"a whole frame with {drawn.point.samples} samples: {_times(drawn.frame)}"
    for name, times in drawn.passes.items():
        yield f"  {name}: {_times(times)}"
    yield (
        f"error of the reference: {drawn.truth_error.half:.1e} at half of the pixels, {drawn.truth_error.most:.1e} at "
        f"nine in ten, {drawn.truth_error.rms:.1e} root mean square"
    )
    yield f"errors are root mean squares of {drawn.of}, over its mean; times are of {device}"


def content(drawn: RenderResult, device: str) -> dict[str, Any]:
    """Return the numbers for --json and a file: errors over the mean of the truth [-], times in ms."""
    return {
        "device": device,
        **_point(drawn.point),
        "frame_milliseconds": _spread(drawn.frame),
        **({"passes": {name: _spread(times) for name, times in drawn.passes.items()}} if drawn.passes else {}),
        "truth_error": drawn.truth_error._asdict(),
        "chart": [_point(one) for one in drawn.chart],
    }


def _point(point: ChartPoint) -> dict[str, Any]:
    times = _spread(point.milliseconds)
    return {"technique": point.label, "samples": point.samples, "rmse": point.rmse, "milliseconds": times}


def _spread(times: Sequence[float]) -> dict[str, float]:
    return {"least": min(times), "median": median(times), "most": max(times)}


def _times(times: Sequence[float]) -> str:
    return f"{median(times):.3g} ms ({min(times):.3g} to {max(times):.3g})"
