"""Error against cost of each technique for layers, and the shares of their light."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

from mcml_sim import Medium, exact
from mcml_sim.media.fresnel import fresnel
from profilefit.laws.stack import StackLaw
from profilefit.recipes.stack.gaussians import medium_gaussians
from profilefit.scenes.layers.law import plate_of
from profilefit.scenes.layers.passes import diffusely_once, of_gaussians, of_table, once
from profilefit.scenes.layers.scene import LayersRequest, laws_of, reference, technique
from profilefit.scenes.layers.truth import StackTable
from profilefit.scenes.stage.judge import TURNS, points
from profilefit.scenes.stage.picture import ChartPoint
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import TechniquePair, alone

TABLE, GAUSSIANS = "exact table", "gaussians"


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
    stage: Stage, request: LayersRequest, table: StackTable, samples: Mapping[str, Sequence[int]], turns: int = TURNS
) -> dict[str, list[ChartPoint]]:
    """Return error and cost of each kind of technique with each of its numbers of samples, of the scene requested.

    Args:
        stage: that draws the scene.
        request: of the scene.
        table: exact light of its stack.
        samples: of the kinds of a file, of `TABLE`, exact light by tables of each thickness, and of "gaussians:N", N
            Gaussians fitted at the thickness of the file.
        turns: how often each is timed.
    """
    judge, laws = reference(stage, request, table), laws_of(request.stack)
    return {
        kind: points(stage, judge, _technique(kind, request, table, laws), request.sampling, numbers, turns)
        for kind, numbers in samples.items()
    }


def _technique(kind: str, request: LayersRequest, table: StackTable, laws: tuple[StackLaw, ...]) -> TechniquePair:
    light = request.stack.illumination
    plates = [plate_of(medium, light) for medium in request.media]
    if kind == TABLE:
        return alone(kind, of_table(table, plates), request.mfp)
    name, _, count = kind.partition(":")
    if name == GAUSSIANS:
        sums = [medium_gaussians(medium, light, int(count)) for medium in request.media]
        return alone(f"{count} Gaussians", of_gaussians(sums, plates), request.mfp)
    return technique(replace(request, kind=kind), laws)
