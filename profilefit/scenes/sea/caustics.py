"""Sunlight on a floor below waves as OpenGL draws it: a lattice of rays, and six splats to spread what they bring.

Hits are drawn into a float map, blended additively (Li, Wang, Li, Zhao, Wang and Liu, J. Image Graphics 16(8), 2011;
they choose the wireframe; points as Shah, Konttinen and Pattanaik, IEEE TVCG 13(2), 2007, have them). The tile
repeats: light that leaves it comes in on the other side.
"""

from __future__ import annotations

from enum import Enum
from typing import NamedTuple

import moderngl
import numpy as np

from mcml_sim.media.arrays import Floats, checked_whole, require
from profilefit.scenes.sea.waves import Waves, calm_ray, checked_sun, require_below, surface_map
from profilefit.scenes.stage.renderer import LINES, POINTS, SUM, TRIANGLES, Pass, Read, Renderer
from profilefit.shader.emit import text_beside

STEPS = 16  # of the search for a hit on an uneven floor
MOST_PIXELS, MOST_VERTICES = 4096, 4096  # of a side
FOLDS = 1.0  # F from which on faces lie over one another


class Splat(Enum):
    """Ways of a cell of the lattice to bring its light to the pixels of the floor."""

    POINTS = "points"  # a pixel a vertex
    WIREFRAME = "wireframe, constant"  # one brightness a fragment, as published: the mean of the map is set to 1
    WIREFRAME_ENERGY = "wireframe, energy"  # one energy an edge: a third of its triangles', over the fragments it draws
    FACES = "faces"  # flux over the area of the triangle on the floor, where a pixel's middle is in it
    DERIVATIVES = "derivatives"  # the product of the lengths of two derivatives in its place, as shaders often have it
    CELLS = "cells"  # flux over that area times the area of the triangle within each pixel: exact for flat triangles


# Shaders of fragments and vertices, the shape that is drawn, and vertices per cell.
SHADERS = {
    Splat.POINTS: ("deposit", "points", POINTS, 1),
    Splat.WIREFRAME: ("deposit", "lines", LINES, 6),
    Splat.WIREFRAME_ENERGY: ("deposit", "lines", LINES, 6),
    Splat.FACES: ("deposit", "faces", TRIANGLES, 6),
    Splat.DERIVATIVES: ("derivatives", "faces", TRIANGLES, 6),
    Splat.CELLS: ("cells", "cells", TRIANGLES, 6),
}


class CausticMap(NamedTuple):
    """Irradiance of a tile.

    light    (pixels, pixels), row 0 at y = 0, relative to the mean of the flux that entered [-]
    entered  mean of the flux that entered, over the sun's irradiance across its rays [-]
    fragments, milliseconds  that were blended into the map, and time of the passes, hits included
    """

    light: Floats
    entered: float
    fragments: int
    milliseconds: float


def focus(waves: Waves, depth: float, n: float = 1.34, tilt: float = 0.0) -> float:
    """Return F = D kappa d(tan psi)/d(slope) [-]: light folds before it comes to the floor where F > 1.

    kappa is the greatest curvature of a crest, D the depth, psi the refracted ray's angle to the vertical. Where the
    sea is level d(tan psi)/d(slope) = (1 - cos i / (n cos t)) / cos(t)^2, 1 - 1/n of an overhead sun: its F is that of
    thin lenses. A low sun's is three times that, in the plane of the sun; that of other planes is smaller.
    """
    deep, angle, index = checked_sun(depth, tilt, n)
    inside = np.sqrt(max(1.0 - (np.sin(angle) / index) ** 2, 0.0))
    return float((1.0 - np.cos(angle) / (index * inside)) / inside**2 * deep * waves.crest)


def splat_for(f: float) -> Splat:
    """Return the cheapest splat that is right: faces before the first fold, F < 1, cells from there on."""
    require(f >= 0, "F", "a number >= 0", f)
    return Splat.FACES if f < FOLDS else Splat.CELLS


class Caustics:
    """Light of one sea on one floor, as passes over maps of a renderer: hits, splats, and the map itself.

    Waves that face away from the sun send nothing down; that they shade others is not drawn.

    map      name of the map, of one channel, 1 the mean; its first column is `drift` whole pixels toward +x of x = 0
    drift    whole pixels by which the map is aside of the tile, toward the light's +x
    entered  mean of the flux that entered, over the sun's irradiance across its rays [-]
    """

    def __init__(
        self,
        renderer: Renderer,
        waves: Waves,
        vertices: int,
        pixels: int,
        depth: float = 5.0,
        tilt: float = 0.0,
        n: float = 1.34,
        floor: Waves | None = None,
        name: str = "caustics",
    ):
        """Draw the hits once, by which the maps' margins are known; arguments as of `caustic_map`.

        name  of this sea and floor among those of a renderer, with which the names of maps begin
        """
        self.renderer, self.waves = renderer, waves
        deep, angle, index = checked_sun(depth, tilt, n)
        self.vertices = checked_whole("vertices", vertices, 2, MOST_VERTICES)
        self.pixels = checked_whole("pixels", pixels, 1, MOST_PIXELS)
        bed = floor or Waves(waves.tile, mean=-deep)
        require_below(waves, bed)
        self._pixel = waves.tile / self.pixels
        # Light is drawn as many whole pixels aside as a calm sea bends it: margins need hold the waves' share alone.
        self.drift = round(deep * calm_ray(angle, index)[0] / self._pixel)
        self._hits, self._splats, self.map = (f"{name} {what}" for what in ("hits", "splats", "map"))
        text = "".join(_text(file) for file in ("waves.glsl", "refract.glsl", "hits.glsl", "hits.frag"))
        given = {
            "tile": waves.tile,
            "sun": (float(np.sin(angle)), 0.0, -float(np.cos(angle))),
            "n": index,
            "bed": (bed.mean, bed.lowest, bed.highest),
            "calm": (self.drift * self._pixel, 0.0),
            "steps": STEPS,
        }
        # Vertices stand in the middle of cells, as fragments do.
        reads: dict[str, Read] = {"sea_map": surface_map(waves, self.vertices), "floor_waves": bed.texels}
        self._find = Pass("hits", reads, self._hits, text, given)
        renderer.declare(self._hits, (self.vertices, self.vertices))
        renderer.run(self._find)
        landed = self.hits()
        self.entered = float(landed[..., 2].mean())
        self._margin = int(np.ceil(np.abs(landed[..., :2]).max() / self._pixel)) + 2
        self._side = self.pixels + 2 * self._margin
        renderer.declare(self._splats, (self._side, self._side), 1)
        renderer.declare(self.map, (self.pixels, self.pixels), 1)

    def hits(self) -> Floats:
        """Return (vertices, vertices, 4): where light lands from its place, less `drift` [m], flux [-], way [m]."""
        return self.renderer.read(self._hits).astype(float)

    def passes(self, splat: Splat) -> tuple[Pass, Pass, Pass]:
        """Return the passes that fill `map`: hits, deposits by a splat, and their fold into the tile."""
        require(isinstance(splat, Splat), "splat", f"one of {', '.join(map(str, Splat))}", splat)
        fragment, vertex, shape, count = SHADERS[splat]
        given: dict[str, object] = {
            "pixel": self._pixel,
            "margin": float(self._margin),
            "side": float(self._side),
            "mean_flux": self.entered,
        }
        if shape == LINES:
            given["shared_out"] = splat is Splat.WIREFRAME_ENERGY
        source, vertices = _text(f"{fragment}.frag"), _text("lattice.glsl") + _text(f"{vertex}.vert")
        reads, number = {"hit_map": self._hits}, count * self.vertices**2
        deposit = Pass(splat.value, reads, self._splats, source, given, vertices, number, shape, kept=SUM, clear=0.0)
        folding = {"margin": self._margin, "tile_side": self.pixels, "scale": 1.0}
        return self._find, deposit, Pass("fold", {"splat_map": self._splats}, self.map, _text("fold.frag"), folding)

    def light(self, splat: Splat) -> CausticMap:
        """Draw, read and time the map; of the constant wireframe the mean is set to 1."""
        find, deposit, fold = passes = self.passes(splat)
        self.renderer.run(find)
        fragments = self.renderer.fragments(deposit)
        self.renderer.run(fold)  # compiled
        milliseconds = self.renderer.time(*passes)
        light = np.roll(self.renderer.read(self.map)[..., 0].astype(float), self.drift, axis=1)
        if splat is Splat.WIREFRAME:
            light /= light.mean()
        return CausticMap(light, self.entered, fragments, milliseconds)


def caustic_map(
    context: moderngl.Context,
    waves: Waves,
    splat: Splat,
    vertices: int,
    pixels: int,
    depth: float = 5.0,
    tilt: float = 0.0,
    n: float = 1.34,
    floor: Waves | None = None,
) -> CausticMap:
    """Return the irradiance of a tile of the floor, by one splat. InputError.

    vertices, pixels  along a side of the tile, of the lattice of rays and of the map
    depth   of a level floor [m];  tilt  of the sun from the vertical, light goes toward +x [rad]
    n       refractive index of the water [-];  floor  an uneven one in place of the level one, with the sea's tile
    """
    with Renderer(context, (1, 1)) as renderer:
        return Caustics(renderer, waves, vertices, pixels, depth, tilt, n, floor).light(splat)


def _text(file: str) -> str:
    return text_beside(__name__, f"glsl/{file}")
