"""Exact half space as a table over albedo and radius, for sums over millions of pairs of points.

ln(R_d l^2 / A) + kappa x and ln(cdf / x), x = r/l, are smooth in s = sqrt(1 - alpha) and ln x: the decay rate kappa
takes what falls off exponentially, the rest bends over one unit of ln x. Cubic splines of both through exact values;
one albedo's curve is then a cubic between the knots of ln x.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Protocol

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline, RectBivariateSpline

from mcml_sim import Setting, exact
from profilefit.errors import InputError
from profilefit.scenes.stage.exact_law import require_isotropic

Floats = NDArray[np.float64]
NEAREST, FARTHEST = 1e-5, 1e4  # x [mfp] of the table's ends
STEP = 1.0 / 12  # of ln x
# 257 of s, closer together at both ends: white light falls off as a power up to x ~ 1/s, and where little is scattered
# each order adds to the tail.
ALBEDOS = 257
LEAST_ALPHA = 1e-9  # stands for 0, where R_d / A has a limit
FAINT = 60.0  # kappa x from which on R_d, below e^-60, is continued by its own asymptote, x^-2 e^(-kappa x)
LEAST_REFRACTED = (
    5e-16  # R_d l^2 / alpha up to which it is too where a surface refracts: exact light has no digits there
)


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
        return np.exp(_cubic(self.profile, near) - self.kappa[:, None] * near)

    def share(self, x: Floats) -> Floats:
        """Return the cdf of each albedo at its x = r/l >= 0, (m, n) [-]."""
        near = np.clip(x, NEAREST, FARTHEST)
        return np.minimum(np.exp(_cubic(self.cdf, near)) * np.minimum(x, FARTHEST), 1.0)


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

    y: Floats
    profile: RectBivariateSpline
    cdf: RectBivariateSpline
    root: CubicSpline

    def curves(self, reflectance: ArrayLike) -> Curves:
        """Return curves at reflectances A (m,) in [0, 1]; InputError."""
        values = np.atleast_1d(np.asarray(reflectance, float))
        if values.ndim != 1 or not np.all((values >= 0) & (values <= 1)):
            raise InputError(f"reflectance must be a list of numbers in [0, 1], got {reflectance!r}")
        s = np.clip(self.root(values), 0.0, 1.0)
        alpha = 1.0 - s * s
        kappa = np.asarray(exact.decay_rate(alpha))
        return Curves(alpha, values, kappa, hermite(self.profile, s, self.y), hermite(self.cdf, s, self.y))


def hermite(spline: RectBivariateSpline, at: Floats, y: Floats) -> Floats:
    """Return a spline of (s, ln x) at s (m,), as cubics between knots y of ln x (m, intervals, 4), as in `Curves`."""
    order = np.argsort(at)
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
    return ExactTable(y, RectBivariateSpline(s, y, rows), RectBivariateSpline(s, y, np.log(within / x)), root)


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


def _cubic(coefficients: Floats, x: Floats) -> Floats:
    """Return the curves (m, intervals, 4) at x (m, n)."""
    place = (np.log(x) - np.log(NEAREST)) / STEP
    k = np.minimum(place.astype(int), coefficients.shape[1] - 1)
    t = place - k
    c = np.take_along_axis(coefficients, k[..., None], axis=1)
    return c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3]))
