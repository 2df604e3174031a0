"""Fur: error over the cost of layers by each way to draw them, toward six angles and on a ball.

Drawn by OpenGL, whose time is that of the passes, each turn once. Toward an angle the error is that of the heights of
first hits; of the ball it is its light's.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from mcml_sim.files.text_file import read_toml
from profilefit.recipes.folder import shipped
from profilefit.scenes.fur.chart import over_layers, wide_patch
from profilefit.scenes.fur.scene import FurRequest, read, reference_render
from profilefit.scenes.fur.ways import WAYS
from profilefit.scenes.stage.picture import ChartPoint
from profilefit.shader.context import opened, renderer
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread
from profilefit.studies.tradeoff.stopwatch import Track, silent

FILE = "fur.toml"
DENSITY, RADIUS, LENGTH, LEAST_SIDE, SEED = 64.0, 0.05, 1.0, 4.0, 1
DEGREES = (0.0, 30.0, 45.0, 60.0, 75.0, 85.0)


@dataclass(frozen=True)
class FurSizes:
    """Angles to the normal [degrees], numbers of layers, rays along a side of a patch."""

    degrees: tuple[float, ...] = DEGREES
    layers: tuple[int, ...] = (4, 8, 16, 32, 64, 128)
    rays: int = 256
    turns: int = 5


FULL, QUICK = FurSizes(), FurSizes((0.0, 45.0, 75.0), (8, 16, 48), 96, 3)


def measure(sizes: FurSizes = FULL, track: Track = silent) -> TradeoffPart:
    """Return a panel an angle, and one of the example's picture."""
    with opened() as context:
        panels = [angle(context, sizes.degrees[i], sizes) for i in track(range(len(sizes.degrees)), "angles")]
        panels.append(picture(context, sizes))
        notes = (f"drawn by {renderer(context)}; {DENSITY:g} strands a unit of area, r0 {RADIUS:g}, L {LENGTH:g}",)
    return TradeoffPart("fur", "Fur in layers", tuple(panels), notes)


def request() -> FurRequest:
    """Return the shipped example."""
    path = shipped("examples") / FILE
    return read(str(path), read_toml(path))


def angle(context: moderngl.Context, degrees: float, sizes: FurSizes = FULL) -> Panel:
    """Return every way and number of layers toward one angle."""
    theta = float(np.radians(degrees))
    patch = wide_patch(DENSITY, RADIUS, LENGTH, theta, LEAST_SIDE, SEED)
    points = over_layers(context, patch, theta, sizes.layers, (sizes.rays, sizes.rays), sizes.turns)
    name = f"angle-{degrees:g}"
    return Panel(
        name,
        f"{degrees:g} degrees, layers",
        f"time of {sizes.rays} x {sizes.rays} rays [ms]",
        "root mean square error of heights / length [-]",
        tuple(_point(name, one) for one in points),
        joined=True,
    )


def picture(context: moderngl.Context, sizes: FurSizes = FULL) -> Panel:
    """Return the example's ball, its light against rays to every strand."""
    with reference_render(context, request()) as drawn:
        points = tuple(_point("ball", one) for way in WAYS for one in drawn.points(way, sizes.layers, sizes.turns))
    return Panel(
        "ball",
        f"examples/{FILE}, layers",
        "time of both passes [ms]",
        "root mean square error / mean [-]",
        points,
        True,
    )


def _point(panel: str, of: ChartPoint) -> Point:
    error = WithSpread.exactly(of.rmse)
    return Point(panel, of.label, str(of.samples), WithSpread.of(of.milliseconds), error, facts={"layers": of.samples})
