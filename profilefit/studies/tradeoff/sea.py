"""Under the sea: error over the cost of a view by each law of its light, of a caustic map by each splat, and of shafts.

Pictures and maps are drawn by OpenGL, whose time is that of its passes, each turn once; errors are root mean squares
over the mean of the light, a view's against paths of all orders, a map's against photons. Shafts are numerics, whose
cost is their samples.
"""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np

from mcml_sim.files.text_file import read_toml
from mcml_sim.media.phase import HenyeyGreenstein
from profilefit.recipes.folder import shipped
from profilefit.scenes.sea.caustics import Splat, caustic_map, focus
from profilefit.scenes.sea.chart import FINE, Bundle, ViewRay, by_lines, by_prisms, by_slices
from profilefit.scenes.sea.haze import KINDS
from profilefit.scenes.sea.scene import SeaRender, SeaRequest, read, reference_render
from profilefit.scenes.sea.truth import caustic_photons, misfit
from profilefit.scenes.sea.waves import Waves, random_sea
from profilefit.shader.context import opened, renderer
from profilefit.studies.tradeoff.points import Panel, Point, TradeoffPart, WithSpread
from profilefit.studies.tradeoff.stopwatch import Track, silent

FILE = "sea.toml"
TILE, DEPTH, PIXELS = 10.0, 5.0, 256  # of caustic maps: lengths in one unit
BEFORE, BEYOND = 0.32, 1.18  # F, from 1 on of which light folds before the floor
ERROR = "root mean square error over the mean [-]"
SHAFTS = {"lines": by_lines, "prisms": by_prisms, "slices": by_slices}


@dataclass(frozen=True)
class SeaSizes:
    """Samples of a view and paths of its truth; vertices along a side, and photons of a map; samples of shafts."""

    samples: tuple[int, ...] = (3, 6, 12, 24, 48)
    paths: int = 4_000_000
    vertices: tuple[int, ...] = (128, 192, 256)
    photons: int = 2048
    of_shafts: tuple[int, ...] = (4, 16, 64, 256)
    turns: int = 5


FULL, QUICK = SeaSizes(), SeaSizes((6, 24), 100_000, (128, 256), 1024, (4, 16, 64), 3)


def measure(sizes: SeaSizes = FULL, track: Track = silent) -> TradeoffPart:
    """Return the example's view, caustic maps before and beyond the first fold, and shafts."""
    with opened() as context:
        with reference_render(context, request(), sizes.paths) as found:
            drawn = (view(found, sizes, track), *maps(context, sizes, track))
        notes = (f"drawn by {renderer(context)}",)
    return TradeoffPart("sea", "Under the sea", (*drawn, shafts(sizes)), notes)


def request() -> SeaRequest:
    """Return the shipped example."""
    path = shipped("examples") / FILE
    return read(str(path), read_toml(path))


def view(render: SeaRender, sizes: SeaSizes = FULL, track: Track = silent) -> Panel:
    """Return a picture by each law of the water's light, over pieces of a ray."""
    errors = {(kind, one): render.judge.rmse(render.picture(kind, one)) for kind in KINDS for one in sizes.samples}
    times: dict[tuple[str, int], list[float]] = {each: [] for each in errors}
    for _ in track(range(sizes.turns), "views"):
        for each in times:
            times[each].append(render.time(*each))
    points = tuple(
        Point("view", kind, str(one), WithSpread.of(times[kind, one]), WithSpread.exactly(off), facts={"pieces": one})
        for (kind, one), off in errors.items()
    )
    return Panel("view", f"examples/{FILE}, pieces of a ray", "time of the view [ms]", ERROR, points, joined=True)


def seas() -> dict[str, tuple[float, Waves]]:
    """Return F, and a random sea whose most curved crest has it."""
    one = random_sea(0.15, TILE, 1)
    cases = {"before": BEFORE, "beyond": BEYOND}
    return {name: (f, one.scaled(f / focus(one, DEPTH))) for name, f in cases.items()}


def maps(context: moderngl.Context, sizes: SeaSizes = FULL, track: Track = silent) -> list[Panel]:
    """Return caustic maps by each splat, over vertices of the sea."""
    panels = []
    for name, (f, waves) in seas().items():
        true = caustic_photons(waves, DEPTH, 0.0, 1.34, PIXELS, sizes.photons)
        drawn = {
            (splat, one): caustic_map(context, waves, splat, one, PIXELS, DEPTH)
            for splat in Splat
            for one in sizes.vertices
        }
        times: dict[tuple[Splat, int], list[float]] = {each: [] for each in drawn}
        for _ in track(range(sizes.turns), f"maps {name} the fold"):
            for (splat, one), taken in times.items():
                taken.append(caustic_map(context, waves, splat, one, PIXELS, DEPTH).milliseconds)
        points = []
        for (splat, one), made in drawn.items():
            off = misfit(made.light, true)
            points.append(
                Point(
                    name,
                    splat.value,
                    str(one),
                    WithSpread.of(times[splat, one]),
                    WithSpread.exactly(off.rms),
                    facts={"vertices": one, "fragments": made.fragments, **off._asdict()},
                )
            )
        title = f"caustic maps of {PIXELS} x {PIXELS} pixels, F = {f:g}, vertices along a side"
        panels.append(Panel(name, title, "time of the map [ms]", ERROR, tuple(points), joined=True))
    return panels


def shafts(sizes: SeaSizes = FULL) -> Panel:
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
            cost, facts = WithSpread.exactly(count), {"pieces": count}
            points.append(Point("shafts", name, str(count), cost, error, worst, facts))
    return Panel("shafts", "shafts over twenty view rays", "samples of a ray [-]", ERROR, tuple(points), joined=True)
