"""Reference of caustic maps by photons, and errors of a map against it."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.checks import checked_whole
from profilefit.errors import InputError
from profilefit.scenes.sea.waves import SUN, Waves, checked_sun, refracted

Floats = NDArray[np.float64]
BRIGHT, DARK = 2.0, 0.6  # of the mean
FEW, EXTREME = 0.01, 0.05  # shares of pixels: where fewer are bright, or dark, so many of the extremest count as that


class MapError(NamedTuple):
    """Errors of a map [-]: rms; of the light where it is bright and dark, relative; energy, its mean less 1."""

    rms: float
    bright: float
    dark: float
    energy: float


def misfit(light: Floats, true: Floats) -> MapError:
    """Return the errors of a map in units of the mean that entered, against one whose mean is that.

    Bright is above 2 of the mean, dark below 0.6. Where fewer than 1 % of the pixels are so, the 5 % that are
    brightest, or darkest, are taken.
    """
    right = true / true.mean()
    bright, dark = right > BRIGHT, right < DARK
    if bright.mean() < FEW:
        bright = right >= np.quantile(right, 1.0 - EXTREME)
    if dark.mean() < FEW:
        dark = right <= np.quantile(right, EXTREME)
    lit, unlit = (float(light[where].mean() / right[where].mean() - 1.0) for where in (bright, dark))
    return MapError(float(np.sqrt(np.mean((light - right) ** 2))), lit, unlit, float(light.mean() - 1.0))


class Photons(NamedTuple):
    """Places where photons of a lattice over a tile land.

    x, y  (rows, columns), not brought back into the tile [m];  flux  per horizontal area of the surface [-]
    """

    x: Floats
    y: Floats
    flux: Floats


def photons(waves: Waves, x: Floats, y: Floats, depth: float, tilt: float, n: float, azimuth: float = 0.0) -> Photons:
    """Return rays through all pairs of x (columns,) and y (rows,) to the level floor at -depth [m].

    azimuth  turns the sun about the vertical, from +x toward +y [rad]. Waves must not shade one another: InputError.
    """
    deep, angle, index = checked_sun(depth, tilt, n)
    if waves.lowest <= -deep:
        raise InputError(f"depth must be below the deepest trough, {-waves.lowest:g} m, got {deep:g}")
    z, zx, zy = waves.lattice(x, y)
    cosine, sine = np.cos(azimuth), np.sin(azimuth)
    along, aside, flux = refracted(angle, (cosine * zx + sine * zy, cosine * zy - sine * zx), index)
    if np.any(flux == 0.0):
        raise InputError(f"tilt must be one at which no wave faces away from the sun, got {angle:g} radians")
    down = deep + z
    return Photons(
        x + down * (cosine * along - sine * aside), y[:, None] + down * (sine * along + cosine * aside), flux
    )


def caustic_photons(
    waves: Waves, depth: float, tilt: float, n: float, pixels: int, side: int = 2048, suns: int = 1, sun: float = SUN
) -> Floats:
    """Return the irradiance of a tile of a level floor, averaged over pixels: (pixels, pixels), row 0 at y = 0 [-].

    side  photons along the tile, a multiple of pixels;  suns  directions of the sun's disc, 1 of a point sun
    sun   half-width of the disc in air [rad]

    Photons stand on a lattice, in the middle of its cells. Each is spread over the box that has the mean and the
    variances of its cell on the floor, so that its light comes to four pixels at most; light that leaves the tile
    comes in on the other side. No light is lost.
    """
    columns = checked_whole("pixels", pixels, 1, 8192)
    fine = checked_whole("side", side, columns, 16384)
    count = checked_whole("suns", suns, 1, 4096)
    if fine % columns:
        raise InputError(f"side must be a multiple of pixels = {columns}, got {fine}")
    step, rows = waves.tile / fine, max(1, 2**21 // fine)
    found = np.zeros(columns * columns)
    x = np.asarray((np.arange(-1, fine + 1) + 0.5) * step, np.float64)
    for angle, azimuth in _disc(tilt, count, sun):
        for first in range(0, fine, rows):
            sent = photons(waves, x, x[first : min(first + rows, fine) + 2], depth, angle, n, azimuth)
            found += _spread(sent, columns, columns / waves.tile)
    return found.reshape(columns, columns) * (columns / fine) ** 2 / count


def boxes(sent: Photons, pixels: int, scale: float) -> Iterator[tuple[NDArray[np.int64], Floats]]:
    """Yield pixels, in one row, that all but the outermost photons of a lattice come to over their boxes, and shares.

    Four pixels each, all photons in each of four turns;  scale  [pixels/m]
    """
    inner = slice(1, -1)
    shares = []
    for where in (sent.x, sent.y):
        by_x, by_y = (0.5 * np.diff(where, axis=axis) for axis in (1, 0))
        by_x, by_y = (by_x[inner, 1:] + by_x[inner, :-1]), (by_y[1:, inner] + by_y[:-1, inner])
        width = np.clip(scale * np.hypot(by_x, by_y), 1e-6, 1.0)
        low = scale * where[inner, inner] - 0.5 * width
        pixel = np.floor(low)
        shares.append((pixel.astype(np.int64), np.clip((low + width - pixel - 1.0) / width, 0.0, 1.0)))
    (column, right), (row, up) = shares
    for aside, part in ((0, 1.0 - right), (1, right)):
        for above, share in ((0, 1.0 - up), (1, up)):
            at = np.mod(row + above, pixels) * pixels + np.mod(column + aside, pixels)
            yield at.ravel(), (part * share).ravel()


def _spread(sent: Photons, pixels: int, scale: float) -> Floats:
    """Spread all but the outermost photons of a lattice over their boxes (pixels^2,) [photons]; scale  [pixels/m]."""
    flux, found = sent.flux[1:-1, 1:-1].ravel(), np.zeros(pixels * pixels)
    for at, share in boxes(sent, pixels, scale):
        found += np.bincount(at, flux * share, pixels * pixels)
    return found


def _disc(tilt: float, count: int, half_width: float) -> list[tuple[float, float]]:
    """Return tilt and azimuth of directions that fill a disc about the sun evenly: Vogel's spiral."""
    if count == 1:
        return [(tilt, 0.0)]
    radius = half_width * np.sqrt((np.arange(count) + 0.5) / count)
    turn = np.pi * (3.0 - np.sqrt(5.0)) * np.arange(count)
    along, across = radius * np.cos(turn), radius * np.sin(turn)
    x, z = np.sin(tilt) + along * np.cos(tilt), np.cos(tilt) - along * np.sin(tilt)
    return list(zip(np.arctan2(np.hypot(x, across), z).tolist(), np.arctan2(across, x).tolist(), strict=True))
