"""Centre of the spot, about which its far rings are even; and what makes a picture useless."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import gaussian_filter, grey_dilation, label

from profilefit.errors import InputError
from profilefit.measured.photo.bracket import Picture
from profilefit.measured.photo.exposure import Plane as Places
from profilefit.measured.photo.pixel_scale import PixelScale

Floats = NDArray[np.float64]
BLUR = 2.0  # pixels of a plane
BRIGHT = 0.25  # of the brightest light, from where a patch is a spot of its own
SMALLEST = 12  # pixels of such a patch
ROUNDS, SETTLED = 30, 1e-3  # of the search; pixels
WIDTHS = 4.0  # radii of half the light, which must fit between spot and border
RINGS = 40


@dataclass(frozen=True)
class Spot:
    """Spot of light; all in pixels.

    centre  (column, row) in the whole picture; reach the distance to the nearest border
    half    radius within which light is half of the brightest
    """

    centre: tuple[float, float]
    reach: float
    half: float


def spot(pictures: Sequence[Picture], sides: tuple[int, int], plate: PixelScale, source: str) -> Spot:
    """Find the spot in planes of one colour; InputError where a picture shows none, two, or an unmeasurable one."""
    first = pictures[0]
    known = np.isfinite(first.light)
    smooth = gaussian_filter(np.where(known, first.light, 0.0), BLUR)
    share = gaussian_filter(known.astype(np.float32), BLUR)
    with np.errstate(divide="ignore", invalid="ignore"):
        smooth = np.where(share > 0.1, smooth / share, 0.0)
    _require_centre(known, smooth, source)
    most = float(smooth.max())
    if not most > 0:
        raise InputError(f"{source}: expected a spot of light, got darkness")
    patches, count = label(smooth > BRIGHT * most)
    sizes = np.bincount(patches.ravel(), minlength=count + 1)[1:]
    if (large := int(np.sum(sizes >= SMALLEST))) != 1:
        words = "none" if large == 0 else f"{large}, apart from one another"
        raise InputError(f"{source}: expected one spot of light, got {words}")
    rows, columns = np.nonzero(patches == 1 + int(np.argmax(sizes)))
    weight = smooth[rows, columns]
    row, column = (float(np.average(each, weights=weight)) for each in (rows, columns))
    start = column * first.step + first.offset[1], row * first.step + first.offset[0]
    half = float(np.sqrt(np.sum(smooth > 0.5 * most) / np.pi)) * first.step
    reach = _reach(start, sides)
    if reach < WIDTHS * half:
        raise InputError(
            f"{source}: expected a spot at least {WIDTHS * half:.0f} pixels from every border, got {max(reach, 0):.0f}"
        )
    centre = _evened(pictures, start, half, reach, plate)
    return Spot(centre, _reach(centre, sides), half)


def _require_centre(known: NDArray[np.bool_], smooth: NDArray[np.float32], source: str) -> None:
    """Require that what no exposure recorded lies in no bright light; a pixel that is stuck elsewhere may."""
    patches, count = label(~known)
    sizes = np.bincount(patches.ravel(), minlength=count + 1)
    around = grey_dilation(patches, size=(3, 3))
    inside = np.unique(around[known & (smooth > BRIGHT * smooth.max())])
    most = max((int(sizes[one]) for one in inside if one > 0), default=0)
    if most >= SMALLEST or not np.any(known):
        raise InputError(
            f"{source}: expected a spot that the shortest exposure does not clip, got {most or known.size} pixels of a "
            "plane that all clip; add a shorter exposure"
        )


def _reach(centre: tuple[float, float], sides: tuple[int, int]) -> float:
    column, row = centre
    return min(column, row, sides[0] - 1 - column, sides[1] - 1 - row)


def _evened(
    pictures: Sequence[Picture], start: tuple[float, float], half: float, reach: float, plate: PixelScale
) -> tuple[float, float]:
    """Find the centre by dipoles of rings beyond the brightest: -I'(r) d cos at a distance d from it."""
    centre: Floats = np.array(start, float)
    pixel = plate.pixel(start)
    edges = np.geomspace(half, reach, RINGS + 1) * pixel
    for _ in range(ROUNDS):
        sums = np.zeros((4, RINGS))
        for one in pictures:
            x, y, light = places(one, plate, (float(centre[0]), float(centre[1])))
            r = np.maximum(np.hypot(x, y), 1e-6 * pixel)
            ring = np.digitize(r, edges) - 1
            good = (ring >= 0) & (ring < RINGS) & np.isfinite(light)
            ring, value = ring[good], light[good]
            for at, weight in enumerate((None, value, value * (x / r)[good], value * (y / r)[good])):
                sums[at] += np.bincount(ring, weight, RINGS)
        count, total, across, down = sums
        full = count > 0
        middle = np.sqrt(edges[1:] * edges[:-1])[full]
        mean = total[full] / count[full]
        slope = np.gradient(mean, middle)
        weight = count[full] / np.maximum(mean, 1e-3 * mean.max())
        matrix = float(np.sum(weight * slope**2))
        step = np.array([np.sum(weight * slope * -2.0 * one[full] / count[full]) for one in (across, down)]) / matrix
        step /= pixel
        size = float(np.hypot(*step))
        centre += step * min(1.0, half / max(size, 1e-12))
        if size < SETTLED:
            break
    return float(centre[0]), float(centre[1])


def places(picture: Picture, plate: PixelScale, centre: tuple[float, float]) -> tuple[Places, Places, Places]:
    """Places of a plane's pixels about the centre [unit], and their light, (n,) each."""
    rows, columns = picture.light.shape
    across = (np.arange(columns, dtype=np.float32) * picture.step + picture.offset[1])[None]
    down = (np.arange(rows, dtype=np.float32) * picture.step + picture.offset[0])[:, None]
    x, y = plate.from_centre(across, down, centre)
    return x.ravel(), y.ravel(), picture.light.ravel()
