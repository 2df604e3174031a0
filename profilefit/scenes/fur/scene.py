"""A furred ball: FUR.toml, drawn in layers beside rays against each strand."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray

from profilefit.recipes.toml_tables import Table
from profilefit.scenes.fur import request
from profilefit.scenes.fur.ball import NOTHING, FurView, random_ball
from profilefit.scenes.fur.passes import Coat, FurPasses, FurSurface
from profilefit.scenes.fur.request import FurRequest
from profilefit.scenes.fur.ways import FurWay
from profilefit.scenes.stage.judge import TURNS
from profilefit.scenes.stage.picture import ChartPoint, Drawn, TruthError, to_srgb
from profilefit.scenes.stage.technique import Pass

Floats = NDArray[np.float64]
WHITE = 0.99  # of the ball's pixels, the brightest of which becomes white


class FurBench(NamedTuple):
    """A furred ball with its passes and its truth: what ways to draw it are measured with.

    fine   (rows, columns, 3) radiance of the truth at each ray, row 0 at the bottom;  mask  pixels that see the ball
    """

    request: FurRequest
    passes: FurPasses
    shade: Pass
    view: FurView
    fine: Floats
    mask: NDArray[np.bool_]

    @property
    def truth(self) -> Floats:
        """Radiance of pixels, the mean of their rays'."""
        return self.averaged(self.fine)

    @property
    def exposure(self) -> float:
        """By which the brightest of the truth becomes white."""
        return float(1.0 / max(np.quantile(self.truth[self.mask].max(axis=-1), WHITE), 1e-30))

    def averaged(self, fine: Floats) -> Floats:
        """Means over the rays of pixels, in linear light."""
        columns, rows = self.request.size
        each = self.request.supersampling
        return np.asarray(fine.reshape(rows, each, columns, each, -1).mean(axis=(1, 3)))

    def rays(self, way: FurWay, layers: int) -> tuple[Floats, float]:
        """Radiance at each ray by a way, and milliseconds of both passes."""
        layered = self.passes.layered(self.view, way, layers)
        for one in (layered, self.shade):
            self.passes.run(one)  # compiled
        milliseconds = self.passes.milliseconds(layered, self.shade)
        return self.passes.radiance(self.shade), milliseconds

    def error(self, radiance: Floats) -> Floats:
        """(rows, columns) root mean square of the colours' errors, over the truth's mean; NaN beside the ball [-]."""
        off = np.sqrt(np.mean((radiance - self.truth) ** 2, axis=-1)) / np.mean(self.truth[self.mask])
        return np.where(self.mask, off, np.nan)

    def rmse(self, radiance: Floats) -> float:
        """The same of all pixels that see the ball or its fur [-]."""
        return float(np.sqrt(np.nanmean(self.error(radiance) ** 2)))

    def point(self, way: FurWay, layers: int, turns: int = TURNS) -> ChartPoint:
        """Error and cost of so many layers."""
        drawn = [self.rays(way, layers) for _ in range(turns)]
        return ChartPoint(way.name, layers, self.rmse(self.averaged(drawn[0][0])), tuple(one for _, one in drawn))

    @property
    def truth_error(self) -> TruthError:
        """Standard errors of its pixels by those of their rays, over its mean: two halves, as on a chess board."""
        each = self.request.supersampling
        if each == 1:
            return TruthError(np.nan, np.nan, np.nan)
        rows, columns, _ = self.fine.shape
        board = (np.add.outer(np.arange(rows), np.arange(columns)) % 2).astype(float)[..., None]
        count = self.averaged(board)
        halves = self.averaged(self.fine * board) / count - self.averaged(self.fine * (1.0 - board)) / (1.0 - count)
        share = 0.5 * np.sqrt(np.mean(halves**2, axis=-1))[self.mask] / np.mean(self.truth[self.mask])
        half, most = np.quantile(share, (0.5, 0.9)).tolist()
        return TruthError(half, most, float(np.sqrt(np.mean(share**2))))


@contextmanager
def bench(context: moderngl.Context, of: FurRequest) -> Iterator[FurBench]:
    """All that ways to draw a request are measured with."""
    ball = random_ball(of.count, of.ball, of.radius, of.length, of.force, of.seed)
    coat = Coat(ball, of.density, of.colour, of.skin, of.light, of.ambient, of.shading)
    columns, rows = of.size
    size = columns * of.supersampling, rows * of.supersampling
    view = FurView.of(of.camera, of.size)
    with FurPasses(context, FurSurface.of_ball(ball), size) as passes:
        hits = ball.cast(view, size)
        shade = coat.shade(view)
        fine = passes.radiance(shade, hits)
        made = FurBench(of, passes, shade, view, fine, np.zeros((rows, columns), bool))
        seen = made.averaged((hits[..., 3:] > NOTHING).astype(float))[..., 0] > 0
        yield made._replace(mask=seen)


def read(file: str, content: Table) -> FurRequest:
    """A scene of a file's content; InputError that names file, table and key, what was got and what is accepted."""
    return request.read(file, content)


def draw(context: moderngl.Context, of: FurRequest) -> Drawn:
    """The picture, its truth, error and cost: half a minute."""
    with bench(context, of) as found:
        numbers = sorted({of.sampling.samples, *of.chart})
        chart = tuple(found.point(of.way, layers) for layers in numbers)
        point = chart[numbers.index(of.sampling.samples)]
        radiance = found.averaged(found.rays(of.way, of.sampling.samples)[0])
        return Drawn(
            picture=to_srgb(radiance[::-1], found.exposure),
            truth=to_srgb(found.truth[::-1], found.exposure),
            error=found.error(radiance)[::-1],
            point=point,
            chart=chart,
            frame=point.milliseconds,
            truth_error=found.truth_error,
            of="the fur's light",
        )
