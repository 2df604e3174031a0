"""Error against cost of each technique for layers, and error of one half space: points and maps for a report."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcml_sim import Layer, Medium, exact
from mcml_sim.media.fresnel import fresnel
from profilefit.laws.stack import StackLaw
from profilefit.recipes.stack.gaussians import shared_gaussians
from profilefit.scenes.layers.half_space import one_half_space
from profilefit.scenes.layers.law import plate_of
from profilefit.scenes.layers.passes import diffusely_once, of_gaussians, of_table, once
from profilefit.scenes.layers.scene import LayersRequest, laws_of, reference, technique
from profilefit.scenes.layers.truth import StackTable
from profilefit.scenes.stage.judge import TURNS, points
from profilefit.scenes.stage.picture import ChartPoint
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.technique import TechniquePair, alone

Floats = NDArray[np.float64]
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


def one_half_space_errors(
    thicknesses: Sequence[float], mfps: Sequence[float], above: float = 0.95, below: float = 0.98, n: float = 1.4
) -> Floats:
    """Return the error of the one half space nearest to two layers, as a share of white: (thicknesses, mfps).

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
    """Return error and cost of each kind of technique with each of its numbers of samples, of the scene requested.

    Args:
        stage: that draws the scene.
        request: of the scene.
        table: exact light of its stack.
        samples: of the kinds of a file, of `TABLE`, exact light by tables of each thickness, and of "gaussians:N", N
            Gaussians fitted at the thickness of the file.
        turns: how often each is timed.
    """
    judge, laws = reference(stage, request, table), laws_of(request)
    return {
        kind: points(stage, judge, _technique(kind, request, table, laws), request.sampling, numbers, turns)
        for kind, numbers in samples.items()
    }


def _technique(kind: str, request: LayersRequest, table: StackTable, laws: tuple[StackLaw, ...]) -> TechniquePair:
    light = request.illumination
    plates = [plate_of(medium, light) for medium in request.media]
    if kind == TABLE:
        return alone(kind, of_table(table, plates), request.mfp)
    name, _, count = kind.partition(":")
    if name == GAUSSIANS:
        sums = [shared_gaussians((medium,), light, int(count))[0] for medium in request.media]
        return alone(f"{count} Gaussians", of_gaussians(sums, plates), request.mfp)
    return technique(request.changed(technique={"kind": kind}), laws)


def _layer(n: float, alpha: float, mfp: float, thickness: float) -> Layer:
    return Layer(n, (1.0 - alpha) / mfp, alpha / mfp, 0.0, thickness)
