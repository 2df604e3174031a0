"""The sunlight on a floor below waves as OpenGL draws it: a lattice of rays, and six splats to spread what they bring.

Hits are drawn into a float map, blended additively (Li, Wang, Li, Zhao, Wang and Liu, J. Image Graphics 16(8), 2011;
they choose the wireframe; points as Shah, Konttinen and Pattanaik, IEEE TVCG 13(2), 2007, have them). The tile
repeats: light that leaves it comes in on the other side.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from enum import Enum
from typing import NamedTuple, Self

import moderngl
import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.checks import checked_whole
from profilefit.errors import InputError
from profilefit.scenes.sea.waves import Waves, checked_sun, refracted
from profilefit.scenes.stage.buffers import float_texture, pixels
from profilefit.scenes.stage.technique import ShaderProgram
from profilefit.shader.context import FULL_SCREEN, check_errors
from profilefit.shader.emit import text_beside

Floats = NDArray[np.float64]
VERSION = "#version 330\n"
STEPS = 16  # of the search for a hit on an uneven floor
MOST_PIXELS, MOST_VERTICES = 4096, 4096  # of a side
FOLDS = 1.0  # F from which on faces lie over one another


class Splat(Enum):
    """How a cell of the lattice brings its light to the pixels of the floor."""

    POINTS = "points"  # a pixel a vertex
    WIREFRAME = "wireframe, constant"  # one brightness a fragment, as published: the mean of the map is set to 1
    WIREFRAME_ENERGY = "wireframe, energy"  # one energy an edge: a third of its triangles', over the fragments it draws
    FACES = "faces"  # flux over the area of the triangle on the floor, where a pixel's middle is in it
    DERIVATIVES = "derivatives"  # the product of the lengths of two derivatives in its place, as shaders often have it
    CELLS = "cells"  # flux over that area times the area of the triangle within each pixel: exact for flat triangles

    @property
    def texts(self) -> tuple[str, str]:
        """Fragment and vertex shader."""
        vertex = {"WIREFRAME": "lines", "WIREFRAME_ENERGY": "lines", "DERIVATIVES": "faces"}.get(self.name)
        fragment = {"DERIVATIVES": "derivatives", "CELLS": "cells"}.get(self.name, "deposit")
        files = f"{vertex or self.value}.vert", "lattice.glsl"
        own, lattice = (text_beside(__name__, f"glsl/{file}") for file in files)
        return text_beside(__name__, f"glsl/{fragment}.frag"), f"{VERSION}{lattice}{own}"

    @property
    def shapes(self) -> tuple[int, int]:
        """OpenGL's kind of shape, and vertices a cell."""
        if self is Splat.POINTS:
            return moderngl.POINTS, 1
        return (moderngl.LINES, 6) if self in (Splat.WIREFRAME, Splat.WIREFRAME_ENERGY) else (moderngl.TRIANGLES, 6)


class CausticMap(NamedTuple):
    """light  (pixels, pixels), row 0 at y = 0: 1 is the mean of the flux that entered [-]

    entered       that mean, over the sun's irradiance across its rays [-]
    fragments     that were blended into the map;  milliseconds  of the passes, hits included, until OpenGL had finished
    """

    light: Floats
    entered: float
    fragments: int
    milliseconds: float


def focus(waves: Waves, depth: float, n: float = 1.34, tilt: float = 0.0) -> float:
    """F = D kappa d(tan psi)/d(slope) [-]: light folds before it comes to the floor where F > 1.

    kappa is the greatest curvature of a crest, D the depth, psi the refracted ray's angle to the vertical. Where the
    sea is level d(tan psi)/d(slope) = (1 - cos i / (n cos t)) / cos(t)^2, 1 - 1/n of an overhead sun: its F is that of
    thin lenses. A low sun's is three times that, in the plane of the sun; that of other planes is smaller.
    """
    deep, angle, index = checked_sun(depth, tilt, n)
    inside = np.sqrt(max(1.0 - (np.sin(angle) / index) ** 2, 0.0))
    return float((1.0 - np.cos(angle) / (index * inside)) / inside**2 * deep * waves.crest)


def splat_for(f: float) -> Splat:
    """The cheapest splat that is right: faces before the first fold, F < 1, cells from there on."""
    if not f >= 0:
        raise InputError(f"F must be a number >= 0, got {f!r}")
    return Splat.FACES if f < FOLDS else Splat.CELLS


class Caustics:
    """The map of one sea over one floor, on the GPU. Release it, or use it in a `with`.

    Waves that face away from the sun send nothing down; that they shade others is not drawn.
    """

    def __init__(
        self,
        context: moderngl.Context,
        waves: Waves,
        vertices: int,
        pixels: int,
        depth: float = 5.0,
        tilt: float = 0.0,
        n: float = 1.34,
        floor: Waves | None = None,
    ):
        """vertices, pixels  along a side of the tile;  others as of `caustic_map`"""
        self.context, self.waves = context, waves
        deep, angle, index = checked_sun(depth, tilt, n)
        self.vertices = checked_whole("vertices", vertices, 2, MOST_VERTICES)
        self.pixels = checked_whole("pixels", pixels, 1, MOST_PIXELS)
        bed = floor or Waves(waves.tile, mean=-deep)
        if bed.tile != waves.tile:
            raise InputError(f"floor must have the sea's tile of {waves.tile:g} m, got {bed.tile:g}")
        if bed.highest >= waves.lowest:
            raise InputError(f"floor must be below the sea's lowest trough, {waves.lowest:g} m, got {bed.highest:g}")
        self._pixel = waves.tile / self.pixels
        # Light is drawn as many whole pixels aside as a calm sea bends it: margins need hold the waves' share alone.
        drift = (deep * float(refracted(angle, (np.zeros(1), np.zeros(1)), index)[0][0])) / self._pixel
        self._drift = round(drift)
        self._given = {
            "tile": waves.tile,
            "sun": (float(np.sin(angle)), 0.0, -float(np.cos(angle))),
            "n": index,
            "bed": (bed.mean, bed.lowest, bed.highest),
            "calm": (self._drift * self._pixel, 0.0),
            "steps": STEPS,
        }
        self._owned: list[moderngl.Texture | moderngl.Framebuffer] = []
        self._query = context.query(samples=True)
        self._programs: dict[tuple[str, str], ShaderProgram] = {}
        self._arrays: dict[tuple[str, str], moderngl.VertexArray] = {}
        self._waves, self._bed = (self._table(one.texels()) for one in (waves, bed))
        self._hits = self._target((self.vertices, self.vertices), 4)
        self._find()
        landed = self.hits()
        self.entered = float(landed[..., 2].mean())
        self._margin = int(np.ceil(np.abs(landed[..., :2]).max() / self._pixel)) + 2
        self._side = self.pixels + 2 * self._margin
        self._splat = self._target((self._side, self._side), 1)
        self._folded = self._target((self.pixels, self.pixels), 1)

    @property
    def map(self) -> moderngl.Texture:
        """What `draw` fills: one channel, 1 the mean; its first column is `drift` whole pixels toward +x of x = 0."""
        return self._folded.color_attachments[0]  # type: ignore[return-value]

    @property
    def drift(self) -> int:
        """Whole pixels by which the map is aside of the tile, toward the light's +x."""
        return self._drift

    def hits(self) -> Floats:
        """(vertices, vertices, 4): where light lands from its place, less `drift` [m], flux [-], splat in water [m]."""
        return pixels(self._hits.color_attachments[0]).astype(float)  # type: ignore[arg-type]

    def draw(self, splat: Splat) -> int:
        """Hits, deposits and the fold into `map`; returns how many fragments the deposits were."""
        if not isinstance(splat, Splat):
            raise InputError(f"splat must be one of {', '.join(map(str, Splat))}, got {splat!r}")
        self._find()
        fragments = self._deposit(splat)
        given = {"margin": self._margin, "tile_side": self.pixels, "scale": 1.0}
        self._fill(self._folded, "fold", self._read("fold.frag"), {"splat_map": self._splat}, given)
        return fragments

    def light(self, splat: Splat) -> CausticMap:
        """Drawn, read and timed; of the constant wireframe the mean is set to 1."""
        self.draw(splat)  # compiled
        milliseconds, fragments = self._timed(lambda: self.draw(splat))
        found = np.roll(pixels(self.map)[..., 0].astype(float), self._drift, axis=1)
        if splat is Splat.WIREFRAME:
            found /= found.mean()
        return CausticMap(found, self.entered, fragments, milliseconds)

    def release(self) -> None:
        for one in (*self._arrays.values(), *self._programs.values(), *self._owned):
            one.release()
        self._arrays.clear()
        self._programs.clear()
        self._owned.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.release()

    def _find(self) -> None:
        text = "".join(self._read(file) for file in ("waves.glsl", "refract.glsl", "hits.glsl", "hits.frag"))
        # Vertices stand in the middle of cells, as fragments do.
        self._fill(self._hits, "hits", text, {"sea_waves": self._waves, "floor_waves": self._bed}, self._given)

    def _deposit(self, splat: Splat) -> int:
        shape, count = splat.shapes
        fragment, vertex = splat.texts
        given: dict[str, object] = {
            "pixel": self._pixel,
            "margin": float(self._margin),
            "side": float(self._side),
            "mean_flux": self.entered,
        }
        if shape == moderngl.LINES:
            given["shared_out"] = splat is Splat.WIREFRAME_ENERGY
        program, array = self._program(splat.value, fragment, vertex)
        program.assign({"hit_map": self._hits.color_attachments[0]}, given)  # type: ignore[dict-item]
        with self.context.scope(self._splat, enable_only=moderngl.BLEND):
            self.context.blend_func = moderngl.ONE, moderngl.ONE
            self._splat.clear()
            with self._query:
                array.render(shape, vertices=count * self.vertices**2)
        self.context.blend_func = moderngl.SRC_ALPHA, moderngl.ONE_MINUS_SRC_ALPHA  # OpenGL's usual one here
        check_errors(self.context, splat.value)
        return int(self._query.samples)

    def _fill(
        self,
        target: moderngl.Framebuffer,
        name: str,
        fragment: str,
        textures: dict[str, moderngl.Framebuffer | moderngl.Texture],
        given: Mapping[str, object],
    ) -> None:
        """A fragment shader over the whole of a target."""
        program, array = self._program(name, VERSION + fragment, VERSION + FULL_SCREEN)
        reads = {
            sampler: one if isinstance(one, moderngl.Texture) else one.color_attachments[0]
            for sampler, one in textures.items()
        }
        program.assign(reads, given)  # type: ignore[arg-type]
        with self.context.scope(target, enable_only=moderngl.NOTHING):
            array.render(moderngl.TRIANGLES, vertices=3)
        check_errors(self.context, name)

    def _program(self, name: str, fragment: str, vertex: str) -> tuple[ShaderProgram, moderngl.VertexArray]:
        key = fragment, vertex
        if key not in self._programs:
            self._programs[key] = ShaderProgram(self.context, name, fragment, vertex)
            self._arrays[key] = self.context.vertex_array(self._programs[key].compiled, [])
        return self._programs[key], self._arrays[key]

    def _target(self, size: tuple[int, int], channels: int) -> moderngl.Framebuffer:
        texture = float_texture(self.context, size, channels)
        target = self.context.framebuffer([texture])
        self._owned += [target, texture]
        return target

    def _table(self, array: NDArray[np.float32]) -> moderngl.Texture:
        texture = float_texture(self.context, (array.shape[1], 1), 4, array)
        self._owned.append(texture)
        return texture

    def _read(self, file: str) -> str:
        return text_beside(__name__, f"glsl/{file}")

    def _timed(self, work: Callable[[], int]) -> tuple[float, int]:
        """Milliseconds on the wall until OpenGL has finished, and what was returned."""
        self.context.finish()
        start = time.perf_counter()
        found = work()
        self.context.finish()
        return 1e3 * (time.perf_counter() - start), found


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
    """Irradiance of a tile of the floor, by one splat. InputError.

    vertices, pixels  along a side of the tile, of the lattice of rays and of the map
    depth   of a level floor [m];  tilt  of the sun from the vertical, light goes toward +x [rad]
    n       refractive index of the water [-];  floor  an uneven one in place of the level one, with the sea's tile
    """
    with Caustics(context, waves, vertices, pixels, depth, tilt, n, floor) as drawn:
        return drawn.light(splat)
