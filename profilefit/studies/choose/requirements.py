"""A scene's requirements of its translucent material: the file of a scene of skin or layers, read and checked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

from pydantic import ConfigDict, Field

from mcml_sim import Setting
from mcml_sim.files.whole_file import read_toml
from mcml_sim.media.arrays import shown
from profilefit.errors import InputError
from profilefit.recipes.declared import LENGTHS, LISTED, Declared, NumberRange, OneOf, Range, Table, Tolerance, words
from profilefit.recipes.stack.file import LayerStack, read_layers
from profilefit.scenes import SCENES
from profilefit.scenes.layers import scene as layers
from profilefit.scenes.layers.half_space import one_half_space
from profilefit.scenes.skin import scene as skin
from profilefit.scenes.skin.material import Painted, translucent
from profilefit.studies.choose.case import Within
from profilefit.studies.choose.cost import GPUS, YARDSTICK

CHOOSE = "choose"
# Keys of files before one format served `choose` and `scene`, by table, and what is written today.
OLDER = {
    "view": {key: f"[{CHOOSE}] {key}" for key in ("pixel", "radius", "resolution", "coverage")}
    | {"world": "lengths in mm"},
    "material": {"light": "[technique] illumination", "index": "n", "name": "material"},
    "tolerance": {"error": "[technique] tolerance", "mfp": f"[{CHOOSE}] mfp", "pixels": f"[{CHOOSE}] pixels"},
    "budget": {"ms": f"[{CHOOSE}] ms", "gpu": f"[{CHOOSE}] gpu"},
}
LEAST_RADIUS = 2.0  # of curvature, in the longest mean free path: below, light goes through rather than along


@dataclass(frozen=True)
class Budget:
    """ms of a frame, None if there is no limit; gpu a class of `cost.GPUS`; screen_share of skin and the like [-]."""

    ms: float | None = None
    gpu: str = YARDSTICK
    screen_share: float = 0.5


@dataclass(frozen=True)
class Requirements:
    """Ranges of what is to be drawn.

    unit         of all lengths, for show
    setting      the light of the reflectances, and the surface
    reflectance  A of red, green, blue, least and most [-];  mfp  of the same [unit]
    pixel        its side on the surface, near and far [unit];  radius  the smallest of curvature [unit], or infinite
    resolution   columns and rows of the screen [pixels]
    tolerance    root mean square error of radiance, as a share of white, `within` reach of a step edge of light
    layers       a stack that one layer a colour is to stand for, or none
    """

    unit: str
    setting: Setting
    reflectance: tuple[Range, Range, Range]
    mfp: tuple[Range, Range, Range]
    pixel: Range
    radius: float
    tolerance: float
    within: Within
    budget: Budget
    resolution: tuple[int, int] = (1920, 1080)
    layers: LayerStack | None = None


Pixels = Annotated[int, Field(ge=1, le=16384)]
Resolution = Annotated[tuple[Pixels, Pixels], LISTED, words("two whole numbers of pixels in 1 ... 16384")]


class ChooseTable(Declared):
    """Table [choose]: limits of a scene that `profilefit scene` does not need; lengths in mm.

    pixel   its side on the surface, near and far;  radius  the smallest of curvature
    mfp, pixels  reach of the error from a step edge;  ms, gpu  budget;  coverage  share of the screen
    """

    pixel: Annotated[Range, NumberRange(*LENGTHS)] | None = None
    radius: Annotated[float, Field(gt=0.0, allow_inf_nan=True)] = math.inf
    mfp: Annotated[float, Field(gt=0.0, le=100.0)] = 4.0
    pixels: Annotated[int, Field(ge=1, le=100)] = 2
    ms: Annotated[float, Field(gt=0.0)] | None = None
    gpu: Annotated[str, OneOf(*GPUS)] = YARDSTICK
    resolution: Resolution | None = None
    coverage: Tolerance = 0.5


class ChooseFile(Declared):
    """File of a scene, of which `profilefit choose` reads the table [choose]."""

    model_config = ConfigDict(extra="ignore")
    choose: ChooseTable = ChooseTable()


def read(path: Path | str, content: Table | None = None) -> Requirements:
    """Read a scene of skin or layers; InputError that names file, table and key, what was got and what is accepted.

    content  of the file, where it is known already

    Requirements of layers are those of the half space nearest to each colour's stack, which takes seconds.
    """
    content = read_toml(path) if content is None else content
    file, kind = str(path), content.get("scene")
    tables = {name: content[name] for name in OLDER if isinstance(content.get(name), dict)}
    if older := [(name, key) for name, table in tables.items() for key in OLDER[name] if key in table]:
        today = ", ".join(f"{OLDER[name][key]} for [{name}] {key}" for name, key in older)
        first = "" if "scene" in content else 'scene = "skin" and '
        raise InputError(f"{file}: keys are of an older format: write {first}{today}")
    if kind not in ("skin", "layers"):
        known = ("skin", "layers") if isinstance(kind, str) and kind in SCENES else SCENES
        got = "nothing" if kind is None else shown(kind)
        raise InputError(f"{file}: scene must be one of {', '.join(known)}, got {got}")
    request = (skin if kind == "skin" else layers).read(file, content)
    limits = ChooseFile.of(file, content).choose
    within = Within(limits.mfp, limits.pixels)
    if isinstance(request, layers.LayersRequest):
        stack: LayerStack | None = request.stack
        setting = Setting(request.illumination, n=request.media[0].layers[0].n)
        near = [one_half_space(medium, request.illumination, within.mfp) for medium in request.media]
        material = Painted.even([one.reflectance for one in near], [one.mfp for one in near])
    else:
        stack = read_layers(file, {"layers": content["layers"]}) if "layers" in content else None
        setting = replace(request.setting, illumination=request.illumination)
        material = request.material
        if not isinstance(material, Painted):
            one = translucent(material, setting)
            material = Painted.even(one.reflectance, one.mfp)
    least = LEAST_RADIUS * max(most for _, most in material.mfp)
    if not least <= limits.radius <= LENGTHS[1] and math.isfinite(limits.radius):
        accepted = (
            f"at least {LEAST_RADIUS:g} times the longest mean free path, {least:.3g}, and at most {LENGTHS[1]:g} mm"
        )
        raise InputError(f"{file}: [{CHOOSE}] radius must be {accepted}, got {shown(limits.radius)}")
    pixel = limits.pixel or (request.camera.height / request.size[1],) * 2
    lengths = "mm", setting, material.reflectance, material.mfp, pixel, limits.radius
    budget = Budget(limits.ms, limits.gpu, limits.coverage)
    resolution = limits.resolution or request.size
    return Requirements(*lengths, request.technique.tolerance, within, budget, resolution, stack)
