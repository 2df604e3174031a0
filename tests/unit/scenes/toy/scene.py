"""TOY.toml: how fast light fades; and its picture."""

from dataclasses import dataclass

from profilefit.recipes.toml_tables import Tables
from profilefit.scenes.stage import request
from profilefit.scenes.stage.renderer import Renderer
from tests.unit.scenes.toy.chart import over_samples
from tests.unit.scenes.toy.passes import faded
from tests.unit.scenes.toy.truth import judged

TABLES = {**request.TABLES, "": ("scene", "k", *request.TABLES)}


@dataclass(frozen=True)
class ToyRequest(request.ViewRequest):
    k: float


def read(file, content):
    tables = Tables(file, TABLES)
    tables.known("", content)
    return ToyRequest(**request.view(tables, content), k=tables.number("", "k", content, 2.0))


def draw(context, of):
    judge, samples = judged(of.k, of.size), of.sampling.samples
    with Renderer(context, of.size) as renderer:
        chart = over_samples(renderer, judge, of)
        picture = renderer.image(faded(of.k, of.size, samples))[..., :3]
        return judge.result(picture, chart, samples, chart[-1].milliseconds, of="toy light")
