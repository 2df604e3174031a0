"""Error against cost of each technique for layers, and the shares of their light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np

from mcml_sim import Medium, exact
from mcml_sim.media.fresnel import fresnel
from profilefit.scenes.layers.passes import diffusely_once, once
from profilefit.scenes.layers.scene import LayersRequest, laws_of, reference, technique
from profilefit.scenes.layers.truth import StackTable
from profilefit.scenes.stage.judge import TURNS, points
from profilefit.scenes.stage.picture import ChartPoint
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import NamedTechnique


class Split(NamedTuple):
    """Shares of the light of one direction that come back, of what arrives [-].

    single  scattered once;  multiple  scattered more often;  mirror  thrown back by the surface
    """

    single: float
    multiple: float
    mirror: float


def split(medium: Medium, illumination: str = "searchlight") -> Split:
    """Return single : multiple : mirrored light of a stack of one index, exact; of g > 0 the similar stack's whole.

    illumination  "searchlight", along the normal, or "diffuse"
    """
    similar = Medium(tuple(layer.similar for layer in medium.layers), medium.n_above)
    light = exact.solve(similar, illumination)
    if illumination == "diffuse":
        first, mirror = diffusely_once(medium), light.specular
    else:
        first = float(once(medium, np.array([1.0]))[0])
        mirror = float(fresnel(medium.n_above, medium.layers[0].n, 1.0)[0])
    return Split(first, max(light.reflectance - first, 0.0), mirror)


def ways(
    stage: Stage,
    request: LayersRequest,
    table: StackTable,
    samples: Mapping[str, Sequence[int]],
    others: Mapping[str, NamedTechnique],
    turns: int = TURNS,
) -> dict[str, list[ChartPoint]]:
    """Return error and cost of techniques with each of their numbers of samples, of the scene that a stage draws.

    table    exact light of the scene's stack
    samples  of the kinds of a file, and of `others` by their names
    """
    judge, laws = reference(stage, request, table), laws_of(request)
    named = {kind: others.get(kind) or technique(request.changed(technique={"kind": kind}), laws) for kind in samples}
    return {kind: points(stage, judge, named[kind], request.sampling, samples[kind], turns) for kind in samples}
