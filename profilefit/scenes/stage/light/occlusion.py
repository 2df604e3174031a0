"""Reference of light from the sky: what the parts of a scene keep from points, by a shadow map for each patch of it.

The sky has patches of equal size, whose light comes from one direction each. What arrives at a point is all light above
its horizon, which is known without patches, less the light of the patches that a part hides. With N patches the error
is some 1 / N of the light where edges are hidden from view by chance, and is measured by twice as many
(`benchmarks/ambient.py`).
"""

from __future__ import annotations

import moderngl
import numpy as np
from numpy.typing import ArrayLike
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import Floats
from profilefit.scenes.stage.light.environment import SkyCells, even_cells, even_directions
from profilefit.scenes.stage.light.lighting import SHADOWS, shadow_passes, shadow_uniforms, sphere
from profilefit.scenes.stage.renderer import SUM, Pass, Renderer, text
from profilefit.scenes.stage.world import Scene

PATCHES, SIDE = 256, 1024  # of the sky, and texels of a side of their shadow maps
MOST_POINTS = 1 << 17  # at which the sky is looked at: between more it is interpolated
NEIGHBOURS, NORMAL = 4, 0.02  # points; a normal's share of a distance, in the radius of the scene
KEPT = "kept_map"
ROW = 1024  # points of a row


def sky_irradiance(
    context: moderngl.Context,
    scene: Scene,
    points: ArrayLike,
    normals: ArrayLike,
    patches: int = PATCHES,
    side: int = SIDE,
) -> Floats:
    """Return the irradiance (n, 3) of the sky, ambient and environment, at points of a scene [light's unit].

    points  (n, 3) of the surface in the world [mm];  normals  (n, 3) unit;  patches, side  see `PATCHES`, `SIDE`
    """
    where, toward = np.asarray(points, float).reshape(-1, 3), np.asarray(normals, float).reshape(-1, 3)
    found = np.broadcast_to(np.asarray(scene.ambient, float), where.shape).copy()
    if scene.environment is not None:
        found += scene.environment.interpolated(toward)
    if scene.has_occlusion and len(where):
        found -= blocked(context, scene, where, toward, patches, side)
    return np.maximum(found, 0.0)


def blocked(
    context: moderngl.Context, scene: Scene, points: Floats, normals: Floats, patches: int = PATCHES, side: int = SIDE
) -> Floats:
    """Return the irradiance (n, 3) of the sky that parts keep from points; arguments of `sky_irradiance`.

    Of more than `MOST_POINTS` that many are looked at, and others are between the nearest of these.
    """
    if len(points) > MOST_POINTS:
        scale = NORMAL * sphere(scene)[1]
        places = np.concatenate([points, scale * normals], axis=1)
        chosen = np.linspace(0, len(points) - 1, MOST_POINTS).astype(int)
        known = blocked(context, scene, points[chosen], normals[chosen], patches, side)
        away, nearest = cKDTree(places[chosen]).query(places, NEIGHBOURS)
        weight = 1.0 / np.maximum(away, 1e-6 * scale)
        return np.asarray(np.einsum("nk,nkc->nc", weight / weight.sum(axis=1, keepdims=True), known[nearest]))
    cells, around = sky_cells(scene, patches), sphere(scene)
    rows = -(-len(points) // ROW)
    with Renderer(context, (ROW, rows)) as renderer:
        renderer.declare(SHADOWS[0], (side, side), 1)
        for name, values in (("position_map", points), ("normal_map", normals)):
            padded = np.zeros((rows * ROW, 4), np.float32)
            padded[: len(points), :3] = values
            renderer.write(name, padded.reshape(rows, ROW, 4))
        renderer.clear(KEPT)
        source = text("shadow.glsl", "blocked.frag")
        for toward, moment in zip(cells.toward, cells.moments, strict=True):
            if not moment.any():
                continue
            uniforms = shadow_uniforms(around, toward, side)
            renderer.run(*shadow_passes(scene.parts, uniforms, SHADOWS[0]))
            reads = {name: name for name in ("position_map", "normal_map", SHADOWS[0])}
            renderer.run(Pass("blocked", reads, KEPT, source, {**uniforms, "moment": moment.T}, kept=SUM))
        return renderer.read(KEPT).reshape(-1, 4)[: len(points), :3].astype(float)


def sky_cells(scene: Scene, patches: int) -> SkyCells:
    """Return a scene's ambient light and environment in so many patches."""
    toward = even_directions(patches)
    even = even_cells(scene.ambient, toward)
    return even if scene.environment is None else scene.environment.cells(toward).plus(even)
