"""One quantity of one law in one arithmetic, over all arguments: each cell with its value, its reference and a class.

A law is computed in several arithmetics: its shader source, line by line in numpy, from half to extended precision.
"""

from __future__ import annotations

import enum
import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from profilefit.laws.base import AlbedoLaw, ProfileLaw
from profilefit.shader import emit
from profilefit.studies.stability.layout import (
    DTYPES,
    FLOAT32,
    FLOAT64,
    MODEL,
    STORED16,
    TEXT16,
    TEXT32,
    ArgumentAxis,
)

Floats = NDArray[np.float64]
Codes = NDArray[np.int8]
Mask = NDArray[np.bool_]


class Verdict(enum.IntEnum):
    """Class of a cell; of several that hold, the last one here counts.

    NOT_JUDGED  a number, not negative and in order, without a reference value here
    """

    RIGHT = 0
    OUTSIDE = 1
    BEYOND = 2
    NOT_JUDGED = 3
    INACCURATE = 4
    NOT_MONOTONE = 5
    NEGATIVE = 6
    NOT_FINITE = 7
    RAISES = 8

    @property
    def words(self) -> str:
        return WORDS[self]

    @property
    def is_red(self) -> bool:
        return self >= Verdict.INACCURATE


WORDS = {
    Verdict.RIGHT: "right",
    Verdict.OUTSIDE: "outside its range",
    Verdict.BEYOND: "beyond the format",
    Verdict.NOT_JUDGED: "not judged",
    Verdict.INACCURATE: "inaccurate",
    Verdict.NOT_MONOTONE: "not monotone",
    Verdict.NEGATIVE: "negative",
    Verdict.NOT_FINITE: "NaN or Inf",
    Verdict.RAISES: "raises",
}
# R_d l^2 and the like, below which the factors of a product leave the format before the product does. Half has no room.
DIMMEST: dict[type, float] = {np.float64: 1e-290, np.float32: 1e-30, np.float16: float(np.finfo(np.float16).tiny)}
# Steps the wrong way count beyond this many units in the last place.
ROUNDED_STEPS = 16.0
NEARLY = 10.0  # factor by which a number may miss one that is too small for its format
# What helps where cells are red, for example in another unit of length; `Cells.advice` says it of one law or function.
UNIT_OF_LENGTH = "choose a unit of length in which l is from {} to {}"
ADVICE = {
    FLOAT64: UNIT_OF_LENGTH.format("1e-100", "1e100"),
    **dict.fromkeys((FLOAT32, TEXT32), UNIT_OF_LENGTH.format("1e-12", "1e12")),
    STORED16: "store A or sqrt(1 - alpha) in half, not alpha, and lengths from 2^-5 to 2^5",
    TEXT16: "compute in float32; store only A, radii and results in half",
    MODEL: "use hazard or quantile, whose error is a few thousandths",
}


@dataclass(frozen=True, eq=False)
class Cells:
    """Classes of a tensor over `axes`.

    subject    label of the law, map or function; own whether it is one of this project's own, held to have no red cell
    quantity   what is computed; arithmetic in which numbers, by what text
    value, reference, error  same shape; `error` is compared with `bound`, NaN where nothing is known
    inside     where the law says that it holds;  codes  `Verdict` of each cell
    unjudged   why, where cells are not judged;  advice  what helps where they are red, by default `ADVICE`'s
    """

    subject: str
    own: bool
    quantity: str
    arithmetic: str
    axes: tuple[ArgumentAxis, ...]
    value: Floats
    reference: Floats
    error: Floats
    bound: float
    inside: Mask
    codes: Codes
    unjudged: str = ""
    advice: str = ""

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(axis.values.size for axis in self.axes)

    @property
    def verdicts(self) -> set[Verdict]:
        """Classes that occur."""
        return {Verdict(int(code)) for code in np.unique(self.codes)}

    @property
    def failures(self) -> Mask:
        """Red cells where the law says that it holds."""
        red: Mask = (self.codes >= Verdict.INACCURATE) & self.inside
        return red


def judged(
    value: Floats,
    reference: Floats,
    error: Floats,
    bound: float,
    inside: Mask,
    dtype: type,
    dim: Mask | bool = False,
    wrong_way: Mask | None = None,
) -> Codes:
    """Return the class of every cell: not judged without a reference, where the error is NaN or the bound infinite.

    Args:
        value: computed values, of any shape.
        reference: reference values, in the shape and unit of `value`.
        error: errors of the values, in their shape.
        bound: largest error that counts as right, in the unit of `error`.
        inside: where the law says that it holds.
        dtype: format of `value`.
        dim: where the reference is too small for the format to reach it, besides where it is itself too small.
        wrong_way: where a value went the wrong way from its neighbour.
    """
    limits, lost = np.finfo(dtype), np.broadcast_to(dim, value.shape)
    codes = np.full(value.shape, Verdict.RIGHT, np.int8)
    size = np.abs(reference)
    large, small = size > float(limits.max), ((size < float(limits.tiny)) & (size > 0)) | dim
    with np.errstate(invalid="ignore", over="ignore"):
        codes[inside & (np.isnan(error) | ~np.isfinite(bound))] = Verdict.NOT_JUDGED
        codes[~inside] = Verdict.OUTSIDE
        exceeds = error > bound
        codes[inside & exceeds & ~large & ~small] = Verdict.INACCURATE
        absurd = np.abs(value) > NEARLY * np.maximum(size, float(limits.tiny))
        faint = inside & small & ~large
        codes[faint] = Verdict.BEYOND
        codes[faint & absurd & exceeds & ~lost] = Verdict.INACCURATE
        codes[inside & large & np.isfinite(reference)] = Verdict.BEYOND
        if wrong_way is not None:
            codes[inside & wrong_way & ~small] = Verdict.NOT_MONOTONE
        codes[value < 0] = Verdict.NEGATIVE
        codes[np.isnan(value) | (np.isinf(value) & ~large & ~lost & ~np.isinf(reference) & inside)] = Verdict.NOT_FINITE
    return codes


def judged_cells(
    subject: str,
    own: bool,
    quantity: str,
    arithmetic: str,
    axes: tuple[ArgumentAxis, ...],
    value: Floats,
    reference: Floats,
    error: Floats,
    bound: float,
    inside: Mask | bool = True,
    *,
    judge: Mask | None = None,
    dim: Mask | bool = False,
    wrong_way: Mask | None = None,
    unjudged: str = "",
    advice: str = "",
) -> Cells:
    """Return cells with their classes, in the format of their arithmetic.

    Args:
        subject: label of the law, map or function.
        own: whether it is one of this project's own, held to have no red cell.
        quantity: what is computed.
        arithmetic: in which numbers, by what text.
        axes: arguments of the cells.
        value: computed values, broadcast to the axes.
        reference: reference values, broadcast to the axes.
        error: errors of the values, broadcast to the axes; NaN where nothing is known.
        bound: largest error that counts as right, in the unit of `error`.
        inside: where the law says that it holds; broadcast to the axes.
        judge: where errors count, by default everywhere; cells elsewhere are outside.
        dim: where the reference is too small for the format to reach it.
        wrong_way: where a value went the wrong way from its neighbour.
        unjudged: why cells are not judged, "" for no reason.
        advice: remedy where cells are red, by default the one of `ADVICE`.
    """
    shape = tuple(axis.values.size for axis in axes)
    value, reference, error, inside = (np.broadcast_to(one, shape) for one in (value, reference, error, inside))
    judge = np.ones(shape, bool) if judge is None else np.broadcast_to(judge, shape)
    codes = judged(value, reference, error, bound, judge, DTYPES[arithmetic], dim, wrong_way)
    return Cells(
        subject, own, quantity, arithmetic, axes, value, reference, error, bound, inside, codes, unjudged, advice
    )


def steps_down(value: Floats, axis: int, dtype: type, scale: Floats | float = 0.0) -> Mask:
    """Return where a value is less than its neighbour before it along an axis, by more than rounding.

    `scale` adds to the size that the rounding is of.
    """
    allowance = ROUNDED_STEPS * float(np.finfo(dtype).eps)
    lower, upper = _neighbours(value, axis)
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.abs(lower) + _neighbours(np.broadcast_to(scale, value.shape), axis)[0]
        falls = upper - lower < -allowance * size - float(np.finfo(dtype).tiny)
    falls &= np.isfinite(lower) & np.isfinite(upper)
    return np.pad(falls, [(1 if i == axis else 0, 0) for i in range(falls.ndim)])  # the first has none before it


def steps_up(value: Floats, axis: int, dtype: type, scale: Floats | float = 0.0) -> Mask:
    """Return where a value is more than its neighbour before it, likewise."""
    return steps_down(-value, axis, dtype, scale)


def relative(value: Floats, reference: Floats) -> Floats:
    """Return |value / reference - 1|; 0 where both are the same, infinite ones too."""
    with np.errstate(all="ignore"):
        error = np.abs(value - reference) / np.abs(reference)
    return np.where(value == reference, 0.0, np.where(reference == 0, np.where(value == 0, 0.0, np.inf), error))


def absolute(value: Floats, reference: Floats) -> Floats:
    """Return |value - reference|; 0 where both are the same, infinite ones too."""
    with np.errstate(all="ignore"):
        return np.where(value == reference, 0.0, np.abs(value - reference))


def cell_count(fields: list[Cells]) -> int:
    """Return the number of all cells."""
    return sum(math.prod(one.shape) for one in fields)


def _neighbours(value: Floats, axis: int) -> tuple[Floats, Floats]:
    moved = np.moveaxis(value, axis, 0)
    return np.moveaxis(moved[:-1], 0, axis), np.moveaxis(moved[1:], 0, axis)


NAME = "law"
# 64 bits of mantissa and 15 of exponent on x86: float64's own rounding and overflow are seen from outside. Where it is
# no more than float64, what float64 does wrong to its last digits goes unseen.
EXTENDED = np.longdouble
NUMPY_HEAD = "import numpy as np\n"


class Rounded:
    """numpy whose every result is of one type; numbers in the code take that of the arrays they meet."""

    def __init__(self, dtype: type) -> None:
        self._dtype = dtype

    def __getattr__(self, name: str) -> Callable[..., Any]:
        function, dtype = getattr(np, name), self._dtype

        def call(*arguments: Any) -> Any:
            arrays = [np.asarray(one) for one in arguments]
            return function(*(one if one.dtype == bool else one.astype(dtype) for one in arrays))

        return call


class RoundedText:
    """Functions of a law's or map's shader source, or of one in Python as such, computed in one type throughout."""

    def __init__(self, law: AlbedoLaw | ProfileLaw | str, dtype: type) -> None:
        self.dtype = dtype
        if not isinstance(law, str):
            text = emit.map_text if isinstance(law, AlbedoLaw) else emit.law_text
            law = text(law, "python", NAME)  # type: ignore[arg-type]
        self._names: dict[str, Any] = {"np": Rounded(dtype)}
        exec(compile(law.replace(NUMPY_HEAD, "", 1), f"{NAME}.py", "exec"), self._names)

    def call(self, function: str, *arguments: Any) -> Any:
        """Call a function of the text, by its name less the prefix, with arrays that are rounded to the type first."""
        given = [one.astype(self.dtype) if isinstance(one, np.ndarray) else one for one in arguments]
        with np.errstate(all="ignore"):  # what is no number is what is looked for
            return self._names[f"{NAME}_{function}"](*given)

    def replace(self, function: str, other: Callable[..., Any]) -> None:
        """Replace a function of the text, by that name less the prefix, with another."""
        self._names[f"{NAME}_{function}"] = other
