"""Surfaces that are sums of cosines over a square tile: a sea, or an uneven floor below it."""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.checks import checked_numbers, checked_whole, is_number, shown
from mcml_sim.media.fresnel import fresnel
from profilefit.errors import InputError
from profilefit.recipes.declared import LENGTHS

Floats = NDArray[np.float64]
SUN = float(np.radians(0.5 * 0.533))  # half-width of the sun's disc in air [rad]
GRAVITY = 9.81  # [m/s^2]
WIND = 5.0  # [m/s] of a light breeze, whose longest waves, wind^2 / g = 2.5 m, fit into a tile a few times
FINE = 512  # points of a side of the lattice on which the steepest and the most curved place are looked for
WHOLE = 1e-6  # a wave vector may be so far from the tile's lattice, in its steps
STILL = np.zeros(0)


@dataclass(frozen=True, eq=False)
class Waves:
    """Surface z(x, y) = mean + sum_i amplitude_i cos(kx_i x + ky_i y + phase_i), z up, the sea's mean level at 0.

    tile        side of the square in which it repeats [m]
    amplitudes  (n,) [m];  vectors  (n, 2) kx, ky, multiples of 2 pi / tile [1/m];  phases  (n,) [rad]
    mean        level [m]: 0 of a sea, minus the mean depth of a floor

    Without waves it is a plane. All methods take x and y that broadcast [m].
    """

    tile: float
    amplitudes: Floats = field(default_factory=lambda: STILL)
    vectors: Floats = field(default_factory=lambda: STILL.reshape(0, 2))
    phases: Floats = field(default_factory=lambda: STILL)
    mean: float = 0.0

    def __post_init__(self) -> None:
        tile = _length("tile", self.tile)
        if not is_number(self.mean) or not np.isfinite(self.mean):
            raise InputError(f"mean must be a level [m], got {shown(self.mean)}")
        for name in ("amplitudes", "vectors", "phases"):
            array = checked_numbers(name, getattr(self, name), "finite numbers")
            if not np.all(np.isfinite(array)):
                raise InputError(f"{name} must be finite numbers, got {array[~np.isfinite(array)].flat[0]:g}")
            object.__setattr__(self, name, array)
        count = self.amplitudes.size
        for name, accepted in (("amplitudes", (count,)), ("vectors", (count, 2)), ("phases", (count,))):
            if getattr(self, name).shape != accepted:
                raise InputError(f"{name} must have shape {accepted}, got {getattr(self, name).shape}")
        steps = self.vectors * tile / (2.0 * np.pi)
        deviation = np.abs(steps - np.round(steps))
        if np.any(deviation > WHOLE):
            worst = self.vectors.flat[int(np.argmax(deviation))]
            raise InputError(f"vectors must be multiples of 2 pi / tile = {2 * np.pi / tile:g} /m, got {worst:g}")

    @property
    def lowest(self) -> float:
        """No place is lower [m]; all troughs meet there."""
        return float(self.mean - np.abs(self.amplitudes).sum())

    @property
    def highest(self) -> float:
        """No place is higher [m]."""
        return float(self.mean + np.abs(self.amplitudes).sum())

    @property
    def rms_slope(self) -> float:
        """Root of the mean of |grad z|^2 over the tile [-], for waves whose vectors all differ."""
        return float(np.sqrt(0.5 * np.sum(self.amplitudes**2 * np.sum(self.vectors**2, axis=1))))

    @cached_property
    def steepest(self) -> float:
        """Largest |grad z| of a fine lattice [-]."""
        x = np.arange(FINE) * self.tile / FINE
        _, zx, zy = self.lattice(x, x)
        return float(np.sqrt(np.max(zx**2 + zy**2)))

    @cached_property
    def crest(self) -> float:
        """Largest principal curvature of a crest, -z'', of a fine lattice [1/m]; slopes count as small."""
        x = np.arange(FINE) * self.tile / FINE
        zxx, zxy, zyy = self._grid(x, x, ("xx", "xy", "yy"))
        return float(np.max(-0.5 * (zxx + zyy) + np.hypot(0.5 * (zxx - zyy), zxy)))

    def height(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return z [m]."""
        angle = self._angle(x, y)
        return self.mean + np.sum(self.amplitudes * np.cos(angle), axis=-1)

    def slope(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Return dz/dx and dz/dy [-]."""
        sines = -self.amplitudes * np.sin(self._angle(x, y))
        return sines @ self.vectors[:, 0], sines @ self.vectors[:, 1]

    def curvature(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats, Floats]:
        """Return d2z/dx2, d2z/dxdy and d2z/dy2 [1/m]."""
        kx, ky = self.vectors.T
        cosines = -self.amplitudes * np.cos(self._angle(x, y))
        return cosines @ (kx * kx), cosines @ (kx * ky), cosines @ (ky * ky)

    def lattice(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Return z, dz/dx and dz/dy at all pairs of x (columns,) and y (rows,): three of (rows, columns)."""
        z, zx, zy = self._grid(x, y, ("", "x", "y"))
        return self.mean + z, zx, zy

    def scaled(self, factor: float) -> Waves:
        """Return waves so many times as high about their mean, and as steep and as curved."""
        return replace(self, amplitudes=self.amplitudes * factor)

    @cached_property
    def texels(self) -> NDArray[np.float32]:
        """Table (1, n, 4) for glsl/waves.glsl: whole waves in the tile along x and y, amplitude [m], phase [turns]."""
        whole = np.round(self.vectors * self.tile / (2.0 * np.pi))
        found = np.column_stack([whole, self.amplitudes, np.mod(self.phases / (2.0 * np.pi), 1.0)])
        return (found if found.size else np.zeros((1, 4))).astype(np.float32)[None]

    def _angle(self, x: ArrayLike, y: ArrayLike) -> Floats:
        kx, ky = self.vectors.T
        return np.asarray(x, float)[..., None] * kx + np.asarray(y, float)[..., None] * ky + self.phases

    def _grid(self, x: Floats, y: Floats, kinds: tuple[str, ...]) -> list[Floats]:
        """Return derivatives of z at all pairs, each named by its letters, as one product of matrices."""
        kx, ky = self.vectors.T
        along = np.exp(1j * np.outer(kx, x))
        across = np.exp(1j * (np.outer(y, ky) + self.phases)) * self.amplitudes
        found = []
        for kind in kinds:
            rows = across * (1j * kx) ** kind.count("x") * (1j * ky) ** kind.count("y")
            found.append(rows.real @ along.real - rows.imag @ along.imag)
        return found


def random_sea(
    rms_slope: float,
    tile: float,
    seed: int = 0,
    count: int = 24,
    harmonics: int = 6,
    wind: tuple[float, float] = (WIND, 0.0),
) -> Waves:
    """Return a wind sea of a given root mean square slope [-] over a tile [m].

    count      of waves that are kept, those of the largest slope;  harmonics  most waves along a side of the tile
    wind       [m/s] along x and y

    Heights are complex normal deviates times the root of Phillips's spectrum, e^{-1 / (k L)^2} / k^4 (k.w / k w)^2 with
    L = w^2 / g (Tessendorf, Simulating Ocean Water, SIGGRAPH course, 2001), on the lattice of the tile. It has no scale
    of its own here: the slope is what is given.
    """
    blow = checked_numbers("wind", wind, "two speeds [m/s]")
    speed = float(np.hypot(*blow)) if blow.shape == (2,) else 0.0
    if not 0.0 < speed < np.inf:
        raise InputError(f"wind must be two speeds [m/s], not both 0, got {shown(wind)}")
    vectors = _lattice(_length("tile", tile), checked_whole("harmonics", harmonics, 1, 64))
    k = np.linalg.norm(vectors, axis=1)
    along = vectors @ blow / (k * speed)
    with np.errstate(divide="ignore", over="ignore"):
        root = np.exp(-0.5 / (k * speed**2 / GRAVITY) ** 2) / k**2 * np.abs(along)
    if not np.any(root > 1e-100):  # whose squares are floats
        raise InputError(f"wind must be strong enough for waves on a tile of {tile:g} m, got {shown(wind)}")
    return _drawn(root, vectors, rms_slope, tile, seed, count)


def random_floor(
    rms_slope: float, tile: float, depth: float, seed: int = 0, count: int = 6, harmonics: int = 4
) -> Waves:
    """Return an uneven floor of waves of all directions alike, around a mean depth [m]; the others as of `random_sea`.

    Each of the waves, drawn from the lattice of the tile, has about as much slope: heights fall as 1 / k.
    """
    vectors = _lattice(_length("tile", tile), checked_whole("harmonics", harmonics, 1, 64))
    rng = np.random.default_rng(seed)
    chosen = rng.permutation(len(vectors))[: checked_whole("count", count, 1)]
    vectors = vectors[chosen]
    root = 1.0 / np.linalg.norm(vectors, axis=1)
    return replace(_drawn(root, vectors, rms_slope, tile, seed, count), mean=-_length("depth", depth))


def refracted(tilt: float, slope: tuple[Floats, Floats], n: float) -> tuple[Floats, Floats, Floats]:
    """Return sunlight behind a surface of these slopes: its ray's x and y a unit of depth, and its flux.

    tilt  of the sun from the vertical, in the plane of x and z; light goes toward +x where it is > 0 [rad]
    slope  dz/dx and dz/dy [-];  n  refractive index below, over that above [-]

    The flux is what passes a unit of horizontal area, over that which falls on a unit of area across the rays:
    T(i) cos(i) / cos(slope), with Fresnel's T of unpolarised light and i against the surface's own normal; 0 where the
    surface faces away. The ray is Snell's: d / n + (cos i / n - cos t) N, of which x / -z and y / -z are returned.
    """
    zx, zy = slope
    stretch = np.sqrt(1.0 + zx * zx + zy * zy)  # 1 / cos of the slope
    across = np.cos(tilt) + zx * np.sin(tilt)  # cos(i) stretch
    cosine = np.maximum(across, 0.0) / stretch
    reflected, inside = fresnel(1.0, n, cosine)
    along = (cosine / n - inside) / stretch  # times the normal (-zx, -zy, 1)
    down = np.cos(tilt) / n - along
    return (np.sin(tilt) / n - along * zx) / down, -along * zy / down, (1.0 - reflected) * np.maximum(across, 0.0)


def checked_sun(depth: object, tilt: object, n: object) -> tuple[float, float, float]:
    """Return the depth of a floor [m], tilt of the sun [rad] and the water's index over the air's [-]. InputError."""
    if not is_number(depth) or not 0.0 < depth < np.inf:
        raise InputError(f"depth must be a length > 0 [m], got {shown(depth)}")
    if not is_number(tilt) or not 0.0 <= tilt < 0.5 * np.pi:
        raise InputError(f"tilt must be in [0, pi / 2), in radians, got {shown(tilt)}")
    if not is_number(n) or not 0.0 < n < np.inf:
        raise InputError(f"n must be a refractive index > 0, got {shown(n)}")
    return float(depth), float(tilt), float(n)


def _lattice(tile: float, harmonics: int) -> Floats:
    """Return the wave vectors of up to so many waves a tile, one of each pair of opposite ones (n, 2) [1/m]."""
    whole = np.arange(-harmonics, harmonics + 1)
    x, y = (one.ravel() for one in np.meshgrid(whole, whole))
    half = ((y > 0) | ((y == 0) & (x > 0))) & (x**2 + y**2 <= harmonics**2)
    return np.column_stack([x, y])[half] * 2.0 * np.pi / tile


def _drawn(root: Floats, vectors: Floats, rms_slope: float, tile: float, seed: int, count: int) -> Waves:
    """Return complex normal deviates times these roots of variances, and of those so many of the largest slope."""
    if not is_number(rms_slope) or not 0.0 <= rms_slope < np.inf:
        raise InputError(f"rms_slope must be a number >= 0, got {shown(rms_slope)}")
    rng = np.random.default_rng(seed)
    real, imaginary = rng.standard_normal((2, root.size)) * root
    amplitudes, phases = np.hypot(real, imaginary), np.arctan2(imaginary, real)
    order = np.argsort(-amplitudes * np.linalg.norm(vectors, axis=1))[: checked_whole("count", count, 1)]
    found = Waves(tile, amplitudes[order], vectors[order], phases[order])
    return found.scaled(rms_slope / found.rms_slope)


def _length(name: str, value: object) -> float:
    least, most = LENGTHS
    if not is_number(value) or not least <= value <= most:
        raise InputError(f"{name} must be a length in {least:g} ... {most:g} m, got {shown(value)}")
    return float(value)
