"""Error against cost of a sea by its maps of light and its pixels, and error of each kind over the scattering."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import moderngl

from profilefit.scenes.sea.caustics import Splat
from profilefit.scenes.sea.haze import KINDS
from profilefit.scenes.sea.passes import SeaPasses
from profilefit.scenes.sea.scene import SeaRender, SeaRequest, reference_render
from profilefit.scenes.stage.renderer import Renderer

TURNS = 3


class MapPoint(NamedTuple):
    """Error of a picture [-] by maps of light that take so many milliseconds, the least of `TURNS`."""

    name: str
    rmse: float
    milliseconds: float


def over_maps(drawn: SeaRender, slices: Sequence[int]) -> list[MapPoint]:
    """Return points of each splat, and of numbers of maps in depths with the splat of the request."""
    of, splats = drawn.request, (Splat.POINTS, Splat.FACES, Splat.CELLS)
    cases = [(f"{one.value}, {of.technique.slices} slices", (one, one), of.technique.slices) for one in splats]
    cases += [(f"{of.splats[1].value}, {one} slices", of.splats, one) for one in slices]
    points: list[MapPoint] = []
    for name, by, count in cases:
        with Renderer(drawn.passes.renderer.context, of.size) as renderer:
            named = of.technique
            own = drawn._replace(passes=SeaPasses(renderer, of.world, by, named.vertices, named.texels, count))
            own.light()  # compiled
            least = min(sum(own.light().values()) for _ in range(TURNS))
            points.append(MapPoint(name, own.judge.rmse(own.picture(of.technique.kind, of.sampling.samples)), least))
    return points


def over_pixels(drawn: SeaRender, supersampling: Sequence[int]) -> list[MapPoint]:
    """Return points of the request's kind by views of a pixel along a side; time is the view's."""
    points = []
    for fine in supersampling:
        own = drawn._replace(request=drawn.request.changed(technique={"supersampling": fine}))
        (one,) = own.points(own.request.technique.kind, [own.request.sampling.samples], TURNS)
        points.append(MapPoint(f"{fine} x {fine} views of a pixel", one.rmse, min(one.milliseconds)))
    return points


def over_water(
    context: moderngl.Context, request: SeaRequest, factors: Sequence[float], paths: int
) -> list[tuple[float, dict[str, float]]]:
    """Return the largest albedo [-] and each kind's error, where the water scatters so many times as much.

    Args:
        context: of OpenGL.
        request: of the scene.
        factors: by which its scattering is multiplied [-].
        paths: of each reference.
    """
    rows = []
    for factor in factors:
        red, green, blue = (factor * one for one in request.water.b)
        with reference_render(context, request.changed(water={"b": (red, green, blue)}), paths) as drawn:
            errors = {kind: drawn.judge.rmse(drawn.picture(kind, request.sampling.samples)) for kind in KINDS}
            rows.append((float(max(drawn.request.world.omega)), errors))
    return rows
