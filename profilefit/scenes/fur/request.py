"""Request of a furred ball, FUR.toml: strands, technique, shading, camera and light."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mcml_sim.media.checks import is_number
from profilefit.recipes.toml_tables import Table, Tables
from profilefit.scenes.fur.ways import FITTED, SWEPT, SWEPT_TWO, LayerTechnique
from profilefit.scenes.stage import request
from profilefit.scenes.stage.request import Defaults, Viewpoint, ViewRequest
from profilefit.scenes.stage.world import Rgb

TABLES = {
    "": ("title", "scene", "unit", "fur", "shading", *request.TABLES),
    "fur": ("density", "radius", "length", "force", "ball", "colour", "skin", "seed"),
    "shading": ("exponents", "shifts", "strengths", "normalised", "rim"),
    **request.TABLES,
    "technique": ("kind", "strands", "exponent", "tolerance", "supersampling", *request.TABLES["technique"]),
}
DENSITY, RADIUS, LENGTH, BALL = 0.64, 0.5, 10.0, 30.0
FORCE, COLOUR, SKIN, SEED = (0.0, -0.4, 0.0), (0.55, 0.38, 0.22), (0.35, 0.22, 0.16), 1
KINDS = ("swept", "shells")
TOLERANCE = 0.05
STRANDS = 2
SUPERSAMPLING = 4
EXPONENTS, SHIFTS, STRENGTHS, RIM = (60.0, 12.0), (-0.1, 0.2), (0.1, 0.15), (0.0, 0.5, 4.0)
VIEW, DEFAULTS = Viewpoint((0.0, 0.0, 0.0), 650.0, (0.0, 0.0, 1.0), 95.0), Defaults(samples=22)
LARGEST = 150.0  # of the ball, and of strands [mm]
SLENDEREST = 140.0  # the ball's radius over a strand's: what a map of them resolves
MOST_STRANDS = 1 << 16
MOST_FORCE = 0.9


@dataclass(frozen=True)
class Shading:
    """Reflection of strands after Fang et al.: two lobes of Kajiya and Kay, and a rim.

    exponents, shifts, strengths  of the two lobes [-]: shift is the tangent of the angle by which one is turned
    normalised  whether a lobe's mean over all half vectors is its strength; else that is its peak, as published
    rim         bias, scale and power
    """

    exponents: tuple[float, float] = EXPONENTS
    shifts: tuple[float, float] = SHIFTS
    strengths: tuple[float, float] = STRENGTHS
    normalised: bool = True
    rim: Rgb = RIM


@dataclass(frozen=True)
class FurRequest(ViewRequest):
    """Picture of a furred ball that a file requests; its samples are layers.

    density        strands of the skin [1/mm^2];  radius, length  of a strand [mm], along the skin's normal
    force          of the tips, by the length [-];  ball  its radius [mm];  colour, skin  reflectances
    way            of drawing;  tolerance  of `choose`: rms error of the heights of hits over the length [-]
    supersampling  rays of a pixel along a side, averaged
    """

    density: float
    radius: float
    length: float
    force: Rgb
    ball: float
    colour: Rgb
    skin: Rgb
    seed: int
    way: LayerTechnique
    tolerance: float
    shading: Shading
    supersampling: int

    @property
    def count(self) -> int:
        """Number of strands."""
        return max(round(self.density * 4.0 * np.pi * self.ball**2), 1)


def read(file: str, content: Table) -> FurRequest:
    """Return the request of a file; InputError with file, table and key, what was got and what is accepted."""
    tables = Tables(file, TABLES)
    tables.known("", content)
    for key in ("title", "unit"):
        tables.text("", key, content, "mm")
    fur, named, shaded = (tables.table(content, name, {}) for name in ("fur", "technique", "shading"))
    found = FurRequest(
        **request.view(tables, content, VIEW.camera, DEFAULTS),
        density=tables.number("fur", "density", fur, DENSITY),
        radius=tables.number("fur", "radius", fur, RADIUS, LARGEST),
        length=tables.number("fur", "length", fur, LENGTH, LARGEST),
        force=tables.three("fur", "force", fur, FORCE, -MOST_FORCE, MOST_FORCE),
        ball=tables.number("fur", "ball", fur, BALL, LARGEST),
        colour=tables.three("fur", "colour", fur, COLOUR, 0.0, 1.0),
        skin=tables.three("fur", "skin", fur, SKIN, 0.0, 1.0),
        seed=tables.whole("fur", "seed", fur, SEED, 0, 2**31),
        way=_way(tables, named),
        tolerance=tables.number("technique", "tolerance", named, TOLERANCE, 1.0),
        shading=_shading(tables, shaded),
        supersampling=tables.whole("technique", "supersampling", named, SUPERSAMPLING, 1, 8),
    )
    _require_fur(tables, found)
    return found


def _way(tables: Tables, named: Table) -> LayerTechnique:
    kind = tables.text("technique", "kind", named, KINDS[0], KINDS)
    swept = kind == KINDS[0]
    if (other := "exponent" if swept else "strands") in named:
        raise tables.bad("technique", other, f"left out where kind is {kind}", named[other])
    if swept:
        return (SWEPT, SWEPT_TWO)[tables.whole("technique", "strands", named, STRANDS, 1, 2) - 1]
    exponent: Any = named.get("exponent", FITTED.name)
    if exponent == FITTED.name:
        return FITTED
    if not (is_number(exponent) and 0 < exponent <= 100):
        raise tables.bad("technique", "exponent", f'a number > 0 and <= 100, or "{FITTED.name}"', exponent)
    return LayerTechnique(f"shells, p = {exponent:g}", float(exponent))


def _shading(tables: Tables, shaded: Table) -> Shading:
    normalised = shaded.get("normalised", True)
    if type(normalised) is not bool:
        raise tables.bad("shading", "normalised", "true or false", normalised)
    return Shading(
        _two(tables, "exponents", shaded, EXPONENTS, 0.0, 1e4),
        _two(tables, "shifts", shaded, SHIFTS, -1.0, 1.0),
        _two(tables, "strengths", shaded, STRENGTHS, 0.0, request.MOST_LIGHT),
        normalised,
        tables.three("shading", "rim", shaded, RIM, 0.0, 100.0),
    )


def _two(
    tables: Tables, key: str, table: Table, default: tuple[float, float], least: float, most: float
) -> tuple[float, float]:
    value: Any = table.get(key, list(default))
    numbers = value if isinstance(value, list) else []
    if len(numbers) != 2 or not all(is_number(one) and least <= one <= most for one in numbers):
        raise tables.bad(
            "shading", key, f"two numbers in {least:g} ... {most:g}, of the first lobe and the other", value
        )
    return float(numbers[0]), float(numbers[1])


def _require_fur(tables: Tables, of: FurRequest) -> None:
    spacing = of.density**-0.5
    if of.radius > spacing:
        accepted = f"at most the strands' mean distance, 1 / sqrt(density) = {spacing:.4g} mm"
        raise tables.bad("fur", "radius", accepted, of.radius)
    if of.ball > SLENDEREST * of.radius:
        raise tables.bad("fur", "ball", f"at most {SLENDEREST:g} times the strands' radius", of.ball)
    if not of.density * 4.0 * np.pi * of.ball**2 <= MOST_STRANDS:
        most = MOST_STRANDS / (4.0 * np.pi * of.ball**2)
        raise tables.bad(
            "fur",
            "density",
            f"so many strands [1/mm^2] that the ball has {MOST_STRANDS} at most, {most:.4g}",
            of.density,
        )
    if not np.linalg.norm(of.force) <= MOST_FORCE:
        raise tables.bad(
            "fur", "force", f"three numbers whose root of squares is {MOST_FORCE:g} at most", list(of.force)
        )
    reach = of.ball + of.length * (1.0 + float(np.linalg.norm(of.force)))
    if np.linalg.norm(of.camera.eye) < 1.1 * reach:
        raise tables.bad(
            "camera",
            "distance",
            f"so long that the eye is {1.1 * reach:.4g} mm from the ball's middle",
            of.camera.distance,
        )
    of.require_light()
