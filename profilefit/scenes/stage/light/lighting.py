"""Light of a scene as passes over a G-buffer: lamps with a shadow map each, and the sky less what is in its way."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.light.environment import Environment
from profilefit.scenes.stage.renderer import NEAREST, SUM, Pass, Read, text
from profilefit.scenes.stage.world import MOST_LAMPS, Camera, Light, Part, Rgb, Scene, looking, orthographic, rgb, unit

IRRADIANCE, OCCLUSION, BACK = "irradiance_map", "occlusion_map", "back_map"
SHADOWS = ("shadow_map", *(f"shadow_map_{number}" for number in range(2, MOST_LAMPS + 1)))  # of one channel
NOWHERE = 1e6  # depth along the light where nothing is [mm]
MARGIN = 1.02  # of the shadow map and of near and far planes around the scene
SLICES, STEPS = 2, 24  # of the search for what occludes: through the line of sight, and to each side


class OtherLamp(NamedTuple):
    """Lamp beside the first, as a frame's shaders see it.

    Attributes:
        shadow: map of depths along its light.
        uniforms: of `shadow.glsl`, its light, and `to_world`, from view space.
    """

    shadow: str
    uniforms: Mapping[str, Any]


def sphere(scene: Scene) -> tuple[Floats, float]:
    """Return middle and radius of a sphere around all parts [mm]."""
    points = np.concatenate([part.mesh.position for part in scene.parts])
    centre = 0.5 * (points.min(axis=0) + points.max(axis=0))
    return centre, float(np.linalg.norm(points - centre, axis=1).max())


def shadow_uniforms(around: tuple[Floats, float], direction: Sequence[float] | Floats, side: int) -> dict[str, Any]:
    """Return uniforms of `shadow.glsl`: a map of so many texels a side over a sphere, seen from a direction."""
    (centre, radius), toward = around, unit(direction)
    half = MARGIN * radius
    clip = orthographic(half, half, 0.5 * radius, 4.0 * radius) @ looking(centre + 2.0 * radius * toward, centre)
    return {"light_clip": clip, "toward_light": tuple(toward), "shadow_pixel": 2.0 * half / side}


def lamp_uniforms(around: tuple[Floats, float], lamp: Light, side: int) -> dict[str, Any]:
    """Return uniforms of a lamp and of its shadow map."""
    return {**shadow_uniforms(around, lamp.direction, side), "light": lamp.irradiance}


def shadow_passes(parts: Sequence[Part], uniforms: Mapping[str, Any], into: str) -> list[Pass]:
    """Return the passes that fill a shadow map."""
    light = {name: uniforms[name] for name in ("light_clip", "toward_light")}
    texts = text("shadow.frag"), text("shadow.vert")
    return [
        Pass("shadow", {}, into, texts[0], light, texts[1], part.mesh, kept=NEAREST, clear=None if i else NOWHERE)
        for i, part in enumerate(parts)
    ]


def other_lamps(scene: Scene, side: int) -> tuple[OtherLamp, ...]:
    """Return the lamps of a scene beside the first."""
    if not scene.more:
        return ()
    around, to_world = sphere(scene), np.linalg.inv(scene.camera.view())
    return tuple(
        OtherLamp(name, {**lamp_uniforms(around, lamp, side), "to_world": to_world})
        for name, lamp in zip(SHADOWS[1:], scene.more, strict=False)
    )


def lamp_pass(lamp: OtherLamp, shadow: Read, to_world: Floats) -> Pass:
    """Return the pass that adds a lamp's light to the irradiance of maps, whose space `to_world` maps to the world."""
    reads: dict[str, Read] = {**_surface(), "shadow_map": shadow}
    uniforms = {**lamp.uniforms, "to_world": to_world}
    return Pass("lamp", reads, IRRADIANCE, text("shadow.glsl", "lamp.frag"), uniforms, kept=SUM)


def occlusion_passes(
    parts: Sequence[Part],
    lens: Mapping[str, Any],
    screen: Mapping[str, Any],
    reach: float,
    slices: int = SLICES,
    steps: int = STEPS,
) -> list[Pass]:
    """Return passes from a G-buffer in view space to the share of the sky's light that arrives.

    lens, screen  uniforms `view` and `projection`, and those of `screen_uniforms`;  reach  of what occludes [mm]
    """
    uniforms = {**screen, "reach": reach, "slices": slices, "steps": steps}
    backs = [
        Pass("back", {}, BACK, text("back.frag"), lens, text("surface.vert"), part.mesh, kept=NEAREST, clear=first)
        for part, first in zip(parts, [0.0, *[None] * (len(parts) - 1)], strict=True)
    ]
    return [*backs, Pass("occlusion", {**_surface(), BACK: BACK}, OCCLUSION, text("occlusion.frag"), uniforms)]


def ambient_pass(scene: Scene, screen: Mapping[str, Any], reads: Mapping[str, Read], to_world: Floats) -> Pass:
    """Return the pass that adds the sky's light to the irradiance of maps.

    screen  the camera's uniforms of the picture in which occlusion was found;  reads  its `seen_map`, `occlusion_map`
    to_world  from the maps' space to the world
    """
    uniforms = {
        **screen,
        "to_world": to_world,
        "to_view": scene.camera.view() @ to_world,
        "ambient": scene.ambient,
        "harmonics": harmonics_of(scene.environment),
        "occluded": float(scene.has_occlusion),
    }
    return Pass(
        "ambient", {**_surface(), **reads}, IRRADIANCE, text("harmonics.glsl", "ambient.frag"), uniforms, kept=SUM
    )


def harmonics_of(sky: Environment | None) -> list[Rgb]:
    """Return the nine coefficients of an environment as a uniform, 0 where there is none."""
    return [(0.0, 0.0, 0.0)] * 9 if sky is None else [rgb(row) for row in sky.harmonics]


def screen_uniforms(camera: Camera, size: tuple[int, int]) -> dict[str, Any]:
    """Return the uniforms of a picture's pixels: `size`, `pixel` [mm] and `perspective`."""
    columns, rows = size
    perspective = float(camera.is_perspective)
    return {"size": (float(columns), float(rows)), "pixel": camera.pixel(rows), "perspective": perspective}


def _surface() -> dict[str, Read]:
    return {"position_map": "position_map", "normal_map": "normal_map"}
