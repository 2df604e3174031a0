"""Random cones in closed form: what they cover seen aslant, what is hidden at a height, and what shells make of them.

A strand is a cone of radius r0 and length L, which tapers to its tip and may lean; feet are independent, n of them a
unit of area. Seen at an angle theta from the normal its shadow on the skin is the hull of its root's disc and of its
tip, L |tan(theta) v - lean| away. Shells are N copies of the surface, on each of which a strand is a disc of radius
r0 (1 - t^p) at the height t L, t = i / N, i = 0 ... N - 1 (Fang et al., Modern Electronics Technique 45(20), 2022: p =
1, and p = 2 in their section 4). Lengths are in one unit, whichever.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.special import gammaln

from mcml_sim.media.checks import checked_numbers, checked_whole, is_number, require_one_shape, shown
from profilefit.errors import InputError
from profilefit.fitting.solver import differences, solve

Floats = NDArray[np.float64]
MOST_LAYERS = 4096
SLENDER = (10.0, 20.0, 50.0)  # L / r0
PER_DECADE = 8  # x = N r0 / L, even in its logarithm
ANGLES = np.radians(np.arange(2.0, 80.0, 4.0))  # middles of equal parts of 0 to 80 degrees
FIRST, LARGEST = 2.0, 8.0
STEP, TOLERANCE = 1e-5, 1e-6  # of an exponent, for derivatives; of its search
NODES = 48  # of quadratures over directions
LEAST_X, MOST_X = 0.64, 6.4  # N r0 / L for which an exponent is fitted


class Exponent(NamedTuple):
    """Exponent that is best for N layers: p = 1 + size x^power, x = N r0 / L.

    By the least mean square of ln(shadow of the shells / shadow of the cone), weighed by sin cos of the angle, 0 to 80
    degrees; L / r0 of 10, 20 and 50 (`fitted`), which differ by their errors.
    """

    size: float
    power: float


FITTED = Exponent(size=1.162, power=-1.803)
FITTED_ERRORS = Exponent(size=0.057, power=0.020)


class Feet(NamedTuple):
    """Feet that are not independent: what is seen is exp(-kappa n (1 - z / L)^2 A), kappa = (1 + size q^power)^sign.

    q = r0 sqrt(n) (1 - z / L), the strands' radius at their height over their distance. Fitted to rays, 30 to 75
    degrees, r0 sqrt(n) 0.2 to 0.6 (`python -m benchmarks.fur --only feet-laws`); seen head on kappa is nearer 1.
    """

    size: float
    power: float
    sign: int
    size_error: float
    power_error: float


# Feet that are at least sqrt(0.5 / n) apart; and tufts of 8 over discs of half the tufts' mean distance.
FEET = {"apart": Feet(2.06, 1.49, 1, 0.12, 0.04), "tufts": Feet(2.16, 1.23, -1, 0.20, 0.07)}


def shadow(radius: ArrayLike, length: ArrayLike, theta: ArrayLike, lean: tuple[float, float] = (0.0, 0.0)) -> Any:
    """Return the area A that a cone hides of the skin [length^2].

    radius, length  > 0;  theta  of the view to the normal in [0, pi / 2) [rad], toward +x; these broadcast
    lean            of the tip along x and y, by the length [-]

    r0^2 (pi + u - atan u), u = sqrt(d^2 - r0^2) / r0, 0 where the tip is within the root's disc; no digits are lost
    where d is near r0, and none at grazing angles.
    """
    root, tall, angle = _checked(radius=radius, length=length, theta=theta)
    aside = tall * np.hypot(np.tan(angle) - lean[0], lean[1])
    u = np.sqrt(np.maximum((aside - root) * (aside + root), 0.0)) / root
    return (root**2 * (np.pi + u - np.arctan(u)))[()]


def visibility(
    density: ArrayLike,
    radius: ArrayLike,
    length: ArrayLike,
    theta: ArrayLike,
    z: ArrayLike,
    lean: tuple[float, float] = (0.0, 0.0),
) -> Any:
    """Return the chance that a ray meets no strand above a height [-]: exp(-n (1 - z / L)^2 A(theta)).

    density  strands a unit of area >= 0 [1/length^2];  z  in [0, length];  others as of `shadow`; all broadcast

    What is above a height is a fur of similar cones. Toward the eye it is what is seen of a place, toward the lamp its
    self-shadow, and at z = 0 the skin that is seen; opacity is 1 less it.
    """
    numbers = {"density": density, "radius": radius, "length": length, "theta": theta, "z": z}
    require_one_shape(**numbers)
    count, tall, height = (checked_numbers(name, numbers[name], "a number >= 0") for name in ("density", "length", "z"))
    for name, value in (("density", count), ("z", height)):
        if not np.all((value >= 0) & np.isfinite(value)):
            raise InputError(f"{name} must be a finite number >= 0, got {shown(numbers[name])}")
    area = shadow(radius, length, theta, lean)
    if not np.all(height <= tall):
        raise InputError(f"z must be at most the length, {shown(length)}, got {shown(z)}")
    return np.exp(-count * (1.0 - height / tall) ** 2 * area)[()]


def feet_factor(feet: str, thick: ArrayLike) -> Any:
    """Return kappa [-] of `Feet`, by which the density in `visibility` is multiplied.

    feet  "apart" or "tufts";  thick  r0 sqrt(n) (1 - z / L) in [0, 1]
    """
    if feet not in FEET:
        raise InputError(f"feet must be one of {', '.join(FEET)}, got {shown(feet)}")
    q = checked_numbers("thick", thick, "a number in [0, 1]")
    if not np.all((q >= 0) & (q <= 1)):
        raise InputError(f"thick must be a number in [0, 1], got {shown(thick)}")
    of = FEET[feet]
    return ((1.0 + of.size * q**of.power) ** of.sign)[()]


def shared_shadow(radius: float, length: float, eye: float, lamp: float, turn: float = 0.0) -> float:
    """Return the area that an upright cone hides of the skin from an eye and from a lamp at once [length^2].

    eye, lamp  angles to the normal in [0, pi / 2);  turn  between them about the normal in [0, pi] [rad]

    r0^2 (pi + tan a - a), a = max(0, min(a1, a2, (a1 + a2 - turn) / 2)), cos a_i = r0 / d_i: both are a disc and a
    spike, which shrinks as secants of the angle about the disc's middle. Turned by 0 the shorter is within the longer.
    What an eye sees is lit by exp(-n (1 - z / L)^2 (A(lamp) - shared)), more than `visibility` says: the hot spot.
    """
    if not (is_number(turn) and 0 <= turn <= np.pi):
        raise InputError(f"turn must be an angle in [0, pi] radians, got {shown(turn)}")
    ends = []
    for at in (eye, lamp):
        root, tall, angle = (float(one) for one in _checked(radius=radius, length=length, theta=at))
        ends.append(float(np.arccos(min(root / max(tall * np.tan(angle), root), 1.0))))
    a = max(min(*ends, 0.5 * (sum(ends) - turn)), 0.0)
    return float(radius**2 * (np.pi + np.tan(a) - a))


def shell_shadow(
    layers: int, exponent: float, radius: float, length: float, theta: float, lean: tuple[float, float] = (0.0, 0.0)
) -> float:
    """Return the shadow of a strand's discs on N shells, over that of the cone [-]: the area of their union, exactly.

    Discs whose middles are on a line cover, at x along it, half the width sqrt(max_i r_i^2 - (x - x_i)^2): but for x^2
    the largest of straight lines, whose envelope is a convex hull.
    """
    count = checked_whole("layers", layers, 1, MOST_LAYERS)
    if not (is_number(exponent) and 0 < exponent < np.inf):
        raise InputError(f"exponent must be a finite number > 0, got {shown(exponent)}")
    whole = float(shadow(radius, length, theta, lean))
    t = np.arange(count) / count
    aside = float(length * np.hypot(np.tan(theta) - lean[0], lean[1]))
    return _union(aside * t, radius * (1.0 - t**exponent)) / whole


def best_exponent(x: ArrayLike) -> Any:
    """Return the exponent p that is best for N layers [-], x = N r0 / L in [0.64, 6.4]; InputError beyond.

    No exponent fills the gaps of fewer layers; of more it is 1. It is the best for coverage; a shaded picture has its
    own.
    """
    number = checked_numbers("x", x, f"a number in [{LEAST_X:g}, {MOST_X:g}]")
    if not np.all((number >= LEAST_X) & (number <= MOST_X)):
        raise InputError(f"x = N r0 / L must be in [{LEAST_X:g}, {MOST_X:g}], got {shown(x)}")
    return (1.0 + FITTED.size * number**FITTED.power)[()]


def occlusion(density: float, radius: float, length: float, z: float, lean: float = 0.0) -> float:
    """Return the share of even light from above that comes to a height [-]: the mean of `visibility` by the cosine.

    Arguments as of `visibility`, numbers; a square of the cosine that is even, times an even angle about the normal.
    """
    node, weight = np.polynomial.legendre.leggauss(NODES)
    square, angle = 0.5 * (node + 1.0)[:, None], 0.5 * np.pi * (node + 1.0)
    tangent = np.sqrt(1.0 / square - 1.0)
    aside = np.hypot(tangent * np.cos(angle) - lean, tangent * np.sin(angle))
    seen = visibility(density, radius, length, np.arctan(aside), z)  # a lean is but another angle
    return float(weight @ seen @ weight / 4.0)


def lobe_mean(exponent: ArrayLike) -> Any:
    """Return the mean of sin^p over all directions [-], by which a Kajiya-Kay lobe is as bright for every p >= 0."""
    p = checked_numbers("exponent", exponent, "a number >= 0")
    if not np.all((p >= 0) & np.isfinite(p)):
        raise InputError(f"exponent must be a finite number >= 0, got {shown(exponent)}")
    return (0.5 * np.sqrt(np.pi) * np.exp(gammaln(0.5 * p + 1.0) - gammaln(0.5 * p + 1.5)))[()]


def misfit(layers: int, exponent: float, slender: float) -> float:
    """Return the mean square of ln(shadow of shells / shadow of the cone), weighed by sin cos, over 0 to 80 degrees."""
    return float(np.sum(_residual(layers, exponent, slender) ** 2))


def best_of(layers: int, slender: float) -> float:
    """Return the exponent of the least misfit."""
    at = differences(lambda p: _residual(layers, float(p[0]), slender), STEP, LARGEST)
    return float(solve(at, np.array([FIRST]), (1.0, LARGEST), tolerance=TOLERANCE).parameters[0])


def _residual(layers: int, exponent: float, slender: float) -> Floats:
    """Return ln(shadow of the shells / shadow of the cone) at each angle, times the root of its share of the weight."""
    logs = np.log([shell_shadow(layers, exponent, 1.0 / slender, 1.0, float(angle)) for angle in ANGLES])
    weight = np.sin(ANGLES) * np.cos(ANGLES)
    return logs * np.sqrt(weight / weight.sum())


def fitted(slender: Sequence[float] = SLENDER) -> tuple[Exponent, Exponent]:
    """Fit p = 1 + size x^power by least squares of ln(p - 1), and return the constants and their errors.

    The errors are the standard deviations of constants fitted to one slenderness each: what the law leaves out.
    """
    each, rows = [], []
    for one in slender:
        count = int(PER_DECADE * np.log10(MOST_X / LEAST_X)) + 1
        numbers = np.unique(np.ceil(one * np.geomspace(LEAST_X, MOST_X, count) - 1e-9).astype(int))
        numbers = numbers[numbers <= MOST_X * one]
        own = [(np.log(n / one), np.log(best_of(int(n), one) - 1.0)) for n in numbers]
        rows += own
        each.append(_line(own))
    size, power = _line(rows)
    spread = np.std(each, axis=0, ddof=1)
    return Exponent(float(np.exp(size)), power), Exponent(float(np.exp(size) * spread[0]), float(spread[1]))


def _union(middle: Floats, radius: Floats) -> float:
    """Return the area of discs whose middles (n,), rising, are on a line."""
    seen = radius > 0
    x, r = middle[seen], radius[seen]
    if x.size == 0 or x[-1] == x[0]:
        return float(np.pi * np.max(r, initial=0.0) ** 2)
    # Lines r_i^2 - x_i^2 + 2 x x_i: those of the upper envelope, and where each begins.
    slope, height = 2.0 * x, (r - x) * (r + x)
    kept: list[int] = []
    begins: list[float] = []
    for one in range(x.size):
        begin = -np.inf
        while kept:
            last = kept[-1]
            begin = (height[last] - height[one]) / (slope[one] - slope[last])
            if begin > begins[-1]:
                break
            kept.pop()
            begins.pop()
            begin = -np.inf
        kept.append(one)
        begins.append(begin)
    own = np.array(kept)
    ends = np.append(begins[1:], np.inf)
    low, high = (np.clip((edge - x[own]) / r[own], -1.0, 1.0) for edge in (np.array(begins), ends))
    return float(np.sum(r[own] ** 2 * (_sector(high) - _sector(low))))


def _sector(u: Floats) -> Floats:
    """Return the area of a unit disc left of u, less a constant."""
    return u * np.sqrt((1.0 - u) * (1.0 + u)) + np.arcsin(u)


def _checked(**values: ArrayLike) -> list[Floats]:
    found = []
    for name, value in values.items():
        accepted = "an angle in [0, pi / 2) radians" if name == "theta" else "a finite number > 0"
        numbers = checked_numbers(name, value, accepted)
        good = (numbers >= 0) & (numbers < 0.5 * np.pi) if name == "theta" else (numbers > 0) & np.isfinite(numbers)
        if not np.all(good):
            raise InputError(f"{name} must be {accepted}, got {shown(value)}")
        found.append(numbers)
    require_one_shape(**values)
    return found


def _line(rows: Sequence[tuple[float, float]]) -> tuple[float, float]:
    x, y = np.array(rows).T
    power, size = np.polyfit(x, y, 1)
    return float(size), float(power)
