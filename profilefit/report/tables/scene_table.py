"""Error and cost of a scene that was drawn, in lines and as data."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from statistics import median
from typing import Any

from profilefit.scenes.stage.picture import Drawn, Point


def scene_lines(drawn: Drawn, device: str) -> Iterator[str]:
    """What is printed: a line for each number of samples, then a whole frame, and how right the truth is."""
    for point in drawn.chart:
        what = f"{point.label}, {point.samples} samples"
        yield f"{what}: error {point.rmse:.3g}, {_times(point.milliseconds)} for its passes"
    yield f"a whole frame with {drawn.point.samples} samples: {_times(drawn.frame)}"
    yield (
        f"the truth's own error: {drawn.truth_error.half:.1e} at half of the pixels, {drawn.truth_error.most:.1e} at "
        f"nine in ten, {drawn.truth_error.rms:.1e} root mean square"
    )
    yield f"errors are root mean squares of scattered light, over its mean; times are of {device}"


def content(drawn: Drawn, device: str) -> dict[str, Any]:
    """The same as data, for --json and a file: errors over the mean of the truth [-], times in ms."""
    return {
        "device": device,
        **_point(drawn.point),
        "frame_milliseconds": _spread(drawn.frame),
        "truth_error": drawn.truth_error._asdict(),
        "chart": [_point(one) for one in drawn.chart],
    }


def _point(point: Point) -> dict[str, Any]:
    return {
        "technique": point.label,
        "samples": point.samples,
        "rmse": point.rmse,
        "milliseconds": _spread(point.milliseconds),
    }


def _spread(times: Sequence[float]) -> dict[str, float]:
    return {"least": min(times), "median": median(times), "most": max(times)}


def _times(times: Sequence[float]) -> str:
    return f"{median(times):.3g} ms ({min(times):.3g} to {max(times):.3g})"
