"""Textures of a head, drawn by formulas: skin with blotches, freckles and stubble, lips, brows, cropped hair; eyes.

A texture (rows, columns, 3) lies over a part's u and v; row 0 is at v = 0. Fixed seeds: the same texture everywhere.
What is drawn has its place on the head [mm]: x to its left, y up, z out of the face.
"""

from __future__ import annotations

from collections.abc import Iterable
from functools import cache
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import gaussian_filter, map_coordinates

from profilefit.scenes.stage.subject.eye import FISSURE, lids, rise
from profilefit.scenes.stage.subject.head import brow, crop, lips, texels

FRECKLES, STUBBLE, BROW = 900, 12_000, 700
# What is left of A in red, green and blue.
FRECKLE = np.array([0.72, 0.56, 0.46])  # at the heart of one
HAIR = np.array([0.22, 0.17, 0.15])  # under a hair
LARGE = np.array([0.04, 0.09, 0.10], np.float32)  # deviation of large blotches, which are reddish
SMALL = np.array([0.05, 0.06, 0.06], np.float32)  # of small ones, which are grey
BEARD = np.array([0.36, 0.32, 0.32])  # under shaved hair
CROP = np.array([0.26, 0.21, 0.20])  # under cropped hair
LIPS = np.array([0.88, 0.48, 0.50])
BLOOD = np.array([0.99, 0.86, 0.87])  # on nose, cheeks and below the eyes
SHADE = np.array([0.98, 0.93, 0.96])  # of shaved skin
CAVITY = np.array([0.45, 0.25, 0.25])  # nostrils and the line between the lips

Numbers = NDArray[Any]


class Canvas:
    """Texture over the head."""

    def __init__(self, columns: int, seed: int):
        """Take the number of columns; there are half as many rows."""
        rows = columns // 2
        self.rng = np.random.default_rng(seed)
        self.place = texels(columns)
        self.left = np.ones((rows, columns, 3), np.float32)
        # Along a row and up a column [mm per texel].
        self.along = np.maximum(_length(np.gradient(self.place, axis=2)), 1e-3)
        self.up = np.maximum(_length(np.gradient(self.place, axis=1)), 1e-3)

    def blend(self, colour: Iterable[float], share: Numbers) -> None:
        """Multiply A by a colour where the share is 1, by 1 where it is 0."""
        for channel, one in enumerate(colour):
            self.left[..., channel] *= 1.0 + np.float32(one - 1.0) * share

    def noise(self, width: float) -> Numbers:
        """Return (rows, columns) soft noise of deviation about 1; width [mm]."""
        before, beside = (self._noise(width / self.up[at], width / self.along[at]) for at in self._texels)
        share = rise(self.along, *(self.along[at] for at in self._texels))
        return np.asarray(before + (beside - before) * share)

    @property
    def _texels(self) -> tuple[tuple[int, int], tuple[int, int]]:
        """Texels in the middle of the face and beside it, where columns are farther apart."""
        rows, columns = self.along.shape
        return (rows // 2, columns // 2), (rows // 2, columns // 4)

    def _noise(self, tall: float, wide: float) -> Numbers:
        rows, columns = self.along.shape
        few = max(int(min(tall, wide) / 3.0), 1)  # wide noise needs few texels
        field = self.rng.standard_normal((rows // few, columns // few), np.float32)
        field = gaussian_filter(field, (tall / few, wide / few), mode=("nearest", "wrap"))
        at = np.meshgrid(*((np.arange(n) + 0.5) / few - 0.5 for n in (rows, columns)), indexing="ij")
        field = field if few == 1 else map_coordinates(field, at, order=1, mode="grid-wrap")
        return np.asarray(field / field.std())

    def dots(self, number: int, chance: Numbers, radii: tuple[float, float], colour: Iterable[float]) -> None:
        """Draw soft discs, more where the chance (rows, columns) is high; radii [mm] from ... to."""
        chosen, radius = self.chosen(number, chance), self.rng.uniform(*radii, number)
        self.hairs(chosen, 2.0 * radius, radius, np.zeros(number), colour)

    def chosen(self, number: int, chance: Numbers) -> NDArray[np.int64]:
        """Return texels, as many a square millimetre as the chance (rows, columns) says."""
        weight = np.cumsum((chance * self.along * self.up).ravel())
        return np.searchsorted(weight, self.rng.random(number) * weight[-1])

    def hairs(
        self, chosen: NDArray[np.int64], length: Numbers, width: Numbers, slope: Numbers, colour: Iterable[float]
    ) -> None:
        """Draw soft ellipses at texels, by length and half width [mm] and angle to the row [rad]."""
        rows, columns = self.along.shape
        row, column = np.divmod(chosen, columns)
        up, along = self.up[row, column], self.along[row, column]
        reach = 1.2 * length
        tall, side = (int(np.ceil(np.max(reach / one))) for one in (up, along))
        dark = np.zeros((rows, columns), np.float32)
        strength = self.rng.uniform(0.45, 1.0, chosen.size)
        c, s = np.cos(slope), np.sin(slope)
        for part in np.array_split(np.arange(chosen.size), 1 + chosen.size * tall * side // 250_000):
            y = np.arange(-tall, tall + 1)[:, None] * up[part, None, None]
            x = np.arange(-side, side + 1) * along[part, None, None]
            at_y = np.clip(row[part, None, None] + np.arange(-tall, tall + 1)[:, None], 0, rows - 1)
            at_x = (column[part, None, None] + np.arange(-side, side + 1)) % columns
            cosine, sine = c[part, None, None], s[part, None, None]
            long, wide = 0.5 * length[part, None, None], width[part, None, None]
            soft = np.exp(-(((cosine * x + sine * y) / long) ** 2) - ((cosine * y - sine * x) / wide) ** 2)
            np.add.at(dark, (at_y, at_x), np.log1p(-0.999 * strength[part, None, None] * soft))
        self.blend(colour, 1.0 - np.exp(dark))


def skin(reflectance: ArrayLike, columns: int = 2048) -> NDArray[np.float32]:
    """Return (columns / 2, columns, 3) A in (0, 1) around the given one of red, green and blue [-]."""
    return np.clip(np.asarray(reflectance, np.float32) * face(columns), 0.005, 0.98)


@cache
def face(columns: int, seed: int = 7) -> NDArray[np.float32]:
    """Return (columns / 2, columns, 3) A of the head over that of even skin [-]."""
    canvas = Canvas(columns, seed)
    x, y, z = canvas.place
    out, front = np.abs(x), rise(z, 20.0, 50.0)

    def spot(at_x: float, at_y: float, wide: float, tall: float, power: float = 2.0) -> Numbers:
        return front * np.exp(-(np.hypot((out - at_x) / wide, (y - at_y) / tall) ** power))

    blotches = canvas.noise(9.0)[..., None] * LARGE
    blotches += canvas.noise(0.5)[..., None] * SMALL
    canvas.left += blotches
    canvas.blend(BLOOD, np.clip(spot(0, -30, 16, 13) + spot(38, -22, 18, 14) + 0.7 * spot(30, -6, 15, 6), 0.0, 1.0))
    jaw = front * rise(-y, 30.0, 60.0) * rise(y, -125.0, -95.0) * (1.0 - spot(0, -64, 27, 11, 6.0))
    jaw *= 1.0 - 0.8 * spot(46, -40, 16, 24, 4.0)
    canvas.blend(SHADE, jaw)
    red, height = lips(canvas.place)
    canvas.blend(LIPS, red)
    canvas.blend(CAVITY, front * np.exp(-((height / 0.7) ** 2)) * rise(-out, -28.0, -24.0))
    canvas.blend(CAVITY, spot(6.6, -43.5, 3.6, 2.6, 4.0))
    canvas.dots(FRECKLES, 0.02 + spot(16, -12, 30, 18) + 0.3 * spot(0, 45, 50, 20), (0.4, 1.1), FRECKLE)
    canvas.dots(STUBBLE, jaw + 1e-9, (0.1, 0.16), BEARD)
    skull = rise(y + 0.5 * np.clip(z - 20.0, 0.0, 60.0), -92.0, -70.0)  # the neck is even, as its mesh is
    canvas.left = 1.0 + (canvas.left - 1.0) * skull[..., None]
    even = (z > 55.0) & (y > -90.0) & (y < 35.0)
    canvas.left /= np.median(canvas.left[even], axis=0)  # most of the face has the A that was given
    _brows(canvas)
    _lashes(canvas)
    _crop(canvas)
    return canvas.left


def _brows(canvas: Canvas) -> None:
    x, y, z = canvas.place
    out = np.abs(x)
    away, thick = brow(out, y)
    chance = (z > 30.0) * (thick > 0.0) * np.exp(-((away / np.maximum(thick, 0.5)) ** 4))
    canvas.blend([0.62, 0.55, 0.52], 0.8 * chance)
    chosen = canvas.chosen(BROW, chance)
    side, far = np.sign(x.ravel()[chosen]), out.ravel()[chosen]
    angle = np.radians(np.interp(far, [8.0, 14.0, 30.0, 50.0], [75.0, 45.0, 12.0, -25.0]))
    angle += canvas.rng.normal(0.0, 0.15, BROW) - 0.25 * np.clip(away.ravel()[chosen] / 3.0, -1.0, 1.0)
    canvas.hairs(chosen, canvas.rng.uniform(3.0, 6.0, BROW), np.full(BROW, 0.16), side * angle, HAIR)


def _lashes(canvas: Canvas) -> None:
    """Darken the lids' edges, more the upper one's."""
    _, y, z = canvas.place
    across, top, bottom = lids(*canvas.place)
    height = y * FISSURE / np.maximum(z, 1.0)
    near = (z > 40.0) * rise(across, 17.0, 21.0) * rise(-across, -54.0, -50.0)
    canvas.blend([0.25, 0.18, 0.16], near * np.exp(-(((height - top - 0.3) / 0.9) ** 2)))
    canvas.blend([0.65, 0.45, 0.42], near * np.exp(-(((height - bottom + 0.2) / 0.7) ** 2)))


def _crop(canvas: Canvas) -> None:
    """Crop hair on the skull, above the forehead and around the ears."""
    grown = crop(canvas.place, 2.5 * canvas.noise(2.0))
    canvas.blend(CROP, grown * np.clip(0.85 + 0.15 * canvas.noise(0.35), 0.0, 1.0))


def _length(vectors: Numbers) -> Numbers:
    return np.sqrt(np.sum(vectors**2, axis=0))
