"""Error against cost of each technique for layers."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

from profilefit.scenes.layers.scene import LayersRequest, laws_of, reference, technique
from profilefit.scenes.layers.truth import StackTable
from profilefit.scenes.stage.judge import TURNS, ChartPoint, points
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import NamedTechnique


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
