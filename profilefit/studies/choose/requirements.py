"""A scene's requirements of its translucent material: SCENE.toml, read and checked."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from mcml_sim import Setting
from mcml_sim.files.text_file import read_toml
from mcml_sim.media.checks import is_number
from mcml_sim.media.setting import ILLUMINATIONS
from profilefit.materials import BY_NAME, CHANNELS
from profilefit.recipes.stack.file import LayerStack, stack_of
from profilefit.recipes.toml_tables import Table, Tables
from profilefit.studies.choose.case import Within
from profilefit.studies.choose.cost import GPUS, YARDSTICK
from profilefit.studies.choose.response import reference_light

Range = tuple[float, float]
TABLES = {
    "": ("unit", "view", "material", "tolerance", "budget", "layers"),
    "view": ("pixel", "radius", "world", "resolution", "coverage"),
    "material": ("light", "index", "name", *CHANNELS),
    "channel": ("reflectance", "mfp"),
    "tolerance": ("error", "mfp", "pixels"),
    "budget": ("ms", "gpu"),
}
LEAST_RADIUS = 2.0  # of curvature, in the longest mean free path: below, light goes through rather than along
LENGTHS = (1e-9, 1e9)  # in the unit of the mean free paths
MOST_ASIDE = 1e6  # ratio of the ends of a range: beyond, it is a slip of the pen


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


def read(path: Path) -> Requirements:
    """A scene from its file; InputError that names file, table and key, what was got and what is accepted."""
    return _Reader(str(path), TABLES).scene(read_toml(path))


def _three(ranges: tuple[Range, ...]) -> tuple[Range, Range, Range]:
    red, green, blue = ranges
    return red, green, blue


class _Reader(Tables):
    """The tables of one file, whose name every message begins with."""

    def scene(self, content: Table) -> Requirements:
        self.known("", content)
        view, material = (self.table(content, name) for name in ("view", "material"))
        tolerance, budget = self.table(content, "tolerance"), self.table(content, "budget", {})
        setting = self.setting(material)
        reflectance, mfp = self.channels(material, setting)
        world = self.number("view", "world", view, 1.0)
        pixel = self.range("view", "pixel", view)
        radius = world * self.number("view", "radius", view, math.inf)
        longest = max(most for _, most in mfp)
        pixel = (world * pixel[0], world * pixel[1])
        curved = math.isfinite(view.get("radius", math.inf))
        self.lengths("view", "pixel", pixel)
        self.lengths("view", "radius", (radius,) if curved else ())
        for channel, ends in zip(CHANNELS, mfp, strict=True):
            self.lengths(f"material.{channel}", "mfp", ends)
        if radius < LEAST_RADIUS * longest:
            least = f"at least {LEAST_RADIUS:g} times the longest mean free path, {LEAST_RADIUS * longest / world:.3g}"
            raise self.bad("view", "radius", least, view["radius"])
        unit = self.text("", "unit", content, "mm")
        return Requirements(
            unit=unit,
            setting=setting,
            reflectance=_three(reflectance),
            mfp=_three(mfp),
            pixel=pixel,
            radius=radius,
            tolerance=self.number("tolerance", "error", tolerance, most=1.0),
            within=self.within(tolerance),
            budget=self.budget(budget, view),
            resolution=self.sides("view", "resolution", view, (1920, 1080), 16384),
            layers=stack_of(self, content["layers"], unit) if "layers" in content else None,
        )

    def within(self, tolerance: Table) -> Within:
        pixels = tolerance.get("pixels", 2)
        if type(pixels) is not int:
            raise self.bad("tolerance", "pixels", "a whole number in 1 ... 100", pixels)
        mfp = self.number("tolerance", "mfp", tolerance, 4.0)
        return self.made("tolerance", lambda: Within(mfp, pixels))

    def setting(self, material: Table) -> Setting:
        light = self.text("material", "light", material, "diffuse", ILLUMINATIONS)
        index = self.number("material", "index", material, 1.0)
        return self.made("material", lambda: reference_light(Setting(light, index)).setting)

    def channels(self, material: Table, setting: Setting) -> tuple[tuple[Range, ...], tuple[Range, ...]]:
        """Ranges of A and of the mean free path, three each."""
        if "name" in material:
            if given := [name for name in CHANNELS if name in material]:
                raise self.bad("material", "name", f"left out where {', '.join(given)} are given", material["name"])
            known = BY_NAME[self.text("material", "name", material, accepted=tuple(BY_NAME))]
            light = reference_light(setting)
            colours = [light.reflectance(alpha) for alpha in known.alpha]
            return tuple((a, a) for a in colours), tuple((length, length) for length in known.mfp)
        found: list[tuple[Range, Range]] = []
        for channel in CHANNELS:
            where = f"material.{channel}"
            one = self.table(material, channel, within="material")
            self.known(where, one, TABLES["channel"])
            found.append((self.range(where, "reflectance", one, most=1.0), self.range(where, "mfp", one)))
        return tuple(a for a, _ in found), tuple(length for _, length in found)

    def budget(self, budget: Table, view: Table) -> Budget:
        return Budget(
            self.number("budget", "ms", budget) if "ms" in budget else None,
            self.text("budget", "gpu", budget, YARDSTICK, tuple(GPUS)),
            self.number("view", "coverage", view, 0.5, most=1.0),
        )

    def range(self, where: str, key: str, table: Table, most: float = math.inf) -> Range:
        """A number, or the least and the most."""
        value = table.get(key)
        ends: list[Any] = value if isinstance(value, list) else [value, value]
        numbers = len(ends) == 2 and all(is_number(end) for end in ends)
        if not (numbers and 0 < ends[0] <= ends[1] <= most and ends[1] < MOST_ASIDE * ends[0]):
            accepted = "a number > 0 or two of them, the smaller first" + (f", <= {most:g}" if most < math.inf else "")
            raise self.bad(where, key, accepted, value)
        return float(ends[0]), float(ends[1])

    def lengths(self, where: str, key: str, found: tuple[float, ...]) -> None:
        """InputError unless ratios and squares of these lengths can be computed with."""
        for one in found:
            if not LENGTHS[0] <= one <= LENGTHS[1]:
                words = f"between {LENGTHS[0]:g} and {LENGTHS[1]:g} in the unit of the mean free paths"
                raise self.bad(where, key, words, one)
