"""What fails in the laws of stacks and in light scattered once, by the numbers of their own formulas."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike, NDArray

from profilefit.laws.stack import StackLaw
from profilefit.studies.stability.cause import Cause
from profilefit.studies.stability.cells import Cells, Mask, Verdict
from profilefit.studies.stability.layout import PDF, PROFILE, SAMPLE, TEXT32

Floats = NDArray[np.float64]
TOTAL, ENERGY, ONCE = "A(d)", "energy", "L, once"
ROUNDINGS = 16.0  # units in the last place that the largest term of a sum may be off by
ALMOST_GONE = 0.01  # mean free paths of a first layer that few radii come from
BACKWARD = -0.5  # g short of which the text of light scattered once loses digits in float32
DARK, ABSORBING = 0.1, 0.3  # albedos short of which `stack_law` is known to be off


def cancelled(law: StackLaw, thickness: ArrayLike, radius: ArrayLike, value: Floats, bound: float, dtype: type) -> Mask:
    """Where R_d is so much less than its terms that their rounding is more than the bound.

    thickness, radius  [mfp of the first layer]
    """
    unit = law.top.mfp
    largest = _largest(law, unit * np.asarray(thickness)[:, None], unit * np.asarray(radius))
    with np.errstate(divide="ignore"):
        depth = np.abs(np.log(largest * unit**2))  # e^-t has as many roundings as t
    rounded = (ROUNDINGS + np.where(np.isfinite(depth), depth, 0.0)) * float(np.finfo(dtype).eps) * largest
    found: Mask = np.abs(value) * bound < rounded
    return found


def _largest(law: StackLaw, d: ArrayLike, r: Floats) -> Floats:
    """The largest term of R_d at thicknesses and radii [length]: R_1, the image, or one of a stack below."""
    unit = law.top.mfp
    height, rate = law.h0 * unit + law.h1 * np.asarray(d), float(law.decay()) + law.k0 / unit
    s = np.hypot(r, height)
    image = float(law.top.whole()) * height * (1.0 + rate * s) * np.exp(-rate * (s - height)) / (2.0 * np.pi * s**3)
    found = np.maximum(np.asarray(law.top.profile(r)), image)
    if isinstance(law.below, StackLaw):
        inner = _largest(law.below, law.below.thickness, np.hypot(r, law.g2 * np.asarray(d)))
        found = np.maximum(found, np.exp(-law.b2 * np.asarray(d) / unit) * inner)
    return found


def _black_below(law: StackLaw) -> bool:
    return law.below.layers[0].alpha <= DARK


def _absorbing(law: StackLaw) -> bool:
    return law.top.alpha < ABSORBING


def _fit_of(condition: Callable[[StackLaw], bool]) -> Callable[[Cells], Mask]:
    """Of stated errors, those of such laws; of such a law itself, what is negative, falls, or is not kept for that."""

    def holds(cells: Cells) -> Mask:
        if isinstance(cells.law, tuple):
            return np.array([condition(one) for one in cells.law])
        if not (isinstance(cells.law, StackLaw) and condition(cells.law)):
            return np.zeros(cells.shape, bool)
        return (cells.codes != Verdict.INACCURATE) | (cells.quantity == ENERGY)

    return holds


def _difference(cells: Cells) -> Mask:
    """R_d is next to nothing beside its terms, A beside A_1, or a radius is of a first layer that is almost gone."""
    law = cells.law
    if not isinstance(law, StackLaw):
        return np.zeros(cells.shape, bool)
    x = cells.axes[0].values
    if cells.quantity == PROFILE:
        value = np.maximum(np.abs(cells.value), np.abs(cells.reference))
        return cancelled(law, x, cells.axes[1].values, value, cells.bound, cells.dtype)
    whole = np.asarray(law.total(law.top.mfp * x))
    dark = whole * cells.bound < ROUNDINGS * float(np.finfo(cells.dtype).eps) * float(law.top.whole())
    return _at_each(cells, dark | ((x < ALMOST_GONE) & (cells.quantity in (SAMPLE, PDF))))


def _borrowed(cells: Cells) -> Mask:
    """R_d of the formula itself is below 0 at some radius under that thickness."""
    law = cells.law
    if not isinstance(law, StackLaw) or cells.own:
        return np.zeros(cells.shape, bool)
    unit, radius = law.top.mfp, np.geomspace(1e-6, 1e3, 100)
    profile = np.asarray(law.profile(unit * radius, unit * cells.axes[0].values[:, None]))
    return _at_each(cells, np.any(profile < 0, axis=1))


def _at_each(cells: Cells, found: NDArray[np.bool_]) -> Mask:
    """What is known of each thickness, at every cell."""
    return np.broadcast_to(found.reshape(-1, *[1] * (len(cells.axes) - 1)), cells.shape)


def is_backward(cells: Cells) -> Mask:
    """Where the text of light scattered once is not held to its bound."""
    return (cells.spread("g", 0.0) < BACKWARD) & (cells.quantity == ONCE and cells.arithmetic == TEXT32)


OFF = frozenset({Verdict.INACCURATE})
OF_FITS = frozenset({Verdict.INACCURATE, Verdict.NEGATIVE, Verdict.NOT_MONOTONE})
STACKS = (
    Cause(
        "borrowed constants",
        "the constants belong to the albedos they were fitted at: under others c_1 R_1(s_1) may be more than the rest",
        "fit them to these layers: `stack_law`, or `profilefit regenerate STACK.toml`",
        _borrowed,
        OF_FITS,
    ),
    Cause(
        "less than its terms",
        "R_1(r) - c_1 R_1(s_1) of a thin first layer, or A_1 - (A_1 - A_2) e, over what is far darker: all is rounding",
        "none for pictures: beyond 99.5 % of the light, or A < 0.001; else what lies below alone, or float64",
        _difference,
        OF_FITS,
    ),
    Cause(
        "black below",
        "nothing comes back from below: R_1(r) - c_1 R_1(s_1) and the image are all, no form of a thin layer's light",
        "`exact.solve`, or `single_scattering` where the first layer is thin",
        _fit_of(_black_below),
        OF_FITS,
    ),
    Cause(
        "absorbing first layer",
        "its light dies at a rate of each direction, not at 2 kappa: R_2 seen through it is no R_2(s_2) times e^(-b d)",
        "`exact.solve`; where the first layer has alpha = 0.3 A is right to 1 %",
        _fit_of(_absorbing),
        OF_FITS,
    ),
    Cause(
        "backward peak",
        "the denominator of p, (1 - g)^2 + 2 g (1 - cos), cancels where g nears -1 and light turns back",
        "g >= -0.5, beyond which nothing known scatters",
        is_backward,
        OFF,
    ),
)
