"""Liang et al.'s head: what is drawn, and FILE.toml that configures it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import moderngl
import numpy as np

from mcml_sim import Setting
from mcml_sim.exact.single_scattering import entered
from mcml_sim.media.fresnel import normal_reflectance
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import InputError, SettingError
from profilefit.laws.refracting_rational import REFRACTING
from profilefit.materials import BY_NAME, CHANNELS
from profilefit.recipes import catalogue
from profilefit.recipes.toml_tables import LENGTHS, Table, Tables
from profilefit.scenes.skin.law import Separable
from profilefit.scenes.skin.material import Painted, Translucent, plain, skin, translucent
from profilefit.scenes.skin.passes import SeparableFilter
from profilefit.scenes.stage import head, request
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.gather import technique
from profilefit.scenes.stage.judge import surface_judge
from profilefit.scenes.stage.picture import RenderResult
from profilefit.scenes.stage.request import ViewRequest
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import Lambert, Technique, alone
from profilefit.scenes.stage.world import Camera, Part, Scene


@dataclass(frozen=True)
class Head(Scene):
    """Scene, and the material of its parts."""

    material: Translucent = field(default_factory=translucent)


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
    if detail < 1:
        raise InputError(f"detail must be a whole number >= 1, got {detail!r}")
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
        Part(head.band(detail), pale, roughness=0.6),
    )
    return Head(parts, camera=camera, material=what)


TABLES = {
    **request.TABLES,
    "": ("title", "scene", "unit", "material", "n", "layers", *request.TABLES, "choose"),
    "material": CHANNELS,
    "technique": ("kind", "law", "constants", "illumination", *request.TABLES["technique"], "tolerance"),
}
SAMPLED, SEPARABLE, NONE = KINDS = ("samples", "separable", "none")
OF_LAW = ("law", "constants", "illumination")
SKIN = 1.4  # refractive index


@dataclass(frozen=True)
class SceneRequest(ViewRequest):
    """Scene of skin that a file requests.

    material  by its name, or painted;  setting  of its A and of the reference: diffuse illumination, n of the file
    illumination  of the law
    """

    label: str
    technique: Technique
    material: str | Painted
    setting: Setting
    illumination: str


def read(file: str, content: Table) -> SceneRequest:
    """Return the request of a file; InputError with file, table and key, what was got and what is accepted."""
    tables = Tables(file, TABLES)
    tables.known("", content)
    tables.text("", "title", content, "")
    tables.text("", "unit", content, "mm", ("mm",))
    setting = Setting("diffuse", n=tables.number("", "n", content, SKIN))
    if not 1.0 <= setting.n <= REFRACTING.high:
        raise tables.bad("", "n", f"a refractive index in [1, {REFRACTING.high:g}]", setting.n)
    label, by, light = _technique(tables, tables.table(content, "technique", {}), setting)
    return SceneRequest(
        **request.view(tables, content),
        label=label,
        technique=by,
        material=_material(tables, content, setting),
        setting=setting,
        illumination=light,
    )


def draw(context: moderngl.Context, of: SceneRequest) -> RenderResult:
    """Draw the picture beside its reference, with error and cost: a minute for 26 000 pixels, of the reference."""
    scene = replace(head_scene(of.material, of.camera, setting=of.setting), light=of.light, ambient=of.ambient)
    if of.setting.n > 1.0:  # else the scattering has no interface, and highlights are those of skin
        scene = replace(scene, f0=normal_reflectance(1.0, of.setting.n))
    pair = alone(of.label, of.technique, scene.material.mfp)
    with Stage(context, of.size) as stage:
        stage.draw(scene)
        request.require_lit(of.file, stage.buffers())
        return request.rendered(stage, surface_judge(stage, scene, pair.mfp, of.setting), of, pair)


def _material(tables: Tables, content: Table, setting: Setting) -> str | Painted:
    if not isinstance(content.get("material"), dict):
        return tables.text("", "material", content, "skin1", tuple(BY_NAME))
    found, most = [], float(entered(setting))
    for channel in CHANNELS:
        where = f"material.{channel}"
        one = tables.table(tables.table(content, "material"), channel, within="material")
        tables.known(where, one, ("reflectance", "mfp"))
        found.append((tables.range(where, "reflectance", one, most=most), tables.range(where, "mfp", one, *LENGTHS)))
    (a, d), (b, e), (c, f) = found
    return Painted((a, b, c), (d, e, f))


def _technique(tables: Tables, named: Table, setting: Setting) -> tuple[str, Technique, str]:
    """Return the technique's name for a reader, the technique, and the illumination of its law."""
    kind = tables.text("technique", "kind", named, SAMPLED, KINDS)
    if kind != SAMPLED:
        for key in OF_LAW:
            if key in named:
                raise tables.bad("technique", key, f"left out where kind is {kind}", named[key])
        return kind, SeparableFilter(Separable(setting=setting)) if kind == SEPARABLE else Lambert(), "diffuse"
    law = tables.text("technique", "law", named, "hazard")
    constants = tables.text("technique", "constants", named, "regenerated")
    light = tables.text("technique", "illumination", named, "diffuse", ILLUMINATIONS)
    try:
        one = tables.build("technique", lambda: catalogue.load(law, constants, replace(setting, illumination=light)))
    except SettingError as error:
        if setting.n == 1.0:
            raise
        raise SettingError(f"{error}: write n = 1 at the top of the file, or name another law") from None
    return f"{law}, {constants}", tables.build("technique", lambda: technique(one)), light
