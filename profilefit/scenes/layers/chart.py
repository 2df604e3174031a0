"""Where layers matter, and what each way of drawing them costs: points and maps, for a report to draw."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Layer, Medium, exact
from mcml_sim.media.fresnel import fresnel
from profilefit.laws.stack import StackLaw
from profilefit.recipes.stack.gaussians import medium_gaussians
from profilefit.scenes.layers.half_space import one_half_space
from profilefit.scenes.layers.law import plate_of
from profilefit.scenes.layers.passes import diffusely_once, of_gaussians, of_table, once
from profilefit.scenes.layers.scene import LayersRequest, Way, judged, laws_of, technique
from profilefit.scenes.layers.truth import StackTable
from profilefit.scenes.stage.judge import TURNS, points
from profilefit.scenes.stage.picture import ChartPoint
from profilefit.scenes.stage.stage import Stage

Floats = NDArray[np.float64]
TABLE, GAUSSIANS = "exact table", "gaussians"


class Split(NamedTuple):
    """Where the light of one direction goes that comes back [-]: shares of what arrives.

    single  scattered once;  multiple  scattered more often;  mirror  thrown back by the surface
    """

    single: float
    multiple: float
    mirror: float


def split(medium: Medium, illumination: str = "searchlight") -> Split:
    """Single : multiple : mirrored light of a stack of one index, exact; of g > 0 the similar stack's whole.

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


def one_half_space_errors(
    thicknesses: Sequence[float], mfps: Sequence[float], above: float = 0.95, below: float = 0.98, n: float = 1.4
) -> Floats:
    """Error of the one half space nearest to two layers, as a share of white: (thicknesses, mfps).

    thicknesses  of the first layer, mfps of what lies below, both in mean free paths of the first
    above, below  albedos [-];  n  of both. Root mean square near a step edge of diffuse light; exact.
    """
    return np.array(
        [
            [one_half_space(Medium((_layer(n, above, 1.0, d), _layer(n, below, mfp, np.inf)))).error for mfp in mfps]
            for d in thicknesses
        ]
    )


def ways(
    stage: Stage, request: LayersRequest, table: StackTable, samples: Mapping[str, Sequence[int]], turns: int = TURNS
) -> dict[str, list[ChartPoint]]:
    """Error and cost of each kind of technique with each of its numbers of samples, of the scene that is requested.

    samples  of the kinds of a file, of `TABLE`, exact light by tables of each thickness, and of "gaussians:N", N
             Gaussians fitted at the thickness of the file
    """
    judge, laws = judged(stage, request, table), laws_of(request.stack)
    found = {}
    for kind, numbers in samples.items():
        way = _way(kind, request, table, laws)
        found[kind] = points(way.judged(judge), way.label, way.by, request.sampling, numbers, turns)
    return found


def _way(kind: str, request: LayersRequest, table: StackTable, laws: tuple[StackLaw, ...]) -> Way:
    light = request.stack.illumination
    plates = [plate_of(medium, light) for medium in request.media]
    if kind == TABLE:
        return Way(kind, of_table(table, plates), request.mfp)
    name, _, count = kind.partition(":")
    if name == GAUSSIANS:
        sums = [medium_gaussians(medium, light, int(count)) for medium in request.media]
        return Way(f"{count} Gaussians", of_gaussians(sums, plates), request.mfp)
    return technique(replace(request, kind=kind), laws)


def _layer(n: float, alpha: float, mfp: float, thickness: float) -> Layer:
    return Layer(n, (1.0 - alpha) / mfp, alpha / mfp, 0.0, thickness)
