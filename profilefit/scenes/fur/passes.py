"""The passes of fur: the first strand that each pixel's ray meets, by layers, and the radiance of such hits."""

from __future__ import annotations

import time
from typing import Any, NamedTuple, Self

import moderngl
import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from mcml_sim.media.checks import checked_whole
from profilefit.errors import InputError
from profilefit.scenes.fur.ball import Ball, FurView, nearest_feet
from profilefit.scenes.fur.law import lobe_mean, occlusion
from profilefit.scenes.fur.request import Shading
from profilefit.scenes.fur.truth import Patch
from profilefit.scenes.fur.ways import FurWay
from profilefit.scenes.stage.buffers import Maps, Singles, pixels
from profilefit.scenes.stage.technique import RADIANCE, FullScreen, Pass
from profilefit.scenes.stage.world import Light, Rgb, unit
from profilefit.shader.emit import read_text, text_beside

Floats = NDArray[np.float64]
HITS = "hit_map"
FINE = 8.0  # texels of a strand's radius in the maps of nearest feet
MOST_TEXELS = 2048
HEIGHTS, LEANS = 64, 12  # of the table of occlusion
BACKGROUND = (0.02, 0.02, 0.02)


class FurSurface(NamedTuple):
    """What strands stand on: its GLSL, its maps of the nearest feet and the next, its uniforms, and the strands."""

    text: str
    maps: list[Singles]
    uniforms: dict[str, Any]
    radius: float
    length: float
    force: tuple[float, ...]

    @classmethod
    def of_ball(cls, ball: Ball) -> Self:
        """A texel is a strand's radius over `FINE` on average, up to `MOST_TEXELS` of a side."""
        texels = min(int(np.ceil(FINE * np.sqrt(4.0 * np.pi) * ball.ball / ball.radius)), MOST_TEXELS)
        maps, given = nearest_feet(ball.feet, texels), {"ball": ball.ball}
        return cls(strand_text("surface.glsl", "ball.glsl"), maps, given, ball.radius, ball.length, ball.force)

    @classmethod
    def of_patch(cls, patch: Patch, fine: float = FINE) -> Self:
        """fine  texels of a strand's radius, up to `MOST_TEXELS` of a side."""
        texels = min(int(np.ceil(fine * patch.side / patch.radius)), MOST_TEXELS)
        given = {"side": patch.side}
        maps = nearest_ways(patch, texels)
        return cls(
            strand_text("surface.glsl", "plane.glsl"), maps, given, patch.radius, patch.length, (*patch.lean, 0.0)
        )


class FurPasses:
    """Both passes, for pictures of one size. Release it, or use it in a `with`."""

    def __init__(self, context: moderngl.Context, surface: FurSurface, size: tuple[int, int]) -> None:
        self.context, self.surface, self.size = context, surface, size
        self.maps = Maps(context, size)
        self._compiled: dict[str, FullScreen] = {}

    def hits(self, view: FurView, way: FurWay, layers: int) -> Singles:
        """(rows, columns, 4) as of `Ball.cast`, row 0 at the bottom."""
        self.run(self.layered(view, way, layers))
        return pixels(self.maps.map(HITS))

    def layered(self, view: FurView, way: FurWay, layers: int) -> Pass:
        """What fills `HITS`."""
        count, surface = checked_whole("layers", layers, 1), self.surface
        nearest, following = surface.maps
        given = {
            **surface.uniforms,
            **_view(view),
            "parallel": float(view.parallel),
            "force": _floats(surface.force),
            "radius": surface.radius,
            "tall": surface.length,
            "exponent": 1.0 if way.tested else way.exponent_of(count, surface.length / surface.radius),
            "layers": count,
            "tested": way.tested,
        }
        source = surface.text + text_beside(__name__, "glsl/fur.frag")
        return Pass("fur", {"nearest_map": nearest, "next_map": following}, HITS, source, given)

    def run(self, one: Pass) -> None:
        """Fills the map that it writes."""
        if one.name not in self._compiled:
            self._compiled[one.name] = FullScreen(self.context, one)
        self._compiled[one.name].run(one, self.maps)

    def milliseconds(self, *of: Pass) -> float:
        """Time of passes that were run before, one after the other."""
        self.context.finish()
        start = time.perf_counter()
        for one in of:
            self.run(one)
        self.context.finish()
        return 1e3 * (time.perf_counter() - start)

    def radiance(self, one: Pass, hits: NDArray[np.floating] | None = None) -> Floats:
        """(rows, columns, 3) by `Shade.of`, of hits in place of those that were drawn last if some are given."""
        if hits is not None:
            self.maps.map(HITS).write(np.ascontiguousarray(hits, np.float32).tobytes())
        self.run(one)
        return pixels(self.maps.map(RADIANCE))[..., :3].astype(float)

    def release(self) -> None:
        for one in self._compiled.values():
            one.release()
        self._compiled.clear()
        self.maps.release()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.release()


class Coat(NamedTuple):
    """How a ball's fur is lit and coloured; density  strands of the skin [1/length^2], colours are reflectances."""

    ball: Ball
    density: float
    colour: Rgb
    skin: Rgb
    light: Light
    ambient: Rgb
    shading: Shading

    def shade(self, view: FurView) -> Pass:
        """From `HITS` to the radiance that the eye sees, linear."""
        shading, ball = self.shading, self.ball
        table, widest = _occlusion(self)
        peak = lobe_mean(shading.exponents) if shading.normalised else 1.0 / (4.0 * np.pi)
        given = {
            **_view(view),
            "force": _floats(ball.force),
            "radius": ball.radius,
            "tall": ball.length,
            "density": self.density,
            "widest": widest,
            "to_light": _floats(unit(self.light.direction)),
            "irradiance": self.light.irradiance,
            "ambient": self.ambient,
            "colour": self.colour,
            "skin_colour": self.skin,
            "background": BACKGROUND,
            "rim": shading.rim,
            "exponents": shading.exponents,
            "turns": _floats(np.arctan(shading.shifts)),
            "strengths": _floats(np.array(shading.strengths) / peak),
        }
        given.pop("eye")
        source = strand_text() + text_beside(__name__, "glsl/shade.frag")
        return Pass("shade", {HITS: HITS, "occlusion_map": table}, RADIANCE, source, given)


def strand_text(*more: str) -> str:
    """glsl/strand.glsl, and other texts beside it, as a shader reads them."""
    return read_text("common") + "".join(text_beside(__name__, f"glsl/{one}") for one in ("strand.glsl", *more))


def nearest_ways(patch: Patch, texels: int) -> list[Singles]:
    """Maps (texels, texels, 4) of the ways from a texel's middle to the nearest foot, and to the next."""
    if len(patch.leans) > 1:
        raise InputError(f"lean must be one of all strands where they are drawn, got {len(patch.leans)}")
    middle = (np.arange(texels) + 0.5) / texels * patch.side
    places = np.stack(np.meshgrid(middle, middle), axis=-1)
    feet = np.mod(patch.feet, patch.side)
    _, index = cKDTree(feet, boxsize=patch.side).query(places, 2 if len(feet) > 1 else 1)
    away = feet[index.reshape(texels, texels, -1)] - places[:, :, None]
    away -= patch.side * np.round(away / patch.side)
    padded = np.concatenate([away, np.zeros_like(away)], axis=-1).astype(np.float32)
    return [padded[:, :, 0], padded[:, :, -1]]


def _occlusion(coat: Coat) -> tuple[Singles, float]:
    """Table (LEANS, HEIGHTS, 1), and its largest lean: a ball's is that of any place on it."""
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
