"""Passes of fur: the first strand that each pixel's ray meets, by layers, and the radiance of such hits."""

from __future__ import annotations

from dataclasses import replace
from typing import Annotated, Any, NamedTuple, Self

import numpy as np
from pydantic import Field
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import checked_whole
from profilefit.recipes.declared import LISTED, Declared, words
from profilefit.scenes.fur.ball import Ball, FurView, nearest_feet
from profilefit.scenes.fur.law import lobe_mean, occlusion
from profilefit.scenes.fur.truth import Patch
from profilefit.scenes.fur.ways import LayerTechnique
from profilefit.scenes.stage.light.environment import Environment
from profilefit.scenes.stage.light.lighting import harmonics_of
from profilefit.scenes.stage.renderer import SUM, Pass, text
from profilefit.scenes.stage.request import MOST_LIGHT, Irradiance
from profilefit.scenes.stage.technique import RADIANCE
from profilefit.scenes.stage.world import Light, Rgb, Singles, unit
from profilefit.shader.emit import read_text, text_beside

HITS = "hit_map"
FINE = 8.0  # texels of a strand's radius in the maps of nearest feet
MOST_TEXELS = 2048
HEIGHTS, LEANS = 64, 12  # of the table of occlusion
BACKGROUND = (0.02, 0.02, 0.02)

Exponent = Annotated[float, Field(ge=0.0, le=1e4)]
Shift = Annotated[float, Field(ge=-1.0, le=1.0)]
Rim = Annotated[float, Field(ge=0.0, le=100.0)]


class FurSurface(NamedTuple):
    """Surface that strands stand on: its GLSL, its maps of the nearest feet and the next, uniforms, and strands."""

    text: str
    maps: dict[str, Singles]
    uniforms: dict[str, Any]
    radius: float
    length: float
    force: tuple[float, ...]

    @classmethod
    def of_ball(cls, ball: Ball) -> Self:
        """Return a ball's, a texel of which is a strand's radius over `FINE` on average, up to `MOST_TEXELS` a side."""
        texels = min(int(np.ceil(FINE * np.sqrt(4.0 * np.pi) * ball.ball / ball.radius)), MOST_TEXELS)
        text, maps = strand_text("surface.glsl", "clumps.glsl", "ball.glsl"), _maps(nearest_feet(ball.feet, texels))
        uniforms = {"ball": ball.ball, "gathered": ball.gathered}
        return cls(text, {**maps, "clump_map": ball.clumps}, uniforms, ball.radius, ball.length, ball.force)

    @classmethod
    def of_patch(cls, patch: Patch, fine: float = FINE) -> Self:
        """Return a patch's, with so many texels of a strand's radius, up to `MOST_TEXELS` a side."""
        texels = min(int(np.ceil(fine * patch.side / patch.radius)), MOST_TEXELS)
        text, maps = strand_text("surface.glsl", "plane.glsl"), _maps(nearest_ways(patch, texels))
        return cls(text, maps, {"side": patch.side}, patch.radius, patch.length, (*patch.lean, 0.0))

    def layered(self, view: FurView, by: LayerTechnique, layers: int) -> Pass:
        """Return the pass that fills `HITS` (rows, columns, 4) with first hits, as of `Ball.cast`."""
        count = checked_whole("layers", layers, 1)
        given = {
            **self.uniforms,
            **_view(view),
            "parallel": float(view.parallel),
            "force": _floats(self.force),
            "radius": self.radius,
            "tall": self.length,
            "exponent": 1.0 if by.tested else by.exponent_of(count, self.length / self.radius),
            "layers": count,
            "tested": by.tested,
            "walked": by.walked,
        }
        source = self.text + text_beside(__name__, "glsl/fur.frag")
        return Pass("fur", dict(self.maps), HITS, source, given)


def pair(least: float, most: float) -> Any:
    """Return an annotation of two numbers, of the first lobe and the other."""
    return words(f"two numbers in {least:g} ... {most:g}, of the first lobe and the other")


class ShadingTable(Declared):
    """Table [shading]: reflection of strands after Fang et al., two lobes of Kajiya and Kay, and a rim.

    exponents, shifts, strengths  of the two lobes [-]: shift is the tangent of the angle by which one is turned
    normalised  whether a lobe's mean over all half vectors is its strength; else that is its peak, as published
    rim         bias, scale and power
    """

    exponents: Annotated[tuple[Exponent, Exponent], LISTED, pair(0.0, 1e4)] = (60.0, 12.0)
    shifts: Annotated[tuple[Shift, Shift], LISTED, pair(-1.0, 1.0)] = (-0.1, 0.2)
    strengths: Annotated[tuple[Irradiance, Irradiance], LISTED, pair(0.0, MOST_LIGHT)] = (0.1, 0.15)
    normalised: bool = True
    rim: Annotated[tuple[Rim, Rim, Rim], LISTED] = (0.0, 0.2, 4.0)


class Coat(NamedTuple):
    """Light and colour of a ball's fur; density  strands of the skin [1/length^2], colours are reflectances.

    more  lamps beside the first;  environment  sky beside the ambient light
    """

    ball: Ball
    density: float
    colour: Rgb
    skin: Rgb
    light: Light
    ambient: Rgb
    shading: ShadingTable
    more: tuple[Light, ...] = ()
    environment: Environment | None = None

    def shades(self, view: FurView) -> list[Pass]:
        """Return the passes from `HITS` to the radiance of all lamps, linear."""
        passes, dark = [self.shade(view)], self._replace(ambient=(0.0, 0.0, 0.0), environment=None)
        for lamp in self.more:
            other = dark._replace(light=lamp).shade(view)
            passes.append(replace(other, uniforms={**other.uniforms, "background": (0.0, 0.0, 0.0)}, kept=SUM))
        return passes

    def shade(self, view: FurView) -> Pass:
        """Return the pass from `HITS` to the radiance that the eye sees by the first lamp and the sky, linear."""
        shading, ball = self.shading, self.ball
        table, widest = _occlusion(self)
        peak = lobe_mean(shading.exponents) if shading.normalised else 1.0 / (4.0 * np.pi)
        given = {
            **_view(view),
            "force": _floats(ball.force),
            "gathered": ball.gathered,
            "radius": ball.radius,
            "tall": ball.length,
            "density": self.density,
            "widest": widest,
            "to_light": _floats(unit(self.light.direction)),
            "irradiance": self.light.irradiance,
            "ambient": self.ambient,
            "harmonics": harmonics_of(self.environment),
            "colour": self.colour,
            "skin_colour": self.skin,
            "background": BACKGROUND,
            "rim": shading.rim,
            "exponents": shading.exponents,
            "turns": _floats(np.arctan(shading.shifts)),
            "strengths": _floats(np.array(shading.strengths) / peak),
        }
        given.pop("eye")
        source = strand_text("clumps.glsl") + text("harmonics.glsl") + text_beside(__name__, "glsl/shade.frag")
        maps: dict[str, str | Singles] = {HITS: HITS, "occlusion_map": table, "clump_map": ball.clumps}
        return Pass("shade", maps, RADIANCE, source, given)


def strand_text(*more: str) -> str:
    """Return glsl/strand.glsl, and other sources beside it, as a shader reads them."""
    return read_text("common") + "".join(text_beside(__name__, f"glsl/{one}") for one in ("strand.glsl", *more))


def _maps(nearest: list[Singles]) -> dict[str, Singles]:
    return dict(zip(("nearest_map", "next_map"), nearest, strict=True))


def nearest_ways(patch: Patch, texels: int) -> list[Singles]:
    """Return maps (texels, texels, 4) of the ways from a texel's middle to the nearest foot, and to the next."""
    middle = (np.arange(texels) + 0.5) / texels * patch.side
    places = np.stack(np.meshgrid(middle, middle), axis=-1)
    feet = np.mod(patch.feet, patch.side)
    _, index = cKDTree(feet, boxsize=patch.side).query(places, 2 if len(feet) > 1 else 1)
    away = feet[index.reshape(texels, texels, -1)] - places[:, :, None]
    away -= patch.side * np.round(away / patch.side)
    padded = np.concatenate([away, np.zeros_like(away)], axis=-1).astype(np.float32)
    return [padded[:, :, 0], padded[:, :, -1]]


def _occlusion(coat: Coat) -> tuple[Singles, float]:
    """Return a table (LEANS, HEIGHTS, 1), and its largest lean: a ball's is that of any place on it."""
    ball, force = coat.ball, float(np.linalg.norm(coat.ball.force))
    # |F_t| / (1 + F_n) is largest where the force is at right angles to the axis.
    widest = max(force / np.sqrt(1.0 - force**2), 1e-6)
    leans, heights = np.linspace(0.0, widest, LEANS), np.linspace(0.0, 1.0, HEIGHTS) * ball.length
    rows = [[occlusion(coat.density, ball.radius, ball.length, z, lean) for z in heights] for lean in leans]
    return np.array(rows, np.float32)[..., None], widest


def _view(view: FurView) -> dict[str, Any]:
    return {name: _floats(getattr(view, name)) for name in ("eye", "forward", "right", "up")}


def _floats(values: Any) -> tuple[float, ...]:
    return tuple(np.asarray(values, float).tolist())
