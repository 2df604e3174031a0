"""Exact light of a stack as one of its quantities varies: curves for the integral over a surface.

At a point that gathers, R_d is that of an endless stack with the thickness there ("a stack at each point"): what a step
in thickness does besides is in no closed form here.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import ArrayLike
from scipy.interpolate import CubicSpline, RectBivariateSpline

from mcml_sim import Medium, exact
from mcml_sim.media.arrays import Floats
from profilefit.errors import InputError
from profilefit.materials import CHANNELS
from profilefit.recipes.stack.file import LayerMap, Media, ThicknessMap
from profilefit.recipes.stack.fit import NODES
from profilefit.scenes.stage.exact_law import Curves, held, hermite, knots

# By place: ln(R_d l^2 / A) + kappa x, ln(cdf / x), A and kappa.
Channel = tuple[RectBivariateSpline, RectBivariateSpline, CubicSpline, CubicSpline]
Places = Callable[[Floats], Floats]
THICKNESSES, WIDEST = 9, 0.5  # of the table, even in ln d: so many at least, and so far apart at most
LEAST = 1e-3  # mean free paths that stand for no first layer
# Mean free paths: exact light of a thinner layer has no digits within a few times its thickness. R_d / A of this one
# stands for it.
THINNEST = 0.03
FAINT = 1e-7  # of the largest x^2 R_d, from which on R_d is continued by its own asymptote, x^-2 e^(-kappa x)
LEFT = 1e-6  # share of the light from which on it is, too


@dataclass(frozen=True)
class StackTable:
    """A `CurveTable` whose values are shares of the way from the least thickness, or absorption, to the most.

    u  places of the rows;  places  of values;  the others by channel
    """

    u: Floats
    places: Places
    profile: tuple[RectBivariateSpline, ...]
    cdf: tuple[RectBivariateSpline, ...]
    reflectance: tuple[CubicSpline, ...]
    kappa: tuple[CubicSpline, ...]

    def curves(self, values: ArrayLike, /) -> Curves:
        """Return the curves, as `CurveTable.curves`."""
        given = np.asarray(values, float)
        u = self.places(given)
        size = (given.size, knots().size - 1, 4)
        reflectance, kappa = np.empty(given.size), np.empty(given.size)
        profile, cdf = np.empty(size), np.empty(size)
        for channel in range(len(CHANNELS)):
            own = slice(channel, None, len(CHANNELS))
            reflectance[own] = self.reflectance[channel](u[own])
            kappa[own] = self.kappa[channel](u[own])
            profile[own] = hermite(self.profile[channel], u[own])
            cdf[own] = hermite(self.cdf[channel], u[own])
        return Curves(np.zeros(given.size), reflectance, kappa, profile, cdf)


def table_of(media: Media, of: LayerMap, illumination: str = "diffuse") -> StackTable:
    """Return the table of a stack with a map; x = r / l, l the mean free path of the first layer in `media`.

    media  of red, green, blue, of one index and g = 0, with the map's mean
    Nine exact solutions of each channel that is unlike the others. InputError as of `exact.solve`.
    """
    if isinstance(of, ThicknessMap) and of.layer == 0:
        return stack_table(media, of.least, of.most, illumination)
    u = np.linspace(0.0, 1.0, THICKNESSES)  # the root of a share: where little absorbs, A falls by the root of mu_a
    least = LEAST * min(medium.layers[0].mfp for medium in media)
    rows = [tuple(_not_empty(one, of.layer, least) for one in of.media(media, share)) for share in (u**2).tolist()]
    return _table(media, list(zip(*rows, strict=True)), u, np.sqrt, illumination)


def _not_empty(medium: Medium, number: int, least: float) -> Medium:
    own = medium.layers[number]
    layers = list(medium.layers)
    layers[number] = replace(own, thickness=max(own.thickness, least))
    return replace(medium, layers=tuple(layers))


def stack_table(media: Media, least: float, most: float, illumination: str = "diffuse") -> StackTable:
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
    u = np.linspace(np.log(low), np.log(most), count)
    rows = [[medium.with_first(d) for d in np.exp(u).tolist()] for medium in media]

    def places(values: Floats) -> Floats:
        return np.log(np.maximum(least + (most - least) * values, low))

    return _table(media, rows, u, places, illumination)


def _table(media: Media, rows: Sequence[Sequence[Medium]], u: Floats, places: Places, illumination: str) -> StackTable:
    """Return a table of rows of media by channel; equal channels are solved once."""
    every = [(medium.layers[0].mfp, tuple(row)) for medium, row in zip(media, rows, strict=True)]
    solved = {one: _channel(*one, u, illumination) for one in dict.fromkeys(every)}
    return StackTable(u, places, *zip(*(solved[one] for one in every), strict=True))


def _channel(unit: float, row: Sequence[Medium], u: Floats, illumination: str) -> Channel:
    """Return what a channel's curves are made of, in a unit of length."""
    y = knots()
    # Far off light decays as in the layer in which it is slowest; rate in 1 / l.
    rate = [min(float(exact.decay_rate(one.alpha)) / one.mfp for one in medium.layers) * unit for medium in row]
    seen = [medium.with_first(max(medium.layers[0].thickness, THINNEST * unit)) for medium in row]
    light = {medium: exact.solve(medium, illumination, NODES) for medium in dict.fromkeys([*row, *seen])}
    shapes = [_shape(light[medium], y, unit, own) for medium, own in zip(seen, rate, strict=True)]
    known, within = (np.array(column) for column in zip(*shapes, strict=True))
    whole = np.array([light[medium].reflectance for medium in row])
    splines = RectBivariateSpline(u, y, known), RectBivariateSpline(u, y, within)
    return *splines, CubicSpline(u, whole), CubicSpline(u, rate)


def _shape(light: exact.Solution, y: Floats, unit: float, rate: float) -> tuple[Floats, Floats]:
    """Return ln(R_d l^2 / A) + kappa x, and ln(cdf / x)."""
    x = np.exp(y)
    share = np.clip(np.asarray(light.cdf(unit * x)), 0.0, 1.0)
    value = np.asarray(light.profile(unit * x)) * unit**2 / light.reflectance
    strength = x**2 * value
    bright = (strength > FAINT * strength.max()) & (1.0 - share > LEFT)
    bright[: int(np.argmax(strength)) + 1] = True
    kept = held(bright[None, :])[0]
    known = np.log(value[kept]) + rate * x[kept] - 2.0 * (y - y[kept])
    return known, np.log(share / x)
