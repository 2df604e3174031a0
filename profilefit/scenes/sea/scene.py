"""Sea with waves, seen from below: SEA.toml, drawn with caustics and shafts, beside all light that comes to an eye."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import cached_property, partial
from typing import Annotated, Any, ClassVar, NamedTuple, Self

import moderngl
import numpy as np
from pydantic import Field, model_validator

from mcml_sim.media.arrays import Floats
from mcml_sim.media.phase import Mixture
from profilefit.recipes.declared import LISTED, Declared, OneOf, Refused, Seed, Shares, Text, words
from profilefit.recipes.kinds import phase
from profilefit.scenes.sea.caustics import Splat, focus, splat_for
from profilefit.scenes.sea.haze import KINDS
from profilefit.scenes.sea.passes import SeaPasses, axes
from profilefit.scenes.sea.paths import Sunlight, traced
from profilefit.scenes.sea.water import JERLOV, Jerlov, World, checked_lobes
from profilefit.scenes.sea.waves import WIND, Waves, random_floor, random_sea
from profilefit.scenes.stage import request
from profilefit.scenes.stage.drawing import Drawer, RayDrawing
from profilefit.scenes.stage.judge import TURNS, ChartPoint, Judge, exposure_of
from profilefit.scenes.stage.reference.surface import averaged
from profilefit.scenes.stage.renderer import Pass, Renderer
from profilefit.scenes.stage.world import Camera

PHASE = "petzold"
FORM = "3-terms"  # of its record: four are nearer, and cost a third more
INDEX = 1.34
AUTO = "auto"
SPLATS = {"points": Splat.POINTS, "wireframe": Splat.WIREFRAME_ENERGY, "faces": Splat.FACES, "cells": Splat.CELLS}
MOST_ROWS = 16384  # of a column of maps
WIDEST = 2.5  # [rad]
LARGEST = 1000.0  # length [m]
MOST_WATER = 100.0  # a coefficient [1/m]
PATHS, MOST_PATHS = 6_000_000, 1024  # of a reference, and of one of its pixels
LOOKS = 4  # at the shafts, of a step: one leaves half of the error's square
WHITE = 0.99  # share of the reference that a picture does not clip

COLOURS = f"three numbers in 0 ... {MOST_WATER:g} [1/m]"
WATERS = {"a": COLOURS, "b": COLOURS, "source": "a text that says where a and b are from"}  # of one's own water


Coefficient = Annotated[float, Field(ge=0.0, le=MOST_WATER)]
Coefficients = Annotated[tuple[Coefficient, Coefficient, Coefficient], LISTED, words(COLOURS)]
Slope = Annotated[float, Field(ge=0.0, le=2.0)]
Length = Annotated[float, Field(gt=0.0, le=LARGEST)]
Coordinate = Annotated[float, Field(ge=-LARGEST, le=LARGEST)]
Point = Annotated[tuple[Coordinate, Coordinate, Coordinate], LISTED]
Speed = Annotated[float, Field(ge=-100.0, le=100.0)]
Side = Annotated[int, Field(ge=2, le=1024)]
WINDS = "two speeds in -100 ... 100 [m/s], not both 0"


class WaterTable(Declared):
    """Table [water]: a type by Jerlov, or absorption `a` and scattering `b` of red, green and blue, and their source.

    phase  a fitted one by its name, or pairs [weight, g] of Henyey and Greenstein's terms;  n  refractive index
    """

    type: Annotated[str, OneOf(*JERLOV)] = "IB"
    a: Coefficients | None = None
    b: Coefficients | None = None
    phase: Annotated[
        str | Annotated[list[Any], LISTED], words("the name of a phase function, or pairs [weight, g]")
    ] = PHASE
    n: Annotated[float, Field(gt=0.0, le=2.0)] = INDEX
    source: Annotated[Text, words(WATERS["source"])] | None = None

    @property
    def coefficients(self) -> Jerlov:
        """Absorption and scattering of red, green and blue [1/m]."""
        return JERLOV[self.type] if self.a is None or self.b is None else Jerlov(self.a, self.b)

    @cached_property
    def lobes(self) -> tuple[tuple[float, float], ...]:
        """Weight and g of the phase function's terms."""
        if isinstance(self.phase, str):
            return lobes_of(self.phase)
        checked_lobes(self.phase)
        return tuple((float(weight), float(g)) for weight, g in self.phase)

    @model_validator(mode="after")
    def _known(self) -> Self:
        given = [key for key in WATERS if getattr(self, key) is not None]
        for key in WATERS if given else ():
            if key not in given:
                raise Refused(WATERS[key], None, key)
        if given and "type" in self.model_fields_set:
            raise Refused("left out where a and b are given", self.type, "type")
        _ = self.lobes
        return self


class SeaTable(Declared):
    """Table [sea]: root mean square slope [-], side of the tile [m], wind [m/s]; time  for which waves move [s]."""

    slope: Slope = 0.17
    tile: Length = 3.0
    wind: Annotated[tuple[Speed, Speed], LISTED, words(WINDS)] = (WIND, 0.0)
    seed: Seed = 7
    time: request.Seconds = 0.0

    @model_validator(mode="after")
    def _blows(self) -> Self:
        if not any(self.wind):
            raise Refused(WINDS, list(self.wind), "wind")
        return self


class FloorTable(Declared):
    """Table [floor]: mean depth [m], root mean square slope [-], reflectance of red, green and blue [-]."""

    depth: Length = 8.0
    slope: Slope = 0.08
    reflectance: Shares = (0.42, 0.38, 0.30)
    seed: Seed = 2


class SeaTechnique(request.TechniqueTable):
    """Table [technique]: kind;  splat  of the maps of light, by its name;  vertices, texels  of a side of these.

    slices  maps in depths;  steps  of a search for a hit;  supersampling  views of a pixel along a side, averaged
    """

    kind: Annotated[str, OneOf(*KINDS)] = KINDS[0]
    splat: Annotated[str, OneOf(AUTO, *SPLATS)] = AUTO
    samples: request.Samples = 24
    vertices: Side = 128
    texels: Side = 256
    slices: Annotated[int, Field(ge=2, le=32)] = 16
    steps: Annotated[int, Field(ge=1, le=64)] = 16
    supersampling: Annotated[int, Field(ge=1, le=8)] = 2

    @model_validator(mode="after")
    def _fits(self) -> Self:
        if self.texels * self.slices > MOST_ROWS:
            raise Refused(f"so many that texels times slices is {MOST_ROWS} at most", self.slices, "slices")
        return self


class SeaCamera(request.ResolutionTable):
    """Table [camera]: eye and target [m];  angle  the picture's height [rad]."""

    reference_pixel: Annotated[int, Field(ge=1, le=16)] = 5
    eye: Point = (6.0, 2.5, -6.4)
    target: Point = (2.0, 2.5, -5.7)
    angle: Annotated[
        float, Field(gt=0.0, le=WIDEST), words(f"the picture's height as an angle in 0 ... {WIDEST:g} radians")
    ] = 1.3

    @model_validator(mode="after")
    def _aslant(self) -> Self:
        x, y, z = np.subtract(self.target, self.eye)
        if not np.hypot(x, y) > 1e-3 * abs(z):
            raise Refused("a point that is not straight above or below the eye", list(self.target), "target")
        return self


class SeaLight(request.OneLampTable):
    """Table [light]: direction toward the sun."""

    direction: request.Direction = (-0.6, 0.0, 0.8)
    irradiance: request.Irradiances = (3.0, 2.9, 2.7)
    ambient: request.Irradiances = (0.04, 0.06, 0.09)

    @model_validator(mode="after")
    def _along(self) -> Self:
        x, y, z = self.direction
        if not (x <= 0 and y == 0 and z > 0):
            accepted = "toward the sun, [x <= 0, 0, z > 0]: its light goes toward +x"
            raise Refused(accepted, list(self.direction), "direction")
        return self


class SeaRequest(request.ViewRequest):
    """Picture of a sea that a file requests; lengths are metres, and z is up."""

    moving: ClassVar[str] = "sea"
    scene: Annotated[str, OneOf("sea")] = "sea"
    unit: Text = "m"
    water: WaterTable = Field(default_factory=WaterTable)
    sea: SeaTable = SeaTable()
    floor: FloorTable = FloorTable()
    technique: SeaTechnique = SeaTechnique()
    camera_table: SeaCamera = Field(SeaCamera(), alias="camera")  # type: ignore[assignment]
    light_table: SeaLight = Field(SeaLight(), alias="light")  # type: ignore[assignment]

    @property
    def camera(self) -> Camera:
        """Lens and place."""
        eye, target = self.camera_table.eye, self.camera_table.target
        away = np.linalg.norm(np.subtract(target, eye))
        return Camera(eye, target, float(2.0 * np.tan(0.5 * self.camera_table.angle) * away))

    @property
    def world(self) -> World:
        """World that it is a picture of."""
        water, sea, floor = self.water, self.sea, self.floor
        waves, bed = Waves(sea.tile), Waves(sea.tile, mean=-float(floor.depth))
        if sea.slope:
            waves = random_sea(sea.slope, sea.tile, sea.seed, sea.wind).after(sea.time, sea.wind, floor.depth)
        if floor.slope:
            bed = random_floor(floor.slope, sea.tile, floor.depth, floor.seed)
        x, _, z = self.light.direction
        tilt = float(np.arctan2(-x, z))
        sun, sky = self.light.irradiance, self.ambient
        a, b = water.coefficients
        return World(a, b, water.lobes, water.n, waves, bed, floor.reflectance, tilt, sun, sky)

    @property
    def splat(self) -> Splat:
        """Splat of all maps of light."""
        if self.technique.splat != AUTO:
            return SPLATS[self.technique.splat]
        world = self.world
        return splat_for(focus(world.sea, world.depth, world.n, world.tilt))

    @model_validator(mode="after")
    def _in_water(self) -> Self:
        world, z = self.world, self.camera.eye[2]
        if not world.floor.highest < z < world.sea.lowest:
            accepted = f"in the water, with z in {world.floor.highest:.3g} ... {world.sea.lowest:.3g} m"
            raise Refused(accepted, list(self.camera.eye), "camera", "eye")
        return self


read = SeaRequest.of


def lobes_of(name: str) -> tuple[tuple[float, float], ...]:
    """Return (weight, g) of the terms fitted to a phase function that has a record. InputError."""
    found = phase.named(name).phase(FORM)
    assert isinstance(found, Mixture)
    return tuple((float(w), float(one.mean_cosine)) for w, one in zip(found.weights, found.phases, strict=True))


class SeaRender(NamedTuple):
    """Scene with its maps of light and its judge; row 0 at the bottom."""

    request: SeaRequest
    passes: SeaPasses
    judge: Judge

    def picture(self, kind: str, samples: int) -> Floats:
        """Return the radiance (h, w, 3) of pixels by a technique."""
        views = self.passes.renderer.image(self._view(kind, samples))[..., :3].astype(float)
        return averaged(views, self.request.technique.supersampling)

    def maps(self) -> dict[str, float]:
        """Draw all maps of light, and return the milliseconds of the floor's, and of those in depths."""
        return {name: self.passes.renderer.time(*own) for name, own in self.passes.light.items()}

    def points(self, kind: str, numbers: Sequence[int], turns: int = TURNS) -> list[ChartPoint]:
        """Return error and cost of each number of samples; time is of the view's pass."""
        return self.judge.points(kind, numbers, partial(self.picture, kind), partial(self.time, kind), turns)

    def time(self, kind: str, samples: int) -> float:
        """Return the milliseconds of the view's pass."""
        return self.passes.renderer.time(self._view(kind, samples))

    def _view(self, kind: str, samples: int) -> Pass:
        of, fine = self.request, self.request.technique.supersampling
        size = of.size[0] * fine, of.size[1] * fine
        return self.passes.view(of.camera, size, kind, samples, of.technique.steps, fine, LOOKS)


@contextmanager
def reference_render(context: moderngl.Context, of: SeaRequest, paths: int = PATHS) -> Iterator[SeaRender]:
    """Open the passes and the reference image of a request; paths  of the reference in all, 0 for no reference."""
    world, named = of.world, of.technique
    with Renderer(context, of.size) as renderer:
        passes = SeaPasses(renderer, world, of.splat, named.vertices, named.texels, named.slices)
        halves = halves_of(of, world, paths) if paths else np.ones((2, of.size[1], of.size[0], 3))
        drawn = SeaRender(of, passes, Judge.of_halves(halves, WHITE))
        drawn.maps()
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
    halves = traced(world, Sunlight(world), eye, corner.reshape(-1, 3), *sides, paths=each, seed=seed)
    return halves.reshape(2, rows, columns, 3)


@contextmanager
def opened(context: moderngl.Context, of: SeaRequest, has_reference: bool) -> Iterator[RayDrawing]:
    """Open the drawing of a request."""
    with reference_render(context, of, PATHS if has_reference else 0) as drawn:
        judge = drawn.judge if has_reference else None
        yield RayDrawing(drawn, judge, lambda of: (of.technique.kind,) * 2, partial(exposure_of, white=WHITE))


drawer = Drawer(opened, ({"kind": "scaled"}, {"kind": "single"}, {"kind": "broadened"}), "light")
draw, picture = drawer.draw, drawer.picture
