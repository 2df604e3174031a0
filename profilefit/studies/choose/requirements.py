"""A scene's requirements of its translucent material: the file of a scene of skin or layers, read and checked."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from mcml_sim import Setting
from mcml_sim.files.text_file import read_toml
from profilefit.errors import InputError
from profilefit.recipes.stack.file import LayerStack, stack_of
from profilefit.recipes.toml_tables import LENGTHS, Range, Table, Tables
from profilefit.scenes import SCENES
from profilefit.scenes.layers import scene as layers
from profilefit.scenes.layers.half_space import one_half_space
from profilefit.scenes.skin import scene as skin
from profilefit.scenes.skin.material import Painted, translucent
from profilefit.scenes.stage.request import ViewRequest
from profilefit.studies.choose.case import Within
from profilefit.studies.choose.cost import GPUS, YARDSTICK

CHOOSE = "choose"
TABLES = {CHOOSE: ("pixel", "radius", "mfp", "pixels", "ms", "gpu", "resolution", "coverage")}
# Keys of files before one format served `choose` and `scene`, by table, and what is written today.
OLDER = {
    "view": {key: f"[{CHOOSE}] {key}" for key in ("pixel", "radius", "resolution", "coverage")}
    | {"world": "lengths in mm"},
    "material": {"light": "[technique] illumination", "index": "n", "name": "material"},
    "tolerance": {"error": "[technique] tolerance", "mfp": f"[{CHOOSE}] mfp", "pixels": f"[{CHOOSE}] pixels"},
    "budget": {"ms": f"[{CHOOSE}] ms", "gpu": f"[{CHOOSE}] gpu"},
}
TOLERANCE = 0.02
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


def read(path: Path | str, content: Table | None = None) -> Requirements:
    """Read a scene of skin or layers; InputError that names file, table and key, what was got and what is accepted.

    content  of the file, where it is known already

    Requirements of layers are those of the half space nearest to each colour's stack, which takes seconds.
    """
    content = read_toml(path) if content is None else content
    reader, kind = _Reader(str(path), TABLES), content.get("scene")
    reader.refuse_older(content)
    if kind == "skin":
        return reader.skin(content)
    if kind == "layers":
        return reader.layers(content)
    known = ("skin", "layers") if isinstance(kind, str) and kind in SCENES else SCENES
    raise reader.bad("", "scene", f"one of {', '.join(known)}", kind)


class _Reader(Tables):
    """The tables of one file, whose name every message begins with."""

    def refuse_older(self, content: Table) -> None:
        """Raise InputError for the keys of an older format, which says what is written today."""
        tables = {name: content[name] for name in OLDER if isinstance(content.get(name), dict)}
        if older := [(name, key) for name, table in tables.items() for key in OLDER[name] if key in table]:
            words = ", ".join(f"{OLDER[name][key]} for [{name}] {key}" for name, key in older)
            first = "" if "scene" in content else 'scene = "skin" and '
            raise InputError(f"{self.file}: keys are of an older format: write {first}{words}")

    def skin(self, content: Table) -> Requirements:
        """Return requirements of a painted or published material."""
        request = skin.read(self.file, content)
        limits = self.limits(content, request)
        setting, material = replace(request.setting, illumination=request.illumination), request.material
        if not isinstance(material, Painted):
            one = translucent(material, setting)
            material = Painted.even(one.reflectance, one.mfp)
        stack = stack_of(self, content["layers"]) if "layers" in content else None
        return self.limited(limits, setting, material, stack)

    def layers(self, content: Table) -> Requirements:
        """Return requirements of the half space nearest to each colour's stack."""
        request = layers.read(self.file, content)
        limits = self.limits(content, request)
        stack, illumination = request.stack.stack, request.stack.illumination
        near = [one_half_space(medium, illumination, limits["within"].mfp) for medium in stack.media]
        material = Painted.even([one.reflectance for one in near], [one.mfp for one in near])
        return self.limited(limits, Setting(illumination, n=stack.media[0].layers[0].n), material, stack)

    def limits(self, content: Table, request: ViewRequest) -> dict[str, Any]:
        """Return the fields of `Requirements` that no material has a part in."""
        own, named = (self.table(content, name, {}) for name in (CHOOSE, "technique"))
        side, mfp = request.camera.height / request.size[1], self.number(CHOOSE, "mfp", own, 4.0)
        pixels = self.whole(CHOOSE, "pixels", own, 2, 1, 100)
        return {
            "pixel": self.range(CHOOSE, "pixel", own, *LENGTHS) if "pixel" in own else (side, side),
            "radius": self.number(CHOOSE, "radius", own, math.inf),
            "tolerance": self.number("technique", "tolerance", named, TOLERANCE, most=1.0),
            "within": self.build(CHOOSE, lambda: Within(mfp, pixels)),
            "budget": Budget(
                self.number(CHOOSE, "ms", own) if "ms" in own else None,
                self.text(CHOOSE, "gpu", own, YARDSTICK, tuple(GPUS)),
                self.number(CHOOSE, "coverage", own, 0.5, most=1.0),
            ),
            "resolution": self.sides(CHOOSE, "resolution", own, request.size, 16384),
        }

    def limited(
        self, limits: dict[str, Any], setting: Setting, material: Painted, stack: LayerStack | None
    ) -> Requirements:
        """Return requirements of a material; InputError where the surface bends within its mean free paths."""
        longest = max(most for _, most in material.mfp)
        if not LEAST_RADIUS * longest <= limits["radius"] <= LENGTHS[1] and math.isfinite(limits["radius"]):
            least = f"{LEAST_RADIUS:g} times the longest mean free path, {LEAST_RADIUS * longest:.3g}"
            raise self.bad(CHOOSE, "radius", f"at least {least}, and at most {LENGTHS[1]:g} mm", limits["radius"])
        return Requirements("mm", setting, material.reflectance, material.mfp, layers=stack, **limits)
