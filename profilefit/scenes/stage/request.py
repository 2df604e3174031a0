"""Request of a scene's file: samples, camera and light; and the picture drawn, beside its reference."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from profilefit.errors import InputError
from profilefit.recipes.toml_tables import Table, Tables
from profilefit.scenes.stage.buffers import INSIDE, Buffers
from profilefit.scenes.stage.judge import TURNS, Judge, points
from profilefit.scenes.stage.pattern import MOST_SAMPLES, Sampling
from profilefit.scenes.stage.picture import RenderResult
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import TechniquePair
from profilefit.scenes.stage.world import Camera, Light, Rgb, Scene, unit

Floats = NDArray[np.float64]
# Tables of a scene's file that the stage reads; the keys of [technique] are those that every scene has.
TABLES = {
    "technique": ("samples", "chart"),
    "camera": ("resolution", "distance", "direction", "height", "target"),
    "light": ("direction", "irradiance", "ambient"),
}
MOST_CHART = 8  # numbers of samples
# The reference sums over all pairs of pixels, six minutes on a core for so many.
MOST_PIXELS = 2**16
NEAREST, FARTHEST = 300.0, 1e4  # of the camera [mm]: the head's band is 122 mm from the middle
LARGEST_VIEW = 1000.0  # [mm]
MOST_LIGHT = 1000.0


@dataclass(frozen=True)
class ViewRequest:
    """Picture that a file requests, in the scene's unit of length.

    Attributes:
        file: where it stands.
        sampling: of a pixel.
        chart: other numbers of samples, whose error and cost are measured.
        camera: lens and place [length].
        light: of the lamp.
        ambient: irradiance from everywhere.
        size: columns and rows [pixels].
    """

    file: str
    sampling: Sampling
    chart: tuple[int, ...]
    camera: Camera
    light: Light
    ambient: Rgb
    size: tuple[int, int]

    @property
    def numbers(self) -> list[int]:
        """Numbers of samples of picture and chart, the least first."""
        return sorted({self.sampling.samples, *self.chart})

    def require_light(self) -> None:
        """Raise InputError where neither the lamp nor anything else shines."""
        if not any((*self.light.irradiance, *self.ambient)):
            raise InputError(f"{self.file}: [light] irradiance and ambient must not both be 0: nothing would be seen")


def _direction(tables: Tables, table: Table, default: Rgb, where: str = "light") -> Rgb:
    direction = tables.three(where, "direction", table, default, -1e6, 1e6)
    if not np.linalg.norm(direction) > 1e-6:
        raise tables.bad(where, "direction", "a direction, not 0", list(direction))
    return direction


class Viewpoint(NamedTuple):
    """Camera of a file that says nothing [mm].

    Attributes:
        target: a point.
        distance, direction: from there to the eye, of any length.
        height: of what is seen there.
    """

    target: Rgb
    distance: float
    direction: Rgb
    height: float

    def camera(self, tables: Tables, table: Table) -> Camera:
        """Return the camera of a table; without a height its lens stays the same at every distance."""
        target = tables.three("camera", "target", table, self.target, -150.0, 150.0)
        distance = tables.number("camera", "distance", table, self.distance, FARTHEST)
        if distance < NEAREST:
            raise tables.bad("camera", "distance", f"a length in {NEAREST:g} ... {FARTHEST:g} mm", table["distance"])
        height = tables.number("camera", "height", table, self.height * distance / self.distance, LARGEST_VIEW)
        direction = _direction(tables, table, self.direction, "camera")
        x, y, z = (np.array(target) + distance * unit(direction)).tolist()
        return Camera((x, y, z), target, height)


HEAD = Viewpoint((4.0, -6.0, 60.0), 650.0, (-109.0, -4.0, 640.0), 130.0)


class Defaults(NamedTuple):
    """View of a file that says nothing, and what limits its picture.

    Attributes:
        samples: of a pixel.
        size: columns and rows [pixels].
        light: of the lamp.
        ambient: irradiance from everywhere.
        limit: why a picture has no more pixels, after "pixels at most".
    """

    samples: int = 16
    size: tuple[int, int] = (160, 120)
    light: Light = Light()
    ambient: Rgb = Scene(()).ambient
    limit: str = "which the truth sums over"


def view(
    tables: Tables,
    content: Table,
    camera: Callable[[Tables, Table], Camera] = HEAD.camera,
    defaults: Defaults = Defaults(),  # noqa: B008  (a tuple)
    toward: Callable[[Tables, Table, Rgb], Rgb] = _direction,
) -> dict[str, Any]:
    """Return the fields of a `ViewRequest`.

    Args:
        tables: of the file.
        content: of the file.
        camera: function that reads the table [camera].
        defaults: of what the file does not say.
        toward: function that reads the direction of [light], which has a default.

    Raises:
        InputError: with file, table and key, what was got and what is accepted.
    """
    named, seen, lamp = (tables.table(content, name, {}) for name in TABLES)
    direction = toward(tables, lamp, defaults.light.direction)
    size = tables.sides("camera", "resolution", seen, defaults.size, 1024)
    if size[0] * size[1] > MOST_PIXELS:
        accepted = f"{MOST_PIXELS} pixels at most, {defaults.limit}"
        raise tables.bad("camera", "resolution", accepted, list(size))
    irradiance = tables.three("light", "irradiance", lamp, defaults.light.irradiance, 0.0, MOST_LIGHT)
    return {
        "file": tables.file,
        "sampling": tables.build("technique", lambda: Sampling(named.get("samples", defaults.samples))),
        "chart": _chart(tables, named),
        "camera": camera(tables, seen),
        "light": Light(direction, irradiance),
        "ambient": tables.three("light", "ambient", lamp, defaults.ambient, 0.0, MOST_LIGHT),
        "size": size,
    }


def require_lit(file: str, buffers: Buffers) -> None:
    """Raise InputError where a view shows nothing that light reaches and scatters in."""
    inside = buffers.mask > INSIDE
    if not np.any(buffers.irradiance[inside] > 0):
        raise InputError(f"{file}: the view must show something that light scatters in, and light must reach it")


def rendered(stage: Stage, judge: Judge, request: ViewRequest, pair: TechniquePair) -> RenderResult:
    """Return the picture of what a stage has drawn, its reference, error and cost."""
    sampling = request.sampling
    chart = points(stage, judge, pair, sampling, request.numbers)
    exitance = stage.scatter(pair.by, pair.mfp, sampling, pair.alpha)
    radiance = stage.render(pair.seen, pair.mfp, sampling, pair.alpha)
    frame = stage.time(pair.seen, pair.mfp, sampling, TURNS, "frame", pair.alpha)
    return judge.result(exitance, chart, sampling.samples, frame, radiance)


def _chart(tables: Tables, named: Table) -> tuple[int, ...]:
    numbers: Any = named.get("chart", [])
    whole = isinstance(numbers, list) and all(type(one) is int and 1 <= one <= MOST_SAMPLES for one in numbers)
    if not whole or len(numbers) > MOST_CHART:
        accepted = f"at most {MOST_CHART} numbers of samples in 1 ... {MOST_SAMPLES}"
        raise tables.bad("technique", "chart", accepted, numbers)
    return tuple(numbers)
