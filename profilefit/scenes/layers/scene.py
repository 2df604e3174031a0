"""Head of layers: STACK.toml with a light and a camera, drawn in any pose with nothing worked out before for it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from functools import cache, cached_property
from typing import Annotated, Literal, Self

import moderngl
import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator

from mcml_sim import Setting
from mcml_sim.media.arrays import Floats
from mcml_sim.media.medium import normal_reflectance
from profilefit.laws.stack import StackLaw
from profilefit.materials import CHANNELS
from profilefit.recipes import catalogue
from profilefit.recipes.declared import OneOf, Refused, Tolerance, words
from profilefit.recipes.folder import LOCAL, fits_folder
from profilefit.recipes.kinds.stack import StackRecord, StackRequest, matching
from profilefit.recipes.stack import fit
from profilefit.recipes.stack.file import LayerMap, ThicknessMap
from profilefit.scenes.layers import passes
from profilefit.scenes.layers.half_space import one_half_space
from profilefit.scenes.layers.law import plate_of
from profilefit.scenes.layers.truth import StackTable, table_of
from profilefit.scenes.stage import request
from profilefit.scenes.stage.drawing import Drawer, StageDrawing
from profilefit.scenes.stage.judge import Judge, surface_judge, whole_judge
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.subject import eye, head
from profilefit.scenes.stage.technique import NamedTechnique, Technique
from profilefit.scenes.stage.world import ROUGHNESS, Part, Rgb, Scene, deformed, rgb

KINDS = ("stack", "table", "dipole", "half space", "none")
OF_LAW = ("stack", "none")  # which take the law's colour at each thickness of the first layer
ELSEWHERE = "where the image is not of the first layer's thickness"
POSES = ("rest", "turn", "nod")
NEGLIGIBLE = 0.01  # share of white that directions may be wrong by before light scattered once is drawn by itself
NO_LENGTH = 1e-6  # mean free path of light that does not leave its pixel [mm]
COLUMNS, BLOTCHES, SEED = 512, 40, 5  # of the thickness over the head, if it is no image


class LayersTechnique(request.TechniqueTable):
    """Table [technique]: kind  of the technique;  single  whether light scattered once leaves in its own directions."""

    kind: Annotated[str, OneOf(*KINDS)] = KINDS[0]
    samples: request.Samples = 64
    single: Annotated[bool | Literal["auto"], words("true, false or auto")] = "auto"
    tolerance: Tolerance = 0.02


class LayersRequest(request.MeshRequest, StackRequest):
    """Picture of a layered head that a file requests; `choose` is read by `profilefit choose`."""

    scene: Annotated[str, OneOf("layers")] = "layers"
    technique: LayersTechnique = LayersTechnique()
    uneven: Annotated[float, Field(ge=0.0, lt=1.0), words("a share in [0, 1)")] = 0.5
    pose: Annotated[str, OneOf(*POSES)] = POSES[0]
    choose: request.OfChoose = None

    @property
    def mfp(self) -> Rgb:
        """Transport mean free path of the first layer, red, green, blue [mm]."""
        return rgb(medium.layers[0].mfp for medium in self.media)

    @property
    def kind(self) -> str:
        """Kind of the technique; without one in the file, exact tables where the law has no such argument."""
        is_said = "kind" in self.technique.model_fields_set
        return self.technique.kind if is_said or self.is_of_law else "table"

    @property
    def is_of_law(self) -> bool:
        """Whether what varies is the thickness of the first layer, an argument of the stack's law."""
        return isinstance(self.map, ThicknessMap) and self.map.layer == 0

    @property
    def single(self) -> bool:
        """Whether light scattered once is drawn by itself: as the file says, else where it is not negligible."""
        said = self.technique.single
        if isinstance(said, bool):
            return said
        return self.is_of_law and max(map(passes.alike_error, self.media)) > NEGLIGIBLE

    @property
    def wait(self) -> str:
        """Say that the law of these layers has to be fitted; empty where a record or the technique needs no fit."""
        if self.kind not in OF_LAW or recorded(self) is not None:
            return ""
        return f"fitting the model of these layers takes minutes; profilefit regenerate {self.file} --out fits keeps it"

    @cached_property
    def map(self) -> LayerMap:
        """Thickness of the first layer [mm] over u and v, or what else an image varies; row 0 at the top."""
        if self.stack.map is not None:
            return self.stack.map
        d, apart = self.media[0].layers[0].thickness, max(self.uneven, 1e-3)
        values = mottled() if self.uneven > 0 else np.full((1, 1), 0.5, np.float32)
        return ThicknessMap(values, d * (1.0 - apart), d * (1.0 + apart))

    @model_validator(mode="after")
    def _drawable(self) -> Self:
        fit.require_exact(self.stack)
        if self.stack.map is not None and "uneven" in self.model_fields_set:
            raise Refused("left out where a layer has an image", self.uneven, "uneven")
        if self.technique.single is True and not self.is_of_law:
            raise Refused(
                "false or auto where the image is not of the first layer's thickness", True, "technique", "single"
            )
        if self.kind in OF_LAW and not self.is_of_law:
            raise Refused(f"table, dipole or half space {ELSEWHERE}", self.kind, "technique", "kind")
        if self.surface.parts and "pose" in self.model_fields_set:
            raise Refused("left out of a mesh of a file", self.pose, "pose")
        return self


read = LayersRequest.of


@contextmanager
def opened(context: moderngl.Context, of: LayersRequest, has_reference: bool) -> Iterator[StageDrawing]:
    """Open the drawing of a request; exact light at nine thicknesses, for the reference, takes minutes."""
    scene, laws = scene_of(of), cache(lambda: laws_of(of))
    table = cache(lambda: table_of(of.media, of.map, of.illumination))

    def technique_of(given: LayersRequest) -> tuple[NamedTechnique, Technique]:
        is_tabulated = given.kind == "table"
        named = technique(given, laws() if given.kind in OF_LAW else None, table() if is_tabulated else None)
        if not given.single:
            return named, named.by
        assert isinstance(given.map, ThicknessMap)
        return named, passes.WithSingle(named.by, given.media, given.map.least, given.map.most)

    with Stage(context, of.size) as stage:
        request.draw_lit(stage, scene, of.file)  # before the minutes that exact light takes
        judge = None
        if has_reference:
            judge = (whole_judge if of.surface.parts else surface_judge)(stage, scene, of.mfp, table())
        yield StageDrawing(stage, technique_of, judge)


drawer = Drawer(opened, ({"kind": "dipole"}, {"kind": "half space"}, {"kind": "table"}))
draw, picture = drawer.draw, drawer.picture


def reference(stage: Stage, of: LayersRequest, table: StackTable) -> Judge:
    """Draw the scene, and return its judge: the stack at each point, by the surface integral."""
    scene = scene_of(of)
    request.draw_lit(stage, scene, of.file)
    return surface_judge(stage, scene, of.mfp, table, has_error=False)


def technique(of: LayersRequest, laws: tuple[StackLaw, ...] | None, table: StackTable | None = None) -> NamedTechnique:
    """Return the technique of a `kind`, without light scattered once by itself.

    It is the stack's law, exact tables, the first layer's dipole (Zhao et al., (10)), the nearest half space, or none.

    Args:
        of: the request.
        laws: of red, green and blue, which the first and the last of these need.
        table: exact light, which the second needs.
    """
    light, n = of.illumination, of.media[0].layers[0].n
    if of.kind in OF_LAW:  # of which the last one's light does not leave its pixel
        assert laws is not None
        plates = [plate_of(medium, light) for medium in of.media]
        lengths = of.mfp if of.kind == "stack" else (NO_LENGTH,) * 3
        assert isinstance(of.map, ThicknessMap)
        return NamedTechnique(of.kind, passes.of_stack(laws, of.map.least, of.map.most, plates), lengths)
    if of.kind == "table":
        assert table is not None
        plates = [plate_of(medium, light) for medium in of.media]
        return NamedTechnique("exact tables", passes.of_table(table, plates), of.mfp)
    if of.kind == "dipole":
        dipole = catalogue.load("dipole", setting=Setting(n=n))
        alpha = rgb(medium.layers[0].alpha for medium in of.media)
        return NamedTechnique("dipole of the first layer", passes.of_half_space(dipole), of.mfp, alpha)
    near = [one_half_space(medium, light) for medium in of.media]
    hazard = catalogue.load("hazard", setting=Setting(light, n=n))
    lengths, albedos = rgb(one.mfp for one in near), rgb(one.alpha for one in near)
    return NamedTechnique(of.kind, passes.of_half_space(hazard), lengths, albedos)


def laws_of(of: StackRequest) -> tuple[StackLaw, StackLaw, StackLaw]:
    """Return the laws of a record of these very layers, in ./fits or shipped; fitted now where there is none."""
    if (record := recorded(of)) is not None:
        return record.laws
    found = [fit.stack_law(medium, of.illumination) for medium in of.media]
    red, green, blue = (one for one in found if isinstance(one, StackLaw))  # a file has two layers or more
    return red, green, blue


def recorded(of: StackRequest) -> StackRecord | None:
    """Return the record of these very layers, in ./fits or shipped; None where there is none."""
    records = (matching(of, folder) for folder in (LOCAL, fits_folder()))
    return next((record for record in records if record is not None), None)


def scene_of(of: LayersRequest) -> Scene:
    """Return the head in its pose, or a mesh; the texture is the share of the way from least to most of the map."""
    f0 = normal_reflectance(1.0, of.media[0].layers[0].n)
    values = np.repeat(of.map.values[::-1, :, None], len(CHANNELS), axis=-1)
    if of.surface.parts:
        bare = ((replace(one.mesh, tint=None), one) for one in of.surface.parts)
        own = tuple(Part(mesh, values, one.roughness or ROUGHNESS, relief=one.relief) for mesh, one in bare)
        return of.under_light(Scene(own, camera=of.camera, f0=f0))
    skin = [Part(mesh, values) for mesh in (head.head(), head.ear(-1), head.ear(1), head.neck())]
    if of.stack.map is None and of.uneven > 0:
        red, _ = head.lips(head.texels(COLUMNS))
        skin[0] = replace(skin[0], reflectance=(values * (1.0 - red[..., None])).astype(np.float32))
    rest = (*skin, *eye.eyes(), head.hair())
    parts = tuple(replace(part, mesh=deformed(part.mesh, lambda points: posed(points, of.pose))) for part in rest)
    return of.under_light(Scene(parts, camera=of.camera, f0=f0))


def posed(points: Floats, pose: str) -> Floats:
    """Return points of the head at rest, moved: the neck stays, the head turns about it or nods, smoothly between."""
    share = np.clip((points[:, 1] + 210.0) / 95.0, 0.0, 1.0)
    angle = {"rest": 0.0, "turn": np.radians(25.0), "nod": np.radians(12.0)}[pose] * share**2 * (3.0 - 2.0 * share)
    c, s = np.cos(angle), np.sin(angle)
    x, y, z = points.T
    if pose == "nod":
        up, out = y + 110.0, z + 22.0
        return np.stack([x, c * up - s * out - 110.0, s * up + c * out - 22.0], axis=1)
    out = z + 22.0
    return np.stack([c * x + s * out, y, c * out - s * x - 22.0], axis=1)


def mottled() -> NDArray[np.float32]:
    """Return (rows, columns) in [0, 1]: soft blotches of several sizes over the head, the same each time."""
    random = np.random.default_rng(SEED)
    v, u = np.meshgrid(np.linspace(0, 1, COLUMNS // 2), np.linspace(0, 1, COLUMNS), indexing="ij")
    total = np.zeros_like(u)
    for _ in range(BLOTCHES):
        at_u, at_v, size, sign = random.random(), random.random(), random.uniform(0.01, 0.08), random.choice((-1, 1))
        across = np.abs(u - at_u)
        across = np.minimum(across, 1.0 - across)  # u runs around
        total += sign * np.exp(-((across / size) ** 2) - ((v - at_v) / (1.4 * size)) ** 2)
    return (0.5 + 0.5 * np.tanh(1.5 * total)).astype(np.float32)
