"""First hit of a ray on an uneven floor, by steps and Newton's iteration; and the plain iterations.

Li, Wang, Li, Zhao, Wang and Liu (J. Image Graphics 16(8), 2011) find it by "about 3" Newton iterations from a distance
of 1; Shah, Konttinen and Pattanaik (IEEE TVCG 13(2), 2007) by an iteration without slopes. Either holds while
S = largest slope x tan(ray to the vertical) < 1: beyond, a ray may cross the floor more than once.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.checks import checked_numbers, checked_whole, is_number, shown
from profilefit.errors import InputError
from profilefit.scenes.sea.waves import random_floor, random_sea, refracted

Floats = NDArray[np.float64]
Height = Callable[..., ArrayLike]  # of x and y [m], to z [m]
Slope = Callable[..., tuple[ArrayLike, ArrayLike]]  # of x and y [m], to dz/dx and dz/dy [-]
NEWTON = 3  # iterations after the steps, as many as the paper has
MOST_STEPS = 1024
UNIT = 1e-6  # a direction's length may be so far from 1: float32 is nearer
SLACK = 1e-9  # of lengths: a bound that is met exactly is one in floating point, too
SHORT = 1e-6  # a secant that stands for a slope, in the range of heights
DENSE, BISECTIONS = 4096, 50  # of the reference
OFF = 0.01  # of the depth: a hit farther from the true one is wrong
PLAIN = ("newton", "newton_1m", "shah")  # from the mean plane, from 1 m (as published), and Shah's from the mean plane


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
    where, along = (one.astype(precision) for one in _rays(origin, direction))
    low, high = _bounds(lowest, highest)
    number = checked_whole("steps", steps, 1, MOST_STEPS)
    last = checked_whole("newton", newton, 0, MOST_STEPS)
    below = -_gap(height, where, along, np.zeros_like(where[..., 2]))
    if np.any(below > _slack(where) * (1.0 + np.abs(where[..., 2]))):
        raise InputError(f"origin must not be below the floor, got one that is {np.nanmax(below):g} m below it")

    def rate(k: Floats) -> Floats:
        if slope is not None:
            return _rate(slope, where, along, k)
        return (_gap(height, where, along, k + short) - _gap(height, where, along, k)) / short

    short = SHORT * ((high - low) or 1.0)
    near, far = _bracket(height, where, along, low, high, number, rate)
    found = _safeguarded(height, rate, where, along, near, far, last)
    return float(found) if found.ndim == 0 else found


def dense_hit(
    height: Height, origin: ArrayLike, direction: ArrayLike, lowest: float, highest: float, steps: int = DENSE
) -> Floats:
    """Return the reference of `first_hit`: thousands of steps, and bisection to the last digit."""
    where, along = _rays(origin, direction)
    near, far = _bracket(height, where, along, *_bounds(lowest, highest), checked_whole("steps", steps, 1))
    for _ in range(BISECTIONS):
        middle = 0.5 * (near + far)
        above = _gap(height, where, along, middle) >= 0
        near, far = np.where(above, middle, near), np.where(above, far, middle)
    return np.asarray(0.5 * (near + far))


def to_plane(origin: ArrayLike, direction: ArrayLike, level: float) -> Floats:
    """Return the distance along a ray to the plane z = level [m]; nan where the ray is level or goes away from it."""
    where, along = _rays(origin, direction)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = (level - where[..., 2]) / along[..., 2]
    return np.where((found >= 0) & np.isfinite(found), found, np.nan)


def newton_hit(
    height: Height, slope: Slope, origin: ArrayLike, direction: ArrayLike, start: ArrayLike, iterations: int = NEWTON
) -> Floats:
    """Return plain Newton iterations from a distance [m]: k - f / f', f' = r_z - grad H . r_xy; diverges if S >= 1."""
    where, along = _rays(origin, direction)
    k = np.asarray(start, float) + np.zeros(where.shape[:-1])
    for _ in range(checked_whole("iterations", iterations, 0)):
        k = k - _gap(height, where, along, k) / _rate(slope, where, along, k)
    return k


def shah_hit(
    height: Height, origin: ArrayLike, direction: ArrayLike, start: ArrayLike, iterations: int = NEWTON
) -> Floats:
    """Return Shah et al.'s iteration from a distance [m]: k - f / r_z, as if the floor were level; may diverge, too."""
    where, along = _rays(origin, direction)
    k = np.asarray(start, float) + np.zeros(where.shape[:-1])
    for _ in range(checked_whole("iterations", iterations, 0)):
        k = k - _gap(height, where, along, k) / along[..., 2]
    return k


def steepness(steepest: float, direction: ArrayLike) -> Floats:
    """Return S [-], the floor's largest slope times the ray's tangent to the vertical: a ray hits once if S < 1."""
    _, along = _rays(np.zeros(3), direction)
    with np.errstate(divide="ignore"):
        return steepest * np.hypot(along[..., 0], along[..., 1]) / np.abs(along[..., 2])


def wrong_shares(
    ways: Sequence[int | str],
    steepnesses: Sequence[float],
    rays: int = 3000,
    tilt: float = np.radians(63.0),
    depth: float = 5.0,
    sea_slope: float = 0.15,
    iterations: int = NEWTON,
    seed: int = 0,
) -> Floats:
    """Return shares of rays whose hit is off by more than 1 % of the depth, of each way at each S: (ways, steepnesses).

    ways         a number of steps before the safeguarded iterations, or one of `PLAIN`
    steepnesses  S by the steepest place of the floor and the ray that a calm sea refracts [-]
    tilt         of the sun [rad];  depth  mean [m];  sea_slope  rms [-], which turns the rays one by one
    """
    for way in ways:
        if isinstance(way, str) and way not in PLAIN:
            raise InputError(f"ways must be numbers of steps or of {', '.join(PLAIN)}, got {way!r}")
    tile = 2.0 * depth
    rng = np.random.default_rng(seed)
    sea = random_sea(sea_slope, tile, seed)
    floor = random_floor(1.0, tile, depth, seed + 1)
    place = rng.uniform(0.0, tile, (rays, 2))
    x, y, _ = refracted(tilt, sea.slope(*place.T), 1.34)
    direction = np.column_stack([x, y, -np.ones(rays)]) / np.sqrt(1.0 + x * x + y * y)[:, None]
    calm = float(refracted(tilt, (np.zeros(1), np.zeros(1)), 1.34)[0][0])
    found = np.zeros((len(ways), len(steepnesses)))
    for column, steep in enumerate(steepnesses):
        under = floor.scaled(steep / (floor.steepest * calm))
        # Floors as steep as that can be higher than the sea: rays start above both, on the lines that they had.
        lift = max(0.0, under.highest - sea.lowest + SLACK)
        start = np.column_stack([place, sea.height(*place.T)]) + lift * direction / direction[:, 2:]
        true = dense_hit(under.height, start, direction, under.lowest, under.highest)
        mean = to_plane(start, direction, under.mean)
        for row, way in enumerate(ways):
            hit: Floats | float
            if way == "shah":
                hit = shah_hit(under.height, start, direction, mean, iterations)
            elif isinstance(way, str):
                first = mean if way == "newton" else 1.0
                hit = newton_hit(under.height, under.slope, start, direction, first, iterations)
            else:
                hit = first_hit(
                    under.height, start, direction, under.lowest, under.highest, way, under.slope, iterations
                )
            found[row, column] = np.mean(~(np.abs(hit - true) <= OFF * depth))
    return found


def _bracket(
    height: Height,
    origin: Floats,
    direction: Floats,
    lowest: float,
    highest: float,
    steps: int,
    rate: Callable[[Floats], Floats] | None = None,
) -> tuple[Floats, Floats]:
    """Return distances between which a ray first comes through the surface; nan where it does not.

    rate  of the gap, by its distance: where a step begins falling and ends rising, the lowest place between, that of a
          cubic with both rates, is looked at, too. Without it such a dip is missed
    """
    z, down = origin[..., 2], direction[..., 2]
    with np.errstate(divide="ignore", invalid="ignore"):
        ends = (np.array([lowest, highest], z.dtype).reshape(2, *[1] * z.ndim) - z) / down
    slanting = down != 0.0
    near = np.where(slanting, np.maximum(ends.min(axis=0), 0.0), np.nan)
    far = np.where(slanting, ends.max(axis=0), np.nan)
    far = np.where(far >= 0.0, far + _slack(origin) * (far + highest - lowest), np.nan)
    width = (far - near) / steps
    before = _gap(height, origin, direction, near)
    if np.any(before < -_slack(origin) * (1.0 + np.abs(z) + abs(highest))):
        raise InputError(f"highest must be no lower than the floor is, got {highest:g} m")
    before = np.maximum(before, 0.0)
    ends_at = None if rate is None else rate(near)
    first, last = (np.full(z.shape, np.nan) for _ in range(2))
    for number in range(1, steps + 1):
        here = near + number * width
        gap = _gap(height, origin, direction, here)
        end, ahead = here, gap
        if rate is not None and ends_at is not None:
            begins_at, ends_at = ends_at, rate(here)
            dip = here - width + width * _least(before, gap, begins_at * width, ends_at * width)
            dip = np.where((gap >= 0.0) & (begins_at < 0.0) & (ends_at > 0.0), dip, np.nan)
            under = _gap(height, origin, direction, dip) < 0.0
            end, ahead = np.where(under, dip, here), np.where(under, -1.0, gap)
        # At the lower plane every ray that descends has come through, whatever rounding makes of the gap.
        through = (ahead < 0.0) | ((down < 0.0) & (ahead >= 0.0) & (number == steps))
        crossed = (before >= 0.0) & through & np.isnan(first)
        first, last = np.where(crossed, here - width, first), np.where(crossed, end, last)
        before = gap
        if not np.any(np.isnan(first) & ~np.isnan(near)):
            break
    return first, last


def _least(start: Floats, end: Floats, begins: Floats, ends: Floats) -> Floats:
    """Return where in [0, 1] a cubic of these values and slopes at 0 and 1 is least, if it falls and then rises."""
    linear, cubic = 3.0 * (end - start) - 2.0 * begins - ends, begins + ends - 2.0 * (end - start)
    with np.errstate(divide="ignore", invalid="ignore"):
        found = -begins / (linear + np.sqrt(np.maximum(linear * linear - 3.0 * cubic * begins, 0.0)))
    return np.asarray(np.clip(found, 0.0, 1.0))


def _safeguarded(
    height: Height,
    rate: Callable[[Floats], Floats],
    origin: Floats,
    direction: Floats,
    near: Floats,
    far: Floats,
    iterations: int,
) -> Floats:
    """Return Newton's iteration from the chord of a bracket: a step that would leave it is a bisection instead."""
    above, below = (_gap(height, origin, direction, end) for end in (near, far))
    with np.errstate(divide="ignore", invalid="ignore"):
        share = np.where(above > np.minimum(below, 0.0), above / (above - np.minimum(below, 0.0)), 0.0)
        k = near + np.clip(share, 0.0, 1.0) * (far - near)
        for _ in range(iterations):
            gap = _gap(height, origin, direction, k)
            near, far = np.where(gap >= 0.0, k, near), np.where(gap >= 0.0, far, k)
            step = np.where(gap == 0.0, k, k - gap / rate(k))
            k = np.where((step >= near) & (step <= far), step, 0.5 * (near + far))
    return np.asarray(k)


def _gap(height: Height, origin: Floats, direction: Floats, k: Floats) -> Floats:
    """Return the height of a ray above the surface after a distance [m]."""
    x, y, z = (origin[..., axis] + k * direction[..., axis] for axis in range(3))
    return np.asarray(z - np.asarray(height(x, y), k.dtype))


def _slack(lengths: Floats) -> float:
    """Return the relative tolerance of lengths in their precision [-]."""
    return max(SLACK, 4.0 * float(np.finfo(lengths.dtype).eps))


def _rate(slope: Slope, origin: Floats, direction: Floats, k: Floats) -> Floats:
    """Return the change of `_gap` with the distance [-]."""
    zx, zy = slope(*(origin[..., axis] + k * direction[..., axis] for axis in range(2)))
    zx, zy = np.asarray(zx, k.dtype), np.asarray(zy, k.dtype)
    return np.asarray(direction[..., 2] - zx * direction[..., 0] - zy * direction[..., 1])


def _rays(origin: ArrayLike, direction: ArrayLike) -> tuple[Floats, Floats]:
    """Return origins and directions as float64 arrays of one shape (..., 3)."""
    found = []
    for name, value in (("origin", origin), ("direction", direction)):
        array = checked_numbers(name, value, "finite numbers (..., 3)")
        if not array.ndim or array.shape[-1] != 3:
            raise InputError(f"{name} must have shape (..., 3), got {array.shape}")
        if not np.all(np.isfinite(array)):
            raise InputError(f"{name} must be finite, got {array[~np.isfinite(array)].flat[0]:g}")
        found.append(array)
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


def _bounds(lowest: object, highest: object) -> tuple[float, float]:
    for name, value in (("lowest", lowest), ("highest", highest)):
        if not is_number(value) or not np.isfinite(value):
            raise InputError(f"{name} must be a finite level [m], got {shown(value)}")
    low, high = float(lowest), float(highest)  # type: ignore[arg-type]
    if low > high:
        raise InputError(f"lowest must not be above highest, got {low:g} and {high:g} m")
    return low, high
