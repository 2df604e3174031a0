"""Surfaces that are sums of cosines over a square tile, a sea or an uneven floor; and the first hit of a ray on one.

Li, Wang, Li, Zhao, Wang and Liu (J. Image Graphics 16(8), 2011) find a hit by "about 3" Newton iterations from a
distance of 1; Shah, Konttinen and Pattanaik (IEEE TVCG 13(2), 2007) by an iteration without slopes. Either holds while
S = largest slope x tan(ray to the vertical) < 1: beyond, a ray may cross the floor more than once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.arrays import (
    Floats,
    checked_finite,
    checked_numbers,
    checked_whole,
    is_number,
    require,
    require_index,
)
from mcml_sim.media.medium import fresnel
from profilefit.errors import InputError
from profilefit.recipes.declared import LENGTHS

GRAVITY = 9.81  # [m/s^2]
WIND = 5.0  # [m/s] of a light breeze, whose longest waves, wind^2 / g = 2.5 m, fit into a tile a few times
OF_SEA, SEA_WAVES = 6, 24  # most waves along a side of the tile, and those that are kept
OF_FLOOR, FLOOR_WAVES = 4, 6
FINE = 512  # points of a side of the lattice on which the steepest and the most curved place are looked for
MAPS = 4  # of surfaces, which are kept
WHOLE = 1e-6  # a wave vector may be so far from the tile's lattice, in its steps
STILL = np.zeros(0)
Height = Callable[..., ArrayLike]  # of x and y [m], to z [m]
Slope = Callable[..., tuple[ArrayLike, ArrayLike]]  # of x and y [m], to dz/dx and dz/dy [-]
NEWTON = 3  # iterations after the steps, as many as the paper has
MOST_STEPS = 1024
UNIT = 1e-6  # a direction's length may be so far from 1: float32 is nearer
SLACK = 1e-9  # of lengths: a bound that is met exactly is one in floating point, too
SHORT = 1e-6  # a secant that stands for a slope, in the range of heights
DENSE, BISECTIONS = 4096, 50  # of the reference
# Rays whose hits are counted: a hit farther than OFF depths from the true one is wrong.
OFF, TILT, DEPTH, SEA_SLOPE, INDEX = 0.01, float(np.radians(63.0)), 5.0, 0.15, 1.34
PLAIN = ("newton", "newton_1m", "shah")  # from the mean plane, from 1 m (as published), and Shah's from the mean plane


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
        require(is_number(self.mean) and np.isfinite(self.mean), "mean", "a level [m]", self.mean)
        for name in ("amplitudes", "vectors", "phases"):
            object.__setattr__(self, name, checked_finite(name, getattr(self, name), "finite numbers"))
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
        zx, zy = self.sampled(FINE, ("x", "y"))
        return float(np.sqrt(np.max(zx**2 + zy**2)))

    @cached_property
    def crest(self) -> float:
        """Largest principal curvature of a crest, -z'', of a fine lattice [1/m]; slopes count as small."""
        zxx, zxy, zyy = self.sampled(FINE, ("xx", "xy", "yy"))
        return float(np.max(-0.5 * (zxx + zyy) + np.hypot(0.5 * (zxx - zyy), zxy)))

    def height(self, x: ArrayLike, y: ArrayLike) -> Floats:
        """Return z [m]."""
        angle = self._angle(x, y)
        return self.mean + np.sum(self.amplitudes * np.cos(angle), axis=-1)

    def slope(self, x: ArrayLike, y: ArrayLike) -> tuple[Floats, Floats]:
        """Return dz/dx and dz/dy [-]."""
        sines = -self.amplitudes * np.sin(self._angle(x, y))
        return sines @ self.vectors[:, 0], sines @ self.vectors[:, 1]

    def sampled(self, count: int, kinds: tuple[str, ...] = ("", "x", "y"), shift: float = 0.0) -> Floats:
        """Return derivatives of z at the points of a lattice of the tile (kinds, count, count), by inverse FFT.

        Its cost does not depend on the number of waves; waves that are too short for the lattice are exact, too.

        Args:
            count: points along a side; rows over y.
            kinds: letters by which z is derived: z itself, dz/dx and dz/dy by default [m, -].
            shift: of the points from the tile's corner, in their distance.
        """
        whole = np.round(self.vectors * self.tile / (2.0 * np.pi)).astype(int)
        factor = self.amplitudes * np.exp(1j * (self.phases + self.vectors.sum(axis=1) * shift * self.tile / count))
        spectrum = np.zeros((len(kinds), count, count), complex)
        for part, kind in zip(spectrum, kinds, strict=True):
            derived = (1j * self.vectors[:, 0]) ** kind.count("x") * (1j * self.vectors[:, 1]) ** kind.count("y")
            np.add.at(part, tuple((whole % count).T[::-1]), factor * derived)
        found = np.fft.ifft2(spectrum).real * count**2
        for part, kind in zip(found, kinds, strict=True):
            part += self.mean if not kind else 0.0
        return np.asarray(found)

    def lattice(self, x: Floats, y: Floats) -> tuple[Floats, Floats, Floats]:
        """Return z, dz/dx and dz/dy at all pairs of x (columns,) and y (rows,): three of (rows, columns)."""
        z, zx, zy = self._grid(x, y, ("", "x", "y"))
        return self.mean + z, zx, zy

    def scaled(self, factor: float) -> Waves:
        """Return waves so many times as high about their mean, and as steep and as curved."""
        return replace(self, amplitudes=self.amplitudes * factor)

    def after(self, time: float, wind: tuple[float, float], depth: float) -> Waves:
        """Return the waves after a time [s]: each moves downwind with its own speed in water of a depth [m].

        omega^2 = g k tanh(k depth) (Airy's linear waves; Lamb, Hydrodynamics, section 229).
        """
        k = np.linalg.norm(self.vectors, axis=1)
        rate = np.sqrt(GRAVITY * k * np.tanh(k * depth)) * np.where(self.vectors @ np.asarray(wind) < 0, -1.0, 1.0)
        return replace(self, phases=self.phases - rate * time)

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


@lru_cache(MAPS)
def surface_map(waves: Waves, count: int) -> NDArray[np.float32]:
    """Return (count, count, 4) z [m], dz/dx and dz/dy [-] in the middles of the tile's cells, as a texture has them."""
    return np.append(np.moveaxis(waves.sampled(count, shift=0.5), 0, -1), np.zeros((count, count, 1)), -1).astype("f4")


def random_sea(rms_slope: float, tile: float, seed: int = 0, wind: tuple[float, float] = (WIND, 0.0)) -> Waves:
    """Return a wind sea of a given root mean square slope [-] over a tile [m]; wind  [m/s] along x and y.

    Heights are complex normal deviates times the root of Phillips's spectrum, e^{-1 / (k L)^2} / k^4 (k.w / k w)^2 with
    L = w^2 / g (Tessendorf, Simulating Ocean Water, SIGGRAPH course, 2001), on the lattice of the tile. It has no scale
    of its own here: the slope is what is given.
    """
    blow = checked_numbers("wind", wind, "two speeds [m/s]")
    speed = float(np.hypot(*blow)) if blow.shape == (2,) else 0.0
    require(0.0 < speed < np.inf, "wind", "two speeds [m/s], not both 0", wind)
    vectors = _lattice(_length("tile", tile), OF_SEA)
    k = np.linalg.norm(vectors, axis=1)
    along = vectors @ blow / (k * speed)
    with np.errstate(divide="ignore", over="ignore"):
        root = np.exp(-0.5 / (k * speed**2 / GRAVITY) ** 2) / k**2 * np.abs(along)
    is_strong = np.any(root > 1e-100)  # whose squares are floats
    require(is_strong, "wind", f"strong enough for waves on a tile of {tile:g} m", wind)
    return _drawn(root, vectors, rms_slope, tile, seed)


def random_floor(rms_slope: float, tile: float, depth: float, seed: int = 0) -> Waves:
    """Return an uneven floor of waves of all directions alike, around a mean depth [m]; the others as of `random_sea`.

    Each of the waves, drawn from the lattice of the tile, has about as much slope: heights fall as 1 / k.
    """
    vectors = _lattice(_length("tile", tile), OF_FLOOR)
    chosen = np.random.default_rng(seed).permutation(len(vectors))[:FLOOR_WAVES]
    vectors = vectors[chosen]
    root = 1.0 / np.linalg.norm(vectors, axis=1)
    return replace(_drawn(root, vectors, rms_slope, tile, seed), mean=-_length("depth", depth))


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


def calm_ray(tilt: float, n: float) -> tuple[float, float]:
    """Return the tangent to the vertical of sunlight below a calm surface, and its flux, as of `refracted` [-]."""
    x, _, flux = refracted(tilt, (np.zeros(1), np.zeros(1)), n)
    return float(x[0]), float(flux[0])


def checked_sun(depth: float, tilt: float, n: float) -> tuple[float, float, float]:
    """Return the depth of a floor [m], tilt of the sun [rad] and the water's index over the air's [-]. InputError."""
    require(is_number(depth) and 0.0 < depth < np.inf, "depth", "a length > 0 [m]", depth)
    require(is_number(tilt) and 0.0 <= tilt < 0.5 * np.pi, "tilt", "in [0, pi / 2), in radians", tilt)
    require_index("n", n)
    return float(depth), float(tilt), float(n)


def require_below(sea: Waves, floor: Waves) -> None:
    """Raise InputError where a floor has not the sea's tile, or is not below its lowest trough."""
    if floor.tile != sea.tile:
        raise InputError(f"floor must have the sea's tile of {sea.tile:g} m, got {floor.tile:g}")
    if floor.highest >= sea.lowest:
        raise InputError(f"floor must be below the sea's lowest trough, {sea.lowest:g} m, got {floor.highest:g}")


def _lattice(tile: float, harmonics: int) -> Floats:
    """Return the wave vectors of up to so many waves a tile, one of each pair of opposite ones (n, 2) [1/m]."""
    whole = np.arange(-harmonics, harmonics + 1)
    x, y = (one.ravel() for one in np.meshgrid(whole, whole))
    half = ((y > 0) | ((y == 0) & (x > 0))) & (x**2 + y**2 <= harmonics**2)
    return np.column_stack([x, y])[half] * 2.0 * np.pi / tile


def _drawn(root: Floats, vectors: Floats, rms_slope: float, tile: float, seed: int) -> Waves:
    """Return complex normal deviates times these roots of variances, and of those `SEA_WAVES` of the largest slope."""
    require(is_number(rms_slope) and 0.0 <= rms_slope < np.inf, "rms_slope", "a number >= 0", rms_slope)
    rng = np.random.default_rng(seed)
    real, imaginary = rng.standard_normal((2, root.size)) * root
    amplitudes, phases = np.hypot(real, imaginary), np.arctan2(imaginary, real)
    order = np.argsort(-amplitudes * np.linalg.norm(vectors, axis=1))[:SEA_WAVES]
    found = Waves(tile, amplitudes[order], vectors[order], phases[order])
    return found.scaled(rms_slope / found.rms_slope)


def _length(name: str, value: float) -> float:
    least, most = LENGTHS
    require(is_number(value) and least <= value <= most, name, f"a length in {least:g} ... {most:g} m", value)
    return float(value)


def first_hit(
    height: Height,
    origin: ArrayLike,
    direction: ArrayLike,
    lowest: float,
    highest: float,
    steps: int = 16,
    slope: Slope | None = None,
    newton: int = NEWTON,
    precision: type[np.floating] = np.float64,
) -> Floats | float:
    """Return the distance along a ray to its first hit on z = height(x, y) from above [m]; nan where there is none.

    origin, direction  (..., 3), z up; of unit length [m, -]
    lowest, highest    between which the height stays [m]
    steps              equal ones between the two planes; of them the first with a change of sign holds the hit
    slope              by which Newton's iteration goes; without it, by short secants along the ray
    newton             iterations; one that would leave the bracket halves it instead
    precision          of the arithmetic; np.float32 is that of a shader

    Of two crossings within one step the first is found if the rates at its ends show the dip between. A level ray
    counts as one that never hits. InputError, too, for an origin below the floor.
    """
    rays = _Rays(height, *(one.astype(precision) for one in _checked_rays(origin, direction)))
    low, high = _bounds(lowest, highest)
    number = checked_whole("steps", steps, 1, MOST_STEPS)
    last = checked_whole("newton", newton, 0, MOST_STEPS)
    z = rays.origin[..., 2]
    below = -rays.gap(np.zeros_like(z))
    if np.any(below > rays.slack * (1.0 + np.abs(z))):
        raise InputError(f"origin must not be below the floor, got one that is {np.nanmax(below):g} m below it")

    def rate(k: Floats) -> Floats:
        if slope is not None:
            return rays.rate(slope, k)
        return (rays.gap(k + short) - rays.gap(k)) / short

    short = SHORT * ((high - low) or 1.0)
    found = _safeguarded(rays, rate, *_bracket(rays, low, high, number, rate), last)
    return float(found) if found.ndim == 0 else found


def dense_hit(
    height: Height, origin: ArrayLike, direction: ArrayLike, lowest: float, highest: float, steps: int = DENSE
) -> Floats:
    """Return the reference of `first_hit`: thousands of steps, and bisection to the last digit."""
    rays = _Rays(height, *_checked_rays(origin, direction))
    near, far = _bracket(rays, *_bounds(lowest, highest), checked_whole("steps", steps, 1))
    for _ in range(BISECTIONS):
        middle = 0.5 * (near + far)
        above = rays.gap(middle) >= 0
        near, far = np.where(above, middle, near), np.where(above, far, middle)
    return np.asarray(0.5 * (near + far))


def to_plane(origin: ArrayLike, direction: ArrayLike, level: float) -> Floats:
    """Return the distance along a ray to the plane z = level [m]; nan where the ray is level or goes away from it."""
    where, along = _checked_rays(origin, direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = (level - where[..., 2]) / along[..., 2]
    return np.where((found >= 0) & np.isfinite(found), found, np.nan)


def newton_hit(
    height: Height, slope: Slope | None, origin: ArrayLike, direction: ArrayLike, start: ArrayLike, count: int = NEWTON
) -> Floats:
    """Return plain Newton iterations from a distance [m]: k - f / f', f' = r_z - grad H . r_xy; diverges if S >= 1.

    Without a slope it is the iteration of Shah et al., as if the floor were level, which may diverge, too.
    """
    rays = _Rays(height, *_checked_rays(origin, direction))
    k = np.asarray(start, float) + np.zeros(rays.origin.shape[:-1])
    for _ in range(checked_whole("count", count, 0)):
        k = k - rays.gap(k) / (rays.direction[..., 2] if slope is None else rays.rate(slope, k))
    return k


def wrong_shares(ways: Sequence[int | str], steepnesses: Sequence[float], rays: int = 3000) -> Floats:
    """Return shares of rays whose hit is off by more than 1 % of the depth, of each way at each S: (ways, steepnesses).

    ways         a number of steps before the safeguarded iterations, or one of `PLAIN`
    steepnesses  S by the steepest place of the floor and the ray that a calm sea refracts [-]
    """
    for way in ways:
        is_known = not isinstance(way, str) or way in PLAIN
        require(is_known, "ways", f"numbers of steps or of {', '.join(PLAIN)}", way)
    tile = 2.0 * DEPTH
    sea, floor = random_sea(SEA_SLOPE, tile, 0), random_floor(1.0, tile, DEPTH, 1)
    place = np.random.default_rng(0).uniform(0.0, tile, (rays, 2))
    x, y, _ = refracted(TILT, sea.slope(*place.T), INDEX)
    direction = np.column_stack([x, y, -np.ones(rays)]) / np.sqrt(1.0 + x * x + y * y)[:, None]
    calm, _ = calm_ray(TILT, INDEX)
    found = np.zeros((len(ways), len(steepnesses)))
    for column, steep in enumerate(steepnesses):
        under = floor.scaled(steep / (floor.steepest * calm))
        # Floors as steep as that can be higher than the sea: rays start above both, on the lines that they had.
        lift = max(0.0, under.highest - sea.lowest + SLACK)
        start = np.column_stack([place, sea.height(*place.T)]) + lift * direction / direction[:, 2:]
        between = under.lowest, under.highest
        true = dense_hit(under.height, start, direction, *between)
        for row, way in enumerate(ways):
            if isinstance(way, str):
                first = 1.0 if way == "newton_1m" else to_plane(start, direction, under.mean)
                hit = newton_hit(under.height, None if way == "shah" else under.slope, start, direction, first)
            else:
                hit = np.asarray(first_hit(under.height, start, direction, *between, way, under.slope))
            found[row, column] = np.mean(~(np.abs(hit - true) <= OFF * DEPTH))
    return found


class _Rays(NamedTuple):
    """Rays above a surface: origins [m] and unit directions, arrays of one shape (..., 3)."""

    height: Height
    origin: Floats
    direction: Floats

    @property
    def slack(self) -> float:
        """Relative tolerance of lengths in their precision [-]."""
        return max(SLACK, 4.0 * float(np.finfo(self.origin.dtype).eps))

    def gap(self, k: Floats) -> Floats:
        """Return the height of a ray above the surface after a distance [m]."""
        x, y, z = (self.origin[..., axis] + k * self.direction[..., axis] for axis in range(3))
        return np.asarray(z - np.asarray(self.height(x, y), k.dtype))

    def rate(self, slope: Slope, k: Floats) -> Floats:
        """Return the change of `gap` with the distance [-]."""
        zx, zy = slope(*(self.origin[..., axis] + k * self.direction[..., axis] for axis in range(2)))
        zx, zy = np.asarray(zx, k.dtype), np.asarray(zy, k.dtype)
        return np.asarray(self.direction[..., 2] - zx * self.direction[..., 0] - zy * self.direction[..., 1])


def _bracket(
    rays: _Rays, lowest: float, highest: float, steps: int, rate: Callable[[Floats], Floats] | None = None
) -> tuple[Floats, Floats]:
    """Return distances between which a ray first comes through the surface; nan where it does not.

    rate  of the gap, by its distance: where a step begins falling and ends rising, the lowest place between, that of a
          cubic with both rates, is looked at, too. Without it such a dip is missed
    """
    z, down, slack = rays.origin[..., 2], rays.direction[..., 2], rays.slack
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (np.array([lowest, highest], z.dtype).reshape(2, *[1] * z.ndim) - z) / down
    slanting = down != 0.0
    near = np.where(slanting, np.maximum(ends.min(axis=0), 0.0), np.nan)
    far = np.where(slanting, ends.max(axis=0), np.nan)
    far = np.where(far >= 0.0, far + slack * (far + highest - lowest), np.nan)
    width = (far - near) / steps
    before = rays.gap(near)
    if np.any(before < -slack * (1.0 + np.abs(z) + abs(highest))):
        raise InputError(f"highest must be no lower than the floor is, got {highest:g} m")
    before = np.maximum(before, 0.0)
    ends_at = None if rate is None else rate(near)
    first, last = (np.full(z.shape, np.nan) for _ in range(2))
    for number in range(1, steps + 1):
        here = near + number * width
        gap = rays.gap(here)
        end, ahead = here, gap
        if rate is not None and ends_at is not None:
            begins_at, ends_at = ends_at, rate(here)
            # A cubic of these values and slopes at both ends, which falls and then rises, is least there.
            left, right, rise = begins_at * width, ends_at * width, gap - before
            linear, cubic = 3.0 * rise - 2.0 * left - right, left + right - 2.0 * rise
            with np.errstate(divide="ignore", invalid="ignore"):
                share = -left / (linear + np.sqrt(np.maximum(linear * linear - 3.0 * cubic * left, 0.0)))
            dip = here - width + width * np.clip(share, 0.0, 1.0)
            dip = np.where((gap >= 0.0) & (begins_at < 0.0) & (ends_at > 0.0), dip, np.nan)
            under = rays.gap(dip) < 0.0
            end, ahead = np.where(under, dip, here), np.where(under, -1.0, gap)
        # At the lower plane every ray that descends has come through, whatever rounding makes of the gap.
        through = (ahead < 0.0) | ((down < 0.0) & (ahead >= 0.0) & (number == steps))
        crossed = (before >= 0.0) & through & np.isnan(first)
        first, last = np.where(crossed, here - width, first), np.where(crossed, end, last)
        before = gap
        if not np.any(np.isnan(first) & ~np.isnan(near)):
            break
    return first, last


def _safeguarded(rays: _Rays, rate: Callable[[Floats], Floats], near: Floats, far: Floats, iterations: int) -> Floats:
    """Return Newton's iteration from the chord of a bracket: a step that would leave it is a bisection instead."""
    above, below = rays.gap(near), rays.gap(far)
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(above > np.minimum(below, 0.0), above / (above - np.minimum(below, 0.0)), 0.0)
        k = near + np.clip(share, 0.0, 1.0) * (far - near)
        for _ in range(iterations):
            gap = rays.gap(k)
            near, far = np.where(gap >= 0.0, k, near), np.where(gap >= 0.0, far, k)
            step = np.where(gap == 0.0, k, k - gap / rate(k))
            k = np.where((step >= near) & (step <= far), step, 0.5 * (near + far))
    return np.asarray(k)


def _checked_rays(origin: ArrayLike, direction: ArrayLike) -> tuple[Floats, Floats]:
    """Return origins and directions as float64 arrays of one shape (..., 3)."""
    found = []
    for name, value in (("origin", origin), ("direction", direction)):
        array = checked_numbers(name, value, "finite numbers (..., 3)")
        if not array.ndim or array.shape[-1] != 3:
            raise InputError(f"{name} must have shape (..., 3), got {array.shape}")
        found.append(checked_finite(name, array))
    length = np.linalg.norm(found[1], axis=-1)
    deviation = np.abs(length - 1.0)
    if np.any(deviation > UNIT):
        worst = length.flat[int(np.argmax(deviation))]
        raise InputError(f"direction must be of unit length, got |direction| = {worst:g}")
    try:
        where, along = np.broadcast_arrays(*found)
    except ValueError:
        raise InputError(
            f"origin and direction must broadcast to one shape, got {found[0].shape} and {found[1].shape}"
        ) from None
    return where, along


def _bounds(lowest: float, highest: float) -> tuple[float, float]:
    for name, value in (("lowest", lowest), ("highest", highest)):
        require(is_number(value) and np.isfinite(value), name, "a finite level [m]", value)
    low, high = float(lowest), float(highest)
    if low > high:
        raise InputError(f"lowest must not be above highest, got {low:g} and {high:g} m")
    return low, high
