"""Furred ball: FUR.toml, drawn in layers beside rays against each strand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.recipes.toml_tables import Table
from profilefit.scenes.fur import request
from profilefit.scenes.fur.ball import NOTHING, FurView, random_ball
from profilefit.scenes.fur.passes import HITS, Coat, FurSurface
from profilefit.scenes.fur.request import FurRequest
from profilefit.scenes.fur.ways import LayerTechnique
from profilefit.scenes.stage.judge import TURNS, Judge
from profilefit.scenes.stage.picture import UNKNOWN, ChartPoint, RenderResult, TruthError
from profilefit.scenes.stage.renderer import Pass, Renderer

Floats = NDArray[np.float64]
WHITE = 0.99  # of the ball's pixels, the brightest of which becomes white


class FurRender(NamedTuple):
    """Furred ball with its passes and its reference.

    Attributes:
        request: of the file.
        renderer: with a pixel a ray.
        surface: of the ball.
        shade: pass from hits to radiance.
        view: of the camera.
        fine: (rows, columns, 3) radiance of the reference at each ray, row 0 at the bottom.
        judge: of pixels that see the ball or its fur.
    """

    request: FurRequest
    renderer: Renderer
    surface: FurSurface
    shade: Pass
    view: FurView
    fine: Floats
    judge: Judge

    def picture(self, by: LayerTechnique, layers: int) -> Floats:
        """Return the radiance (h, w, 3) of pixels by a technique."""
        rays = self.renderer.image(*self._passes(by, layers))
        return averaged(rays[..., :3].astype(float), self.request.supersampling)

    def points(self, by: LayerTechnique, layers: Sequence[int], turns: int = TURNS) -> list[ChartPoint]:
        """Return error and cost of each number of layers; time is of both passes."""

        draw, time = (
            (lambda count: self.picture(by, count)),
            (lambda count: self.renderer.time(*self._passes(by, count))),
        )
        return self.judge.points(by.name, layers, draw, time, turns)

    def _passes(self, by: LayerTechnique, layers: int) -> tuple[Pass, Pass]:
        return self.surface.layered(self.view, by, layers), self.shade


def averaged(fine: Floats, each: int) -> Floats:
    """Return the means (rows, columns, c) of pixels with so many rays along a side, in linear light."""
    rows, columns, channels = fine.shape
    return np.asarray(fine.reshape(rows // each, each, columns // each, each, channels).mean(axis=(1, 3)))


@contextmanager
def reference_render(context: moderngl.Context, of: FurRequest) -> Iterator[FurRender]:
    """Open the passes and the reference image of a request."""
    ball, each = random_ball(of.count, of.ball, of.radius, of.length, of.force, of.seed), of.supersampling
    size, view = (of.size[0] * each, of.size[1] * each), FurView.of(of.camera, of.size)
    shade = Coat(ball, of.density, of.colour, of.skin, of.light, of.ambient, of.shading).shade(view)
    with Renderer(context, size) as renderer:
        hits = ball.cast(view, size)
        renderer.write(HITS, hits)
        fine = renderer.image(shade)[..., :3].astype(float)
        mask = averaged((hits[..., 3:] > NOTHING).astype(float), each)[..., 0] > 0
        reference = averaged(fine, each)
        exposure = float(1.0 / max(np.quantile(reference[mask].max(axis=-1), WHITE), 1e-30))
        error = _standard_error(fine, each, mask) if each > 1 else UNKNOWN
        judge = Judge(reference, mask, error, exposure)
        yield FurRender(of, renderer, FurSurface.of_ball(ball), shade, view, fine, judge)


def _standard_error(fine: Floats, each: int, mask: NDArray[np.bool_]) -> TruthError:
    """Return the standard errors of pixels by those of their rays: two halves, as on a chess board."""
    rows, columns, _ = fine.shape
    board = (np.add.outer(np.arange(rows), np.arange(columns)) % 2).astype(float)[..., None]
    count = averaged(board, each)
    halves = averaged(fine * board, each) / count - averaged(fine * (1.0 - board), each) / (1.0 - count)
    mean = np.mean(averaged(fine, each)[mask])
    return TruthError.of(0.5 * np.sqrt(np.mean(halves**2, axis=-1))[mask] / mean)


def read(file: str, content: Table) -> FurRequest:
    """Return the request of a file; InputError with file, table and key, what was got and what is accepted."""
    return request.read(file, content)


def draw(context: moderngl.Context, of: FurRequest) -> RenderResult:
    """Draw the picture beside its reference, with error and cost: half a minute."""
    with reference_render(context, of) as drawn:
        chart, samples = drawn.points(of.way, of.numbers), of.sampling.samples
        frame = next(point.milliseconds for point in chart if point.samples == samples)
        return drawn.judge.result(drawn.picture(of.way, samples), chart, samples, frame, of="the fur's light")
