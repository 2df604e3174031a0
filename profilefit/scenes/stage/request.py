"""What a scene's file requests of the stage: samples, camera and light; and the picture drawn, beside its truth."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from profilefit.errors import InputError
from profilefit.recipes.toml_tables import Table, Tables
from profilefit.scenes.stage.buffers import INSIDE, Buffers
from profilefit.scenes.stage.judge import TURNS, Judge, points
from profilefit.scenes.stage.pattern import MOST_SAMPLES, Sampling
from profilefit.scenes.stage.picture import Drawn, TruthError, to_srgb
from profilefit.scenes.stage.technique import Technique
from profilefit.scenes.stage.world import Camera, Light, Rgb, Scene, unit

Floats = NDArray[np.float64]
# Tables of a scene's file that the stage reads; the keys of [technique] are those that every scene has.
TABLES = {
    "technique": ("samples", "chart"),
    "camera": ("resolution", "distance", "direction", "height", "target"),
    "light": ("direction", "irradiance", "ambient"),
}
MOST_CHART = 8  # numbers of samples
# The truth sums over all pairs of pixels, six minutes on a core for so many.
MOST_PIXELS = 2**16
NEAREST, FARTHEST = 300.0, 1e4  # of the camera [mm]: the head's band is 122 mm from the middle
LARGEST_VIEW = 1000.0  # [mm]
MOST_LIGHT = 1000.0
EXPOSURE = 1.1  # of the pictures: few of their pixels are clipped by it


@dataclass(frozen=True)
class ViewRequest:
    """chart  other numbers of samples, whose error and cost are measured;  size  columns and rows [pixels]"""

    file: str
    sampling: Sampling
    chart: tuple[int, ...]
    camera: Camera
    light: Light
    ambient: Rgb
    size: tuple[int, int]


class Viewpoint(NamedTuple):
    """What a camera looks at, if a file says nothing [mm].

    target  a point;  distance, direction  from there to the eye, of any length;  height  of what is seen there
    """

    target: Rgb
    distance: float
    direction: Rgb
    height: float


HEAD = Viewpoint((4.0, -6.0, 60.0), 650.0, (-109.0, -4.0, 640.0), 130.0)


class Shown(NamedTuple):
    """A technique in a picture: what is measured, and what is shown if that is another one.

    by     whose scattered light is held against the truth;  seen  what the picture has: `by`, or more than that
    """

    label: str
    by: Technique
    seen: Technique


def view(tables: Tables, content: Table, default: Viewpoint = HEAD) -> dict[str, Any]:
    """The fields of a `ViewRequest`; InputError that names file, table and key, what was got and what is accepted."""
    named, seen, lit = (tables.table(content, name, {}) for name in TABLES)
    light = Light()
    direction = _direction(tables, "light", lit, light.direction)
    size = tables.sides("camera", "resolution", seen, (160, 120), 1024)
    if size[0] * size[1] > MOST_PIXELS:
        raise tables.bad("camera", "resolution", f"{MOST_PIXELS} pixels at most, which the truth sums over", list(size))
    return {
        "file": tables.file,
        "sampling": tables.made("technique", lambda: Sampling(named.get("samples", 16))),
        "chart": chart(tables, named),
        "camera": _camera(tables, seen, default),
        "light": Light(direction, tables.three("light", "irradiance", lit, light.irradiance, 0.0, MOST_LIGHT)),
        "ambient": tables.three("light", "ambient", lit, Scene(()).ambient, 0.0, MOST_LIGHT),
        "size": size,
    }


def require_lit(file: str, buffers: Buffers) -> None:
    """InputError where a view shows nothing that light reaches and scatters in."""
    inside = buffers.mask > INSIDE
    if not np.any(buffers.irradiance[inside] > 0):
        raise InputError(f"{file}: the view must show something that light scatters in, and light must reach it")


def drawn(judge: Judge, request: ViewRequest, shown: Shown, truth_error: TruthError) -> Drawn:
    """The picture on the judge's stage, its truth, error and cost."""
    stage, sampling = judge.stage, request.sampling
    numbers = tuple(dict.fromkeys((sampling.samples, *request.chart)))
    point, *others = points(judge, shown.label, shown.by, sampling, numbers)
    exitance = stage.scatter(shown.by, judge.mfp, sampling, judge.alpha)
    radiance = stage.render(shown.seen, judge.mfp, sampling, judge.alpha)
    frame = tuple(stage.time(shown.seen, judge.mfp, sampling, TURNS, "frame", judge.alpha))
    # What the surface mirrors and what shines through thin parts is the stage's own in both.
    true = radiance + (judge.truth - exitance) / np.pi
    return Drawn(
        picture=to_srgb(radiance[::-1], EXPOSURE),
        truth=to_srgb(true[::-1], EXPOSURE),
        error=judge.relative_error(exitance)[::-1],
        point=point,
        chart=tuple(sorted((point, *others), key=lambda one: one.samples)),
        frame=frame,
        truth_error=truth_error,
    )


def chart(tables: Tables, named: Table) -> tuple[int, ...]:
    """Numbers of samples; InputError."""
    numbers: Any = named.get("chart", [])
    whole = isinstance(numbers, list) and all(type(one) is int and 1 <= one <= MOST_SAMPLES for one in numbers)
    if not whole or len(numbers) > MOST_CHART:
        accepted = f"at most {MOST_CHART} numbers of samples in 1 ... {MOST_SAMPLES}"
        raise tables.bad("technique", "chart", accepted, numbers)
    return tuple(numbers)


def _direction(tables: Tables, where: str, table: Table, default: Rgb) -> Rgb:
    """Of any length but 0."""
    direction = tables.three(where, "direction", table, default, -1e6, 1e6)
    if not np.linalg.norm(direction) > 1e-6:
        raise tables.bad(where, "direction", "a direction, not 0", list(direction))
    return direction


def _camera(tables: Tables, seen: Table, default: Viewpoint) -> Camera:
    """Without a height its lens stays the same at every distance."""
    target = tables.three("camera", "target", seen, default.target, -150.0, 150.0)
    distance = tables.number("camera", "distance", seen, default.distance, FARTHEST)
    if distance < NEAREST:
        raise tables.bad("camera", "distance", f"a length in {NEAREST:g} ... {FARTHEST:g} mm", seen["distance"])
    height = tables.number("camera", "height", seen, default.height * distance / default.distance, LARGEST_VIEW)
    direction = _direction(tables, "camera", seen, default.direction)
    x, y, z = (np.array(target) + distance * unit(direction)).tolist()
    return Camera((x, y, z), target, height)
