"""Exact half space as tables: textures behind the functions of a law, for shaders; curves, for sums over surfaces.

Curves are for millions of pairs of points. ln(R_d l^2 / A) + kappa x and ln(cdf / x), x = r/l, are smooth in
s = sqrt(1 - alpha) and ln x: the decay rate kappa takes what falls off exponentially, the rest bends over one unit of
ln x. Cubic splines of both through exact values; one albedo's curve is then a cubic between the knots of ln x.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from functools import cache, lru_cache
from typing import Any, Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline, RectBivariateSpline

from mcml_sim import Setting, exact
from mcml_sim.media.arrays import Floats, namespace, require
from profilefit.errors import SettingError
from profilefit.scenes.stage.world import Singles
from profilefit.shader.emit import literal, text_beside

DIFFUSE = Setting("diffuse")  # the light that irradiance is
NAME = "exact"
# Of textures.
MOST_DEPTH = 24 * np.log(2.0)  # t = -ln(1 - xi) at the largest xi of a law's text, 1 - 2^-24
DRAWN, KNOWN = 2048, 4096  # columns
NEAR = 0.05  # x = NEAR sinh u [mfp]: u is even in x near the source and in ln x far away
FIRST_X, LAST_X = 1e-6, 1000.0  # x [mfp] of the first and the last column
LEAST_DENSITY = 1e-37  # [1/mfp]: its logarithm stays a number
MOST_ALBEDOS = 16
# Of curves.
NEAREST, FARTHEST = 1e-5, 1e4  # x [mfp] of the table's ends
STEP = 1.0 / 12  # of ln x
# 257 of s, closer together at both ends: white light falls off as a power up to x ~ 1/s, and where little is scattered
# each order adds to the tail.
ALBEDOS = 257
LEAST_ALPHA = 1e-9  # stands for 0, where R_d / A has a limit
# R_d is continued by its own asymptote, x^-2 e^(-kappa x), from this kappa x on, below e^-60; where a surface refracts
# also below this R_d l^2 / alpha: exact light has no digits there.
FAINT, LEAST_REFRACTED = 60.0, 5e-16


@dataclass(frozen=True)
class ExactLaw:
    """Exact profiles of some albedos: density, cdf and the radius that a share of the energy leaves within.

    alpha  those that shaders may use; for another one the nearest is taken
    """

    alpha: tuple[float, ...]
    setting: Setting = DIFFUSE

    def __post_init__(self) -> None:
        are_albedos = 1 <= len(self.alpha) <= MOST_ALBEDOS and all(0 < a <= 1 for a in self.alpha)
        require(are_albedos, "alpha", f"1 ... {MOST_ALBEDOS} albedos in (0, 1]", self.alpha)
        require_isotropic(self.setting)

    def text(self, name: str) -> str:
        """Return the law's text with the prefix `name`; it needs the textures of `textures(name)`."""
        reflectance = np.atleast_1d(exact.reflectance(self.alpha, self.setting))
        rows = {"ROWS": str(len(self.alpha)), "ALPHAS": ", ".join(literal(a) for a in self.alpha)}
        return table_text(name, reflectance) + _filled("exact_law", name, rows)

    def textures(self, name: str) -> dict[str, Singles]:
        """Return float textures (rows, columns, channels) by the names of their samplers."""
        drawn, known = _tables(self.alpha, self.setting)
        return {f"{name}_drawn": drawn, f"{name}_known": known}


def require_isotropic(setting: Setting) -> None:
    """Raise SettingError where a setting has g: the tables take the decay rate of isotropic scattering."""
    if setting.g != 0.0:
        raise SettingError(f"a scene's exact light scatters isotropically: setting must have g = 0, got {setting}")


def table_text(name: str, reflectance: Iterable[float]) -> str:
    """Return GLSL of a table, whose shapes are rows, of A [-] each."""
    reflectances = [literal(float(a)) for a in reflectance]
    values = {
        "ROWS": str(len(reflectances)),
        "REFLECTANCES": ", ".join(reflectances),
        "MOST_DEPTH": literal(MOST_DEPTH),
        "LARGEST_U": literal(float(np.arcsinh(LAST_X / NEAR))),
        "NEAR": literal(NEAR),
    }
    return _filled("exact_table", name, values)


def _filled(file: str, name: str, values: Mapping[str, str]) -> str:
    text = text_beside(__name__, f"glsl/{file}.glsl").replace("LAW_", f"{name}_")
    for key, value in values.items():
        text = text.replace(f"@{key}@", value)
    return text


def columns() -> tuple[Floats, Floats]:
    """Return t (DRAWN,) of the radii that are drawn, and x (KNOWN,) [mfp] of density and cdf: a table's columns."""
    t = np.linspace(0.0, MOST_DEPTH, DRAWN)
    t[0] = 1e-4 * t[1]
    return t, np.maximum(NEAR * np.sinh(np.linspace(0.0, np.arcsinh(LAST_X / NEAR), KNOWN)), FIRST_X)


def row(radius: Floats, ring: Floats, share: Floats) -> tuple[Singles, Singles]:
    """Return a row of x at each t, and a row of density and cdf at each x.

    They are ln(x/t) (DRAWN, 1), and the logarithm of the density 2 pi x R_d / A beside -ln(1 - cdf) (KNOWN, 2).
    """
    left = np.maximum(1.0 - share, np.exp(-MOST_DEPTH - 10.0))
    known = np.stack([np.log(np.maximum(ring, LEAST_DENSITY)), -np.log(left)], axis=-1)
    return np.log(np.minimum(radius, LAST_X) / columns()[0])[:, None].astype(np.float32), known.astype(np.float32)


@cache
def _tables(alpha: tuple[float, ...], setting: Setting) -> tuple[Singles, Singles]:
    """Return a row for each albedo; the same arrays each time, which are sent once."""
    t, x = columns()
    rows = []
    for one in alpha:
        ring = 2.0 * np.pi * x * exact.profile(x, one, setting=setting) / exact.reflectance(one, setting)
        radius = np.asarray(exact.quantile(-np.expm1(-t), one, setting=setting))
        rows.append(row(radius, ring, np.asarray(exact.cdf(x, one, setting=setting))))
    drawn, known = zip(*rows, strict=True)
    return np.stack(drawn), np.stack(known)


@dataclass(frozen=True)
class Curves:
    """Exact half space at m albedos, or another `CurveTable` at m values.

    alpha, reflectance, kappa (m,)  albedo, A [-], decay rate [1/mfp]
    profile, cdf (m, intervals, 4)  ln(R_d l^2 / A) + kappa x and ln(cdf / x) between knots of ln x, which start at
                                    ln NEAREST, STEP apart: rising powers of the way t from one to the next, 0 to 1
    """

    alpha: Floats
    reflectance: Floats
    kappa: Floats
    profile: Floats
    cdf: Floats

    def density(self, x: Floats) -> Floats:
        """Return R_d l^2 / A of each albedo at its x = r/l > 0, (m, n); taken at the table's ends beyond them [-]."""
        near = np.clip(x, NEAREST, FARTHEST)
        return np.exp(cubic(self.profile, near) - self.kappa[:, None] * near)

    def share(self, x: Floats) -> Floats:
        """Return the cdf of each albedo at its x = r/l >= 0, (m, n) [-]."""
        near = np.clip(x, NEAREST, FARTHEST)
        return np.minimum(np.exp(cubic(self.cdf, near)) * np.minimum(x, FARTHEST), 1.0)


class CurveTable(Protocol):
    """Source of curves for light that scatters in a surface: an `ExactTable`, or a scene's own."""

    def curves(self, values: ArrayLike, /) -> Curves:
        """Return curves at values (3 m,) in [0, 1] [-], pixel by pixel, red, green, blue in turn.

        A value is A, or what the table has in its place. Each curve is normalised by its own A, `Curves.reflectance`:
        its cdf tends to 1.
        """


@dataclass(frozen=True)
class ExactTable:
    """Splines of one setting: (s, ln x) -> ln(R_d l^2 / A) + kappa x, and ln(cdf / x); A -> s, s -> kappa."""

    profile: RectBivariateSpline
    cdf: RectBivariateSpline
    root: CubicSpline

    def curves(self, reflectance: ArrayLike) -> Curves:
        """Return curves at reflectances A (m,) in [0, 1]; InputError."""
        values = np.atleast_1d(np.asarray(reflectance, float))
        are_shares = values.ndim == 1 and np.all((values >= 0) & (values <= 1))
        require(are_shares, "reflectance", "a list of numbers in [0, 1]", reflectance)
        s = np.clip(self.root(values), 0.0, 1.0)
        alpha = 1.0 - s * s
        kappa = np.asarray(exact.decay_rate(alpha))
        return Curves(alpha, values, kappa, hermite(self.profile, s), hermite(self.cdf, s))


def hermite(spline: RectBivariateSpline, at: Floats) -> Floats:
    """Return a spline of (s, ln x) at s (m,), as cubics between `knots` (m, intervals, 4), as in `Curves`."""
    order, y = np.argsort(at), knots()
    value, slope = np.empty((at.size, y.size)), np.empty((at.size, y.size))
    value[order] = spline(at[order], y)
    slope[order] = STEP * spline(at[order], y, dy=1)
    left, right, rise, next_rise = value[:, :-1], value[:, 1:], slope[:, :-1], slope[:, 1:]
    span = right - left
    return np.stack([left, rise, 3.0 * span - 2.0 * rise - next_rise, rise + next_rise - 2.0 * span], axis=-1)


def knots() -> Floats:
    """Return ln x of a table's columns."""
    return np.log(NEAREST) + STEP * np.arange(int(np.ceil(np.log(FARTHEST / NEAREST) / STEP)) + 1)


@lru_cache(maxsize=4)
def exact_table(setting: Setting) -> ExactTable:
    """Return the table of a light and a surface, built once: seconds; SettingError where it has g.

    Relative error below 1e-5 of R_d for x in [1e-5, 3000] where x^2 R_d l^2 / A > 1e-10, and of the cdf everywhere;
    where the surface refracts, below 1e-3 of R_d where x^2 R_d l^2 / A > 1e-8, and 1e-7 of the whole in the cdf.
    """
    require_isotropic(setting)
    y = knots()
    s = 1.0 - (1.0 - np.linspace(0.0, 1.0, ALBEDOS) ** 3) ** 2
    alpha = np.maximum(1.0 - s * s, LEAST_ALPHA)
    x, albedos = np.exp(y), alpha[:, None]
    reflectance = np.asarray(exact.reflectance(alpha, setting))
    within = np.asarray(exact.cdf(x, albedos, setting=setting))
    root = CubicSpline(np.append(0.0, reflectance[-2::-1]), s[::-1])
    rows = log_profile(y, alpha, setting) - np.log(reflectance)[:, None]
    return ExactTable(RectBivariateSpline(s, y, rows), RectBivariateSpline(s, y, np.log(within / x)), root)


def log_profile(y: Floats, alpha: Floats, setting: Setting) -> Floats:
    """Return ln(R_d l^2) + kappa x (albedos, radii) at y = ln x, continued as x^-2 where R_d is faint [-]."""
    path = np.asarray(exact.decay_rate(alpha))[:, None] * np.exp(y)
    kept = held(path <= FAINT)
    profile = np.asarray(exact.profile(np.exp(y[kept]), alpha[:, None], setting=setting))
    if setting.n != 1.0:
        kept = held((path <= FAINT) & (profile > LEAST_REFRACTED * alpha[:, None]))
        profile = np.take_along_axis(profile, kept, axis=1)
    return np.log(profile) + np.take_along_axis(path, kept, axis=1) - 2.0 * (y - y[kept])


def held(bright: NDArray[np.bool_]) -> NDArray[np.int64]:
    """Return for each column itself, or the last before all that is faint."""
    last = np.where(bright.all(axis=1), bright.shape[1], np.argmin(bright, axis=1)) - 1
    return np.minimum(np.arange(bright.shape[1]), last[:, None])


def cubic(coefficients: Any, x: Any) -> Any:
    """Return the curves (m, intervals, 4) at x (m, n), arrays of numpy or of jax."""
    numpy = namespace(x)
    place = (numpy.log(x) - np.log(NEAREST)) / STEP
    k = numpy.minimum(place.astype(int), coefficients.shape[1] - 1)
    t = place - k
    c = numpy.take_along_axis(coefficients, k[..., None], axis=1)
    return c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3]))
