"""Exact light of a stack as the first layer's thickness varies: curves for the integral over a surface.

At a point that gathers, R_d is that of an endless stack with the thickness there ("a stack at each point"): what a step
in thickness does besides is in no closed form here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, RectBivariateSpline

from mcml_sim import Medium, exact
from mcml_sim.media.arrays import Floats
from profilefit.errors import InputError
from profilefit.materials import CHANNELS
from profilefit.recipes.stack.fit import NODES
from profilefit.scenes.stage.exact_law import Curves, held, hermite, knots

# By ln d: ln(R_d l^2 / A) + kappa x, ln(cdf / x) and A; and kappa.
Channel = tuple[RectBivariateSpline, RectBivariateSpline, CubicSpline, float]
THICKNESSES, WIDEST = 9, 0.5  # of the table, even in ln d: so many at least, and so far apart at most
LEAST = 1e-3  # mean free paths that stand for no first layer
# Mean free paths: exact light of a thinner layer has no digits within a few times its thickness. R_d / A of this one
# stands for it.
THINNEST = 0.03
FAINT = 1e-7  # of the largest x^2 R_d, from which on R_d is continued by its own asymptote, x^-2 e^(-kappa x)
LEFT = 1e-6  # share of the light from which on it is, too


@dataclass(frozen=True)
class StackTable:
    """A `CurveTable` whose values are shares of the way from the least thickness to the most.

    least, most  thickness [unit of the media];  u  ln d of the rows;  the others by channel
    """

    least: float
    most: float
    u: Floats
    profile: tuple[RectBivariateSpline, ...]
    cdf: tuple[RectBivariateSpline, ...]
    reflectance: tuple[CubicSpline, ...]
    kappa: tuple[float, ...]

    def curves(self, values: ArrayLike, /) -> Curves:
        """Return the curves, as `CurveTable.curves`."""
        given = np.asarray(values, float)
        u = np.log(np.maximum(self.least + (self.most - self.least) * given, np.exp(self.u[0])))
        size = (given.size, knots().size - 1, 4)
        reflectance, kappa = np.empty(given.size), np.empty(given.size)
        profile, cdf = np.empty(size), np.empty(size)
        for channel in range(len(CHANNELS)):
            own = slice(channel, None, len(CHANNELS))
            reflectance[own] = self.reflectance[channel](u[own])
            kappa[own] = self.kappa[channel]
            profile[own] = hermite(self.profile[channel], u[own])
            cdf[own] = hermite(self.cdf[channel], u[own])
        return Curves(np.zeros(given.size), reflectance, kappa, profile, cdf)


def stack_table(
    media: tuple[Medium, Medium, Medium], least: float, most: float, illumination: str = "diffuse"
) -> StackTable:
    """Return the table of a stack whose first layer is `least` to `most` thick; x = r / l, l its mean free path.

    media  of red, green, blue, of one index and g = 0;  thicknesses in their unit, 0 <= least < most
    Between thicknesses, to 99.5 % of the light: A is right to 1e-5 and R_d to 1e-3 (relative), the cdf to 2e-5, where
    the most is three times the least; where it is a hundred times, to 2e-3, 5e-2 and 1e-3, and R_d is worst at radii at
    which light comes just from the next interface under the critical angle (1e-2 where indices match). A first layer
    thinner than 0.03 l has its own A, and R_d / A of one of 0.03 l. InputError as of `exact.solve`. Of each channel
    that is unlike the others nine exact solutions or more, some seconds each.
    """
    if not 0 <= least < most < np.inf:
        raise InputError(f"least and most must be thicknesses, 0 <= least < most, got {least!r} and {most!r}")
    shortest = min(most, *(medium.layers[0].mfp for medium in media))
    low = max(least, LEAST * shortest)
    count = max(THICKNESSES, 1 + int(np.ceil(np.log(most / low) / WIDEST)))
    u, y = np.linspace(np.log(low), np.log(most), count), knots()
    solved = {one: _channel(one, u, y, illumination) for one in dict.fromkeys(media)}
    return StackTable(least, most, u, *zip(*(solved[medium] for medium in media), strict=True))


def _channel(medium: Medium, u: Floats, y: Floats, illumination: str) -> Channel:
    """Return what a channel's curves are made of: equal channels are solved once."""
    unit, own = medium.layers[0].mfp, np.exp(u).tolist()
    # Far off light decays as in the layer in which it is slowest; rate in 1 / l.
    rate = min(float(exact.decay_rate(layer.alpha)) / layer.mfp for layer in medium.layers) * unit
    seen = np.maximum(own, THINNEST * unit).tolist()
    light = {d: exact.solve(medium.with_first(d), illumination, NODES) for d in dict.fromkeys([*own, *seen])}
    shapes = {d: _shape(light[d], y, rate) for d in dict.fromkeys(seen)}
    known, within = (np.array(column) for column in zip(*(shapes[d] for d in seen), strict=True))
    whole = np.array([light[d].reflectance for d in own])
    return RectBivariateSpline(u, y, known), RectBivariateSpline(u, y, within), CubicSpline(u, whole), rate


def _shape(light: exact.Solution, y: Floats, rate: float) -> tuple[Floats, Floats]:
    """Return ln(R_d l^2 / A) + kappa x, and ln(cdf / x)."""
    unit, x = light.medium.layers[0].mfp, np.exp(y)
    share = np.clip(np.asarray(light.cdf(unit * x)), 0.0, 1.0)
    value = np.asarray(light.profile(unit * x)) * unit**2 / light.reflectance
    strength = x**2 * value
    bright = (strength > FAINT * strength.max()) & (1.0 - share > LEFT)
    bright[: int(np.argmax(strength)) + 1] = True
    kept = held(bright[None, :])[0]
    known = np.log(value[kept]) + rate * x[kept] - 2.0 * (y - y[kept])
    return known, np.log(share / x)
