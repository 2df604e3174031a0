"""Error of each technique for a heart over its cost, and of a screen that does not see all of the surface."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import ArrayLike

from mcml_sim.media.arrays import Floats
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.heart.scene import HeartRender, HeartRequest
from profilefit.scenes.heart.truth import summed
from profilefit.scenes.stage.judge import TURNS, ChartPoint, points
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.reference.surface_sum import Elements

SURE = Sampling(64)  # where the error of a technique is asked for, not its noise


def ways(
    drawn: HeartRender, request: HeartRequest, samples: Mapping[str, Sequence[int]], turns: int = TURNS
) -> dict[str, list[ChartPoint]]:
    """Return error and cost of each kind of technique with each of its numbers of samples.

    Times are of all passes after the G-buffer: of an atlas, to draw it, to blur it and to read it.
    """
    return {
        kind: points(drawn.stage, drawn.judge, drawn.named(kind), request.sampling, numbers, turns)
        for kind, numbers in samples.items()
    }


def error(drawn: HeartRender, kind: str) -> float:
    """Return the root mean square error of a technique with many samples, over the mean of the reference [-]."""
    return drawn.judge.rmse(drawn.stage.scatter(drawn.technique(kind), drawn.light.mfp, SURE))


def occlusion_error(elements: Elements, seen: ArrayLike, kernel: Kernel, at: ArrayLike, own: ArrayLike) -> Floats:
    """Return the error of a screen-space gather that is caused by hidden surface: (m, 3), in the irradiance's unit.

    seen  (n,) of the elements, 0 or 1;  at, own  (m, 3) points that gather, and their irradiance
    Light of what is seen less that of all, each over its share of the kernel: as gathers on a screen have it.
    """
    light, one = elements.irradiance, np.ones_like(elements.irradiance)
    visible = np.asarray(seen, float)[:, None]
    columns = np.concatenate([visible * light, visible * one, light, one], axis=1)
    here, unity = np.asarray(own, float), np.ones(np.shape(own))
    of = elements._replace(irradiance=columns), kernel.variances, np.tile(kernel.weights, (1, 4))
    gathered = summed(*of, at, np.concatenate([here, unity, here, unity], axis=1))
    part, share, whole, energy = np.split(gathered, 4, axis=1)
    least = np.finfo(float).tiny
    return part / np.maximum(share, least) - whole / np.maximum(energy, least)
