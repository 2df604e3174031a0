"""The passes of a picture under the sea: caustics on the floor, caustics in depths for the shafts, and the view."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import NamedTuple, Self

import moderngl
import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.checks import checked_whole
from mcml_sim.media.fresnel import fresnel
from profilefit.scenes.sea.caustics import VERSION, Caustics, Splat
from profilefit.scenes.sea.haze import BROADENED, TURN, turned, ways
from profilefit.scenes.sea.haze import table as fade_table
from profilefit.scenes.sea.law import water_gaussians
from profilefit.scenes.sea.world import World
from profilefit.scenes.stage.buffers import float_texture, pixels
from profilefit.scenes.stage.technique import ShaderProgram
from profilefit.scenes.stage.world import Camera, unit
from profilefit.shader.context import FULL_SCREEN, check_errors
from profilefit.shader.emit import read_text, text_beside

Floats = NDArray[np.float64]
VIEW = ("segment.glsl", "waves.glsl", "hits.glsl", "view.frag")
GAUSSIANS = 4  # of the floor's light
FADING = 512  # texels of the table of what the water leaves
DARK = 1e-3  # of wide light, from where on nothing is seen
FARTHEST = 60.0  # by the attenuation, where that is not reached before
GLOW, DEPTHS = 128, 32  # cosines and depths of the sky's and the floor's light
CONE = 512  # angles of that light to the vertical


class Lit(NamedTuple):
    """Of red, green and blue (3,): sun and sky that come in, per horizontal area; share of the sky's on the floor;
    irradiance of the floor by its own light, which the surface mirrors; and the floor's mean radiant exitance.
    """

    sun: Floats
    sky: Floats
    sky_on_floor: Floats
    again: Floats
    exitance: Floats


class Passes:
    """The maps of one world and its view, on the GPU. Release it, or use it in a `with`.

    splat  of the floor's map, and of each depth's: `Caustics` has them
    """

    def __init__(
        self,
        context: moderngl.Context,
        world: World,
        splats: tuple[Splat, Splat],
        vertices: int = 256,
        texels: int = 256,
        slices: int = 12,
    ) -> None:
        self.context, self.world, self.splats = context, world, splats
        count = checked_whole("slices", slices, 2, 64)
        self.reach = reach_of(world)
        self._floor = Caustics(context, world.sea, vertices, texels, world.depth, world.tilt, world.n, world.floor)
        # From below the troughs down to below the floor.
        self._deepest, self._top = -world.floor.lowest, max(-world.sea.lowest, 0.02 * world.depth)
        self._step = (self._deepest - self._top) / (count - 1)
        depths = self._top + self._step * np.arange(count) + 1e-6 * self._deepest
        self._depths = [
            Caustics(context, world.sea, vertices, texels, float(one), world.tilt, world.n) for one in depths
        ]
        self._shafts = float_texture(context, (texels, texels * count), 1)
        self._column = context.framebuffer([self._shafts])
        self._programs: dict[str, tuple[ShaderProgram, moderngl.VertexArray]] = {}
        self._owned: list[moderngl.Texture | moderngl.Framebuffer] = [self._shafts, self._column]
        self._sea, self._bed = (self._table(one.texels()) for one in (world.sea, world.floor))
        self._lobes = self._table(_four(np.array(world.lobes)[None]))
        self._kinds: dict[str, list[moderngl.Texture]] = {}
        self._target: moderngl.Framebuffer | None = None

    def light(self) -> dict[str, float]:
        """Draws all maps of light; milliseconds of the floor's, and of those in depths."""
        return {
            "caustics on the floor": self._timed(self.draw_floor),
            "caustics in depths": self._timed(self.draw_depths),
        }

    def draw_floor(self) -> None:
        """The floor's map, and its levels of detail."""
        self._floor.draw(self.splats[0])
        self._floor.map.build_mipmaps()
        self._floor.map.filter = moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR
        check_errors(self.context, "levels of detail")

    def draw_depths(self) -> None:
        """A map a depth, one above the other."""
        side, text = self._floor.pixels, self._text("stack.frag")
        for number, one in enumerate(self._depths):
            one.draw(self.splats[1])
            self._column.viewport = 0, number * side, side, side
            self._fill(self._column, "stack", text, {"light_map": one.map}, {"below": number * side})

    def view(self, camera: Camera, size: tuple[int, int], kind: str, pieces: int, steps: int) -> tuple[Floats, float]:
        """Radiance (rows, columns, 3) that the camera sees, row 0 at the bottom, z up; and milliseconds of its pass."""
        if self._target is None or self._target.size != size:
            self._target = self.context.framebuffer([float_texture(self.context, size, 4)])
            self._owned += [*self._target.color_attachments, self._target]  # type: ignore[list-item]
        target = self._target
        textures, given = self._given(camera, size, kind, pieces, steps)
        parts = *map(read_text, ("common", "near_zero")), *map(self._text, VIEW)
        text = VERSION + "".join(parts)
        self._fill(target, "view", text, textures, given)  # compiled
        milliseconds = self._timed(lambda: self._fill(target, "view", text, textures, given))
        return pixels(target.color_attachments[0])[..., :3].astype(float), milliseconds  # type: ignore[arg-type]

    def release(self) -> None:
        for program, array in self._programs.values():
            array.release()
            program.release()
        for one in (self._floor, *self._depths, *self._owned):
            one.release()
        self._programs.clear()
        self._owned.clear()
        self._depths.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.release()

    def _given(
        self, camera: Camera, size: tuple[int, int], kind: str, pieces: int, steps: int
    ) -> tuple[dict[str, moderngl.Texture], dict[str, object]]:
        world, (right, up, forward) = self.world, axes(camera, size)
        fade, blur, glowing = self._of_kind(kind)
        lit = self._lit(kind)
        textures = {
            "sea_waves": self._sea,
            "floor_waves": self._bed,
            "fade_map": fade,
            "lobe_map": self._lobes,
            "glow_map": glowing,
            "blur_map": blur,
            "floor_map": self._floor.map,
            "shaft_map": self._shafts,
        }
        given = {
            "tile": world.sea.tile,
            "bed": (world.floor.mean, world.floor.lowest, world.floor.highest),
            "crest": max(world.sea.highest, 1e-6),
            "steps": checked_whole("steps", steps, 1, 64),
            "eye": camera.eye,
            "forward": _rgb(forward),
            "right": _rgb(right),
            "up": _rgb(up),
            "angle": camera.pixel(size[1]),
            "reach": self.reach,
            "n": world.n,
            "beam": _rgb(world.beam),
            "floor_drift": self._floor.drift * world.sea.tile / self._floor.pixels,
            "shaft": min(world.shaft, 1e6),
            "first_depth": self._top,
            "depth_step": self._step,
            "b": world.b,
            "sunlight": _rgb(lit.sun),
            "skylight": _rgb(lit.sky),
            "sky": world.sky,
            "reflectance": world.reflectance,
            "sky_on_floor": _rgb(lit.sky_on_floor),
            "again": _rgb(lit.again),
            "glow_depth": self._deepest,
            "turn": TURN,
            "rate": float(np.min(world.c)),
            "pieces": checked_whole("pieces", pieces, 1, 1024),
        }
        return textures, given

    def _lit(self, kind: str) -> Lit:
        world = self.world
        entered, sky = np.array(world.sun) * self._floor.entered, np.array(world.sky) * world.diffuse_in
        inside, weight = window(world)
        on_floor = weight @ np.exp(-optical(world, kind, world.depth / inside)[2]) / np.sum(weight)
        from_sun = np.exp(-optical(world, kind, np.array(world.depth * world.slant))[2])
        first, back = entered * from_sun + sky * on_floor, np.array(world.reflectance) * mirrored(world, kind)
        again = first * back / (1.0 - back)
        return Lit(entered, sky, on_floor, again, (first + again) * np.array(world.reflectance))

    def _of_kind(self, kind: str) -> list[moderngl.Texture]:
        """Tables of what the water leaves, of the blur of the floor's light, and of what sky and floor add."""
        if kind not in self._kinds:
            world, lit = self.world, self._lit(kind)
            lengths, depths = np.linspace(0.0, self.reach, FADING), np.linspace(0.0, self._deepest, DEPTHS)
            fade = fade_table(world.c, world.omega, world.shaft, world.lobes, kind, lengths)
            glowing = glow(world, kind, depths, lit.sky, lit.exitance)
            self._kinds[kind] = [self._table(one) for one in (fade, self._blur(kind), glowing)]
        return self._kinds[kind]

    def _blur(self, kind: str) -> NDArray[np.float32]:
        """(2, n, 4): weights, and levels of detail whose texels are as wide as the Gaussians."""
        world = self.world
        if kind != BROADENED:
            return np.zeros((2, 1, 4), np.float32)
        found = np.zeros((2, GAUSSIANS, 4), np.float32)
        for channel, (c, omega) in enumerate(zip(world.c, world.omega, strict=True)):
            way = float(c * world.depth * world.slant)
            one = water_gaussians(float(omega), way, world.lobes, GAUSSIANS)
            sigma = np.sqrt(one.variances) / c * self._floor.pixels / world.sea.tile
            found[0, :, channel], found[1, :, channel] = one.weights, np.maximum(np.log2(2.0 * sigma), 0.0)
        return found

    def _fill(
        self,
        target: moderngl.Framebuffer,
        name: str,
        fragment: str,
        textures: dict[str, moderngl.Texture],
        given: dict[str, object],
    ) -> None:
        if name not in self._programs:
            made = ShaderProgram(self.context, name, fragment, VERSION + FULL_SCREEN)
            self._programs[name] = made, self.context.vertex_array(made.compiled, [])
        program, array = self._programs[name]
        program.assign(textures, given)
        with self.context.scope(target, enable_only=moderngl.NOTHING):
            array.render(moderngl.TRIANGLES, vertices=3)
        check_errors(self.context, name)

    def _table(self, array: NDArray[np.float32]) -> moderngl.Texture:
        texture = float_texture(self.context, (array.shape[1], array.shape[0]), 4, array)
        self._owned.append(texture)
        return texture

    def _text(self, file: str) -> str:
        return text_beside(__name__, f"glsl/{file}")

    def _timed(self, work: Callable[[], None]) -> float:
        self.context.finish()
        start = time.perf_counter()
        work()
        self.context.finish()
        return 1e3 * (time.perf_counter() - start)


def axes(camera: Camera, size: tuple[int, int]) -> tuple[Floats, Floats, Floats]:
    """Half a picture's width and height as vectors, and the unit vector to its middle, at a distance of 1; z is up."""
    forward = unit(np.subtract(camera.target, camera.eye))
    right = unit(np.cross(forward, (0.0, 0.0, 1.0)))
    up = np.cross(right, forward)
    half = 0.5 * camera.height / camera.distance
    return right * half * size[0] / size[1], up * half, forward


def reach_of(world: World) -> float:
    """How far one sees at most [m]: where a thousandth of wide light is left in each colour."""
    found = []
    for c, omega in zip(world.c, world.omega, strict=True):
        far = np.linspace(0.0, FARTHEST, 1000)
        _, _, wide = ways(omega, far, np.inf, world.lobes, BROADENED)
        found.append(far[np.argmax(wide > -np.log(DARK))] / c if wide[-1] > -np.log(DARK) else FARTHEST / c)
    return float(max(found))


def glow(world: World, kind: str, depths: Floats, sky: Floats, floor: Floats) -> NDArray[np.float32]:
    """(m, n, 4) for glsl/view.frag: -ln of the wide light that a scattering turns into a view, red, green, blue [1/sr].

    Rows over depths (m,) [m], columns over the cosine of the view to the upward vertical, -1 ... 1. It is the sky's,
    the floor's, and what the calm surface mirrors of that: the mean over the directions of each of the phase function
    times what the water leaves.

    sky, floor  (3,) irradiance that comes in, and radiant exitance of the floor
    """
    inside, flux = window(world)
    even, width = _cosines(1.0)
    back = fresnel(world.n, 1.0, even)[0]
    rises = np.maximum(world.depth - depths, 0.0)
    view = np.linspace(-1.0, 1.0, GLOW)
    found = np.zeros((depths.size, GLOW, 3))
    # Light from above goes down: a view up, against it, sees what is turned little.
    for upward, cosines, share, lengths, light in (
        (1.0, inside, flux / inside / np.sum(flux), depths, sky),
        (-1.0, even, 2.0 * width, rises, floor),
        (1.0, even, 2.0 * width * back, world.depth + depths, floor),
    ):
        sharp, _, wide = (np.exp(-one) for one in optical(world, kind, lengths[:, None] / cosines))  # (m, CONE, 3)
        for part, left in zip(turned(world.lobes, upward * view, cosines), (sharp, wide), strict=True):
            found += light * np.einsum("vd,mdc->mvc", part * share, left)
    return _four(-np.log(np.maximum(found, 1e-30)))


def optical(world: World, kind: str, lengths: Floats) -> tuple[Floats, Floats, Floats]:
    """`haze.ways` of lengths (...) [m] in the world's water, each (..., 3), for a shaft that is endless."""
    return ways(world.omega, world.c * lengths[..., None], np.inf, world.lobes, kind)


def mirrored(world: World, kind: str) -> Floats:
    """Share (3,) of the floor's light that comes back to it from the calm surface: 2 int mu R e^{-wide way} dmu."""
    cosine, width = _cosines(1.0)
    left = np.exp(-optical(world, kind, 2.0 * world.depth / cosine)[2])
    return np.asarray((2.0 * cosine * fresnel(world.n, 1.0, cosine)[0] * width) @ left)


def window(world: World) -> tuple[Floats, Floats]:
    """Cosines in the calm water of the sky's light (n,), and its flux in each."""
    inside, width = _cosines(np.arcsin(1.0 / world.n) / (0.5 * np.pi))
    mirrored_there, _ = fresnel(world.n, 1.0, inside)
    return inside, (1.0 - mirrored_there) * inside * width


def _cosines(share: float) -> tuple[Floats, Floats]:
    """Cosines (CONE,) of angles that are even from 0 to a share of a right angle, and their widths."""
    step = 0.5 * np.pi * share / CONE
    angle = (np.arange(CONE) + 0.5) * step
    return np.cos(angle), np.sin(angle) * step


def _four(array: NDArray) -> NDArray[np.float32]:
    """(rows, columns, 4), what is missing 0."""
    found = np.zeros((*array.shape[:2], 4), np.float32)
    found[..., : array.shape[2]] = array
    return found


def _rgb(values: Floats) -> tuple[float, float, float]:
    x, y, z = np.asarray(values, float).tolist()
    return x, y, z
