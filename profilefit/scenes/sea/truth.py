"""Sunlight on a floor below waves: of one dimension exactly, by all the rays that come to a place; else by photons.

Light is refracted once, by Snell and Fresnel; what the water does to it is not part of this. Irradiance is per
horizontal area, over that of the sun across its rays. A point sun makes it infinite on folds: averages over pixels are
finite, and those of a sun with a disc are finite everywhere.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.arrays import Floats, checked_finite, checked_whole, is_number, require, require_all
from profilefit.errors import InputError
from profilefit.scenes.sea.waves import STILL, Waves, checked_sun, refracted

Surface = Callable[..., ArrayLike]  # of x [m], to z [m]
PER_DEPTH = 5000  # samples of a surface in a length as long as the floor is deep
MOST_SAMPLES = 2**23
HALVINGS = 60  # of a bracket, until its ends are neighbours in floating point
# Central differences of eighth order (Fornberg, Mathematics of Computation 51, 1988, table 1).
FIRST = np.array([1 / 280, -4 / 105, 1 / 5, -4 / 5, 0.0, 4 / 5, -1 / 5, 4 / 105, -1 / 280])
SECOND = np.array([-1 / 560, 8 / 315, -1 / 5, 8 / 5, -205 / 72, 8 / 5, -1 / 5, 8 / 315, -1 / 560])
BRIGHT, DARK = 2.0, 0.6  # of the mean
FEW, EXTREME = 0.01, 0.05  # shares of pixels: where fewer are bright, or dark, so many of the extremest count as that


def caustic_irradiance(
    surface: Surface,
    x: ArrayLike,
    depth: float,
    tilt: float,
    n: float,
    *,
    slope: Surface | None = None,
    curvature: Surface | None = None,
    spacing: float | None = None,
) -> Any:
    """Return irradiance on a level floor at z = -depth below waves z = surface(x), of a point sun [-]; the shape of x.

    x      [m];  depth  below z = 0, below the deepest trough [m]
    tilt   of the sun from the vertical, in [0, pi / 2): light goes toward +x and down [rad]
    n      refractive index of the water over that of the air; 1.34 for the sea [-]
    slope, curvature  dz/dx [-] and d2z/dx2 [1/m] as functions of x; by default differences of eighth order
    spacing  of the samples between which no two features of the surface lie; by default depth / 5000 [m]

    The sum over all places whose refracted ray comes to x of T cos(i) / cos(slope) / |dX/dx|: infinite on folds.
    Crests shade what is behind them. Light that would leave the water again on its way down is not followed.
    """
    where = checked_finite("x", x, "finite numbers [m]")
    rays = Rays(surface, where, depth, tilt, n, slope, curvature, spacing)
    target, place, _ = rays.arrivals(where.ravel())
    _, stretch, flux = rays.at(place)
    with np.errstate(divide="ignore", invalid="ignore"):
        light = np.where(rays.is_lit(place) & (flux > 0.0), flux / np.abs(stretch), 0.0)
    found = np.bincount(target, light, where.size).reshape(where.shape)
    return float(found) if found.ndim == 0 else found


class Rays:
    """Rays that a surface sends to a floor, between the places from where they can come to these x.

    aside  of the sun from `tilt` [rad], which may leave its range
    """

    def __init__(
        self,
        surface: Surface,
        x: Floats,
        depth: float,
        tilt: float,
        n: float,
        slope: Surface | None = None,
        curvature: Surface | None = None,
        spacing: float | None = None,
        aside: float = 0.0,
    ):
        self.depth, self.tilt, self.n = checked_sun(depth, tilt, n)
        self.tilt += aside
        self._surface = surface
        is_length = spacing is None or (is_number(spacing) and 0.0 < spacing < np.inf)
        require(is_length, "spacing", "a length > 0 [m]", spacing)
        self._step = float(spacing or self.depth / PER_DEPTH)
        self._slope, self._curvature = slope, curvature
        low, high = (float(x.min()), float(x.max())) if x.size else (0.0, 0.0)
        reach = self.depth
        while True:  # until no ray from beyond comes in, nor shadow
            count = int(np.ceil((high - low + 2.0 * reach) / self._step)) + 1
            if count > MOST_SAMPLES:
                raise InputError(f"x must span fewer than {MOST_SAMPLES} samples of spacing, got {count}")
            nodes = np.linspace(low - reach, high + reach, count)
            landing, stretch, _ = self.at(nodes)
            accepted = "one at which light enters everywhere, none is all reflected"
            require(np.all(np.isfinite(stretch)), "n", accepted, self.n)
            shadow = float(np.ptp(self._height(nodes)) * np.tan(self.tilt))  # of the highest crest
            farthest = float(np.max(np.abs(landing - nodes))) + abs(shadow) + 8.0 * self._step
            if farthest <= reach:
                break
            reach = 1.5 * farthest
        self.nodes = self._with_folds(nodes, stretch)
        self.landing = self.at(self.nodes)[0]
        self._before = np.maximum.accumulate(self._across(self.nodes))

    def at(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        """Return where rays of places on the surface land [m], dX/dx [-], and flux per horizontal area [-]."""
        z, zx, zxx = self._derivatives(x)
        across, _, flux = refracted(self.tilt, (zx, np.zeros_like(zx)), self.n)
        # tan(psi), psi the ray's angle to the vertical: slope a, then sin(psi - a) = sin(tilt - a) / n.
        incident = self.tilt - np.arctan(zx)
        inside = np.sqrt(np.maximum(1.0 - (np.sin(incident) / self.n) ** 2, 0.0))  # 0 where all is reflected, if n < 1
        with np.errstate(divide="ignore", invalid="ignore"):
            turn = 1.0 - np.cos(incident) / (self.n * inside)
            rate = (1.0 + across**2) * turn / (1.0 + zx**2)
            stretch = 1.0 + zx * across + (self.depth + z) * rate * zxx
        return x + (self.depth + z) * across, stretch, flux

    def arrivals(self, x: Floats) -> tuple[NDArray[np.int64], Floats, NDArray[np.bool_]]:
        """Return which of x a ray comes to, from which place [m], and whether it lands farther on with the place."""
        turning = np.flatnonzero(np.diff(np.sign(np.diff(self.landing))) != 0) + 1
        ends = np.concatenate([[0], turning, [self.landing.size - 1]])
        order = np.argsort(x)
        found: list[tuple[NDArray[np.int64], NDArray[np.int64], bool]] = []
        for first, last in zip(ends[:-1].tolist(), ends[1:].tolist(), strict=True):
            branch = self.landing[first : last + 1]
            rising = bool(branch[-1] > branch[0])
            low, high = min(branch[0], branch[-1]), max(branch[0], branch[-1])
            inside = order[np.searchsorted(x, low, "left", order) : np.searchsorted(x, high, "left", order)]
            cell = np.searchsorted(branch if rising else branch[::-1], x[inside], "right") - 1
            cell = np.clip(cell if rising else branch.size - 2 - cell, 0, branch.size - 2)
            found.append((inside, first + cell, rising))
        target, cell = (np.concatenate([one[part] for one in found]) for part in (0, 1))
        rises = np.repeat([one[2] for one in found], [one[0].size for one in found])
        near, far = self.nodes[cell], self.nodes[cell + 1]
        goal = x[target]
        start, end = self.landing[cell], self.landing[cell + 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            place = near + np.clip(np.nan_to_num((goal - start) / (end - start), nan=0.5), 0.0, 1.0) * (far - near)
            for _ in range(HALVINGS):
                landing, stretch, _ = self.at(place)
                beyond = (landing > goal) == rises
                near, far = np.where(beyond, near, place), np.where(beyond, place, far)
                step = place - (landing - goal) / stretch
                new = np.where((step >= near) & (step <= far), step, 0.5 * (near + far))
                done = np.abs(new - place) <= 1e-15 * (1.0 + np.abs(place))
                place = new
                if np.all(done):
                    break
        return target, place, rises

    def is_lit(self, x: Floats) -> NDArray[np.bool_]:
        """Return whether no crest is in the way: the place is farther across the rays than all before it."""
        cell = np.clip(np.searchsorted(self.nodes, x, "right") - 1, 0, self.nodes.size - 1)
        return self._across(x) >= self._before[cell]

    def _across(self, x: Floats) -> Floats:
        """Return the distance across the rays [m], the same all along one."""
        return x * np.cos(self.tilt) + self._height(x) * np.sin(self.tilt)

    def _with_folds(self, nodes: Floats, stretch: Floats) -> Floats:
        """Return the places where dX/dx changes its sign among them: between two, X is monotone."""
        cell = np.flatnonzero(np.sign(stretch[:-1]) * np.sign(stretch[1:]) < 0)
        near, far, sign = nodes[cell], nodes[cell + 1], np.sign(stretch[cell])
        for _ in range(HALVINGS):
            middle = 0.5 * (near + far)
            same = np.sign(self.at(middle)[1]) == sign
            near, far = np.where(same, middle, near), np.where(same, far, middle)
        return np.unique(np.concatenate([nodes, 0.5 * (near + far)]))

    def _height(self, x: Floats) -> Floats:
        try:
            z = np.asarray(self._surface(x), float)
        except (TypeError, ValueError) as error:
            raise InputError(f"surface must be a function of an array of x [m], got {error}") from None
        z = np.broadcast_to(z, x.shape)
        require_all("surface", z, np.isfinite(z), "finite")
        if np.any(z <= -self.depth):
            raise InputError(f"depth must be below the deepest trough, {-z.min():g} m, got {self.depth:g}")
        return z

    def _derivatives(self, x: Floats) -> tuple[Floats, Floats, Floats]:
        z, step = self._height(x), self._step
        zx, zxx = STILL, STILL
        if self._slope is not None:
            zx = np.broadcast_to(np.asarray(self._slope(x), float), x.shape)
        if self._curvature is not None:
            zxx = np.broadcast_to(np.asarray(self._curvature(x), float), x.shape)
        if self._slope is None or self._curvature is None:
            around = [z if one == 0 else self._height(x + one * step) for one in range(-4, 5)]
            zx = zx if self._slope else sum(w * one for w, one in zip(FIRST, around, strict=True)) / step
            zxx = zxx if self._curvature else sum(w * one for w, one in zip(SECOND, around, strict=True)) / step**2
        return z, zx, zxx


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


def photons(waves: Waves, x: Floats, y: Floats, depth: float, tilt: float, n: float) -> Photons:
    """Return rays through all pairs of x (columns,) and y (rows,) to the level floor at -depth [m].

    Waves must not shade one another: InputError.
    """
    deep, angle, index = checked_sun(depth, tilt, n)
    if waves.lowest <= -deep:
        raise InputError(f"depth must be below the deepest trough, {-waves.lowest:g} m, got {deep:g}")
    z, zx, zy = waves.lattice(x, y)
    along, aside, flux = refracted(angle, (zx, zy), index)
    if np.any(flux == 0.0):
        raise InputError(f"tilt must be one at which no wave faces away from the sun, got {angle:g} radians")
    down = deep + z
    return Photons(x + down * along, y[:, None] + down * aside, flux)


def caustic_photons(waves: Waves, depth: float, tilt: float, n: float, pixels: int, side: int = 2048) -> Floats:
    """Return the irradiance of a tile of a level floor, averaged over pixels: (pixels, pixels), row 0 at y = 0 [-].

    side  photons along the tile, a multiple of pixels;  of a point sun

    Photons stand on a lattice, in the middle of its cells. Each is spread over the box that has the mean and the
    variances of its cell on the floor, so that its light comes to four pixels at most; light that leaves the tile
    comes in on the other side. No light is lost.
    """
    columns = checked_whole("pixels", pixels, 1, 8192)
    fine = checked_whole("side", side, columns, 16384)
    require(fine % columns == 0, "side", f"a multiple of pixels = {columns}", fine)
    step, rows = waves.tile / fine, max(1, 2**21 // fine)
    found = np.zeros(columns * columns)
    x = np.asarray((np.arange(-1, fine + 1) + 0.5) * step, np.float64)
    for first in range(0, fine, rows):
        sent = photons(waves, x, x[first : min(first + rows, fine) + 2], depth, tilt, n)
        flux, each = sent.flux[1:-1, 1:-1].ravel(), boxes(sent, columns, columns / waves.tile)
        found += sum(np.bincount(at, flux * share, found.size) for at, share in each)
    return found.reshape(columns, columns) * (columns / fine) ** 2


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
