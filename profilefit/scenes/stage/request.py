"""Request of a scene's file: samples, camera and light; and the picture drawn, beside its reference."""

from __future__ import annotations

from typing import Annotated, Any, ClassVar, NamedTuple, Self

import numpy as np
from pydantic import AfterValidator, Field, model_validator

from profilefit.errors import InputError
from profilefit.recipes.declared import LISTED, Declared, OneOf, Refused, Text, words
from profilefit.scenes.stage.judge import TURNS, Judge, RenderResult, points
from profilefit.scenes.stage.pattern import MOST_SAMPLES, Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import NamedTechnique, Technique
from profilefit.scenes.stage.world import INSIDE, Camera, Light, Rgb, Scene, unit

MOST_CHART = 8  # numbers of samples
# The reference sums over all pairs of pixels, six minutes on a core for so many.
MOST_PIXELS = 2**16
NEAREST, FARTHEST = 300.0, 1e4  # of the camera [mm]: the head's band is 122 mm from the middle
LARGEST_VIEW = 1000.0  # [mm]
MOST_LIGHT = 1000.0


def _direction(value: Rgb) -> Rgb:
    if not np.linalg.norm(value) > 1e-6:
        raise Refused("a direction, not 0", list(value))
    return value


Component = Annotated[float, Field(ge=-1e6, le=1e6)]
Direction = Annotated[tuple[Component, Component, Component], LISTED, AfterValidator(_direction)]
Place = Annotated[float, Field(ge=-150.0, le=150.0)]
Irradiance = Annotated[float, Field(ge=0.0, le=MOST_LIGHT)]
Irradiances = Annotated[tuple[Irradiance, Irradiance, Irradiance], LISTED]
Samples = Annotated[int, Field(ge=1, le=MOST_SAMPLES)]
OfChoose = Annotated[Any, words("what `profilefit choose` reads")]
Pixels = Annotated[int, Field(ge=1, le=1024)]
Resolution = Annotated[tuple[Pixels, Pixels], LISTED, words("two whole numbers of pixels in 1 ... 1024")]


class TechniqueTable(Declared):
    """Table [technique]: samples of a pixel; chart  other numbers of samples, whose error and cost are measured."""

    samples: Samples = 16
    chart: Annotated[
        tuple[Samples, ...],
        LISTED,
        Field(max_length=MOST_CHART),
        words(f"at most {MOST_CHART} numbers of samples in 1 ... {MOST_SAMPLES}"),
    ] = ()


class ResolutionTable(Declared):
    """Table [camera]: columns and rows of the picture [pixels]."""

    limit: ClassVar[str] = "which the truth sums over"
    resolution: Resolution = (160, 120)

    @model_validator(mode="after")
    def _few(self) -> Self:
        if self.resolution[0] * self.resolution[1] > MOST_PIXELS:
            raise Refused(f"{MOST_PIXELS} pixels at most, {self.limit}", list(self.resolution), "resolution")
        return self


class CameraTable(ResolutionTable):
    """Table [camera] of a look at a point; what it does not say is the scene's `Viewpoint` [mm]."""

    distance: Annotated[float, Field(ge=NEAREST, le=FARTHEST)] | None = None
    direction: Direction | None = None
    height: Annotated[float, Field(gt=0.0, le=LARGEST_VIEW)] | None = None
    target: Annotated[tuple[Place, Place, Place], LISTED] | None = None


class LightTable(Declared):
    """Table [light]: direction toward the lamp, irradiance of a surface that faces it, and ambient irradiance."""

    direction: Direction = Light().direction
    irradiance: Irradiances = Light().irradiance
    ambient: Irradiances = Scene(()).ambient

    @model_validator(mode="after")
    def _some(self) -> Self:
        if not any((*self.irradiance, *self.ambient)):
            raise InputError("irradiance and ambient must not both be 0: nothing would be seen")
        return self


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


HEAD = Viewpoint((4.0, -6.0, 60.0), 650.0, (-109.0, -4.0, 640.0), 130.0)


class ViewRequest(Declared):
    """Picture that a file requests, in the scene's unit of length."""

    title: Text = ""
    unit: Annotated[str, OneOf("mm")] = "mm"
    technique: TechniqueTable = TechniqueTable()
    camera_table: CameraTable = Field(CameraTable(), alias="camera")
    light_table: LightTable = Field(LightTable(), alias="light")

    @property
    def viewpoint(self) -> Viewpoint:
        """Camera of a file that says nothing."""
        return HEAD

    @property
    def camera(self) -> Camera:
        """Lens and place; without a height the lens stays the same at every distance."""
        table, default = self.camera_table, self.viewpoint
        target, distance = table.target or default.target, table.distance or default.distance
        x, y, z = (np.array(target) + distance * unit(table.direction or default.direction)).tolist()
        return Camera((x, y, z), target, table.height or default.height * distance / default.distance)

    @property
    def light(self) -> Light:
        """Lamp."""
        return Light(self.light_table.direction, self.light_table.irradiance)

    @property
    def ambient(self) -> Rgb:
        """Irradiance from everywhere."""
        return self.light_table.ambient

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows [pixels]."""
        return self.camera_table.resolution

    @property
    def sampling(self) -> Sampling:
        """Samples of a pixel."""
        return Sampling(self.technique.samples)

    @property
    def numbers(self) -> list[int]:
        """Numbers of samples of picture and chart, the least first."""
        return sorted({self.technique.samples, *self.technique.chart})


def draw_lit(stage: Stage, scene: Scene, file: str) -> None:
    """Draw a scene; InputError, with the file, where it shows nothing that light reaches and scatters in."""
    stage.draw(scene)
    buffers = stage.buffers()
    inside = buffers.mask > INSIDE
    if not np.any(buffers.irradiance[inside] > 0):
        raise InputError(f"{file}: the view must show something that light scatters in, and light must reach it")


def rendered(
    stage: Stage, judge: Judge, request: ViewRequest, named: NamedTechnique, seen: Technique | None = None
) -> RenderResult:
    """Return the picture of what a stage has drawn, its reference, error and cost; seen  what else it is shown by."""
    sampling = request.sampling
    chart = points(stage, judge, named, sampling, request.numbers)
    exitance = stage.scatter(named.by, named.mfp, sampling, named.alpha)
    radiance = stage.render(seen or named.by, named.mfp, sampling, named.alpha)
    frame = stage.time(seen or named.by, named.mfp, sampling, TURNS, "frame", named.alpha)
    return judge.result(exitance, chart, sampling.samples, frame, radiance)
