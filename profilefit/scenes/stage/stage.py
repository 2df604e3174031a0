"""Render of Liang et al., section 5: shadow and thickness, G-buffer, scattering by a technique, combination.

    with Stage(open_context(), (512, 512)) as stage:
        stage.draw(scene)
        image = stage.render(profilefit.load("hazard", setting=Setting("diffuse")), mfp, Sampling(64))

Lengths are millimetres of one world scale. Irradiance is diffuse light, so a law of the diffuse setting is meant; one
of the searchlight setting may be passed as well, to see the difference.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import moderngl
import numpy as np
from numpy.typing import ArrayLike

from mcml_sim.media.arrays import Floats, checked_whole, require
from profilefit.errors import InputError
from profilefit.scenes.stage.light.lighting import (
    BACK,
    IRRADIANCE,
    MARGIN,
    OCCLUSION,
    SHADOWS,
    ambient_pass,
    lamp_pass,
    lamp_uniforms,
    occlusion_passes,
    other_lamps,
    screen_uniforms,
    shadow_passes,
    sphere,
)
from profilefit.scenes.stage.light.occlusion import PATCHES, sky_irradiance
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.renderer import NEAREST, POINTS, GpuOwner, Pass, Read, Renderer, Smooth, text
from profilefit.scenes.stage.technique import EXITANCE, RADIANCE, Frame, Law, Technique, combination, technique
from profilefit.scenes.stage.world import (
    EVEN,
    INSIDE,
    PLACE,
    SURFACE,
    Buffers,
    Mesh,
    Part,
    Scene,
    Singles,
)
from profilefit.shader.context import seconds

DEFAULT = Sampling()
By = Law | Technique
MOST_PIXELS = 16384  # of a side: what OpenGL drivers take at most
PASSES = ("scatter", "frame")
SIDES = "width", "height"
SHADOW_SIDE = 2048  # texels of a side of a shadow map
COLUMNS = 2048  # of points that are drawn
LEAST, MOST = np.nextafter(0.0, 1.0), np.finfo(float).max  # lengths > 0, finite


class Stage(GpuOwner):
    """Four passes over maps of one size, in one context. Release it, or use it in a `with`."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], shadow_side: int = SHADOW_SIDE):
        """Take a context, the width and height of the picture [pixels] and the side of the shadow map [texels]."""
        self.context = context
        self._shadow_side = checked_whole("shadow_side", shadow_side, 1, MOST_PIXELS)
        width, height = (checked_whole(name, side, 1, MOST_PIXELS) for name, side in zip(SIDES, size, strict=True))
        self.size = width, height
        self.renderer = Renderer(context, self.size)
        for name in SHADOWS:
            self.renderer.declare(name, (self._shadow_side,) * 2, 1)
        for name in (BACK, OCCLUSION):
            self.renderer.declare(name, self.size, 1)
        self._released = False
        self._view: tuple[float, bool] | None = None  # side of a pixel [mm], and whether it is in perspective
        self._scene: Scene | None = None
        self._mean_reflectance: Floats | None = None

    def draw(self, scene: Scene) -> None:
        """Run passes 1 and 2: the G-buffer of a scene."""
        self._alive()
        self.renderer.run(*self._surface(scene))
        camera = scene.camera
        self._seen(camera.pixel(self.size[1]), camera.is_perspective, scene)

    def unwrapping(self, part: Part, inset: tuple[float, float], has_sky: bool = True) -> list[Pass]:
        """Return passes that lay a part of the scene last drawn out over its uv: positions in the world.

        What the screen does not show is in the way of no light from the sky.

        inset  share of the maps that u and v from 0 to 1 take [-];  has_sky  whether irradiance has the sky's light
        InputError on a part of another scene.
        """
        values = {**self._light_on(part), "inset": inset}
        passes = [_surface("atlas", part, self.renderer.map(SHADOWS[0]), values, clear=0.0), *self._lamps()]
        scene = self._scene
        if scene is not None and scene.has_sky and has_sky:
            seen, open_share = (self.renderer.map(name) for name in ("position_map", OCCLUSION))
            screen = screen_uniforms(scene.camera, self.size)
            passes.append(ambient_pass(scene, screen, {"seen_map": seen, OCCLUSION: open_share}, np.eye(4)))
        return passes

    def irradiance(self, pieces: Sequence[tuple[Part, Mesh]]) -> list[Floats]:
        """Return the irradiance (n, 3) at the vertices of meshes, each on a part of the scene last drawn [-].

        It is a reference's: the light of the sky is that of `sky`, of all meshes at once.
        """
        lamps, places, normals = zip(*(self._lit_points(part, points) for part, points in pieces), strict=True)
        sky = self.sky(np.concatenate(places), np.concatenate(normals))
        ends = np.cumsum([len(light) for light in lamps])[:-1]
        return [light + own for light, own in zip(lamps, np.split(sky, ends), strict=True)]

    def _lit_points(self, part: Part, points: Mesh) -> tuple[Floats, Floats, Floats]:
        """Return irradiance by lamps, places and normals (n, 3) at the vertices of a mesh on a part."""
        count = len(points.position)
        columns = min(count, COLUMNS)
        size = columns, -(-count // columns)
        drawn = replace(points, triangles=np.arange(count, dtype=np.int32))
        values = {**self._light_on(part), "sides": tuple(map(float, size))}
        with Renderer(self.context, size) as renderer:
            shadow, lit = self.renderer.map(SHADOWS[0]), replace(part, mesh=drawn)
            renderer.run(_surface("points", lit, shadow, values, shape=POINTS, clear=0.0), *self._lamps())
            names = IRRADIANCE, "position_map", "normal_map"
            light, where, normals = (renderer.read(name).reshape(-1, 4)[:count, :3].astype(float) for name in names)
        return light, where, normals

    def _lamps(self) -> list[Pass]:
        """Return passes that add lamps beside the first to maps of places in the world."""
        lamps = () if self._scene is None else other_lamps(self._scene, self._shadow_side)
        return [lamp_pass(lamp, self.renderer.map(lamp.shadow), np.eye(4)) for lamp in lamps]

    def upload(self, buffers: Buffers) -> None:
        """Take a G-buffer of numpy arrays in place of a scene; no light shines then, and `render` has no highlights."""
        self._alive()
        require(buffers.size == self.size, "buffers", f"{self.size} pixels, as the stage is", buffers.size)
        for name, array in buffers.maps().items():
            self.renderer.write(name, array)
        self._seen(buffers.pixel, buffers.is_perspective, None)

    def buffers(self) -> Buffers:
        """Return the G-buffer as numpy arrays."""
        view = self._ready()
        return Buffers.of_maps(map(self.renderer.read, SURFACE), *view)

    def true_buffers(self) -> Buffers:
        """Return the G-buffer with the irradiance of a reference: the sky's by `sky_irradiance`."""
        scene, buffers = self._scene, self.buffers()
        if scene is None or not scene.has_sky:
            return buffers
        self.renderer.run(*self._surface(scene, has_sky=False))
        irradiance = self.renderer.read(IRRADIANCE)[..., :3]
        self.renderer.write(IRRADIANCE, buffers.maps()[IRRADIANCE])
        shown = np.any(buffers.normal != 0, axis=-1)
        view = scene.camera.view()
        points = (buffers.position[shown].astype(float) - view[:3, 3]) @ view[:3, :3]
        normals = buffers.normal[shown].astype(float) @ view[:3, :3]
        irradiance[shown] += self.sky(points, normals).astype(np.float32)
        return replace(buffers, irradiance=irradiance)

    def sky(self, points: Floats, normals: Floats, patches: int = PATCHES) -> Floats:
        """Return `sky_irradiance` (n, 3) at points of the scene last drawn."""
        self._ready()
        if self._scene is None:
            return np.zeros((len(points), 3))
        return sky_irradiance(self.context, self._scene, points, normals, patches)

    def scatter(
        self,
        law: By,
        mfp: ArrayLike,
        sampling: Sampling = DEFAULT,
        fixed_alpha: ArrayLike | None = None,
        rows: tuple[int, int] | None = None,
    ) -> Singles:
        """Return the radiant exitance (h, w, 3), A times the blurred irradiance, in its unit: pass 3.

        Radiance is that over pi.

        Args:
            law: one with a shader source, or an `ExactLaw`, which is sampled; or a technique of another kind.
            mfp: transport mean free path of red, green and blue, or one for all [mm].
            sampling: of each pixel.
            fixed_alpha: reduced albedo of the three, or one for all [-]; by default that of A, pixel
                by pixel.
            rows: the first, and the first beyond: only these are drawn and returned, though they gather from all.
        """
        self._scatter(law, mfp, sampling, fixed_alpha, rows)
        first, last = rows or (0, self.size[1])
        return self.renderer.read(EXITANCE)[first:last, :, :3]

    def render(
        self, law: By, mfp: ArrayLike, sampling: Sampling = DEFAULT, fixed_alpha: ArrayLike | None = None
    ) -> Singles:
        """Return the linear radiance (h, w, 3) to the camera [light's unit / sr]: passes 3 and 4; args of `scatter`."""
        self._frame(law, mfp, sampling, fixed_alpha, is_whole=False)
        return self.renderer.read(RADIANCE)[..., :3]

    def time(
        self,
        law: By,
        mfp: ArrayLike,
        sampling: Sampling = DEFAULT,
        repeats: int = 5,
        passes: str = "scatter",
        fixed_alpha: ArrayLike | None = None,
    ) -> list[float]:
        """Return the milliseconds of each repeat, by `seconds`; all is compiled before. Others as of `scatter`.

        passes  "scatter", pass 3 alone, or "frame", all four of the scene last drawn
        """
        require(passes in PASSES, "passes", f"one of {', '.join(PASSES)}", passes)
        is_drawn = passes == "scatter" or self._scene is not None
        require(is_drawn, "passes", "scatter where no scene was drawn", passes)
        by = technique(law)  # a law's source is written once, and not in the time that is taken

        def work() -> None:
            if passes == "frame":
                self._frame(by, mfp, sampling, fixed_alpha, is_whole=True)
            else:
                self._scatter(by, mfp, sampling, fixed_alpha)

        work()
        return [1e3 * seconds(self.context, work) for _ in range(repeats)]

    def release(self) -> None:
        self.renderer.release()
        self._released = True

    def _surface(self, scene: Scene, has_sky: bool = True) -> list[Pass]:
        """Return passes 1 and 2: into shadow maps, and into the maps of a G-buffer."""
        (centre, radius), camera, lit = sphere(scene), scene.camera, self._lit(scene)
        depth = -(camera.view() @ np.append(centre, 1.0))[2]
        near, far = max(depth - MARGIN * radius, 0.01 * radius), depth + MARGIN * radius
        projection = camera.projection(self.size[0] / self.size[1], near, far)
        values = {**lit, "view": camera.view(), "projection": projection}
        passes = shadow_passes(scene.parts, lit, SHADOWS[0])
        passes += [
            _surface("surface", part, SHADOWS[0], values, kept=NEAREST, clear=None if i else 0.0)
            for i, part in enumerate(scene.parts)
        ]
        to_world = np.asarray(np.linalg.inv(camera.view()), float)
        for lamp in other_lamps(scene, self._shadow_side):
            passes += shadow_passes(scene.parts, lamp.uniforms, lamp.shadow)
            passes.append(lamp_pass(lamp, lamp.shadow, to_world))
        if not (scene.has_sky and has_sky):
            return passes
        screen = screen_uniforms(camera, self.size)
        if scene.has_occlusion:
            lens = {"view": camera.view(), "projection": projection}
            passes += occlusion_passes(scene.parts, lens, screen, radius)
        return [*passes, ambient_pass(scene, screen, {"seen_map": "position_map", OCCLUSION: OCCLUSION}, to_world)]

    def _lit(self, scene: Scene) -> dict[str, Any]:
        return lamp_uniforms(sphere(scene), scene.light, self._shadow_side)

    def _light_on(self, part: Part) -> dict[str, Any]:
        """Return uniforms of the light on a part of the scene last drawn, in the world. InputError on another part."""
        self._alive()
        if self._scene is None or not any(one is part for one in self._scene.parts):
            raise InputError("part must be one of the scene last drawn, got another one")
        return {**self._lit(self._scene), "view": np.eye(4)}

    def _seen(self, pixel: float, is_perspective: bool, scene: Scene | None) -> None:
        self._view, self._scene, self._mean_reflectance = (pixel, is_perspective), scene, None

    def _alive(self) -> None:
        if self._released:
            raise InputError("stage must not be used after it was released: make another one")

    def _ready(self) -> tuple[float, bool]:
        self._alive()
        if self._view is None:
            raise InputError("stage must have a scene or buffers: draw or upload comes first")
        return self._view

    def _scatter(
        self,
        law: By,
        mfp: ArrayLike,
        sampling: Sampling,
        fixed_alpha: ArrayLike | None,
        rows: tuple[int, int] | None = None,
    ) -> tuple[Technique, Frame]:
        by, view = technique(law), self._ready()
        lengths = _three("mfp", mfp, "lengths > 0 [mm]", LEAST, MOST)
        alpha = None if fixed_alpha is None else _three("fixed_alpha", fixed_alpha, "albedos in [0, 1]", 0.0, 1.0)
        lamps = () if self._scene is None else other_lamps(self._scene, self._shadow_side)
        frame = Frame(self.size, *view, sampling, lengths, alpha, self._mean, self._scene, lamps)
        by.before(self)
        self.renderer.run(*(replace(one, rows=rows if one.writes == EXITANCE else None) for one in by.passes(frame)))
        return by, frame

    def _frame(
        self, law: By, mfp: ArrayLike, sampling: Sampling, fixed_alpha: ArrayLike | None, is_whole: bool
    ) -> None:
        """Run passes 3 and 4, and 1 and 2 before them if the frame is a whole one."""
        if is_whole and self._scene is not None:
            self.renderer.run(*self._surface(self._scene))
        self.renderer.run(*combination(*self._scatter(law, mfp, sampling, fixed_alpha)))

    def _mean(self) -> Floats:
        """Return the mean A (3,) where light scatters inside, 0 where that is nowhere; computed once a picture."""
        if self._mean_reflectance is None:
            buffers = self.buffers()
            inside = buffers.mask > INSIDE
            mean = buffers.reflectance[inside].mean(axis=0, dtype=float) if inside.any() else np.zeros(3)
            self._mean_reflectance = mean
        return self._mean_reflectance


def _three(name: str, value: ArrayLike, accepted: str, low: float, high: float) -> Floats:
    try:
        three = np.broadcast_to(np.asarray(value, float), 3).copy()
    except (TypeError, ValueError):
        raise InputError(f"{name} must be one number or three, got {value!r}") from None
    require(np.all((three >= low) & (three <= high)), name, accepted, value)
    return three


def _surface(vertex: str, part: Part, shadow: Read, values: dict[str, Any], **more: Any) -> Pass:
    own = {"translucent": float(part.is_translucent), "roughness": part.roughness}
    uv = part.mesh.uv
    tiles = uv.size > 0 and (float(uv[:, 1].min()) < 0.0 or float(uv[:, 1].max()) > 1.0)
    reads: dict[str, Read] = {
        "skin": Smooth(part.reflectance, tiles),
        "relief": Smooth(EVEN if part.relief is None else part.relief, tiles),
        "shadow_map": shadow,
    }
    fragment, source = text("shadow.glsl", "surface.frag"), text(f"{vertex}.vert")
    return Pass(vertex, reads, (*SURFACE, PLACE), fragment, {**values, **own}, source, part.mesh, **more)
