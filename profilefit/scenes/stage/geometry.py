"""Passes 1 and 2: the depth along the light, and from the camera all that the others need, in five maps at once."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.stage.buffers import PLACE, SURFACE
from profilefit.scenes.stage.renderer import NEAREST, Pass, Read, Smooth
from profilefit.scenes.stage.world import Part, Scene, looking, orthographic, unit
from profilefit.shader.emit import text_beside

SHADOW, SHADOW_SIDE = "shadow_map", 2048  # of one channel, and of that many texels a side
NOWHERE = 1e6  # depth along the light where nothing is [mm]
MARGIN = 1.02  # of the shadow map and of near and far planes around the scene
Values = dict[str, Any]


@dataclass(frozen=True)
class Sphere:
    """Sphere around all parts of a scene [mm]."""

    centre: NDArray[np.float64]
    radius: float

    @classmethod
    def around(cls, scene: Scene) -> Sphere:
        points = np.concatenate([part.mesh.position for part in scene.parts])
        centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
        return cls(centre, float(np.linalg.norm(points - centre, axis=1).max()))


def surface_passes(scene: Scene, aspect: float, shadow_side: int) -> list[Pass]:
    """Return passes 1 and 2 of a scene: into `SHADOW`, of `shadow_side` texels, then into the maps of a G-buffer.

    Args:
        scene: the parts, light and camera.
        aspect: width of the picture over its height [-].
        shadow_side: texels of a side of the shadow map.
    """
    sphere, camera = Sphere.around(scene), scene.camera
    light = _light(scene, sphere)
    depth = -(camera.view() @ np.append(sphere.centre, 1.0))[2]
    near = max(depth - MARGIN * sphere.radius, 0.01 * sphere.radius)
    values = {
        **light,
        **_shading(scene, sphere, shadow_side),
        "view": camera.view(),
        "projection": camera.projection(aspect, near, depth + MARGIN * sphere.radius),
    }
    fragment, vertex = _text("shadow.frag"), _text("shadow.vert")
    return [
        Pass("shadow", {}, SHADOW, fragment, light, vertex, part.mesh, kept=NEAREST, clear=None if number else NOWHERE)
        for number, part in enumerate(scene.parts)
    ] + [
        _surface("surface", part, SHADOW, values, kept=NEAREST, clear=None if number else 0.0)
        for number, part in enumerate(scene.parts)
    ]


def unwrapping(part: Part, scene: Scene, shadow: moderngl.Texture, inset: tuple[float, float]) -> Pass:
    """Return the pass that lays a part of a scene out over its uv, positions and normals in the world.

    Args:
        part: one of the scene's.
        scene: whose light falls on it.
        shadow: the shadow map of that scene.
        inset: share of the maps that u and v from 0 to 1 take [-].
    """
    sphere = Sphere.around(scene)
    values = {**_light(scene, sphere), **_shading(scene, sphere, shadow.width), "view": np.eye(4), "inset": inset}
    return _surface("atlas", part, shadow, values, clear=0.0)


def _surface(vertex: str, part: Part, shadow: Read, values: Values, **more: Any) -> Pass:
    own = {"translucent": float(part.is_translucent), "roughness": part.roughness}
    reads: dict[str, Read] = {"skin": Smooth(part.reflectance), "shadow_map": shadow}
    fragment, text = _text("surface.frag"), _text(f"{vertex}.vert")
    return Pass(vertex, reads, (*SURFACE, PLACE), fragment, {**values, **own}, text, part.mesh, **more)


def _light(scene: Scene, sphere: Sphere) -> Values:
    toward, half = unit(scene.light.direction), MARGIN * sphere.radius
    eye = sphere.centre + 2.0 * sphere.radius * toward
    clip = orthographic(half, half, 0.5 * sphere.radius, 4.0 * sphere.radius) @ looking(eye, sphere.centre)
    return {"light_clip": clip, "toward_light": tuple(toward)}


def _shading(scene: Scene, sphere: Sphere, shadow_side: int) -> Values:
    pixel = 2.0 * MARGIN * sphere.radius / shadow_side
    return {"shadow_pixel": pixel, "light": scene.light.irradiance, "ambient": scene.ambient}


def _text(file: str) -> str:
    return text_beside(__name__, f"glsl/{file}")
