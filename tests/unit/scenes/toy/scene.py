"""TOY.toml: how fast light fades; and its picture."""

from typing import Annotated

from pydantic import Field

from profilefit.scenes.stage import request
from profilefit.scenes.stage.renderer import Renderer
from tests.unit.scenes.toy.chart import over_samples
from tests.unit.scenes.toy.passes import faded
from tests.unit.scenes.toy.truth import judged


class ToyRequest(request.ViewRequest):
    scene: str = "toy"
    k: Annotated[float, Field(gt=0.0)] = 2.0


read = ToyRequest.of


def draw(context, of):
    judge, samples = judged(of.k, of.size), of.sampling.samples
    with Renderer(context, of.size) as renderer:
        chart = over_samples(renderer, judge, of)
        picture = renderer.image(faded(of.k, of.size, samples))[..., :3]
        return judge.result(picture, chart, samples, chart[-1].milliseconds, of="toy light")
