"""Furred ball: FUR.toml, its strands, shading and camera, drawn in layers beside rays against each strand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import Annotated, ClassVar, Literal, NamedTuple, Self

import moderngl
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from mcml_sim.media.arrays import Floats
from profilefit.recipes.declared import LISTED, Declared, OneOf, Refused, Seed, Shares, Text, Tolerance, words
from profilefit.scenes.fur.ball import NOTHING, Ball, FurView, random_ball
from profilefit.scenes.fur.passes import HITS, Coat, FurSurface, ShadingTable
from profilefit.scenes.fur.ways import FITTED, SWEPT, SWEPT_TWO, WALKED, LayerTechnique
from profilefit.scenes.stage.drawing import Drawer, RayDrawing
from profilefit.scenes.stage.judge import TURNS, ChartPoint, Judge, exposure_of
from profilefit.scenes.stage.reference.surface import UNKNOWN, TruthError, averaged
from profilefit.scenes.stage.renderer import Pass, Renderer
from profilefit.scenes.stage.request import (
    Direction,
    Irradiances,
    LightTable,
    Samples,
    Seconds,
    TechniqueTable,
    Viewpoint,
    ViewRequest,
)
from profilefit.scenes.stage.world import Rgb, rgb

KINDS = ("walked", "swept", "shells")
VIEW = Viewpoint((0.0, -4.0, 0.0), 650.0, (0.0, 0.0, 1.0), 84.0)
LARGEST = 150.0  # of the ball, and of strands [mm]
SLENDEREST = 640.0  # the ball's radius over a strand's: what a map of them resolves
MOST_STRANDS, MOST_CLUMPS = 1 << 18, 1 << 13
MOST_FORCE = 0.9
WHITE = 0.99  # of the ball's pixels, the brightest of which becomes white


Length = Annotated[float, Field(gt=0.0, le=LARGEST)]
Force = Annotated[float, Field(ge=-MOST_FORCE, le=MOST_FORCE)]


class FurTable(Declared):
    """Table [fur]: strands of a ball's skin.

    density  of strands [1/mm^2];  radius, length  of a strand [mm], along the skin's normal
    force    displacement of the tips, over the length [-];  ball  its radius [mm];  colour, skin  reflectances
    clumps   density of clumps, 0 for none [1/mm^2];  gather  share of the way to its clump's centre that a tip is moved
    gust     largest displacement that wind adds, over the length [-], as a sine of period [s] at a time [s]
    """

    density: Annotated[float, Field(gt=0.0)] = 19.2
    radius: Length = 0.05
    length: Length = 12.0
    force: Annotated[tuple[Force, Force, Force], LISTED] = (0.3, -0.7, 0.0)
    gust: Annotated[tuple[Force, Force, Force], LISTED] = (0.1, 0.05, 0.0)
    period: Annotated[float, Field(gt=0.0, le=1e3)] = 2.0
    time: Seconds = 0.0
    clumps: Annotated[float, Field(ge=0.0)] = 0.6
    gather: Annotated[float, Field(ge=0.0, le=0.9)] = 0.75
    ball: Length = 27.0
    colour: Shares = (0.62, 0.38, 0.18)
    skin: Shares = (0.35, 0.22, 0.16)
    seed: Seed = 1

    @property
    def count(self) -> int:
        """Number of strands."""
        return max(round(self.density * self.area), 1)

    @property
    def area(self) -> float:
        """Area of the skin [mm^2]."""
        return float(4.0 * np.pi * self.ball**2)

    @property
    def strands(self) -> Ball:
        """Strands at the time."""
        of = self.count, self.ball, self.radius, self.length, self.lean, self.seed
        return random_ball(*of, round(self.clumps * self.area), self.gather)

    @property
    def reach(self) -> float:
        """Distance from the ball's middle that no tip is beyond [mm]."""
        return self.ball + self.length * (1.0 + float(np.linalg.norm(self.force) + np.linalg.norm(self.gust)))

    @property
    def lean(self) -> Rgb:
        """Displacement of the tips at the time, over the length [-]."""
        return rgb(np.add(self.force, np.sin(2.0 * np.pi * self.time / self.period) * np.array(self.gust)))

    @model_validator(mode="after")
    def _sound(self) -> Self:
        spacing, area = self.density**-0.5, self.area
        if self.radius > spacing:
            accepted = f"at most the strands' mean distance, 1 / sqrt(density) = {spacing:.4g} mm"
            raise Refused(accepted, self.radius, "radius")
        if self.ball > SLENDEREST * self.radius:
            raise Refused(f"at most {SLENDEREST:g} times the strands' radius", self.ball, "ball")
        if not self.density * area <= MOST_STRANDS:
            most = f"{MOST_STRANDS} at most, {MOST_STRANDS / area:.4g}"
            raise Refused(f"so many strands [1/mm^2] that the ball has {most}", self.density, "density")
        if not self.clumps * area <= MOST_CLUMPS:
            most = f"{MOST_CLUMPS} at most, {MOST_CLUMPS / area:.4g}"
            raise Refused(f"so many clumps [1/mm^2] that the ball has {most}", self.clumps, "clumps")
        accepted = f"three numbers whose root of squares is {MOST_FORCE:g} at most"
        if not np.linalg.norm(self.force) <= MOST_FORCE:
            raise Refused(accepted, list(self.force), "force")
        if not np.linalg.norm(self.force) + np.linalg.norm(self.gust) <= MOST_FORCE:
            raise Refused(f"{accepted}, together with the force's", list(self.gust), "gust")
        return self


class FurTechnique(TechniqueTable):
    """Table [technique]; its samples are layers.

    kind      a ray is held against strands in even steps, in layers, or against their discs on shells
    strands   that a step or a swept layer tests;  exponent  of the shells' opacity
    tolerance  of `choose`: rms error of the heights of hits over the length [-]
    supersampling  rays of a pixel along a side, averaged
    """

    kind: Annotated[str, OneOf(*KINDS)] = KINDS[0]
    samples: Samples = 128
    strands: Annotated[int, Field(ge=1, le=2)] = 2
    exponent: Annotated[
        Annotated[float, Field(gt=0.0, le=100.0)] | Literal["fitted"],
        words(f'a number > 0 and <= 100, or "{FITTED.name}"'),
    ] = "fitted"
    tolerance: Tolerance = 0.05
    supersampling: Annotated[int, Field(ge=1, le=8)] = 4

    @property
    def way(self) -> LayerTechnique:
        """Technique of drawing layers."""
        if self.kind == "walked":
            return WALKED._replace(tested=self.strands)
        if self.kind == "swept":
            return (SWEPT, SWEPT_TWO)[self.strands - 1]
        if isinstance(self.exponent, str):
            return FITTED
        return LayerTechnique(f"shells, p = {self.exponent:g}", self.exponent)

    @model_validator(mode="after")
    def _of_kind(self) -> Self:
        other = "strands" if self.kind == "shells" else "exponent"
        if other in self.model_fields_set:
            raise Refused(f"left out where kind is {self.kind}", getattr(self, other), other)
        return self


class FurLight(LightTable):
    """Table [light]: from above, beside the eye."""

    direction: Direction = (-0.60, 0.60, 0.55)
    irradiance: Irradiances = (4.4, 4.1, 3.6)
    ambient: Irradiances = (0.30, 0.34, 0.40)


class FurRequest(ViewRequest):
    """Picture of a furred ball that a file requests."""

    moving: ClassVar[str] = "fur"
    scene: Annotated[str, OneOf("fur")] = "fur"
    unit: Text = "mm"
    fur: FurTable = FurTable()
    shading_table: ShadingTable = Field(ShadingTable(), alias="shading")
    technique: FurTechnique = FurTechnique()
    light_table: FurLight = Field(FurLight(), alias="light")

    @property
    def viewpoint(self) -> Viewpoint:
        """Camera of a file that says nothing."""
        return VIEW

    @model_validator(mode="after")
    def _outside(self) -> Self:
        least = 1.1 * self.fur.reach
        if np.linalg.norm(self.camera.eye) < least:
            accepted = f"so long that the eye is {least:.4g} mm from the ball's middle"
            raise Refused(accepted, self.camera.distance, "camera", "distance")
        return self


read = FurRequest.of


class FurRender(NamedTuple):
    """Furred ball with its passes and its reference.

    Attributes:
        request: of the file.
        renderer: with a pixel a ray.
        surface: of the ball.
        shade: passes from hits to radiance.
        view: of the camera.
        fine: (rows, columns, 3) radiance of the reference at each ray, row 0 at the bottom.
        judge: of pixels that see the ball or its fur.
    """

    request: FurRequest
    renderer: Renderer
    surface: FurSurface
    shade: tuple[Pass, ...]
    view: FurView
    fine: Floats
    judge: Judge

    def picture(self, by: LayerTechnique, layers: int) -> Floats:
        """Return the radiance (h, w, 3) of pixels by a technique."""
        rays = self.renderer.image(*self._passes(by, layers))
        return averaged(rays[..., :3].astype(float), self.request.technique.supersampling)

    def points(self, by: LayerTechnique, layers: Sequence[int], turns: int = TURNS) -> list[ChartPoint]:
        """Return error and cost of each number of layers; time is of both passes."""
        return self.judge.points(by.name, layers, partial(self.picture, by), partial(self.time, by), turns)

    def time(self, by: LayerTechnique, layers: int) -> float:
        """Return the milliseconds of all passes."""
        return self.renderer.time(*self._passes(by, layers))

    def maps(self) -> dict[str, float]:
        """Return nothing: no map is drawn before the picture."""
        return {}

    def _passes(self, by: LayerTechnique, layers: int) -> tuple[Pass, ...]:
        return self.surface.layered(self.view, by, layers), *self.shade


@contextmanager
def reference_render(context: moderngl.Context, of: FurRequest, has_reference: bool = True) -> Iterator[FurRender]:
    """Open the passes and the reference image of a request; without one, its judge is not to be used."""
    fur, each = of.fur, of.technique.supersampling
    ball = fur.strands
    size, view = (of.size[0] * each, of.size[1] * each), FurView.of(of.camera, of.size)
    light, colours = of.light_table, (fur.colour, fur.skin)
    coat = Coat(ball, fur.density, *colours, of.light, of.ambient, of.shading_table, light.lamps, light.sky)
    shade = tuple(coat.shades(view))
    with Renderer(context, size) as renderer:
        hits = ball.cast(view, size) if has_reference else np.ones((size[1], size[0], 4), np.float32)
        renderer.write(HITS, hits)
        fine = renderer.image(*shade)[..., :3].astype(float)
        mask = averaged((hits[..., 3:] > NOTHING).astype(float), each)[..., 0] > 0
        reference = averaged(fine, each)
        exposure = _exposure(reference[mask])
        error = _standard_error(fine, each, mask) if each > 1 else UNKNOWN
        judge = Judge(reference, mask, error, exposure)
        yield FurRender(of, renderer, FurSurface.of_ball(ball), shade, view, fine, judge)


def _standard_error(fine: Floats, each: int, mask: NDArray[np.bool_]) -> TruthError:
    """Return the standard errors of pixels by those of their rays: two halves, as on a chess board."""
    rows, columns, _ = fine.shape
    board = (np.add.outer(np.arange(rows), np.arange(columns)) % 2).astype(float)[..., None]
    count = averaged(board, each)
    halves = averaged(fine * board, each) / count - averaged(fine * (1.0 - board), each) / (1.0 - count)
    mean = np.mean(averaged(fine, each)[mask])
    return TruthError.of(0.5 * np.sqrt(np.mean(halves**2, axis=-1))[mask] / mean)


def _exposure(radiance: Floats) -> float:
    brightest = radiance.max(axis=-1)
    shown = brightest[brightest > 0.0]  # the background is black
    return exposure_of(shown if shown.size else brightest, WHITE)


@contextmanager
def opened(context: moderngl.Context, of: FurRequest, has_reference: bool) -> Iterator[RayDrawing]:
    """Open the drawing of a request."""
    with reference_render(context, of, has_reference) as drawn:
        judge = drawn.judge if has_reference else None
        yield RayDrawing(drawn, judge, lambda of: (of.technique.way.name, of.technique.way), _exposure)


SHELLS = {"kind": "shells", "exponent": 1.0}
drawer = Drawer(opened, ({"kind": "swept"}, SHELLS, {"kind": "walked"}), "the fur's light")
draw, picture = drawer.draw, drawer.picture
