"""Light in texture space: a surface laid out over its uv, blurred by Gaussians one after the other.

Each Gaussian is blurred from the one before, by the difference of their variances, along columns and then along rows of
the atlas, as wide on the surface everywhere. Margins have the light of where the surface goes on (`links`), and the
share of a texel that is surface goes along with its light: nothing seeps in from where nothing is.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import Self

import moderngl
import numpy as np

from profilefit.errors import InputError
from profilefit.scenes.heart.law import Kernel
from profilefit.scenes.heart.links import links
from profilefit.scenes.stage.buffers import INSIDE, Singles, Targets, pixels
from profilefit.scenes.stage.technique import FullScreen, Pass, Unwraps, maps
from profilefit.scenes.stage.world import Part
from profilefit.shader.emit import text_beside

REACH = 3.3  # of a blur's taps, in its sigma
SHORTEST = 0.2  # of texels are shorter than those whose margins blurs are made for
LIGHT, FILLED, STRETCH = "light_map", "filled_map", "stretch_map"
BLURRED = "blurred_map"  # by a whole kernel
SUMS = ("sum_map", "other_sum_map")


class Atlas:
    """Targets of one size, over which one part of a stage's scene is laid out. Release it, or use it in a `with`."""

    def __init__(self, context: moderngl.Context, size: tuple[int, int], margin: int):
        """size  columns, rows [texels];  margin  around the charts, which blurs reach into [texels]"""
        if not 0 < 2 * margin < min(size):
            raise InputError(f"margin must be texels from 1 to less than half of {min(size)}, got {margin!r}")
        self.context, self.size, self.margin = context, size, margin
        self.targets = Targets(context, size)
        self._passes: dict[str, FullScreen] = {}
        self._links: Singles | None = None
        self._shortest = 0.0  # what a texel leads at least, but for those at poles [mm]
        self.texel = 0.0  # mean side of a texel, once a surface was drawn [mm]

    @property
    def links(self) -> Singles:
        """(rows, columns, 3) places whose light texels have; `draw` comes first."""
        if self._links is None:
            raise InputError("atlas must have a surface: draw comes first")
        return self._links

    @property
    def inset(self) -> tuple[float, float]:
        """Share of the atlas that u and v from 0 to 1 take."""
        columns, rows = self.size
        return 1.0 - 2.0 * self.margin / columns, 1.0 - 2.0 * self.margin / rows

    def draw(self, stage: Unwraps, part: Part) -> None:
        """Irradiance and place of a part of the scene that the stage has drawn. Links are made the first time."""
        stage.unwrap(part, self.targets.surface, self.inset)
        if self._links is None:
            place = pixels(self.targets.map("position_map"))
            self._links = links(place[..., :3].astype(float), place[..., 3] > INSIDE, self.margin)
        self._run(self._filled("position_map"))
        self._run(self._pass("stretch", STRETCH, "position_map", FILLED))
        if not self.texel:
            stretch = self.read(STRETCH)
            sides = stretch[stretch[..., 2] > INSIDE, :2].astype(float)
            self._shortest = float(np.quantile(sides, SHORTEST))
            self.texel = float(np.sqrt(np.mean(np.prod(sides, axis=1))))

    def blur(self, kernel: Kernel) -> moderngl.Texture:
        """sum_k w_k times the light blurred by v_k, of all Gaussians of a kernel, with margins; until the next blur."""
        self._run(self._pass("begin", LIGHT, "irradiance_map", STRETCH))
        weights = np.broadcast_to(np.atleast_2d(kernel.weights.T).T, (kernel.variances.size, 3))
        self.targets.into(SUMS[1]).clear()
        done = 0.0
        for number, (variance, weight) in enumerate(zip(kernel.variances.tolist(), weights, strict=True)):
            for one in self._gaussian(done, variance):
                self._run(one)
            done = variance
            into, before = SUMS[number % 2], SUMS[1 - number % 2]
            add = self._pass("add", into, weight=tuple(map(float, weight)))
            self._run(replace(add, reads={LIGHT: LIGHT, "sum_map": before}))
        self._run(self._filled(SUMS[(kernel.variances.size - 1) % 2], BLURRED))
        return self.targets.map(BLURRED)

    def read(self, name: str) -> Singles:
        """(rows, columns, 4) of a map, row 0 at the bottom."""
        return pixels(self.targets.map(name))

    def release(self) -> None:
        for one in self._passes.values():
            one.release()
        self.targets.release()
        self._passes.clear()

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self.release()

    def _gaussian(self, done: float, variance: float) -> Iterator[Pass]:
        """From one variance to another [mm^2], in as many parts as it takes for each to stay within the margin."""
        widest, sigma = self.margin / REACH, np.sqrt(variance - done)
        parts = int(np.ceil((sigma / (widest * self._shortest)) ** 2))
        for number in range(parts):
            before = float(np.sqrt(done + (variance - done) * number / parts))
            given = {"sigma": float(sigma / np.sqrt(parts)), "before": before, "widest": widest, "reach": REACH}
            for along in ((1.0, 0.0), (0.0, 1.0)):
                yield self._filled(LIGHT)
                yield self._pass("blur", LIGHT, FILLED, STRETCH, along=along, **given)

    def _filled(self, name: str, into: str = FILLED) -> Pass:
        """A map with its margins."""
        reads: dict[str, str | Singles | moderngl.Texture] = {LIGHT: name, "link_map": self.links}
        return replace(self._pass("fill", into), reads=reads)

    def _pass(self, name: str, into: str, *reads: str, **uniforms: object) -> Pass:
        return Pass(name, maps(*reads), into, text_beside(__name__, f"glsl/{name}.frag"), uniforms)

    def _run(self, one: Pass) -> None:
        if one.source not in self._passes:
            self._passes[one.source] = FullScreen(self.context, one)
        self._passes[one.source].run(one, self.targets)
