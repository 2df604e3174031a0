"""Under a sea with waves: SEA.toml, drawn with caustics and shafts, beside all the light that comes to the eye."""

from __future__ import annotations

import moderngl

from profilefit.recipes.toml_tables import Table
from profilefit.scenes.sea import request
from profilefit.scenes.sea.bench import bench
from profilefit.scenes.sea.request import SeaRequest
from profilefit.scenes.stage.judge import TURNS
from profilefit.scenes.stage.picture import Drawn, to_srgb


def read(file: str, content: Table) -> SeaRequest:
    """A scene of a file's content; InputError that names file, table and key, what was got and what is accepted."""
    return request.read(file, content)


def draw(context: moderngl.Context, of: SeaRequest) -> Drawn:
    """The picture, its truth, error and cost: a minute."""
    with bench(context, of) as found:
        numbers = sorted({of.sampling.samples, *of.chart})
        chart = tuple(found.point(of.kind, samples) for samples in numbers)
        radiance, _ = found.view(of.kind, of.sampling.samples)
        truth, exposure = found.truth, found.exposure
        maps = [found.passes.light() for _ in range(TURNS)]
        point = chart[numbers.index(of.sampling.samples)]
        light = {name: tuple(one[name] for one in maps) for name in maps[0]}
        frame = tuple(map(sum, zip(*light.values(), point.milliseconds, strict=True)))
        return Drawn(
            picture=to_srgb(radiance[::-1], exposure),
            truth=to_srgb(truth[::-1], exposure),
            error=found.relative_error(radiance)[::-1],
            point=point,
            chart=chart,
            frame=frame,
            truth_error=found.truth_error,
            of="light",
            passes={**light, "view": point.milliseconds},
        )
