"""Error of a technique, measured: rendered through OpenGL on a grid of pixels, against the reference.

The surface is a plane or a cylinder, lit on one side of a step edge, seen by parallel rays. The reference is the exact
profile over the visible surface, summed pair by pair on a grid as much finer as short paths ask for, and averaged over
each pixel; nothing here asks what the error was predicted to be.
"""

from __future__ import annotations

import math
from typing import Self

import moderngl
import numpy as np
from numpy.typing import NDArray

from benchmarks.planes import step_edge
from mcml_sim import Setting
from profilefit.scenes.skin.passes import SeparableFilter
from profilefit.scenes.skin.truth import albedo_of
from profilefit.scenes.stage.pattern import Sampling
from profilefit.scenes.stage.reference.surface import gathered, seen
from profilefit.scenes.stage.stage import Stage
from profilefit.scenes.stage.world import Buffers
from profilefit.studies.choose.case import Case, Option, Within, is_filter
from profilefit.studies.choose.error import ReferenceLight, passes

Floats = NDArray[np.float64]
# How far the picture goes beyond the places that count, and above and below them [longest mean free path]: the first
# that all but HELD of the light of every channel is within, for no more than LOST may be missing.
REACHES, HELD, LOST = (6.0, 8.0, 12.0, 16.0, 24.0, 32.0), 0.002, 0.01
MOST_PIXELS = 1_500_000
MARGIN = 4  # [pixels]
ROWS = 64  # of the picture, each an estimate of every place
# Pixels of the reference in the shortest mean free path, in a pixel, and in all, at the most.
FINE, FINEST, MOST_FINE = 8.0, 48, 1_000_000


def surface(case: Case, columns: int, rows: int, factor: int = 1) -> Buffers:
    """Return the edge with pixels so many times as fine."""
    pixel = case.pixel / factor
    flat = step_edge((columns * factor, rows * factor), pixel, np.array(case.reflectance))
    if case.is_flat:
        return flat
    x = flat.position[..., 0].astype(float)
    share = np.clip(x / case.radius, -1.0, 1.0)
    height = np.sqrt(1.0 - share**2)
    position, normal = flat.position.copy(), flat.normal.copy()
    position[..., 2] += case.radius * (height - 1.0)
    normal[..., 0], normal[..., 2] = share, height
    mask = (np.abs(x) < case.radius).astype(np.float32)
    return Buffers(flat.irradiance, flat.reflectance, position, normal, mask, flat.thickness, pixel)


def fits(case: Case, setting: Setting, within: Within) -> bool:
    """Return whether a picture of MOST_PIXELS holds what the places gather from."""
    small = math.prod(size(case, setting, within)) <= MOST_PIXELS
    return small and _lost(case, setting, REACHES[-1]) < LOST


def size(case: Case, setting: Setting, within: Within) -> tuple[int, int]:
    """Return columns and rows of the picture that a plane needs; a cylinder needs no more."""
    reach = next((r for r in REACHES if _lost(case, setting, r) < HELD), REACHES[-1])
    longest = max(case.mfp)
    half = max(within.mfp * longest, within.pixels * case.pixel) + reach * longest
    columns, rows = (2 * (math.ceil(extent / case.pixel) + MARGIN) for extent in (half, reach * longest))
    return columns, max(rows, ROWS)


def _lost(case: Case, setting: Setting, reach: float) -> float:
    """Return the largest share of a channel's light from that many longest mean free paths beyond an edge."""
    pairs = zip(case.reflectance, case.mfp, strict=True)
    far = reach * max(case.mfp)
    return max(float(ReferenceLight(setting).beyond(a)(np.array(far / length))) for a, length in pairs)


class Measured:
    """Case, drawn once: the error of any option on it. Use it in a `with`."""

    def __init__(
        self, context: moderngl.Context, case: Case, setting: Setting, within: Within, size: tuple[int, int]
    ) -> None:
        self.case, self.setting, self.within, self.size = case, setting, within, size
        self._columns = [self._places(channel) for channel in range(3)]
        self._truth = self._reference()
        self._drawn = surface(case, *self.size)
        self._stage = Stage(context, self.size, shadow_side=16)
        self._stage.upload(self._drawn)

    def __enter__(self) -> Self:
        return self

    def __exit__(self, *error: object) -> None:
        self._stage.release()

    def error(self, option: Option, seed: int = 0) -> float:
        """Return the root mean square error of the worst channel, as a share of white [-]."""
        light = self._rendered(option, seed)
        pairs = [(light[:, columns, c], self._truth[columns, c]) for c, columns in enumerate(self._columns)]
        return max(float(np.sqrt(np.mean((found - wanted) ** 2))) for found, wanted in pairs)

    def _rendered(self, option: Option, seed: int) -> Floats:
        """Render (ROWS, columns, 3) radiant exitance under an irradiance of 1."""
        rows = (self.size[1] - ROWS) // 2, (self.size[1] + ROWS) // 2
        if option.kind == "nothing":
            return (self._drawn.irradiance * self._drawn.reflectance.astype(float))[slice(*rows)]
        if not is_filter(option):
            drawn = Sampling(option.number, seed=seed)
            return self._stage.scatter(option.law, self.case.mfp, drawn, rows=rows).astype(float)
        total = np.zeros((ROWS, self.size[0], 3))
        for share, kernel, _ in passes(option, self.case, ReferenceLight(self.setting)):
            drawn = Sampling(option.number)
            total += share * self._stage.scatter(
                SeparableFilter(kernel), self.case.mfp, drawn, self._kernel_alpha, rows
            )
        return total

    @property
    def _kernel_alpha(self) -> list[float]:

        return [albedo_of(a, self.setting) for a in self.case.filter_reflectance]

    def _places(self, channel: int) -> NDArray[np.int64]:
        """Return the columns on both sides of the edge."""
        beyond = (self.case.places(channel, self.within) / self.case.pixel).astype(int)
        beyond = beyond[beyond < self.size[0] // 2]
        middle = self.size[0] // 2
        return np.concatenate([middle - 1 - beyond, middle + beyond])

    def _reference(self) -> Floats:
        """Return the reference (columns, 3), where there are places, NaN elsewhere."""
        wanted = math.ceil(FINE * self.case.pixel / min(self.case.mfp))
        factor = max(min(wanted, FINEST, int((MOST_FINE / math.prod(self.size)) ** 0.5)), 1)
        scene, view = seen(surface(self.case, *self.size, factor))
        columns = np.unique(np.concatenate(self._columns))
        fine = (factor * columns[:, None] + np.arange(factor)).ravel()
        pixels = np.stack([np.full(len(fine), self.size[1] * factor // 2), fine], axis=1)
        light = gathered(scene, view, self.case.mfp, self.setting, pixels).light
        answer = np.full((self.size[0], 3), np.nan)
        answer[columns] = light.reshape(len(columns), factor, 3).mean(axis=1)
        return answer
