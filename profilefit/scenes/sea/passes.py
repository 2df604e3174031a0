"""Passes of a picture under the sea: caustics on the floor, caustics in depths for the shafts, and the view."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.arrays import Floats, checked_whole
from mcml_sim.media.medium import fresnel
from profilefit.scenes.sea.caustics import Caustics, Splat
from profilefit.scenes.sea.haze import BROADENED, TURN, turned, ways
from profilefit.scenes.sea.haze import table as fade_table
from profilefit.scenes.sea.law import water_gaussians
from profilefit.scenes.sea.water import World
from profilefit.scenes.sea.waves import surface_map
from profilefit.scenes.stage.renderer import Pass, Read, Renderer
from profilefit.scenes.stage.world import Camera, Singles, rgb, unit
from profilefit.shader.emit import read_text, text_beside

VIEW, SHAFTS = "view_map", "shaft_map"
SOURCES = ("segment.glsl", "waves.glsl", "hits.glsl", "view.frag")  # of the view, in glsl
SEA_TEXELS = 512  # along a side of the tile, of the waves from below
GAUSSIANS = 4  # of the floor's light
FADING = 512  # texels of the table of what the water leaves
DARK = 1e-3  # of wide light, from where on nothing is seen
LEAST_SPREAD = 1e-3  # of the sun's rays [rad], below which the phase function is as it is
FARTHEST = 60.0  # by the attenuation, where that is not reached before
GLOW, DEPTHS = 128, 32  # cosines and depths of the sky's and the floor's light
TURNS = 1024  # angles of the phase function
CONE = 512  # angles of that light to the vertical


class SeaPasses:
    """Passes of one world in maps of a renderer.

    reach  how far one sees at most [m]
    light  passes of the floor's map and its levels of detail, and of the maps in depths, by their names
    """

    def __init__(self, renderer: Renderer, world: World, splat: Splat, vertices: int, texels: int, slices: int) -> None:
        """Draw hits once, and lay out the maps.

        splat  of all maps;  slices  maps in depths
        vertices, texels  rays, and texels of a map, along a side of the tile
        """
        self.renderer, self.world, self.reach = renderer, world, reach_of(world)
        count = checked_whole("slices", slices, 2, 64)
        self._floor = Caustics(
            renderer, world.sea, vertices, texels, world.depth, world.tilt, world.n, world.floor, "floor"
        )
        # From below the troughs down to below the floor.
        self._deepest, self._top = -world.floor.lowest, max(-world.sea.lowest, 0.02 * world.depth)
        self._step = (self._deepest - self._top) / (count - 1)
        depths = self._top + self._step * np.arange(count) + 1e-6 * self._deepest
        renderer.declare(SHAFTS, (texels, texels * count), 1)
        *before, fold = self._floor.passes(splat)
        self.light: dict[str, list[Pass]] = {
            "caustics on the floor": [*before, replace(fold, mipmaps=True)],
            "caustics in depths": [],
        }
        for number, depth in enumerate(depths.tolist()):
            name, below = f"depth {number}", number * texels
            one = Caustics(renderer, world.sea, vertices, texels, depth, world.tilt, world.n, name=name)
            rows, text = (below, below + texels), text_beside(__name__, "glsl/stack.frag")
            stack = Pass("stack", {"light_map": one.map}, SHAFTS, text, {"below": below}, rows=rows)
            self.light["caustics in depths"] += [*one.passes(splat), stack]
        self._sea = surface_map(world.sea, SEA_TEXELS)
        self._turns = _four(np.log(blurred_phase(world, TURNS))[None, :, None])
        self._tables: dict[str, tuple[Singles, Singles, Singles]] = {}

    def view(
        self, camera: Camera, size: tuple[int, int], kind: str, pieces: int, steps: int, views: int = 1, looks: int = 1
    ) -> Pass:
        """Return the pass of the radiance that a camera sees, after those of `light`: z is up.

        size  columns and rows;  kind  one of `haze.KINDS`
        pieces, steps  of a ray through the water, and of the search for a hit
        views          of a pixel along a side, each of which looks at other places of a piece
        looks          at the shafts, of each piece
        """
        self.renderer.declare(VIEW, size)
        world, (right, up, forward) = self.world, axes(camera, size)
        fade, blur, glowing = self._of_kind(kind)
        sun, sky, sky_on_floor, interreflection, _ = self._irradiance(kind)
        reads: dict[str, Read] = {
            "sea_map": self._sea,
            "floor_waves": world.floor.texels,
            "fade_map": fade,
            "turn_map": self._turns,
            "glow_map": glowing,
            "blur_map": blur,
            "floor_map": self._floor.map,
            "shaft_map": SHAFTS,
        }
        given = {
            "tile": world.sea.tile,
            "bed": (world.floor.mean, world.floor.lowest, world.floor.highest),
            "crest": max(world.sea.highest, 1e-6),
            "steps": checked_whole("steps", steps, 1, 64),
            "eye": camera.eye,
            "forward": rgb(forward),
            "right": rgb(right),
            "up": rgb(up),
            "angle": camera.pixel(size[1]),
            "reach": self.reach,
            "n": world.n,
            "beam": rgb(world.beam),
            "floor_drift": self._floor.drift * world.sea.tile / self._floor.pixels,
            "shaft": min(world.shaft, 1e6),
            "first_depth": self._top,
            "depth_step": self._step,
            "b": world.b,
            "sunlight": rgb(sun),
            "skylight": rgb(sky),
            "sky": world.sky,
            "reflectance": world.reflectance,
            "sky_on_floor": rgb(sky_on_floor),
            "again": rgb(interreflection),
            "glow_depth": self._deepest,
            "turn": TURN,
            "rate": float(np.min(world.c)),
            "pieces": checked_whole("pieces", pieces, 1, 1024),
            "looks": checked_whole("looks", looks, 1, 64),
            "views": checked_whole("views", views, 1, 64),
        }
        shared, own = map(read_text, ("common", "near_zero")), (text_beside(__name__, f"glsl/{one}") for one in SOURCES)
        return Pass("view", reads, VIEW, "".join((*shared, *own)), given)

    def _irradiance(self, kind: str) -> tuple[Floats, Floats, Floats, Floats, Floats]:
        """Return light of red, green and blue, each (3,).

        Of sun and sky, as they come in per horizontal area; share of the sky's that comes to the floor; irradiance of
        the floor by its own light, which the surface mirrors; mean radiant exitance of the floor.
        """
        world = self.world
        entered, sky = np.array(world.sun) * self._floor.entered, np.array(world.sky) * world.diffuse_in
        inside, weight = window(world)
        on_floor = weight @ np.exp(-optical(world, kind, world.depth / inside)[2]) / np.sum(weight)
        from_sun = np.exp(-optical(world, kind, np.array(world.depth * world.slant))[2])
        first, back = entered * from_sun + sky * on_floor, np.array(world.reflectance) * mirrored(world, kind)
        more = first * back / (1.0 - back)
        return entered, sky, on_floor, more, (first + more) * np.array(world.reflectance)

    def _of_kind(self, kind: str) -> tuple[Singles, Singles, Singles]:
        """Return tables of what the water leaves, of the blur of the floor's light, and of what sky and floor add."""
        if kind not in self._tables:
            world, (_, sky, _, _, exitance) = self.world, self._irradiance(kind)
            lengths, depths = np.linspace(0.0, self.reach, FADING), np.linspace(0.0, self._deepest, DEPTHS)
            fade = fade_table(world.c, world.omega, world.shaft, world.lobes, kind, lengths)
            self._tables[kind] = fade, self._blur(kind), glow(world, kind, depths, sky, exitance)
        return self._tables[kind]

    def _blur(self, kind: str) -> Singles:
        """Return (2, n, 4) weights, and levels of detail whose texels are as wide as the Gaussians."""
        world = self.world
        if kind != BROADENED:
            return np.zeros((2, 1, 4), np.float32)
        blur = np.zeros((2, GAUSSIANS, 4), np.float32)
        for channel, (c, omega) in enumerate(zip(world.c, world.omega, strict=True)):
            way = float(c * world.depth * world.slant)
            one = water_gaussians(float(omega), way, world.lobes, GAUSSIANS)
            sigma = np.sqrt(one.variances) / c * self._floor.pixels / world.sea.tile
            blur[0, :, channel], blur[1, :, channel] = one.weights, np.maximum(np.log2(2.0 * sigma), 0.0)
        return blur


def axes(camera: Camera, size: tuple[int, int]) -> tuple[Floats, Floats, Floats]:
    """Return half a picture's width and height as vectors at a distance of 1, and the unit vector to its middle."""
    forward = unit(np.subtract(camera.target, camera.eye))
    right = unit(np.cross(forward, (0.0, 0.0, 1.0)))
    up = np.cross(right, forward)
    half = 0.5 * camera.height / camera.distance
    return right * half * size[0] / size[1], up * half, forward


def reach_of(world: World) -> float:
    """Return how far one sees at most [m]: where a thousandth of wide light is left in each colour."""
    found = []
    for c, omega in zip(world.c, world.omega, strict=True):
        far = np.linspace(0.0, FARTHEST, 1000)
        _, _, wide = ways(omega, far, np.inf, world.lobes, BROADENED)
        found.append(far[np.argmax(wide > -np.log(DARK))] / c if wide[-1] > -np.log(DARK) else FARTHEST / c)
    return float(max(found))


def blurred_phase(world: World, count: int) -> Floats:
    """Return the phase function [1/sr] that sunlight behind the waves has, at angles pi x^4, x even from 0 to 1.

    Its rays spread as Gaussian angles do, by which moment l of a phase function, g^l, is exp(-l (l + 1) spread^2 / 4)
    as large.
    """
    cosine = np.cos(np.pi * np.linspace(0.0, 1.0, count) ** 4)
    if world.spread < LEAST_SPREAD:
        return np.asarray(world.phase.pdf(cosine))
    found, before, polynomial = np.zeros(count), np.zeros(count), np.ones(count)
    for order in range(int(8.0 / world.spread)):
        moment = sum(weight * g**order for weight, g in world.lobes)
        share = moment * np.exp(-0.25 * order * (order + 1) * world.spread**2)
        found += (2 * order + 1) / (4.0 * np.pi) * share * polynomial
        after = ((2 * order + 1) * cosine * polynomial - order * before) / (order + 1)
        before, polynomial = polynomial, after
    return found


def glow(world: World, kind: str, depths: Floats, sky: Floats, floor: Floats) -> NDArray[np.float32]:
    """Return (m, n, 4) for glsl/view.frag: -ln of the wide light that a scattering turns into a view [1/sr].

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
    """Return `haze.ways` of lengths (...) [m] in the world's water, each (..., 3), for a shaft that is endless."""
    return ways(world.omega, world.c * lengths[..., None], np.inf, world.lobes, kind)


def mirrored(world: World, kind: str) -> Floats:
    """Return the share (3,) of the floor's light that the calm surface sends back: 2 int mu R e^{-wide way} dmu."""
    cosine, width = _cosines(1.0)
    left = np.exp(-optical(world, kind, 2.0 * world.depth / cosine)[2])
    return np.asarray((2.0 * cosine * fresnel(world.n, 1.0, cosine)[0] * width) @ left)


def window(world: World) -> tuple[Floats, Floats]:
    """Return cosines in the calm water of the sky's light (n,), and its flux in each."""
    inside, width = _cosines(np.arcsin(1.0 / world.n) / (0.5 * np.pi))
    mirrored_there, _ = fresnel(world.n, 1.0, inside)
    return inside, (1.0 - mirrored_there) * inside * width


def _cosines(share: float) -> tuple[Floats, Floats]:
    """Return cosines (CONE,) of angles that are even from 0 to a share of a right angle, and their widths."""
    step = 0.5 * np.pi * share / CONE
    angle = (np.arange(CONE) + 0.5) * step
    return np.cos(angle), np.sin(angle) * step


def _four(array: NDArray) -> NDArray[np.float32]:
    """Return (rows, columns, 4), what is missing 0."""
    found = np.zeros((*array.shape[:2], 4), np.float32)
    found[..., : array.shape[2]] = array
    return found
