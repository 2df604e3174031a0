"""Sea with waves, seen from below: SEA.toml, drawn with caustics and shafts, beside all light that comes to an eye."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from typing import Any, NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.checks import is_number
from mcml_sim.media.phase import Mixture
from profilefit.errors import InputError
from profilefit.recipes.kinds import phase
from profilefit.recipes.toml_tables import Table, Tables
from profilefit.scenes.sea.caustics import Splat, focus, splat_for
from profilefit.scenes.sea.haze import KINDS
from profilefit.scenes.sea.passes import SeaPasses, axes
from profilefit.scenes.sea.paths import Sunlight, traced
from profilefit.scenes.sea.water import World, checked_lobes
from profilefit.scenes.sea.waves import WIND, Waves, random_floor, random_sea
from profilefit.scenes.stage import request
from profilefit.scenes.stage.judge import TURNS, Judge
from profilefit.scenes.stage.picture import ChartPoint, RenderResult
from profilefit.scenes.stage.renderer import Pass, Renderer
from profilefit.scenes.stage.request import Defaults, ViewRequest
from profilefit.scenes.stage.world import Camera, Light, Rgb

Floats = NDArray[np.float64]
TABLES = {
    "": ("title", "scene", "unit", "water", "sea", "floor", "technique", "camera", "light"),
    "water": ("a", "b", "phase", "n", "source"),
    "sea": ("slope", "tile", "wind", "seed"),
    "floor": ("depth", "slope", "reflectance", "seed"),
    "technique": (
        "kind",
        "splat",
        *request.TABLES["technique"],
        "vertices",
        "texels",
        "slices",
        "steps",
        "supersampling",
    ),
    "camera": ("resolution", "eye", "target", "angle"),
    "light": request.TABLES["light"],
}
PHASE = "petzold"
FORM = "3-terms"  # of its record: four are nearer, and cost a third more
INDEX = 1.34
SLOPE, TILE, SEA_SEED = 0.12, 5.0, 4
DEPTH, FLOOR_SLOPE, FLOOR_SEED, REFLECTANCE = 4.0, 0.08, 2, (0.42, 0.38, 0.30)
AUTO = "auto"
SPLATS = {"points": Splat.POINTS, "wireframe": Splat.WIREFRAME_ENERGY, "faces": Splat.FACES, "cells": Splat.CELLS}
# Of whole numbers in [technique]: least, most, and what is taken if a file says nothing.
RANGES = {
    "vertices": (2, 1024, 128),
    "texels": (2, 1024, 256),
    "slices": (2, 32, 6),
    "steps": (1, 64, 16),
    "supersampling": (1, 8, 2),
}
MOST_ROWS = 16384  # of a column of maps
EYE, TARGET, ANGLE = (6.0, 2.5, -2.2), (0.0, 2.5, -2.4), 1.1
WIDEST = 2.5  # [rad]
DEFAULTS = Defaults(
    samples=12,
    size=(128, 96),
    light=Light((-0.5, 0.0, 0.9), (3.0, 2.9, 2.7)),
    ambient=(0.25, 0.32, 0.42),
    limit="whose truth is traced",
)
LARGEST = 1000.0  # length [m]
MOST_WATER = 100.0  # a coefficient [1/m]
PATHS, MOST_PATHS = 2_000_000, 1024  # of a reference, and of one of its pixels
WHITE = 0.99  # share of the reference that a picture does not clip


@dataclass(frozen=True)
class SeaRequest(ViewRequest):
    """Picture of a sea that a file requests; lengths are metres, and z is up.

    a, b     absorption and scattering of red, green and blue [1/m];  lobes  (weight, g) of the phase function's terms
    n        refractive index;  sea, floor  surfaces, each by (slope, seed), tile and depth [m], wind [m/s]
    kind     of the technique;  splat  by its name, or `AUTO`;  vertices, texels  of a side of maps of light
    slices   maps in depths;  steps  of a search for a hit;  supersampling  views of a pixel along a side, averaged
    """

    a: Rgb
    b: Rgb
    lobes: tuple[tuple[float, float], ...]
    n: float
    tile: float
    slope: float
    wind: tuple[float, float]
    sea_seed: int
    depth: float
    floor_slope: float
    floor_seed: int
    reflectance: Rgb
    kind: str
    splat: str
    vertices: int
    texels: int
    slices: int
    steps: int
    supersampling: int

    @property
    def world(self) -> World:
        """World that it is a picture of."""
        level = -float(self.depth)
        sea, bed = Waves(self.tile), Waves(self.tile, mean=level)
        if self.slope:
            sea = random_sea(self.slope, self.tile, self.sea_seed, wind=self.wind)
        if self.floor_slope:
            bed = random_floor(self.floor_slope, self.tile, self.depth, self.floor_seed)
        x, _, z = self.light.direction
        return World(
            self.a,
            self.b,
            self.lobes,
            self.n,
            sea,
            bed,
            self.reflectance,
            float(np.arctan2(-x, z)),
            self.light.irradiance,
            self.ambient,
        )

    @property
    def splats(self) -> tuple[Splat, Splat]:
        """Splats of the floor's map, and of those in depths."""
        if self.splat != AUTO:
            return (SPLATS[self.splat],) * 2
        world = self.world
        f = focus(world.sea, world.depth, world.n, world.tilt)
        return (splat_for(f),) * 2


def read(file: str, content: Table) -> SeaRequest:
    """Return the request of a file; InputError with file, table and key, what was got and what is accepted."""
    tables = Tables(file, TABLES)
    tables.known("", content)
    for key in ("title", "unit"):
        tables.text("", key, content, "m")
    water, sea, floor, named = (tables.table(content, name, {}) for name in list(TABLES)[1:5])
    for key in ("a", "b"):
        if key not in water:
            raise tables.bad("water", key, f"three numbers in 0 ... {MOST_WATER:g} [1/m]", None)
    if "source" not in water:
        raise tables.bad("water", "source", "a text that says where a and b are from", None)
    tables.text("water", "source", water)
    numbers: dict[str, Any] = {
        key: tables.whole("technique", key, named, default, least, most)
        for key, (least, most, default) in RANGES.items()
    }
    found = SeaRequest(
        **request.view(tables, content, _camera, DEFAULTS, _toward),
        **numbers,
        a=tables.three("water", "a", water, (0.0,) * 3, 0.0, MOST_WATER),
        b=tables.three("water", "b", water, (0.0,) * 3, 0.0, MOST_WATER),
        lobes=_lobes(tables, water),
        n=tables.number("water", "n", water, INDEX, 2.0),
        tile=tables.number("sea", "tile", sea, TILE, LARGEST),
        slope=_slope(tables, "sea", sea, SLOPE),
        wind=_wind(tables, sea),
        sea_seed=tables.whole("sea", "seed", sea, SEA_SEED, 0, 2**31),
        depth=tables.number("floor", "depth", floor, DEPTH, LARGEST),
        floor_slope=_slope(tables, "floor", floor, FLOOR_SLOPE),
        floor_seed=tables.whole("floor", "seed", floor, FLOOR_SEED, 0, 2**31),
        reflectance=tables.three("floor", "reflectance", floor, REFLECTANCE, 0.0, 1.0),
        kind=tables.text("technique", "kind", named, KINDS[0], KINDS),
        splat=tables.text("technique", "splat", named, AUTO, (AUTO, *SPLATS)),
    )
    if found.texels * found.slices > MOST_ROWS:
        accepted = f"so many that texels times slices is {MOST_ROWS} at most"
        raise tables.bad("technique", "slices", accepted, found.slices)
    try:
        world = found.world
    except InputError as error:
        raise InputError(f"{file}: {error}") from None
    _require_sight(tables, found, world)
    return found


def _camera(tables: Tables, seen: Table) -> Camera:
    eye = tables.three("camera", "eye", seen, EYE, -LARGEST, LARGEST)
    target = tables.three("camera", "target", seen, TARGET, -LARGEST, LARGEST)
    if not np.hypot(*np.subtract(target, eye)[:2]) > 1e-3 * abs(target[2] - eye[2]):
        raise tables.bad("camera", "target", "a point that is not straight above or below the eye", list(target))
    angle = tables.number("camera", "angle", seen, ANGLE)
    if angle > WIDEST:
        raise tables.bad("camera", "angle", f"the picture's height as an angle in 0 ... {WIDEST:g} radians", angle)
    return Camera(eye, target, float(2.0 * np.tan(0.5 * angle) * np.linalg.norm(np.subtract(target, eye))))


def _toward(tables: Tables, lit: Table, default: Rgb) -> Rgb:
    direction = tables.three("light", "direction", lit, default, -1e6, 1e6)
    x, y, z = direction
    if not (x <= 0 and y == 0 and z > 0):
        accepted = "toward the sun, [x <= 0, 0, z > 0]: its light goes toward +x"
        raise tables.bad("light", "direction", accepted, list(direction))
    return direction


def _lobes(tables: Tables, water: Table) -> tuple[tuple[float, float], ...]:
    named: Any = water.get("phase", PHASE)
    if isinstance(named, str):
        return tables.build("water", lambda: lobes_of(named))
    tables.build("water", lambda: checked_lobes(named))
    return tuple((float(weight), float(g)) for weight, g in named)


def lobes_of(name: str) -> tuple[tuple[float, float], ...]:
    """Return (weight, g) of the terms fitted to a phase function that has a record. InputError."""
    found = phase.named(name).phase(FORM)
    assert isinstance(found, Mixture)
    return tuple((float(w), float(one.mean_cosine)) for w, one in zip(found.weights, found.phases, strict=True))


def _slope(tables: Tables, where: str, table: Table, default: float) -> float:
    """Return the root mean square of a slope, 0 of a level surface."""
    value = table.get("slope", default)
    return 0.0 if value == 0 else tables.number(where, "slope", table, default, 2.0)


def _wind(tables: Tables, sea: Table) -> tuple[float, float]:
    value = sea.get("wind", [WIND, 0.0])
    numbers = value if isinstance(value, list) else []
    if len(numbers) != 2 or not all(is_number(one) and abs(one) <= 100 for one in numbers) or not any(numbers):
        raise tables.bad("sea", "wind", "two speeds in -100 ... 100 [m/s], not both 0", value)
    return float(numbers[0]), float(numbers[1])


def _require_sight(tables: Tables, of: SeaRequest, world: World) -> None:
    z = of.camera.eye[2]
    if not world.floor.highest < z < world.sea.lowest:
        accepted = f"in the water, with z in {world.floor.highest:.3g} ... {world.sea.lowest:.3g} m"
        raise tables.bad("camera", "eye", accepted, list(of.camera.eye))
    of.require_light()


class SeaRender(NamedTuple):
    """Scene with its maps of light and its judge; row 0 at the bottom."""

    request: SeaRequest
    passes: SeaPasses
    judge: Judge

    def picture(self, kind: str, samples: int) -> Floats:
        """Return the radiance (h, w, 3) of pixels by a technique."""
        (columns, rows), fine = self.request.size, self.request.supersampling
        views = self.passes.renderer.image(self._view(kind, samples))[..., :3].astype(float)
        return views.reshape(rows, fine, columns, fine, 3).mean(axis=(1, 3))

    def time(self, kind: str, samples: int) -> float:
        """Return the milliseconds of a view's pass, which was drawn before."""
        return self.passes.renderer.time(self._view(kind, samples))

    def light(self) -> dict[str, float]:
        """Draw all maps of light, and return the milliseconds of the floor's, and of those in depths."""
        return {name: self.passes.renderer.time(*own) for name, own in self.passes.light.items()}

    def points(self, kind: str, numbers: Sequence[int], turns: int = TURNS) -> list[ChartPoint]:
        """Return error and cost of each number of samples; time is of the view's pass."""
        draw, time = (lambda count: self.picture(kind, count)), (lambda count: self.time(kind, count))
        return self.judge.points(kind, numbers, draw, time, turns)

    def _view(self, kind: str, samples: int) -> Pass:
        of, fine = self.request, self.request.supersampling
        return self.passes.view(of.camera, (of.size[0] * fine, of.size[1] * fine), kind, samples, of.steps)


@contextmanager
def reference_render(context: moderngl.Context, of: SeaRequest, paths: int = PATHS) -> Iterator[SeaRender]:
    """Open the passes and the reference image of a request; paths  of the reference, all pixels together."""
    world = of.world
    with Renderer(context, of.size) as renderer:
        passes = SeaPasses(renderer, world, of.splats, of.vertices, of.texels, of.slices)
        drawn = SeaRender(of, passes, Judge.of_halves(halves_of(of, world, paths), WHITE))
        drawn.light()
        yield drawn


def halves_of(of: SeaRequest, world: World, paths: int = PATHS, seed: int = 0) -> Floats:
    """Return (2, h, w, 3) halves of the radiance that the camera sees, row 0 at the bottom."""
    columns, rows = of.size
    each = 2 * int(np.clip(paths / (2 * columns * rows), 1, MOST_PATHS // 2))
    right, up, forward = axes(of.camera, of.size)
    x, y = (2.0 * np.arange(count) / count - 1.0 for count in of.size)
    corner = forward + x[None, :, None] * right + y[:, None, None] * up
    sides = 2.0 * right / columns, 2.0 * up / rows
    eye = np.array(of.camera.eye)
    light = traced(world, Sunlight(world), eye, corner.reshape(-1, 3), *sides, paths=each, seed=seed)
    return light.halves.reshape(2, rows, columns, 3)


def draw(context: moderngl.Context, of: SeaRequest) -> RenderResult:
    """Draw the picture beside its reference, with error and cost: a minute."""
    with reference_render(context, of) as drawn:
        chart, samples = drawn.points(of.kind, of.numbers), of.sampling.samples
        view = next(point.milliseconds for point in chart if point.samples == samples)
        maps = [drawn.light() for _ in range(TURNS)]
        passes = {**{name: tuple(one[name] for one in maps) for name in maps[0]}, "view": view}
        frame = tuple(map(sum, zip(*passes.values(), strict=True)))
        picture = drawn.picture(of.kind, samples)
        return drawn.judge.result(picture, chart, samples, frame, of="light", passes=passes)
