"""What formats do to any law: numbers that do not fit, and too few bits."""

from __future__ import annotations

import numpy as np

from profilefit.studies.stability.cause import Cause
from profilefit.studies.stability.cells import Cells, Mask, Verdict, red
from profilefit.studies.stability.layout import REFLECTANCE_OF, STORED16, TEXT16, accepted


def _no_square(cells: Cells) -> Mask:
    """l^2, 1/l or R_d l^-2 is not a normal number, and with l = 1 the same cell is not red."""
    length = next((i for i, axis in enumerate(cells.axes) if axis.name == "l"), None)
    if length is None:
        return np.zeros(cells.shape, bool)
    unit = cells.codes.take([cells.axes[length].nearest(1.0)], axis=length)
    return ~accepted(cells.spread("l", 1.0), cells.dtype) & ~red(unit)


def _right_in_single(cells: Cells) -> Mask:
    """The same text at the same arguments is not red in single precision."""
    if cells.arithmetic != TEXT16 or cells.twin is None:
        return np.zeros(cells.shape, bool)
    return ~red(cells.twin)


def _alpha_in_half(cells: Cells) -> Mask:
    """sqrt(1 - alpha) changes by more than it may when alpha is kept in half."""
    if cells.arithmetic != STORED16 or cells.quantity != REFLECTANCE_OF:
        return np.zeros(cells.shape, bool)
    alpha = cells.spread("α", 0.5)
    kept = alpha.astype(np.float16).astype(float)
    return np.abs(np.sqrt(1.0 - np.minimum(kept, 1.0)) - np.sqrt(1.0 - alpha)) > 0.2 * cells.bound


def _misused(cells: Cells) -> Mask:
    """A shader cannot refuse an argument that the law in Python refuses by name."""
    return np.zeros(cells.shape, bool) if cells.refused is None else cells.refused


def _no_derivative(cells: Cells) -> Mask:
    """At an end: alpha = 1, r = 0 or infinite, xi = 0."""
    if not cells.quantity.startswith("∂"):
        return np.zeros(cells.shape, bool)
    x = cells.spread("r/l", 1.0)
    return (
        (cells.spread("α", 0.5) == 1.0)
        | (cells.spread("A", 0.5) == 1.0)
        | (x == 0)
        | np.isinf(x)
        | (cells.spread("ξ", 0.5) == 0)
    )


NUMBERS = frozenset({Verdict.NOT_FINITE, Verdict.NEGATIVE})
ERRORS = frozenset({Verdict.INACCURATE, Verdict.NOT_MONOTONE})
FORMAT = (
    Cause(
        "texts do not check",
        "a shader refuses nothing: an infinite alpha or l = 0 is Inf - Inf or 0/0",
        "check once a material: alpha in [0, 1], l > 0, r >= 0, as the law in Python does",
        _misused,
        frozenset({Verdict.NOT_FINITE}),
    ),
    Cause(
        "no derivative at an end",
        "A goes with sqrt(1 - alpha), whose slope is infinite at alpha = 1, and Inf times 0 is NaN; so at r or xi = 0",
        "differentiate inside, alpha < 1, or by sqrt(1 - alpha)",
        _no_derivative,
        frozenset({Verdict.NOT_FINITE}),
    ),
    Cause(
        "l^2 leaves the format",
        "R_d = f(r/l) / l^2: the square of l, or 1/l, is no normal number of the format",
        "another unit of length, l from 1e-12 to 1e12 in float32, 1e-100 to 1e100 in float64",
        _no_square,
    ),
    Cause(
        "alpha near 1 in half",
        "half has no number between 1 - 2^-11 and 1, and everything near white goes with sqrt(1 - alpha)",
        "keep A or sqrt(1 - alpha) in half",
        _alpha_in_half,
    ),
    Cause(
        "constants outside half",
        "1e-25, 1e8 and 1 - 2^-24, which keep the text finite, are 0, Inf and 1 in half; x^2, 1/x and 1/l^2 overflow",
        "compute in float32; keep only A, radii and results in half",
        _right_in_single,
        NUMBERS,
    ),
    Cause(
        "eleven bits",
        "differences such as 1 - e^-t and 1 - xi keep few of half's eleven bits: in float32 the same text is right",
        "compute in float32; keep only A, radii and results in half",
        _right_in_single,
        ERRORS,
    ),
)
