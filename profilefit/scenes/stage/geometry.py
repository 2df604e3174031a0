"""Passes 1 and 2: the depth along the light, and from the camera all that the others need, in four targets at once."""

from __future__ import annotations

from dataclasses import dataclass

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.stage.technique import ShaderProgram
from profilefit.scenes.stage.world import Part, Scene, looking, orthographic, unit
from profilefit.shader.context import check_errors
from profilefit.shader.emit import text_beside

SHADOW_SIDE = 2048
NOWHERE = 1e6  # depth along the light where nothing is [mm]
MARGIN = 1.02  # of the shadow map and of near and far planes around the scene
ANISOTROPY = 8.0
Values = dict[str, object]


@dataclass(frozen=True)
class Sphere:
    """Around everything there is [mm]."""

    centre: NDArray[np.float64]
    radius: float


class Geometry:
    """The programs of both passes and the shadow map."""

    def __init__(self, context: moderngl.Context, shadow_side: int = SHADOW_SIDE):
        self.context = context
        self._shadow, self._surface = (
            ShaderProgram(context, name, *(text_beside(__name__, f"glsl/{name}.{stage}") for stage in ("frag", "vert")))
            for name in ("shadow", "surface")
        )
        self._map = context.texture((shadow_side, shadow_side), 1, dtype="f4")
        self._map.filter = (moderngl.NEAREST, moderngl.NEAREST)
        self._depth = context.depth_renderbuffer((shadow_side, shadow_side))
        self._target = context.framebuffer([self._map], self._depth)
        self._parts: tuple[Part, ...] = ()
        self._drawn: list[_Drawn] = []

    def draw(self, scene: Scene, target: moderngl.Framebuffer) -> None:
        """Both passes; the target has four float textures and a depth. Parts seen before are not sent again."""
        if scene.parts is not self._parts:
            self._release_parts()
            self._drawn = [_Drawn(self.context, part, self._shadow.compiled, self._surface) for part in scene.parts]
            self._parts = scene.parts
        sphere = _around(scene)
        light = self._light(scene, sphere)
        self._draw_shadow(light)
        self._draw_surface(scene, light, sphere, target)

    def release(self) -> None:
        self._release_parts()
        for one in (self._target, self._depth, self._map, self._surface, self._shadow):
            one.release()

    def _release_parts(self) -> None:
        for part in self._drawn:
            part.release()
        self._parts, self._drawn = (), []

    def _light(self, scene: Scene, sphere: Sphere) -> Values:
        toward = unit(scene.light.direction)
        half = MARGIN * sphere.radius
        eye = sphere.centre + 2.0 * sphere.radius * toward
        clip = orthographic(half, half, 0.5 * sphere.radius, 4.0 * sphere.radius) @ looking(eye, sphere.centre)
        return {
            "light_clip": clip,
            "toward_light": tuple(toward),
        }

    def _draw_shadow(self, light: Values) -> None:
        self._shadow.assign({}, light)
        with self.context.scope(self._target, enable_only=moderngl.DEPTH_TEST):
            self._target.clear(NOWHERE, depth=1.0)
            for part in self._drawn:
                part.shadow.render(moderngl.TRIANGLES)
        check_errors(self.context, "shadow")

    def _draw_surface(self, scene: Scene, light: Values, sphere: Sphere, target: moderngl.Framebuffer) -> None:
        camera = scene.camera
        depth = -(camera.view() @ np.append(sphere.centre, 1.0))[2]
        near = max(depth - MARGIN * sphere.radius, 0.01 * sphere.radius)
        values = {
            **light,
            "shadow_pixel": 2.0 * MARGIN * sphere.radius / self._map.width,
            "view": camera.view(),
            "projection": camera.projection(target.width / target.height, near, depth + MARGIN * sphere.radius),
            "light": scene.light.irradiance,
            "ambient": scene.ambient,
        }
        with self.context.scope(target, enable_only=moderngl.DEPTH_TEST):
            target.clear(depth=1.0)
            for part in self._drawn:
                part.draw_surface(self._map, values)
        check_errors(self.context, "surface")


class _Drawn:
    """A part on the GPU, for as long as it is drawn."""

    def __init__(self, context: moderngl.Context, part: Part, shadow: moderngl.Program, surface: ShaderProgram):
        self.part, self._shader = part, surface
        self._vertices = context.buffer(part.mesh.vertices().tobytes())
        self._triangles = context.buffer(part.mesh.triangles.astype("i4").tobytes())
        self.shadow = context.vertex_array(shadow, [(self._vertices, "3f 5x4", "position")], self._triangles)
        names = "position", "normal", "uv"
        self._surface = context.vertex_array(surface.compiled, [(self._vertices, "3f 3f 2f", *names)], self._triangles)
        rows, columns = part.reflectance.shape[:2]
        self._skin = context.texture((columns, rows), 3, part.reflectance.astype("f4").tobytes(), dtype="f4")
        self._skin.repeat_y = False
        self._skin.build_mipmaps()
        self._skin.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._skin.anisotropy = ANISOTROPY

    def draw_surface(self, shadow_map: moderngl.Texture, values: Values) -> None:
        own = {"translucent": float(self.part.is_translucent), "roughness": self.part.roughness}
        self._shader.assign({"skin": self._skin, "shadow_map": shadow_map}, {**values, **own})
        self._surface.render(moderngl.TRIANGLES)

    def release(self) -> None:
        for one in (self.shadow, self._surface, self._vertices, self._triangles, self._skin):
            one.release()


def _around(scene: Scene) -> Sphere:
    points = np.concatenate([part.mesh.position for part in scene.parts])
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return Sphere(centre, float(np.linalg.norm(points - centre, axis=1).max()))
