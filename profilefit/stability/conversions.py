"""Conversions: the factor of every length over all albedos, there and back, and alpha of a colour."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from profilefit.convert import LENGTHS, Optical, alpha_of, reflectance_of
from profilefit.errors import InputError
from profilefit.stability import axes
from profilefit.stability.cells import Cells, judged, steps_down
from profilefit.stability.classes import Verdict
from profilefit.stability.layout import ALPHA_OF, FLOAT64

Floats = NDArray[np.float64]
# There and back: a few roundings; a colour to what `alpha_of` promises of A.
RETURN_BOUND, COLOUR_BOUND = 1e-12, 1e-8


def cells_of() -> Iterator[Cells]:
    """Lengths in order of `convert.LENGTHS`, then colours under both lights."""
    for length in LENGTHS:
        yield _length(length.name)
    for light in ("searchlight", "diffuse"):
        yield _colour(light)


def _length(name: str) -> Cells:
    """l = 1 there and back: infinite lengths, where nothing is absorbed, are refused on the way back, by name."""
    axis = axes.alpha(np.float64)
    with np.errstate(all="ignore"):
        value = np.asarray(Optical(axis.values, np.array(1.0)).length(name))
        back = np.array([_returned(name, one, a) for one, a in zip(value, axis.values, strict=True)])
    infinite = np.isinf(value) & (axis.values == 1.0)
    error = np.where(infinite, 0.0, np.abs(back - 1.0))
    reference = np.where(infinite, np.inf, value)
    inside = np.ones(value.shape, bool)
    codes = judged(value, reference, error, RETURN_BOUND, inside, np.float64)
    codes[(value == 0) | np.isnan(back)] = Verdict.NOT_FINITE
    return Cells("convert", False, name, FLOAT64, (axis,), value, reference, error, RETURN_BOUND, inside, codes)


def _returned(name: str, value: float, alpha: float) -> float:
    try:
        return float(Optical.from_length(name, value, alpha).mfp)
    except InputError:
        return 1.0 if np.isinf(value) else np.nan


def _albedo(reflectance: float, light: str) -> float:
    """alpha [-], or NaN where something is raised: every A in [0, 1] has one."""
    try:
        return float(alpha_of(reflectance, light))
    except Exception:  # whatever comes is what is looked for
        return np.nan


def _colour(light: str) -> Cells:
    axis = axes.reflectance(np.float64)
    value = np.array([_albedo(one, light) for one in axis.values])
    raised = np.isnan(value)
    error = np.abs(reflectance_of(np.where(raised, 0.0, value), light) - axis.values)
    inside = np.ones(value.shape, bool)
    wrong_way = steps_down(value, 0, np.float64, 1.0)
    codes = judged(value, value, error, COLOUR_BOUND, inside, np.float64, wrong_way=wrong_way)
    codes[raised] = Verdict.RAISES
    return Cells(
        "convert", False, f"{ALPHA_OF}, {light}", FLOAT64, (axis,), value, value, error, COLOUR_BOUND, inside, codes
    )
