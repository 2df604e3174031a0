"""Costs of techniques for a sea, and the water in which each is accurate: over maps, pixels and scattering."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import moderngl

from profilefit.scenes.sea.bench import SeaBench, bench
from profilefit.scenes.sea.caustics import Splat
from profilefit.scenes.sea.haze import KINDS
from profilefit.scenes.sea.passes import Passes
from profilefit.scenes.sea.request import SeaRequest

TURNS = 3


class MapPoint(NamedTuple):
    """Error of a picture [-] by maps of light that take so many milliseconds, the least of `TURNS`."""

    name: str
    rmse: float
    milliseconds: float


def over_maps(found: SeaBench, slices: Sequence[int]) -> list[MapPoint]:
    """Judge the request's kind by each splat, and by numbers of maps in depths with the splat that it has."""
    of, splats = found.request, (Splat.POINTS, Splat.FACES, Splat.CELLS)
    told: list[MapPoint] = []
    ways = [(f"{one.value}, {of.slices} slices", (one, one), of.slices) for one in splats]
    ways += [(f"{of.splats[1].value}, {one} slices", of.splats, one) for one in slices]
    for name, by, count in ways:
        with Passes(found.passes.context, of.world, by, of.vertices, of.texels, count) as passes:
            passes.light()  # compiled
            taken = min(sum(passes.light().values()) for _ in range(TURNS))
            own = found._replace(passes=passes)
            told.append(MapPoint(name, own.rmse(own.view(of.kind, of.sampling.samples)[0]), taken))
    return told


def over_pixels(found: SeaBench, supersampling: Sequence[int]) -> list[MapPoint]:
    """Judge the request's kind by views of a pixel along a side; time is the view's."""
    told = []
    for fine in supersampling:
        own = found._replace(request=replace(found.request, supersampling=fine))
        point = own.point(own.request.kind, own.request.sampling.samples, TURNS)
        told.append(MapPoint(f"{fine} x {fine} views of a pixel", point.rmse, min(point.milliseconds)))
    return told


def over_water(
    context: moderngl.Context, request: SeaRequest, factors: Sequence[float], paths: int
) -> list[tuple[float, dict[str, float]]]:
    """Return errors of each kind where the water scatters so many times as much, after the largest albedo [-]."""
    told = []
    for factor in factors:
        red, green, blue = (factor * one for one in request.b)
        with bench(context, replace(request, b=(red, green, blue)), paths) as found:
            errors = {kind: found.rmse(found.view(kind, request.sampling.samples)[0]) for kind in KINDS}
            told.append((float(max(found.request.world.omega)), errors))
    return told
