"""Passes 1 and 2: the depth along the light, and from the camera all that the others need, in five targets at once."""

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
        self._unwrapped: ShaderProgram | None = None

    def draw(self, scene: Scene, target: moderngl.Framebuffer) -> None:
        """Both passes; the target has five float textures and a depth. Parts seen before are not sent again."""
        if scene.parts is not self._parts:
            self._release_parts()
            self._drawn = [_Drawn(self.context, part, self._shadow.compiled) for part in scene.parts]
            self._parts = scene.parts
        sphere = _around(scene)
        light = self._light(scene, sphere)
        self._draw_shadow(light)
        self._draw_surface(scene, light, sphere, target)

    def unwrap(self, part: Part, scene: Scene, target: moderngl.Framebuffer, inset: tuple[float, float]) -> None:
        """After `draw` of the scene: one of its parts laid out over its uv, positions and normals in the world.

        inset  share of the target that u and v from 0 to 1 take
        """
        if self._unwrapped is None:
            texts = (text_beside(__name__, f"glsl/{file}") for file in ("surface.frag", "atlas.vert"))
            self._unwrapped = ShaderProgram(self.context, "atlas", *texts)
        drawn = next(one for one in self._drawn if one.part is part)
        light = self._light(scene, _around(scene))
        values = {**light, **self._shading(scene), "view": np.eye(4), "inset": inset}
        with self.context.scope(target, enable_only=moderngl.NOTHING):
            target.clear()
            drawn.draw_surface(self._map, values, self._unwrapped)
        check_errors(self.context, "atlas")

    def release(self) -> None:
        self._release_parts()
        if self._unwrapped is not None:
            self._unwrapped.release()
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
            **self._shading(scene),
            "view": camera.view(),
            "projection": camera.projection(target.width / target.height, near, depth + MARGIN * sphere.radius),
        }
        with self.context.scope(target, enable_only=moderngl.DEPTH_TEST):
            target.clear(depth=1.0)
            for part in self._drawn:
                part.draw_surface(self._map, values, self._surface)
        check_errors(self.context, "surface")

    def _shading(self, scene: Scene) -> Values:
        pixel = 2.0 * MARGIN * _around(scene).radius / self._map.width
        return {"shadow_pixel": pixel, "light": scene.light.irradiance, "ambient": scene.ambient}


class _Drawn:
    """A part on the GPU, for as long as it is drawn."""

    def __init__(self, context: moderngl.Context, part: Part, shadow: moderngl.Program):
        self.context, self.part = context, part
        self._vertices = context.buffer(part.mesh.vertices().tobytes())
        self._triangles = context.buffer(part.mesh.triangles.astype("i4").tobytes())
        self.shadow = context.vertex_array(shadow, [(self._vertices, "3f 5x4", "position")], self._triangles)
        self._seen: dict[ShaderProgram, moderngl.VertexArray] = {}
        rows, columns = part.reflectance.shape[:2]
        self._skin = context.texture((columns, rows), 3, part.reflectance.astype("f4").tobytes(), dtype="f4")
        self._skin.repeat_y = False
        self._skin.build_mipmaps()
        self._skin.filter = (moderngl.LINEAR_MIPMAP_LINEAR, moderngl.LINEAR)
        self._skin.anisotropy = ANISOTROPY

    def draw_surface(self, shadow_map: moderngl.Texture, values: Values, by: ShaderProgram) -> None:
        own = {"translucent": float(self.part.is_translucent), "roughness": self.part.roughness}
        by.assign({"skin": self._skin, "shadow_map": shadow_map}, {**values, **own})
        if by not in self._seen:
            content = [(self._vertices, "3f 3f 2f", "position", "normal", "uv")]
            self._seen[by] = self.context.vertex_array(by.compiled, content, self._triangles)
        self._seen[by].render(moderngl.TRIANGLES)

    def release(self) -> None:
        for array in (self.shadow, *self._seen.values()):
            array.release()
        for one in (self._vertices, self._triangles, self._skin):
            one.release()


def _around(scene: Scene) -> Sphere:
    points = np.concatenate([part.mesh.position for part in scene.parts])
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return Sphere(centre, float(np.linalg.norm(points - centre, axis=1).max()))
