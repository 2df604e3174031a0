"""Error and cost of layers of fur over their number, as OpenGL draws a patch toward one angle."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np

from mcml_sim.media.arrays import Floats
from profilefit.scenes.fur.ball import FurView
from profilefit.scenes.fur.passes import FurSurface
from profilefit.scenes.fur.truth import Patch, cast, random_patch
from profilefit.scenes.fur.ways import WAYS
from profilefit.scenes.stage.judge import ChartPoint
from profilefit.scenes.stage.renderer import Renderer

WIDER = 1.3  # than a ray's way over the skin
AWAY = 3.0  # lengths of a strand, from the tips to where rays start


def wide_patch(density: float, radius: float, length: float, theta: float, least: float, seed: int) -> Patch:
    """Return a random patch so wide that no ray comes by a strand twice; least  its side at least [length]."""
    return random_patch(density, radius, length, max(least, WIDER * float(np.tan(theta)) * length), seed)


def patch_view(patch: Patch, theta: float, size: tuple[int, int]) -> tuple[FurView, Floats]:
    """Return rays toward -x at an angle to the normal, over all the patch, and where they pass the tips (n, 2)."""
    toward = np.array([-np.sin(theta), 0.0, -np.cos(theta)])
    half, far = 0.5 * patch.side, AWAY * patch.length / np.cos(theta)
    middle = np.array([half, half, patch.length])
    view = FurView(middle - far * toward, toward, np.array([half, 0.0, 0.0]), np.array([0.0, half, 0.0]), parallel=True)
    start, _ = view.rays(size)
    return view, (start + far * toward)[..., :2].reshape(-1, 2)


def over_layers(
    context: moderngl.Context, patch: Patch, theta: float, layers: Sequence[int], size: tuple[int, int], turns: int
) -> list[ChartPoint]:
    """Return the root mean square error of the heights of first hits over the length, and milliseconds, of each way.

    theta  of the view to the normal [rad];  size  columns and rows of rays;  turns  in which all are drawn once
    """
    view, start = patch_view(patch, theta, size)
    true, surface = cast(patch, theta, start) / patch.length, FurSurface.of_patch(patch)
    each = [(way, surface.layered(view, way, count)) for way in WAYS for count in layers]
    with Renderer(context, size) as renderer:
        heights = [np.maximum(renderer.image(one)[..., 3].ravel(), 0.0) for _, one in each]
        times = [[renderer.time(one) for _, one in each] for _ in range(turns)]
    return [
        ChartPoint(way.name, one.uniforms["layers"], float(np.sqrt(np.mean((found - true) ** 2))), own)
        for (way, one), found, own in zip(each, heights, zip(*times, strict=True), strict=True)
    ]
