"""Light from far away in all directions: a map of radiance, what it lets fall on a surface, and harmonics of that.

A map is latitude and longitude: row 0 is at the zenith, +y; the middle column is toward -z, and from there columns go
to the right, toward +x.

Irradiance is a cosine's blur of the map. In spherical harmonics Y_lm it is the map's L_lm times pi, 2 pi / 3 and pi / 4
for l = 0, 1, 2 (Ramamoorthi and Hanrahan 2001). The cosine has no part of l = 3, so that harmonics up to l = 2, nine of
them, are those up to l = 3 as well; what is left out begins with l = 4, and is measured (`Environment.error`).
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.ndimage import map_coordinates
from scipy.spatial import cKDTree

from mcml_sim.media.arrays import Floats, require
from profilefit.errors import InputError
from profilefit.measured.photo import exposure

KINDS = (".hdr", ".exr")  # Radiance's RGBE, and OpenEXR
MOST_BYTES, MOST_COLUMNS = 256 << 20, 8192
MOST_RADIANCE = 1e9  # of a pixel
ROWS, COLUMNS = 128, 256  # of the cells that pixels are merged into
SMALL = 1e-12  # share of all light, below which a cell has none
AT_ONCE = 64  # normals
NORMALS = 400  # at which the error of harmonics is measured
TABLE = 48, 96  # of irradiance, over the normal's colatitude and azimuth
# Of the harmonics 1, y, z, x, xy, yz, 3 z^2 - 1, zx, x^2 - y^2: their factors, and pi, 2 pi / 3 or pi / 4.
NORMALISED = np.sqrt(np.array([1.0, 3.0, 3.0, 3.0, 15.0, 15.0, 1.25, 15.0, 3.75]) / (4.0 * np.pi))
OF_COSINE = np.pi * np.array([1.0, *[2.0 / 3.0] * 3, *[0.25] * 5])


class HarmonicError(NamedTuple):
    """Error of irradiance by harmonics, over its mean [-]: root mean square and largest of `NORMALS` normals."""

    rms: float
    most: float


class SkyCells(NamedTuple):
    """Light from patches of the sky.

    Attributes:
        toward: (n, 3) unit directions.
        moments: (n, 3, 3) integral of radiance times direction over a patch, by channel and axis: irradiance of a
            surface is its normal times this, where the whole patch is above its horizon.
    """

    toward: Floats
    moments: Floats

    def plus(self, other: SkyCells) -> SkyCells:
        """Return the light of two skies in the same patches."""
        return SkyCells(self.toward, self.moments + other.moments)


@dataclass(frozen=True, eq=False)
class Environment:
    """Radiance of the sky, merged into cells [light's unit].

    power    (n, 3) integral of radiance over each cell;  moments  (n, 3, 3) the same times direction, channel and axis
    """

    power: Floats
    moments: Floats

    @classmethod
    def of_map(cls, radiance: ArrayLike, rotation: float = 0.0, scale: float = 1.0) -> Self:
        """Return the light of a map (rows, 2 rows, 3) of radiance >= 0.

        rotation  about the vertical, so that what was toward -z is toward +x at 90 [degrees];  scale  of radiance
        """
        values = np.asarray(radiance)
        if values.ndim != 3 or values.shape[2] != 3 or values.shape[1] != 2 * values.shape[0] or not values.size:
            raise InputError(f"map must have shape (rows, 2 rows, 3), got {values.shape}")
        require(bool(np.all((values >= 0) & (values <= MOST_RADIANCE))), "map", f"in 0 ... {MOST_RADIANCE:g}", values)
        if len(values) < ROWS:
            fine = -(-ROWS // len(values))
            values = np.repeat(np.repeat(values, fine, axis=0), fine, axis=1)
        rows, columns = values.shape[:2]
        theta, phi = np.linspace(0.0, np.pi, rows + 1), np.pi * np.linspace(-1.0, 1.0, columns + 1)
        phi = phi + np.radians(rotation)
        # Integrals of the solid angle, and of the direction over it, are products of one by rows and one by columns.
        band, flat = -np.diff(np.cos(theta)), np.diff(theta - 0.5 * np.sin(2.0 * theta)) / 2.0
        height, around = np.diff(np.sin(theta) ** 2) / 2.0, np.diff(phi)
        right, ahead = -np.diff(np.cos(phi)), -np.diff(np.sin(phi))
        tops, lefts = (np.arange(most) * side // most for most, side in ((ROWS, rows), (COLUMNS, columns)))
        by_column = np.stack([around, right, ahead])
        power, moments = np.empty((ROWS, COLUMNS, 3)), np.empty((ROWS, COLUMNS, 3, 3))
        for at, (top, bottom) in enumerate(zip(tops, [*tops[1:], rows], strict=True)):
            part = scale * np.asarray(values[top:bottom], float)
            by_row = np.stack([band[top:bottom], flat[top:bottom], height[top:bottom]])
            sums = np.einsum("kr,rcx,jc->kjcx", by_row, part, by_column)
            merged = np.add.reduceat(sums, lefts, axis=2)
            power[at] = merged[0, 0]
            moments[at] = np.stack([merged[1, 1], merged[2, 0], merged[1, 2]], axis=-1)
        return cls(power.reshape(-1, 3), moments.reshape(-1, 3, 3))

    @cached_property
    def harmonics(self) -> Floats:
        """(9, 3) coefficients of irradiance, by `basis` of the normal and channel."""
        toward = _directions(self.moments)
        return np.einsum("nk,nx->kx", NORMALISED * basis(toward), self.power) * (OF_COSINE * NORMALISED)[:, None]

    @cached_property
    def error(self) -> HarmonicError:
        """Error of the harmonics against the integral over the map."""
        normals = even_directions(NORMALS)
        exact = self.irradiance(normals)
        apart = np.abs(harmonic_irradiance(self.harmonics, normals) - exact)
        mean = float(np.mean(exact))
        if not mean > 0:
            return HarmonicError(0.0, 0.0)
        return HarmonicError(float(np.sqrt(np.mean(apart**2))) / mean, float(apart.max()) / mean)

    def irradiance(self, normals: ArrayLike) -> Floats:
        """Return irradiance (n, 3) of unoccluded surfaces of normals (n, 3), by the integral over the map."""
        where = np.asarray(normals, float)
        flat = self.moments[self.power.any(axis=1)].reshape(-1, 3)  # cells and channels, axis
        found = [np.zeros((0, 3))]
        for start in range(0, len(where), AT_ONCE):
            seen = np.maximum(flat @ where[start : start + AT_ONCE].T, 0.0)
            found.append(seen.reshape(-1, 3, seen.shape[1]).sum(axis=0).T)
        return np.concatenate(found)

    @cached_property
    def table(self) -> Floats:
        """Irradiance (rows, columns, 3) over the normal's colatitude and azimuth, `TABLE`."""
        theta, phi = np.linspace(0.0, np.pi, TABLE[0]), 2.0 * np.pi * np.arange(TABLE[1]) / TABLE[1]
        across = np.sin(theta)[:, None]
        normals = [across * np.sin(phi), np.cos(theta)[:, None] + 0.0 * phi, -across * np.cos(phi)]
        return self.irradiance(np.stack(normals, axis=-1).reshape(-1, 3)).reshape(*TABLE, 3)

    def interpolated(self, normals: Floats) -> Floats:
        """Return `irradiance` of many normals by `table`, with an error of some 1e-4."""
        x, y, z = normals.T
        row = np.arccos(np.clip(y, -1.0, 1.0)) / np.pi * (TABLE[0] - 1)
        column = np.arctan2(x, -z) / (2.0 * np.pi) * TABLE[1]
        wide = np.concatenate([self.table[:, -4:], self.table, self.table[:, :4]], axis=1)  # azimuth repeats
        at = np.stack([row, np.mod(column, TABLE[1]) + 4.0])
        return np.stack([map_coordinates(wide[..., c], at, order=3, mode="nearest") for c in range(3)], axis=1)

    def cells(self, toward: Floats) -> SkyCells:
        """Return the light in the patches nearest to directions (n, 3)."""
        own = _directions(self.moments)
        nearest = cKDTree(toward).query(own)[1]
        moments = np.zeros((len(toward), 3, 3))
        np.add.at(moments, nearest, self.moments)
        return SkyCells(_directions(moments, toward), moments)


def even_cells(radiant: ArrayLike, toward: Floats) -> SkyCells:
    """Return the light of a sky that is the same all over, of irradiance (3,), in patches of equal size."""
    each = 4.0 / len(toward) * np.asarray(radiant, float)
    return SkyCells(toward, each[:, None] * toward[:, None, :])


def even_directions(number: int) -> Floats:
    """Return directions (n, 3) spread evenly over the sphere, by a spiral of the golden angle."""
    i = np.arange(number) + 0.5
    y, turn = 1.0 - 2.0 * i / number, np.pi * (3.0 - np.sqrt(5.0)) * i
    flat = np.sqrt(1.0 - y**2)
    return np.stack([flat * np.cos(turn), y, flat * np.sin(turn)], axis=1)


def basis(toward: Floats) -> Floats:
    """Return the nine harmonics (n, 9) of directions (n, 3), before `NORMALISED`."""
    x, y, z = toward.T
    return np.stack([np.ones_like(x), y, z, x, x * y, y * z, 3.0 * z**2 - 1.0, z * x, x**2 - y**2], axis=1)


def harmonic_irradiance(harmonics: Floats, normals: Floats) -> Floats:
    """Return irradiance (n, 3) by `Environment.harmonics`, which may be below 0 opposite to a lamp."""
    return np.asarray(basis(normals) @ harmonics)


def read_map(path: Path) -> NDArray[np.float32]:
    """Read a map (rows, 2 rows, 3) of radiance from a .hdr or an .exr. InputError in one line."""
    kind = path.suffix.lower()
    if kind not in KINDS:
        raise InputError(f"{path}: expected a map of radiance, {' or '.join(KINDS)}, got {kind or 'no suffix'!r}")
    values = exposure.radiance(path, MOST_BYTES, (MOST_COLUMNS, MOST_COLUMNS // 2))
    rows, columns = values.shape[:2]
    if columns != 2 * rows:
        accepted = "latitude and longitude, twice as wide as high"
        raise InputError(f"{path}: expected {accepted}, got {columns} x {rows} pixels")
    with np.errstate(invalid="ignore"):
        wrong = values[~((values >= 0) & (values <= MOST_RADIANCE))]
    if wrong.size:
        raise InputError(f"{path}: expected radiance in 0 ... {MOST_RADIANCE:g}, got {wrong[0]:g}")
    return values


def _directions(moments: Floats, otherwise: ArrayLike = (0.0, 1.0, 0.0)) -> Floats:
    """Return unit directions (n, 3) of light's moments over all channels; others where there is no light."""
    total = moments.sum(axis=1)
    length = np.linalg.norm(total, axis=1, keepdims=True)
    lit = length > SMALL * max(float(length.sum()), np.finfo(float).tiny)
    return np.where(lit, total / np.where(lit, length, 1.0), otherwise)
