"""Liang et al.'s head: what is drawn, and FILE.toml that configures it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from typing import Any

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
from profilefit.scenes.stage import head
from profilefit.scenes.stage.buffers import INSIDE, Buffers
from profilefit.scenes.stage.exact_law import DIFFUSE
from profilefit.scenes.stage.gather import technique
from profilefit.scenes.stage.judge import TURNS, Judge, points
from profilefit.scenes.stage.pattern import MOST_SAMPLES, Sampling
from profilefit.scenes.stage.picture import Drawn, to_srgb
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.surface_integral import exitance_of, own_error
from profilefit.scenes.stage.technique import Lambert, Technique
from profilefit.scenes.stage.world import Camera, Light, Part, Rgb, Scene, unit


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
    "": ("scene", "material", "technique", "camera", "light"),
    "technique": ("kind", "law", "constants", "illumination", "samples", "chart"),
    "camera": ("resolution", "distance", "height", "target"),
    "light": ("direction", "irradiance", "ambient"),
}
SAMPLED = "samples"
KINDS: dict[str, Technique] = {"separable": SeparableFilter(), "none": Lambert()}
OF_LAW = ("law", "constants", "illumination")
MOST_CHART = 8  # numbers of samples
# The truth sums over all pairs of pixels, six minutes on a core for so many.
MOST_PIXELS = 2**16
NEAREST, FARTHEST = 300.0, 1e4  # of the camera [mm]: the band is 122 mm from the middle
LARGEST_VIEW = 1000.0  # [mm]
MOST_LIGHT = 1000.0
# What a file's camera looks at, from which distance and in which direction, and how much of it is seen [mm].
TARGET, DISTANCE, FROM, HEIGHT = (4.0, -6.0, 60.0), 650.0, (-109.0, -4.0, 640.0), 130.0
EXPOSURE = 1.1  # of the pictures: few of their pixels are clipped by it


@dataclass(frozen=True)
class SceneRequest:
    """What a file requests. chart  other numbers of samples, whose error and cost are measured;  size  [pixels]"""

    file: str
    label: str
    technique: Technique
    sampling: Sampling
    chart: tuple[int, ...]
    material: str
    camera: Camera
    light: Light
    ambient: Rgb
    size: tuple[int, int]


def read(file: str, content: Table) -> SceneRequest:
    """A scene of a file's content; InputError that names file, table and key, what was got and what is accepted."""
    tables = Tables(file, TABLES)
    tables.known("", content)
    named, view, lit = (tables.table(content, name, {}) for name in ("technique", "camera", "light"))
    label, by = _technique(tables, named)
    light = Light()
    direction = tables.three("light", "direction", lit, light.direction, -1e6, 1e6)
    if not np.linalg.norm(direction) > 1e-6:
        raise tables.bad("light", "direction", "a direction, not 0", list(direction))
    size = tables.sides("camera", "resolution", view, (160, 120), 1024)
    if size[0] * size[1] > MOST_PIXELS:
        raise tables.bad("camera", "resolution", f"{MOST_PIXELS} pixels at most, which the truth sums over", list(size))
    return SceneRequest(
        file=file,
        label=label,
        technique=by,
        sampling=tables.made("technique", lambda: Sampling(named.get("samples", 16))),
        chart=_chart(tables, named),
        material=tables.text("", "material", content, "skin1", tuple(BY_NAME)),
        camera=_camera(tables, view),
        light=Light(direction, tables.three("light", "irradiance", lit, light.irradiance, 0.0, MOST_LIGHT)),
        ambient=tables.three("light", "ambient", lit, Scene(()).ambient, 0.0, MOST_LIGHT),
        size=size,
    )


def draw(context: moderngl.Context, request: SceneRequest) -> Drawn:
    """The picture, its truth, error and cost: a minute for 26 000 pixels, which the truth takes."""
    scene = replace(
        head_scene(request.material, request.camera),
        light=request.light,
        ambient=request.ambient,
        camera=request.camera,
    )
    mfp, by, sampling = scene.material.mfp, request.technique, request.sampling
    with Stage(context, (2 * request.size[0], 2 * request.size[1])) as stage:
        stage.draw(scene)
        fine = stage.buffers()
    with Stage(context, request.size) as stage:
        stage.draw(scene)
        buffers = stage.buffers()
        _require_lit(request.file, buffers)
        judge = Judge(stage, mfp, exitance_of(buffers, mfp), buffers.mask > INSIDE)
        numbers = dict.fromkeys((sampling.samples, *request.chart))
        point, *others = points(judge, request.label, by, sampling, tuple(numbers))
        exitance, radiance = stage.scatter(by, mfp, sampling), stage.render(by, mfp, sampling)
        frame = tuple(stage.time(by, mfp, sampling, TURNS, "frame"))
    # What the surface mirrors and what shines through thin parts is the stage's own in both.
    true = radiance + (judge.truth - exitance) / np.pi
    return Drawn(
        picture=to_srgb(radiance[::-1], EXPOSURE),
        truth=to_srgb(true[::-1], EXPOSURE),
        error=judge.relative_error(exitance)[::-1],
        point=point,
        chart=tuple(sorted((point, *others), key=lambda one: one.samples)),
        frame=frame,
        truth_error=own_error(fine, mfp),
    )


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


def _chart(tables: Tables, named: Table) -> tuple[int, ...]:
    numbers: Any = named.get("chart", [])
    whole = isinstance(numbers, list) and all(type(one) is int and 1 <= one <= MOST_SAMPLES for one in numbers)
    if not whole or len(numbers) > MOST_CHART:
        accepted = f"at most {MOST_CHART} numbers of samples in 1 ... {MOST_SAMPLES}"
        raise tables.bad("technique", "chart", accepted, numbers)
    return tuple(numbers)


def _camera(tables: Tables, view: Table) -> Camera:
    """Looks from the front; without a height its lens stays the same at every distance."""
    target = tables.three("camera", "target", view, TARGET, -150.0, 150.0)
    distance = tables.number("camera", "distance", view, DISTANCE, FARTHEST)
    if distance < NEAREST:
        raise tables.bad("camera", "distance", f"a length in {NEAREST:g} ... {FARTHEST:g} mm", view["distance"])
    height = tables.number("camera", "height", view, HEIGHT * distance / DISTANCE, LARGEST_VIEW)
    x, y, z = (np.array(target) + distance * unit(FROM)).tolist()
    return Camera((x, y, z), target, height)


def _require_lit(file: str, buffers: Buffers) -> None:
    inside = buffers.mask > INSIDE
    if not np.any(buffers.irradiance[inside] > 0):
        raise InputError(f"{file}: the view must show something that light scatters in, and light must reach it")
