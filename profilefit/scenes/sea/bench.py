"""A sea that is drawn, with its maps of light and its truth: what ways to draw it are measured with."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import NamedTuple

import moderngl
import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter

from profilefit.scenes.sea.passes import Passes, axes
from profilefit.scenes.sea.paths import Sunlight, traced
from profilefit.scenes.sea.request import SeaRequest
from profilefit.scenes.sea.world import World
from profilefit.scenes.stage.judge import TURNS
from profilefit.scenes.stage.picture import ChartPoint, TruthError

Floats = NDArray[np.float64]
SQUARE = 7  # pixels of a side, over which a map of errors takes a mean
PATHS, MOST_PATHS = 2_000_000, 1024  # of a truth, and of one of its pixels
WHITE = 0.99  # share of the truth that a picture does not clip


class SeaBench(NamedTuple):
    """A scene with its maps of light and its truth, (2, h, w, 3) halves of it; row 0 at the bottom."""

    request: SeaRequest
    passes: Passes
    halves: Floats

    @property
    def truth(self) -> Floats:
        """Radiance (h, w, 3)."""
        return np.asarray(self.halves.mean(axis=0))

    @property
    def exposure(self) -> float:
        """By which the brightest of the truth becomes white."""
        return float(1.0 / max(np.quantile(self.truth, WHITE), 1e-30))

    def view(self, kind: str, samples: int) -> tuple[Floats, float]:
        """Radiance by a technique, and milliseconds of its pass."""
        of, fine = self.request, self.request.supersampling
        columns, rows = of.size
        found, milliseconds = self.passes.view(of.camera, (columns * fine, rows * fine), kind, samples, of.steps)
        return found.reshape(rows, fine, columns, fine, 3).mean(axis=(1, 3)), milliseconds

    def rmse(self, radiance: Floats) -> float:
        """Root mean square error over the mean of the truth [-], without the noise of its halves, which err apart."""
        first, second = radiance - self.halves
        return float(np.sqrt(max(np.mean(first * second), 0.0)) / np.mean(self.truth))

    def relative_error(self, radiance: Floats) -> Floats:
        """(h, w) the same over squares of so many pixels around each [-]."""
        first, second = radiance - self.halves
        square = uniform_filter(np.mean(first * second, axis=-1), SQUARE, mode="nearest")
        return np.asarray(np.sqrt(np.maximum(square, 0.0)) / np.mean(self.truth))

    def point(self, kind: str, samples: int, turns: int = TURNS) -> ChartPoint:
        """Error, and cost of the view's pass."""
        views = [self.view(kind, samples) for _ in range(turns)]
        return ChartPoint(kind, samples, self.rmse(views[0][0]), tuple(one for _, one in views))

    @property
    def truth_error(self) -> TruthError:
        """Standard errors of its pixels, over its mean."""
        share = np.sqrt(np.mean((self.halves[1] - self.halves[0]) ** 2, axis=-1)) / 2.0 / np.mean(self.truth)
        half, most = np.quantile(share, (0.5, 0.9)).tolist()
        return TruthError(half, most, float(np.sqrt(np.mean(share**2))))


@contextmanager
def bench(context: moderngl.Context, of: SeaRequest, paths: int = PATHS) -> Iterator[SeaBench]:
    """All that ways to draw a request are measured with; paths  of the truth, all pixels together."""
    world = of.world
    with Passes(context, world, of.splats, of.vertices, of.texels, of.slices) as passes:
        passes.light()
        yield SeaBench(of, passes, truth_of(of, world, paths))


def truth_of(of: SeaRequest, world: World, paths: int = PATHS, seed: int = 0) -> Floats:
    """(2, h, w, 3) halves of the radiance that the camera sees, row 0 at the bottom."""
    columns, rows = of.size
    each = 2 * int(np.clip(paths / (2 * columns * rows), 1, MOST_PATHS // 2))
    right, up, forward = axes(of.camera, of.size)
    x, y = (2.0 * np.arange(count) / count - 1.0 for count in of.size)
    corner = forward + x[None, :, None] * right + y[:, None, None] * up
    sides = 2.0 * right / columns, 2.0 * up / rows
    eye = np.array(of.camera.eye)
    found = traced(world, Sunlight(world), eye, corner.reshape(-1, 3), *sides, paths=each, seed=seed)
    return found.halves.reshape(2, rows, columns, 3)
