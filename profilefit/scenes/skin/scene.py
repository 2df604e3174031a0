"""Liang et al.'s head: what is drawn, and FILE.toml that configures it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import moderngl
import numpy as np

from mcml_sim import Setting
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.errors import InputError
from profilefit.materials import BY_NAME
from profilefit.recipes import catalogue
from profilefit.recipes.toml_tables import Table, Tables
from profilefit.scenes.skin.material import Translucent, plain, skin, translucent
from profilefit.scenes.skin.passes import SeparableFilter
from profilefit.scenes.stage import head, request
from profilefit.scenes.stage.buffers import INSIDE
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.gather import technique
from profilefit.scenes.stage.judge import Judge
from profilefit.scenes.stage.picture import Drawn
from profilefit.scenes.stage.request import Shown, ViewRequest
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.surface_integral import exitance_of, own_error
from profilefit.scenes.stage.technique import Lambert, Technique
from profilefit.scenes.stage.world import Camera, Part, Scene


@dataclass(frozen=True)
class Head(Scene):
    """The scene, and what scatters in its parts."""

    material: Translucent = field(default_factory=translucent)


FACE = Camera(eye=(-95.0, 20.0, 690.0), target=(0.0, -6.0, 0.0), height=290.0)


def head_scene(
    material: str = "skin1", camera: Camera = FACE, detail: int = 1, columns: int = 2048, setting: Setting = DIFFUSE
) -> Head:
    """A head under grazing light with a thin band before it; all of one material, freckles and stubble on the face.

    detail  of the meshes, a whole number >= 1;  columns  of the skin's texture
    setting  in which the material has its A
    """
    if detail < 1:
        raise InputError(f"detail must be a whole number >= 1, got {detail!r}")
    what = translucent(material, setting)
    face = skin(what.reflectance, columns)
    even = plain(what.reflectance)
    pale = plain(np.minimum(np.multiply(what.reflectance, (1.2, 1.5, 1.8)), 0.9))
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
    "": ("scene", "material", *request.TABLES),
    "technique": ("kind", "law", "constants", "illumination", *request.TABLES["technique"]),
}
SAMPLED = "samples"
KINDS: dict[str, Technique] = {"separable": SeparableFilter(), "none": Lambert()}
OF_LAW = ("law", "constants", "illumination")


@dataclass(frozen=True)
class SceneRequest(ViewRequest):
    """What a file requests."""

    label: str
    technique: Technique
    material: str


def read(file: str, content: Table) -> SceneRequest:
    """A scene of a file's content; InputError that names file, table and key, what was got and what is accepted."""
    tables = Tables(file, TABLES)
    tables.known("", content)
    label, by = _technique(tables, tables.table(content, "technique", {}))
    material = tables.text("", "material", content, "skin1", tuple(BY_NAME))
    return SceneRequest(**request.view(tables, content), label=label, technique=by, material=material)


def draw(context: moderngl.Context, of: SceneRequest) -> Drawn:
    """The picture, its truth, error and cost: a minute for 26 000 pixels, which the truth takes."""
    scene = replace(head_scene(of.material, of.camera), light=of.light, ambient=of.ambient, camera=of.camera)
    mfp = scene.material.mfp
    with Stage(context, (2 * of.size[0], 2 * of.size[1])) as stage:
        stage.draw(scene)
        fine = stage.buffers()
    with Stage(context, of.size) as stage:
        stage.draw(scene)
        buffers = stage.buffers()
        request.require_lit(of.file, buffers)
        judge = Judge(stage, mfp, exitance_of(buffers, mfp), buffers.mask > INSIDE)
        shown = Shown(of.label, of.technique, of.technique)
        return request.drawn(judge, of, shown, own_error(fine, mfp))


def _technique(tables: Tables, named: Table) -> tuple[str, Technique]:
    """Its name for a reader, and itself."""
    kind = tables.text("technique", "kind", named, SAMPLED, (SAMPLED, *KINDS))
    if kind != SAMPLED:
        for key in OF_LAW:
            if key in named:
                raise tables.bad("technique", key, f"left out where kind is {kind}", named[key])
        return kind, KINDS[kind]
    law = tables.text("technique", "law", named, "hazard")
    constants = tables.text("technique", "constants", named, "regenerated")
    light = tables.text("technique", "illumination", named, "diffuse", ILLUMINATIONS)
    return f"{law}, {constants}", tables.made(
        "technique", lambda: technique(catalogue.load(law, constants, Setting(light)))
    )
