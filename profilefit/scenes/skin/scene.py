"""Liang et al.'s head: what is drawn, and FILE.toml that configures it."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Self

import moderngl
import numpy as np
from pydantic import Discriminator, Field, Tag, model_validator

from mcml_sim import Setting
from mcml_sim.exact.single_scattering import entered
from mcml_sim.media.arrays import require
from mcml_sim.media.medium import normal_reflectance
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import SettingError
from profilefit.laws.rational import REFRACTING
from profilefit.materials import BY_NAME, CHANNELS
from profilefit.recipes import catalogue
from profilefit.recipes.declared import (
    LENGTHS,
    Declared,
    NumberRange,
    OneOf,
    Range,
    Refused,
    Text,
    Tolerance,
    at,
    words,
)
from profilefit.scenes.skin.law import Separable
from profilefit.scenes.skin.material import Painted, Translucent, plain, translucent
from profilefit.scenes.skin.paint import skin
from profilefit.scenes.skin.passes import SeparableFilter
from profilefit.scenes.stage import request
from profilefit.scenes.stage.drawing import Drawer, StageDrawing
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.judge import surface_judge, whole_judge
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.subject import eye, head
from profilefit.scenes.stage.technique import Lambert, NamedTechnique, Technique, technique
from profilefit.scenes.stage.world import ROUGHNESS, Camera, Part, Scene


@dataclass(frozen=True)
class Head(Scene):
    """Scene, and the material of its parts."""

    material: Translucent = field(default_factory=translucent)


CLOTH = (0.03, 0.05, 0.11)  # A of the visor's strap
FACE = Camera(eye=(-95.0, 20.0, 690.0), target=(0.0, -6.0, 0.0), height=290.0)


def head_scene(
    material: str | Painted = "skin1",
    camera: Camera = FACE,
    detail: int = 1,
    columns: int = 2048,
    setting: Setting = DIFFUSE,
) -> Head:
    """Return a head under grazing light behind a thin band: all of one material, freckles and stubble on the face.

    material  by its name, or the middle of a painted one
    detail  of the meshes, a whole number >= 1;  columns  of the skin's texture
    setting  in which the material has its A: by default n = 1, as in published comparisons; skin has n = 1.4
    """
    require(detail >= 1, "detail", "a whole number >= 1", detail)
    what = material.middle(setting) if isinstance(material, Painted) else translucent(material, setting)
    most = float(entered(setting))  # a colour that the surface lets out
    face = np.minimum(skin(what.reflectance, columns), np.float32(most))
    even = plain(what.reflectance)
    pale = plain(np.minimum(np.multiply(what.reflectance, (1.2, 1.5, 1.8)), min(0.9, most)))
    parts = (
        Part(head.head(detail), face),
        Part(head.ear(-1, detail), even),
        Part(head.ear(1, detail), even),
        Part(head.neck(detail), even),
        *eye.eyes(detail),
        Part(head.strap(detail), plain(CLOTH), roughness=0.8, is_translucent=False),
        Part(head.band(detail), pale, roughness=0.6),
    )
    return Head(parts, camera=camera, material=what)


SAMPLED, SEPARABLE, NONE = KINDS = ("samples", "separable", "none")
OTHERS = {SEPARABLE: "separable filter", NONE: "no scattering"}  # for a reader
OF_LAW = ("law", "constants", "illumination")
SKIN = 1.4  # refractive index


class ChannelTable(Declared):
    """Table [material.COLOUR]: least and most of A [-], and of the transport mean free path [mm]."""

    reflectance: Annotated[Range, NumberRange()]
    mfp: Annotated[Range, NumberRange(*LENGTHS)]


class MaterialTable(Declared):
    """Table [material] of a painted material."""

    red: ChannelTable
    green: ChannelTable
    blue: ChannelTable

    @property
    def painted(self) -> Painted:
        """Ranges of the three colours."""
        a, b, c = self.red, self.green, self.blue
        return Painted((a.reflectance, b.reflectance, c.reflectance), (a.mfp, b.mfp, c.mfp))


class SkinTechnique(request.TechniqueTable):
    """Table [technique]: samples of a law, the separable filter, or none."""

    kind: Annotated[str, OneOf(*KINDS)] = SAMPLED
    samples: request.Samples = 64
    law: Text = "hazard"
    constants: Text = "regenerated"
    illumination: Annotated[str, OneOf(*ILLUMINATIONS)] = "diffuse"
    tolerance: Tolerance = 0.02

    @model_validator(mode="after")
    def _of_law(self) -> Self:
        for key in OF_LAW:
            if self.kind != SAMPLED and key in self.model_fields_set:
                raise Refused(f"left out where kind is {self.kind}", getattr(self, key), key)
        return self


class SceneRequest(request.MeshRequest):
    """Scene of skin that a file requests; `layers` and `choose` are read by `profilefit choose`."""

    scene: Annotated[str, OneOf("skin")] = "skin"
    material_table: Annotated[
        Annotated[Annotated[str, OneOf(*BY_NAME)], Tag("[name]")] | Annotated[MaterialTable, Tag("[table]")],
        Discriminator(lambda value: "[table]" if isinstance(value, dict) else "[name]"),
    ] = Field("skin1", alias="material")
    n: Annotated[float, Field(ge=1.0, le=REFRACTING.high), words(f"a refractive index in [1, {REFRACTING.high:g}]")] = (
        SKIN
    )
    technique: SkinTechnique = SkinTechnique()
    layers: request.OfChoose = None
    choose: request.OfChoose = None

    @property
    def material(self) -> str | Painted:
        """Material by its name, or painted."""
        table = self.material_table
        return table.painted if isinstance(table, MaterialTable) else table

    @property
    def setting(self) -> Setting:
        """Setting of the material's A and of the reference: diffuse illumination."""
        return Setting("diffuse", n=self.n)

    @property
    def illumination(self) -> str:
        """Illumination of the law."""
        return self.technique.illumination

    @property
    def label(self) -> str:
        """Name of the technique for a reader."""
        named = self.technique
        return f"{named.law}, {named.constants}" if named.kind == SAMPLED else OTHERS[named.kind]

    @cached_property
    def method(self) -> Technique:
        """Technique that the scene is drawn by."""
        named = self.technique
        if named.kind != SAMPLED:
            return SeparableFilter(Separable(setting=self.setting)) if named.kind == SEPARABLE else Lambert()
        try:
            law = catalogue.load(named.law, named.constants, replace(self.setting, illumination=named.illumination))
        except SettingError as error:
            if self.n == 1.0:
                raise
            raise SettingError(f"{error}: write n = 1 at the top of the file, or name another law") from None
        return technique(law)

    @model_validator(mode="after")
    def _possible(self) -> Self:
        table, most = self.material_table, float(entered(self.setting))  # a colour that the surface lets out
        for channel in CHANNELS if isinstance(table, MaterialTable) else ():
            low, high = ends = getattr(table, channel).reflectance
            if high > most:
                accepted = NumberRange(most=most).words
                raise Refused(accepted, low if low == high else list(ends), "material", channel, "reflectance")
        with at("technique"):
            _ = self.method
        return self


read = SceneRequest.of


@contextmanager
def opened(context: moderngl.Context, of: SceneRequest, has_reference: bool) -> Iterator[StageDrawing]:
    """Open the drawing of a request."""
    scene = of.under_light(_scene_of(of))
    if of.setting.n > 1.0:  # else the scattering has no interface, and highlights are those of skin
        scene = replace(scene, f0=normal_reflectance(1.0, of.setting.n))

    def technique_of(given: SceneRequest) -> tuple[NamedTechnique, Technique]:
        return NamedTechnique(given.label, given.method, scene.material.mfp), given.method

    with Stage(context, of.size) as stage:
        request.draw_lit(stage, scene, of.file)
        judge = None
        if has_reference:
            judged = whole_judge if of.surface.parts else surface_judge  # parts of the head lie inside each other
            judge = judged(stage, scene, scene.material.mfp, of.setting)
        yield StageDrawing(stage, technique_of, judge)


def _scene_of(of: SceneRequest) -> Head:
    if not of.surface.parts:
        return head_scene(of.material, of.camera, setting=of.setting)
    given = of.material
    what = given.middle(of.setting) if isinstance(given, Painted) else translucent(given, of.setting)
    most = float(entered(of.setting))
    parts = tuple(one.part(plain(what.reflectance), ROUGHNESS, most) for one in of.surface.parts)
    return Head(parts, camera=of.camera, material=what)


drawer = Drawer(opened, ({"kind": SEPARABLE}, {"kind": NONE}, {"kind": SAMPLED}))
draw, picture = drawer.draw, drawer.picture
