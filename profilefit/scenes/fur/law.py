"""Random cones in closed form: what they cover seen aslant, what is hidden at a height, and what shells make of them.

A strand is a cone of radius r0 and length L, which tapers to its tip and may lean; feet are independent, n of them a
unit of area. Seen at an angle theta from the normal its shadow on the skin is the hull of its root's disc and of its
tip, L |tan(theta) v - lean| away. Shells are N copies of the surface, on each of which a strand is a disc of radius
r0 (1 - t^p) at the height t L, t = i / N, i = 0 ... N - 1 (Fang et al., Modern Electronics Technique 45(20), 2022: p =
1, and p = 2 in their section 4). Lengths are in one unit, whichever.
"""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gammaln

from mcml_sim.media.arrays import Floats, checked_numbers, checked_whole, is_number, require, require_one_shape, shown
from profilefit.shader import emit
from profilefit.shader.law_file import TRANSLATED, function_lines, json_file, require_language, text_file

MOST_LAYERS = 4096
NODES = 48  # of quadratures over directions
LEAST_X, MOST_X = 0.64, 6.4  # N r0 / L for which an exponent is fitted


class Exponent(NamedTuple):
    """Exponent that is best for N layers: p = 1 + size x^power, x = N r0 / L.

    By the least mean square of ln(shadow of the shells / shadow of the cone), weighed by sin cos of the angle, 0 to 80
    degrees; L / r0 of 10, 20 and 50, which differ by their errors (`benchmarks.fur_exponent`).
    """

    size: float
    power: float


FITTED = Exponent(size=1.162, power=-1.803)
FITTED_ERRORS = Exponent(size=0.057, power=0.020)


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
        require(np.all((value >= 0) & np.isfinite(value)), name, "a finite number >= 0", numbers[name])
    area = shadow(radius, length, theta, lean)
    require(np.all(height <= tall), "z", f"at most the length, {shown(length)}", z)
    return np.exp(-count * (1.0 - height / tall) ** 2 * area)[()]


def shell_shadow(
    layers: int, exponent: float, radius: float, length: float, theta: float, lean: tuple[float, float] = (0.0, 0.0)
) -> float:
    """Return the shadow of a strand's discs on N shells, over that of the cone [-]: the area of their union, exactly.

    Discs whose middles are on a line cover, at x along it, half the width sqrt(max_i r_i^2 - (x - x_i)^2): but for x^2
    the largest of straight lines, whose envelope is a convex hull.
    """
    count = checked_whole("layers", layers, 1, MOST_LAYERS)
    require(is_number(exponent) and 0 < exponent < np.inf, "exponent", "a finite number > 0", exponent)
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
    fitted = np.all((number >= LEAST_X) & (number <= MOST_X))
    require(fitted, "x = N r0 / L", f"in [{LEAST_X:g}, {MOST_X:g}]", x)
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
    require(np.all((p >= 0) & np.isfinite(p)), "exponent", "a finite number >= 0", exponent)
    return (0.5 * np.sqrt(np.pi) * np.exp(gammaln(0.5 * p + 1.0) - gammaln(0.5 * p + 1.5)))[()]


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
        require(np.all(good), name, accepted, value)
        found.append(numbers)
    require_one_shape(**values)
    return found


# Shader source of these closed forms, and of where a ray comes into a cone.
FUR = "fur"  # what names begin with
OWN = "strand_"  # in the GLSL beside
TITLE = "random cones of fur: what they hide, their discs on shells, and where a ray comes into one"
NAMES = (
    ("shadow(radius, aside)", "area A that one hides of the skin [length^2]"),
    ("shared(radius, first, second, turn)", "area that one hides from an eye and from a lamp at once [length^2]"),
    ("visibility(density, shadow, z)", "chance that a ray meets none above z [-]"),
    ("slice(t, exponent)", "radius of its disc on a shell at t, over that of the root [-]"),
    ("swept(qx, qy, mx, my, r, k)", "how far along a ray it comes into one [length], 1e8 if it does not"),
)
NOTE = (
    "any length unit, the same for all; radius > 0 is that of the root",
    "aside >= 0 is how far from the root the tip is seen [length]: length tan(theta) of an upright cone, of one that",
    "leans |length (tan(theta) v - lean)|, v the direction of the view along the skin",
    "first and second are such asides, of an eye and of a lamp, turn the angle between them, 0 to pi [rad]: what the",
    "eye sees is lit by the visibility of a lamp's shadow less what both share",
    "density of strands [1/length^2]; z and t heights over the length, 0 at the skin, 1 at the tip; exponent > 0",
    "q is where the ray is across a cone's axis, r the cone's radius at that height [length], m and k what they change",
    "a length of ray [-]",
    "roots before the ray's begin or beyond the cone's ends are found too: leave them out",
)
EQUATIONS = (
    "A = r0^2 (pi + u - atan u), u = sqrt(max(d^2 - r0^2, 0)) / r0, d aside",
    "shared = r0^2 (pi + v - atan v), v = min(u1, u2, max(0, 1 / tan((b1 + b2 + turn) / 2))), tan b = 1 / u",
    "visibility = exp(-density A (1 - z)^2), slice = 1 - t^exponent",
    "swept = the first s of |q + m s| = r + k s where that is >= 0",
)


def strand_text(lang: str = "glsl", name: str = FUR) -> str:
    """Return the five functions of floats of `NAMES`, ready to include; any length unit, the same for all.

    lang, name  as for `emit.law_text`;  `swept` is finite, 1e8 where there is no root
    InputError on another language, and on a name that no language takes.
    """
    own = emit.text_beside(__name__, "glsl/strand.glsl").replace(OWN, emit.PLACEHOLDER)
    return emit.filled([emit.read_text("common"), own], name, {}, 0, lang, {})


def source(subject: str, lang: str = "glsl", name: str | None = None) -> str:
    """Return the whole file of cones in one of `law_file.LANGUAGES`, under a head of its functions and units.

    subject  "fur";  lang, name  and errors as of `strand_text`; InputError on a name for JSON, which has no functions.
    """
    require_language(lang, name)
    if lang == "json":
        content: dict[str, Any] = {"law": FUR, "title": TITLE, "functions": dict(NAMES)}
        return json_file({**content, "equations": "; ".join(EQUATIONS), "note": " ".join(NOTE)})
    start = name or FUR
    head = [TITLE, *function_lines(start, NAMES), "", *EQUATIONS, "", *NOTE]
    return text_file(head, lang, strand_text(TRANSLATED.get(lang, lang), start))
