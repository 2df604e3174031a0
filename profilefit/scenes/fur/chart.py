"""Error and cost of layers of fur over their number, as OpenGL draws a patch toward one angle."""

from __future__ import annotations

from collections.abc import Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.fur.ball import FurView
from profilefit.scenes.fur.passes import FurPasses, FurSurface
from profilefit.scenes.fur.truth import Patch, cast, random_patch
from profilefit.scenes.fur.ways import WAYS, FurWay
from profilefit.scenes.stage.picture import ChartPoint

Floats = NDArray[np.float64]
WIDER = 1.3  # than a ray's way over the skin
AWAY = 3.0  # lengths of a strand, from the tips to where rays start


def wide_patch(density: float, radius: float, length: float, theta: float, least: float, seed: int) -> Patch:
    """A random patch so wide that no ray at an angle comes by a strand twice; least  its side at least [length]."""
    return random_patch(density, radius, length, max(least, WIDER * float(np.tan(theta)) * length), seed)


def patch_view(patch: Patch, theta: float, size: tuple[int, int]) -> tuple[FurView, Floats]:
    """Rays toward -x at an angle to the normal, over all the patch; where they pass the tips (n, 2), row by row."""
    toward = np.array([-np.sin(theta), 0.0, -np.cos(theta)])
    half, far = 0.5 * patch.side, AWAY * patch.length / np.cos(theta)
    middle = np.array([half, half, patch.length])
    view = FurView(middle - far * toward, toward, np.array([half, 0.0, 0.0]), np.array([0.0, half, 0.0]), parallel=True)
    start, _ = view.rays(size)
    return view, (start + far * toward)[..., :2].reshape(-1, 2)


def over_layers(
    context: moderngl.Context,
    patch: Patch,
    theta: float,
    layers: Sequence[int],
    size: tuple[int, int],
    turns: int,
    ways: Sequence[FurWay] = WAYS,
) -> list[ChartPoint]:
    """Of each way and number: root mean square error of the heights of first hits over the length, and milliseconds.

    theta  of the view to the normal [rad];  size  columns and rows of rays;  turns  in which all are drawn once
    """
    view, start = patch_view(patch, theta, size)
    true = cast(patch, theta, start) / patch.length
    each = [(way, one) for way in ways for one in layers]
    errors: list[float] = []
    times: list[list[float]] = [[] for _ in each]
    with FurPasses(context, FurSurface.of_patch(patch), size) as passes:
        for way, one in each:
            found = np.maximum(passes.hits(view, way, one)[..., 3].ravel(), 0.0)
            errors.append(float(np.sqrt(np.mean((found - true) ** 2))))
        for _ in range(turns):
            for (way, one), taken in zip(each, times, strict=True):
                taken.append(passes.milliseconds(passes.layered(view, way, one)))
    return [
        ChartPoint(way.name, one, error, tuple(taken))
        for (way, one), error, taken in zip(each, errors, times, strict=True)
    ]
