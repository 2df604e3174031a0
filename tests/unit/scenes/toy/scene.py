"""TOY.toml: how fast light fades; and its picture."""

from contextlib import contextmanager
from dataclasses import dataclass
from typing import Annotated

from pydantic import Field

from profilefit.scenes.stage import request
from profilefit.scenes.stage.drawing import Drawer
from profilefit.scenes.stage.judge import Rendering
from profilefit.scenes.stage.renderer import Renderer
from tests.unit.scenes.toy.chart import over_samples
from tests.unit.scenes.toy.passes import faded
from tests.unit.scenes.toy.truth import judged


class ToyRequest(request.ViewRequest):
    scene: str = "toy"
    k: Annotated[float, Field(gt=0.0)] = 2.0


read = ToyRequest.of


@dataclass(frozen=True)
class ToyDrawing:
    renderer: Renderer
    judge: object

    def shot(self, of, turns):
        one = faded(of.k, of.size, of.technique.samples)
        return Rendering("toy", self.renderer.image(one)[..., :3], tuple(self.renderer.time(one) for _ in range(turns)))

    def points(self, of, numbers):
        return over_samples(self.renderer, self.judge, of, numbers)

    def exposure(self, radiance):
        return 1.0


@contextmanager
def opened(context, of, has_reference):
    with Renderer(context, of.size) as renderer:
        yield ToyDrawing(renderer, judged(of.k, of.size) if has_reference else None)


drawer = Drawer(opened, (), "toy light")
draw, picture = drawer.draw, drawer.picture
