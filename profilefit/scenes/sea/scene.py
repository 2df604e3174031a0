"""Sea with waves, seen from below: SEA.toml, drawn with caustics and shafts, beside all light that comes to an eye."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.recipes.toml_tables import Table
from profilefit.scenes.sea import request
from profilefit.scenes.sea.passes import SeaPasses, axes
from profilefit.scenes.sea.paths import Sunlight, traced
from profilefit.scenes.sea.request import SeaRequest
from profilefit.scenes.sea.world import World
from profilefit.scenes.stage.judge import TURNS, Judge
from profilefit.scenes.stage.picture import ChartPoint, RenderResult
from profilefit.scenes.stage.renderer import Pass, Renderer

Floats = NDArray[np.float64]
PATHS, MOST_PATHS = 2_000_000, 1024  # of a reference, and of one of its pixels
WHITE = 0.99  # share of the reference that a picture does not clip


class SeaRender(NamedTuple):
    """Scene with its maps of light and its judge; row 0 at the bottom."""

    request: SeaRequest
    passes: SeaPasses
    judge: Judge

    def picture(self, kind: str, samples: int) -> Floats:
        """Return the radiance (h, w, 3) of pixels by a technique."""
        (columns, rows), fine = self.request.size, self.request.supersampling
        views = self.passes.renderer.image(self._view(kind, samples))[..., :3].astype(float)
        return views.reshape(rows, fine, columns, fine, 3).mean(axis=(1, 3))

    def time(self, kind: str, samples: int) -> float:
        """Return the milliseconds of a view's pass, which was drawn before."""
        return self.passes.renderer.time(self._view(kind, samples))

    def light(self) -> dict[str, float]:
        """Draw all maps of light, and return the milliseconds of the floor's, and of those in depths."""
        return {name: self.passes.renderer.time(*own) for name, own in self.passes.light.items()}

    def points(self, kind: str, numbers: Sequence[int], turns: int = TURNS) -> list[ChartPoint]:
        """Return error and cost of each number of samples; time is of the view's pass."""
        draw, time = (lambda count: self.picture(kind, count)), (lambda count: self.time(kind, count))
        return self.judge.points(kind, numbers, draw, time, turns)

    def _view(self, kind: str, samples: int) -> Pass:
        of, fine = self.request, self.request.supersampling
        return self.passes.view(of.camera, (of.size[0] * fine, of.size[1] * fine), kind, samples, of.steps)


@contextmanager
def reference_render(context: moderngl.Context, of: SeaRequest, paths: int = PATHS) -> Iterator[SeaRender]:
    """Open the passes and the reference image of a request; paths  of the reference, all pixels together."""
    world = of.world
    with Renderer(context, of.size) as renderer:
        passes = SeaPasses(renderer, world, of.splats, of.vertices, of.texels, of.slices)
        drawn = SeaRender(of, passes, Judge.of_halves(halves_of(of, world, paths), WHITE))
        drawn.light()
        yield drawn


def halves_of(of: SeaRequest, world: World, paths: int = PATHS, seed: int = 0) -> Floats:
    """Return (2, h, w, 3) halves of the radiance that the camera sees, row 0 at the bottom."""
    columns, rows = of.size
    each = 2 * int(np.clip(paths / (2 * columns * rows), 1, MOST_PATHS // 2))
    right, up, forward = axes(of.camera, of.size)
    x, y = (2.0 * np.arange(count) / count - 1.0 for count in of.size)
    corner = forward + x[None, :, None] * right + y[:, None, None] * up
    sides = 2.0 * right / columns, 2.0 * up / rows
    eye = np.array(of.camera.eye)
    light = traced(world, Sunlight(world), eye, corner.reshape(-1, 3), *sides, paths=each, seed=seed)
    return light.halves.reshape(2, rows, columns, 3)


def read(file: str, content: Table) -> SeaRequest:
    """Return the request of a file; InputError with file, table and key, what was got and what is accepted."""
    return request.read(file, content)


def draw(context: moderngl.Context, of: SeaRequest) -> RenderResult:
    """Draw the picture beside its reference, with error and cost: a minute."""
    with reference_render(context, of) as drawn:
        chart, samples = drawn.points(of.kind, of.numbers), of.sampling.samples
        view = next(point.milliseconds for point in chart if point.samples == samples)
        maps = [drawn.light() for _ in range(TURNS)]
        passes = {**{name: tuple(one[name] for one in maps) for name in maps[0]}, "view": view}
        frame = tuple(map(sum, zip(*passes.values(), strict=True)))
        picture = drawn.picture(of.kind, samples)
        return drawn.judge.result(picture, chart, samples, frame, of="light", passes=passes)
