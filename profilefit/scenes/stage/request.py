"""Request of a scene's file: samples, camera and light; and the picture drawn, beside its reference."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Annotated, Any, ClassVar, NamedTuple, Self, TypeVar

import numpy as np
from pydantic import AfterValidator, BeforeValidator, Field, PrivateAttr, ValidationInfo, model_validator

from profilefit.errors import InputError
from profilefit.recipes.declared import LISTED, Declared, Line, OneOf, Refused, Text, words
from profilefit.scenes.stage.light.environment import Environment, read_map
from profilefit.scenes.stage.pattern import MOST_SAMPLES, Sampling
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.subject.mesh_file import MeshTable
from profilefit.scenes.stage.world import INSIDE, MOST_LAMPS, Camera, Light, Rgb, Scene, unit

MOST_CHART = 8  # numbers of samples
MOST_SIDE, MOST_RAYS = 4096, 16384  # of a picture [pixels], and rays along a side, as many as OpenGL's maps have texels
# Of a reference: two minutes on two cores for a head that fills half of them, and 3.4 GB of memory at 1920 x 1080. Its
# error takes more of both: 4.4 GB at 1280 x 720.
MOST_PIXELS = 2**21
NEAREST, FARTHEST = 300.0, 1e4  # of the camera [mm]: the head's band is 122 mm from the middle
LARGEST_VIEW = 1000.0  # [mm]
FAR_OFF, MARGIN = 3.0, 1.2  # distance to a mesh, and height of its view, in its size
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
Seconds = Annotated[float, Field(ge=0.0, le=1e4)]
Samples = Annotated[int, Field(ge=1, le=MOST_SAMPLES)]
OfChoose = Annotated[Any, words("what `profilefit choose` reads")]
Pixels = Annotated[int, Field(ge=1, le=MOST_SIDE)]
Resolution = Annotated[tuple[Pixels, Pixels], LISTED, words(f"two whole numbers of pixels in 1 ... {MOST_SIDE}")]


AnyScene = TypeVar("AnyScene", bound=Scene)
ENVIRONMENT = "a map of radiance over latitude and longitude, a .hdr or .exr of at most 8192 x 4096 pixels"
OF_ENVIRONMENT = ("rotation", "scale")


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
    """Table [camera]: columns and rows of the picture; side of a pixel of the reference and its errors [pixels]."""

    resolution: Resolution = (960, 540)
    reference_pixel: Annotated[int, Field(ge=1, le=16)] = 2


class CameraTable(ResolutionTable):
    """Table [camera] of a look at a point; what it does not say is the scene's `Viewpoint` [mm]."""

    distance: Annotated[float, Field(ge=NEAREST, le=FARTHEST)] | None = None
    direction: Direction | None = None
    height: Annotated[float, Field(gt=0.0, le=LARGEST_VIEW)] | None = None
    target: Annotated[tuple[Place, Place, Place], LISTED] | None = None


class LampTable(Declared):
    """Table [[light.more]]: another lamp, direction toward it, and irradiance of a surface that faces it."""

    direction: Direction
    irradiance: Irradiances


def _few(content: Any) -> Any:
    """Return tables [[light.more]] before they are looked at; Refused where there are too many."""
    if isinstance(content, list) and len(content) >= MOST_LAMPS:
        raise Refused(f"at most {MOST_LAMPS - 1} lamps beside the first", len(content))
    return content


class OneLampTable(Declared):
    """Table [light]: direction toward the lamp, irradiance of a surface that faces it, and ambient irradiance."""

    direction: Direction = Light().direction
    irradiance: Irradiances = Light().irradiance
    ambient: Irradiances = Scene(()).ambient

    @property
    def sky(self) -> Environment | None:
        """Environment that was read; None where the file names none."""
        return None

    @property
    def lamps(self) -> tuple[Light, ...]:
        """Lamps beside the first."""
        return ()

    @property
    def is_dark(self) -> bool:
        """Whether no light comes from anywhere."""
        return not any((*self.irradiance, *self.ambient))

    @model_validator(mode="after")
    def _some(self) -> Self:
        if self.is_dark:
            raise InputError("irradiance and ambient must not both be 0: nothing would be seen")
        return self


class LightTable(OneLampTable):
    """Table [light]: the first lamp, others, and a sky: even, of an environment, or both.

    more         lamps beside the first
    environment  map of radiance, looked for beside the file
    rotation     of the map about the vertical [degrees];  scale  of its radiance
    """

    more: Annotated[
        tuple[LampTable, ...],
        LISTED,
        BeforeValidator(_few),
        Field(json_schema_extra={"maxItems": MOST_LAMPS - 1}),
    ] = ()
    environment: Annotated[Line, words(ENVIRONMENT)] | None = None
    rotation: Annotated[float, Field(ge=-360.0, le=360.0)] = 0.0
    scale: Annotated[float, Field(gt=0.0, le=1e6)] = 1.0
    _sky: Environment | None = PrivateAttr(None)

    @property
    def sky(self) -> Environment | None:
        """Environment that was read; None where the file names none."""
        return self._sky

    @property
    def lamps(self) -> tuple[Light, ...]:
        """Lamps beside the first."""
        return tuple(Light(lamp.direction, lamp.irradiance) for lamp in self.more)

    @property
    def is_dark(self) -> bool:
        """Whether no light comes from anywhere."""
        is_lit = any(any(lamp.irradiance) for lamp in self.more) or self.environment is not None
        return super().is_dark and not is_lit

    @model_validator(mode="after")
    def _mapped(self, info: ValidationInfo) -> Self:
        if self.environment is not None:
            radiance = read_map(Path(str(info.context)).parent / self.environment)
            self._sky = Environment.of_map(radiance, self.rotation, self.scale)
        for key in () if self.environment is not None else OF_ENVIRONMENT:
            if key in self.model_fields_set:
                raise Refused("left out where there is no environment", getattr(self, key), key)
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


HEAD = Viewpoint((-14.0, -23.0, 60.0), 650.0, (-160.0, 0.0, 640.0), 150.0)


class ViewRequest(Declared):
    """Picture that a file requests, in the scene's unit of length; moving  its table with a time, if it has one."""

    moving: ClassVar[str] = ""
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

    def under_light(self, scene: AnyScene) -> AnyScene:
        """Return a scene under the lamps and the sky of the file."""
        table = self.light_table
        return replace(scene, light=self.light, ambient=self.ambient, more=table.lamps, environment=table.sky)

    @property
    def size(self) -> tuple[int, int]:
        """Columns and rows [pixels]."""
        return self.camera_table.resolution

    @property
    def of_reference(self) -> Self:
        """Request at the size of the reference, whose sides are rounded to whole pixels."""
        if self.camera_table.reference_pixel == 1:
            return self
        columns, rows = (max(round(side / self.camera_table.reference_pixel), 1) for side in self.size)
        return self.changed(camera_table={"resolution": (columns, rows), "reference_pixel": 1})

    def after(self, seconds: float) -> Self:
        """Return the request some seconds later. InputError where nothing moves."""
        if not self.moving:
            raise InputError(f"{self.file}: --frames must be left out where nothing moves; sea and fur move")
        values: dict[str, Any] = {self.moving: {"time": getattr(self, self.moving).time + seconds}}
        return self.changed(None, **values)

    @model_validator(mode="after")
    def _rays_fit(self) -> Self:
        each, sides = getattr(self.technique, "supersampling", 1), self.size
        if each * max(sides) > MOST_RAYS:
            accepted = f"so few that supersampling times columns and rows is {MOST_RAYS} at most"
            raise Refused(accepted, list(sides), "camera", "resolution")
        return self

    def require_reference(self) -> None:
        """Raise InputError where the reference would have too many pixels."""
        columns, rows = self.of_reference.size
        if columns * rows > MOST_PIXELS:
            raise InputError(
                f"{self.file}: [camera] resolution over reference_pixel must be {MOST_PIXELS} pixels of a reference at "
                f"most, got {columns} x {rows}; a larger picture is drawn with --no-reference"
            )

    @property
    def wait(self) -> str:
        """Say what takes minutes before the picture; empty where nothing does."""
        return ""

    @property
    def sampling(self) -> Sampling:
        """Samples of a pixel."""
        return Sampling(self.technique.samples)

    @property
    def numbers(self) -> list[int]:
        """Numbers of samples of picture and chart, the least first."""
        return sorted({self.technique.samples, *self.technique.chart})


class MeshRequest(ViewRequest):
    """Picture of a head, or of a mesh of one's own."""

    surface: MeshTable = MeshTable()

    @property
    def viewpoint(self) -> Viewpoint:
        """Camera of a file that says nothing."""
        return seen_whole(self.surface.extent) if self.surface.parts else HEAD

    @model_validator(mode="after")
    def _outside(self) -> Self:
        require_outside(self, self.surface)
        return self


def seen_whole(extent: float) -> Viewpoint:
    """Return a camera that sees all of a mesh of so large a box, from the front [mm]."""
    return Viewpoint((0.0, 0.0, 0.0), max(NEAREST, FAR_OFF * extent), (0.0, 0.0, 1.0), MARGIN * extent)


def require_outside(of: ViewRequest, surface: MeshTable) -> None:
    """Refuse a camera inside the box around a mesh."""
    eye = np.abs(of.camera.eye)
    if surface.parts and np.all(eye < 0.5 * surface.extent):
        accepted = f"so long that the eye is outside the mesh, {surface.extent:.4g} mm large"
        raise Refused(accepted, of.camera.distance, "camera", "distance")


def draw_lit(stage: Stage, scene: Scene, file: str) -> None:
    """Draw a scene; InputError, with the file, where it shows nothing that light reaches and scatters in."""
    stage.draw(scene)
    buffers = stage.buffers()
    inside = buffers.mask > INSIDE
    if not np.any(buffers.irradiance[inside] > 0):
        raise InputError(f"{file}: the view must show something that light scatters in, and light must reach it")
