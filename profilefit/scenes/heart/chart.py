"""Cost of each technique for a heart, and where texture, screen or both are right: points and maps for a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.heart.scene import (
    SCREEN,
    SPLIT,
    TEXTURE,
    HeartRender,
    HeartRequest,
    Scattering,
    reference_render,
)
from profilefit.scenes.stage.judge import TURNS, points
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.picture import ChartPoint

Floats = NDArray[np.float64]
SURE = Sampling(64)  # where a map shows the error of a technique, not its noise
CHOSEN = 2000  # pixels of a map's errors
MAPPED = (SPLIT, TEXTURE, SCREEN)


def ways(
    drawn: HeartRender, request: HeartRequest, samples: Mapping[str, Sequence[int]], turns: int = TURNS
) -> dict[str, list[ChartPoint]]:
    """Return error and cost of each kind of technique with each of its numbers of samples.

    Times are of all passes after the G-buffer: of an atlas, to draw it, to blur it and to read it.
    """
    return {
        kind: points(drawn.stage, drawn.judge, drawn.pair(kind), request.sampling, numbers, turns)
        for kind, numbers in samples.items()
    }


def frames(drawn: HeartRender, kinds: Sequence[str], turns: int = TURNS, sampling: Sampling = SURE) -> dict[str, float]:
    """Return the least milliseconds of a whole frame by each kind, taken in turns."""
    stage, pairs = drawn.stage, [drawn.pair(kind) for kind in kinds]
    times = [[stage.time(one.by, one.mfp, sampling, 1, "frame")[0] for one in pairs] for _ in range(turns)]
    return dict(zip(kinds, np.min(times, axis=0).tolist(), strict=True))


def over_texel_and_view(
    context: moderngl.Context,
    request: HeartRequest,
    light: Scattering,
    texels: Sequence[float],
    degrees: Sequence[float],
) -> dict[str, Floats]:
    """Return errors (texels, views) of texture, screen and their split.

    Args:
        context: of OpenGL.
        request: of the scene.
        light: of its stack.
        texels: mean sides [mm].
        degrees: by which views are turned about the upright.
    """
    errors = {kind: np.empty((len(texels), len(degrees))) for kind in MAPPED}
    for column, one in enumerate(degrees):
        with reference_render(context, turned(request, one), light, CHOSEN) as seen:
            for row, texel in enumerate(texels):
                with seen.with_texels(texel) as own:
                    for kind in MAPPED:
                        errors[kind][row, column] = error(own, kind)
    return errors


def turned(request: HeartRequest, degrees: float) -> HeartRequest:
    """Return the request seen from the front, turned by an angle about the upright."""
    angle, distance = np.radians(degrees), request.camera.distance
    return request.changed(camera_table={"direction": (np.sin(angle), 0.0, np.cos(angle)), "distance": distance})


def error(drawn: HeartRender, kind: str) -> float:
    """Return the root mean square error of a technique with many samples, over the mean of the reference [-]."""
    return drawn.judge.rmse(drawn.stage.scatter(drawn.technique(kind), drawn.light.mfp, SURE))
