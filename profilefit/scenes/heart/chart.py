"""What each way of drawing a heart costs, and where texture, screen or both are right: points and maps."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.scenes.heart.scene import SCREEN, SPLIT, TEXTURE, Bench, HeartRequest, Scattering, bench
from profilefit.scenes.stage.judge import TURNS, points
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.picture import ChartPoint
from profilefit.scenes.stage.world import unit

Floats = NDArray[np.float64]
SURE = Sampling(64)  # where a map shows what a way is wrong by, not its noise
CHOSEN = 2000  # pixels of a map's errors
MAPPED = (SPLIT, TEXTURE, SCREEN)


def ways(
    found: Bench, request: HeartRequest, samples: Mapping[str, Sequence[int]], turns: int = TURNS
) -> dict[str, list[ChartPoint]]:
    """Error and cost of each kind of technique with each of its numbers of samples.

    Times are of all passes after the G-buffer: of an atlas, to draw it, to blur it and to read it.
    """
    return {
        kind: points(found.judge, kind, found.way(kind), request.sampling, numbers, turns)
        for kind, numbers in samples.items()
    }


def frames(found: Bench, kinds: Sequence[str], turns: int = TURNS, sampling: Sampling = SURE) -> dict[str, float]:
    """Least milliseconds of a whole frame by each kind, taken in turns."""
    judge, by = found.judge, {kind: found.way(kind) for kind in kinds}
    taken = [[judge.stage.time(one, judge.mfp, sampling, 1, "frame")[0] for one in by.values()] for _ in range(turns)]
    return dict(zip(by, np.min(taken, axis=0).tolist(), strict=True))


def over_texel_and_view(
    context: moderngl.Context,
    request: HeartRequest,
    light: Scattering,
    texels: Sequence[float],
    degrees: Sequence[float],
) -> dict[str, Floats]:
    """Errors (texels, views) of texture, screen and their split: texels [mm], and views turned about the upright."""
    found = {kind: np.empty((len(texels), len(degrees))) for kind in MAPPED}
    for column, one in enumerate(degrees):
        with bench(context, turned(request, one), light, CHOSEN) as seen:
            for row, texel in enumerate(texels):
                with seen.with_texels(texel) as own:
                    for kind in MAPPED:
                        found[kind][row, column] = error(own, kind)
    return found


def turned(request: HeartRequest, degrees: float) -> HeartRequest:
    """Seen from the front, turned by an angle about the upright."""
    angle, camera = np.radians(degrees), request.camera
    away = camera.distance * unit((np.sin(angle), 0.0, np.cos(angle)))
    x, y, z = (np.array(camera.target) + away).tolist()
    return replace(request, camera=replace(camera, eye=(x, y, z)))


def error(found: Bench, kind: str) -> float:
    """Root mean square error of a way with many samples, over the mean of the truth [-]."""
    judge = found.judge
    return judge.rmse(judge.stage.scatter(found.way(kind), judge.mfp, SURE))
