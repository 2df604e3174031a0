"""Scenes: error over the cost of a view of the sea, of caustic maps and shafts, and of fur by each way to draw layers.

Drawn by OpenGL, whose time is that of its passes, each turn once. Errors are root mean squares over the mean of the
light: a view's against paths of all orders, a map's against photons, of a ball of fur against rays to every strand;
toward an angle, of the heights of first hits over the length. Shafts are numerics, whose cost is their samples.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import Any

import moderngl
import numpy as np

from mcml_sim.files.whole_file import read_toml
from mcml_sim.media.phase import HenyeyGreenstein
from profilefit.recipes.folder import shipped
from profilefit.scenes import SCENES
from profilefit.scenes.fur import scene as fur_scene
from profilefit.scenes.fur.chart import over_layers, wide_patch
from profilefit.scenes.fur.ways import OF_PICTURES
from profilefit.scenes.sea import scene as sea_scene
from profilefit.scenes.sea.caustics import Splat, caustic_map, focus
from profilefit.scenes.sea.chart import FINE, Bundle, ViewRay, by_lines, by_prisms, by_slices
from profilefit.scenes.sea.haze import KINDS
from profilefit.scenes.sea.truth import caustic_photons, misfit
from profilefit.scenes.sea.waves import Waves, random_sea
from profilefit.scenes.stage.judge import ChartPoint
from profilefit.shader.context import opened, renderer
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread
from profilefit.studies.tradeoff.stopwatch import Track, silent

TILE, DEPTH, PIXELS = 10.0, 5.0, 256  # of caustic maps: lengths in one unit
BEFORE, BEYOND = 0.32, 1.18  # F, from 1 on of which light folds before the floor
ERROR = "root mean square error over the mean [-]"
SHAFTS = {"lines": by_lines, "prisms": by_prisms, "slices": by_slices}
DENSITY, RADIUS, LENGTH, LEAST_SIDE, SEED = 64.0, 0.05, 1.0, 4.0, 1  # of a patch of fur
DEGREES = (0.0, 30.0, 45.0, 60.0, 75.0, 85.0)


@dataclass(frozen=True)
class SeaSizes:
    """Samples of a view and paths of its truth; vertices along a side, and photons of a map; samples of shafts."""

    samples: tuple[int, ...] = (3, 6, 12, 24, 48)
    paths: int = 4_000_000
    vertices: tuple[int, ...] = (128, 192, 256)
    photons: int = 2048
    of_shafts: tuple[int, ...] = (4, 16, 64, 256)
    turns: int = 5


@dataclass(frozen=True)
class FurSizes:
    """Angles to the normal [degrees], numbers of layers, rays along a side of a patch."""

    degrees: tuple[float, ...] = DEGREES
    layers: tuple[int, ...] = (4, 8, 16, 32, 64, 128)
    rays: int = 256
    turns: int = 5


SEA, QUICK_SEA = SeaSizes(), SeaSizes((6, 24), 100_000, (128, 256), 1024, (4, 16, 64), 3)
FUR, QUICK_FUR = FurSizes(), FurSizes((0.0, 45.0, 75.0), (8, 16, 48), 96, 3)


def measure_sea(sizes: SeaSizes = SEA, track: Track = silent) -> TradeoffPart:
    """Return the example's view, caustic maps before and beyond the first fold, and shafts."""
    with opened() as context:
        with sea_scene.reference_render(context, example("sea"), sizes.paths) as found:
            drawn = (view(found, sizes), *maps(context, sizes, track))
        notes = (f"drawn by {renderer(context)}",)
    return TradeoffPart("sea", "Under the sea", (*drawn, shafts(sizes)), notes)


def measure_fur(sizes: FurSizes = FUR, track: Track = silent) -> TradeoffPart:
    """Return a panel an angle, and one of the example's picture."""
    with opened() as context:
        panels = [angle(context, sizes.degrees[i], sizes) for i in track(range(len(sizes.degrees)), "angles")]
        panels.append(picture(context, sizes))
        notes = (f"drawn by {renderer(context)}; {DENSITY:g} strands a unit of area, r0 {RADIUS:g}, L {LENGTH:g}",)
    return TradeoffPart("fur", "Fur in layers", tuple(panels), notes)


SMALL = {"sea": (160, 90), "fur": (160, 120)}  # pixels of a picture that is drawn again and again


def example(name: str) -> Any:
    """Return the request of a scene's shipped example, as a small picture."""
    home, file = SCENES[name]
    path = shipped("examples") / file
    return import_module(home).read(str(path), read_toml(path)).changed(camera_table={"resolution": SMALL[name]})


def _points(panel: str, found: Iterable[ChartPoint], fact: str) -> tuple[Point, ...]:
    """Return points of a chart; the number of samples, or of what they are, is a fact of that name."""
    return tuple(
        Point(
            *(panel, one.label, str(one.samples), WithSpread.of(one.milliseconds), WithSpread.exactly(one.rmse)),
            facts={fact: one.samples},
        )
        for one in found
    )


def view(render: sea_scene.SeaRender, sizes: SeaSizes = SEA) -> Panel:
    """Return a picture by each law of the water's light, over pieces of a ray."""
    found = [one for kind in KINDS for one in render.points(kind, sizes.samples, sizes.turns)]
    points, title = _points("view", found, "pieces"), "examples/sea.toml, pieces of a ray"
    return Panel("view", title, "time of the view [ms]", ERROR, points, joined=True)


def seas() -> dict[str, tuple[float, Waves]]:
    """Return F, and a random sea whose most curved crest has it."""
    one = random_sea(0.15, TILE, 1)
    cases = {"before": BEFORE, "beyond": BEYOND}
    return {name: (f, one.scaled(f / focus(one, DEPTH))) for name, f in cases.items()}


def maps(context: moderngl.Context, sizes: SeaSizes = SEA, track: Track = silent) -> list[Panel]:
    """Return caustic maps by each splat, over vertices of the sea."""
    panels = []
    for name, (f, waves) in seas().items():
        true = caustic_photons(waves, DEPTH, 0.0, 1.34, PIXELS, sizes.photons)
        cases = [(splat, one) for splat in Splat for one in sizes.vertices]
        drawn, *timed = (
            [caustic_map(context, waves, *case, PIXELS, DEPTH) for case in cases]
            for _ in (0, *track(range(sizes.turns), f"maps {name} the fold"))
        )
        points = []
        for (splat, one), made, turns in zip(cases, drawn, zip(*timed, strict=True), strict=True):
            off = misfit(made.light, true)
            facts = {"vertices": one, "fragments": made.fragments, **off._asdict()}
            cost, error = WithSpread.of([each.milliseconds for each in turns]), WithSpread.exactly(off.rms)
            points.append(Point(name, splat.value, str(one), cost, error, facts=facts))
        title = f"caustic maps of {PIXELS} x {PIXELS} pixels, F = {f:g}, vertices along a side"
        panels.append(Panel(name, title, "time of the map [ms]", ERROR, tuple(points), joined=True))
    return panels


def shafts(sizes: SeaSizes = SEA) -> Panel:
    """Return twenty view rays through a bundle of light, against quadrature."""
    bundle, one = Bundle(0.0, ((0.05, 1, 0.0), (0.03, 2, 1.0), (0.02, 3, 2.0))), HenyeyGreenstein(0.924)
    views = [
        ViewRay(x, z, (float(np.cos(up) * np.cos(side)), float(np.cos(up) * np.sin(side)), float(np.sin(up))), length)
        for x in (0.0, 0.37)
        for z, up, length in ((1.0, 0.35, 2.0), (2.0, -0.35, 3.0), (0.5, 0.79, 2.0), (2.5, -1.05, 2.5), (1.5, 0.0, 3.0))
        for side in (0.0, 0.7)
    ]
    true = np.array([by_prisms(bundle, at, one, FINE) for at in views])
    points = []
    for name, way in SHAFTS.items():
        for count in sizes.of_shafts:
            off = np.array([way(bundle, at, one, count) for at in views]) / true - 1.0
            error, worst = (WithSpread.exactly(float(each)) for each in (np.sqrt(np.mean(off**2)), np.max(np.abs(off))))
            points.append(Point("shafts", name, str(count), WithSpread.exactly(count), error, worst, {"pieces": count}))
    return Panel("shafts", "shafts over twenty view rays", "samples of a ray [-]", ERROR, tuple(points), joined=True)


def angle(context: moderngl.Context, degrees: float, sizes: FurSizes = FUR) -> Panel:
    """Return every way and number of layers toward one angle."""
    theta = float(np.radians(degrees))
    patch = wide_patch(DENSITY, RADIUS, LENGTH, theta, LEAST_SIDE, SEED)
    found = over_layers(context, patch, theta, sizes.layers, (sizes.rays, sizes.rays), sizes.turns)
    name, cost = f"angle-{degrees:g}", f"time of {sizes.rays} x {sizes.rays} rays [ms]"
    error, points = "root mean square error of heights / length [-]", _points(name, found, "layers")
    return Panel(name, f"{degrees:g} degrees, layers", cost, error, points, joined=True)


def picture(context: moderngl.Context, sizes: FurSizes = FUR) -> Panel:
    """Return the example's ball, its light against rays to every strand."""
    with fur_scene.reference_render(context, example("fur")) as drawn:
        found = [one for way in OF_PICTURES for one in drawn.points(way, sizes.layers, sizes.turns)]
    cost, error = "time of both passes [ms]", "root mean square error / mean [-]"
    return Panel("ball", "examples/fur.toml, layers", cost, error, _points("ball", found, "layers"), joined=True)
