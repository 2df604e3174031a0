"""One quantity of one law in one arithmetic, over all arguments: each cell with its value, what is right, a class.

A law is computed in several arithmetics: its text, line by line in numpy, from half to extended precision.
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
from profilefit.studies.stability.layout import FLOAT64, ArgumentAxis

Codes = NDArray[np.int8]
Mask = NDArray[np.bool_]


class Verdict(enum.IntEnum):
    """The class of a cell; of several that hold, the last one here counts.

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


def red(codes: Codes) -> Mask:
    """Which cells are red."""
    found: Mask = codes >= Verdict.INACCURATE
    return found


Floats = NDArray[np.float64]
# R_d l^2 and the like, below which the factors of a product leave the format before the product does. Half has no room.
DIMMEST: dict[type, float] = {np.float64: 1e-290, np.float32: 1e-30, np.float16: float(np.finfo(np.float16).tiny)}
# Steps the wrong way count beyond this many units in the last place.
ROUNDED_STEPS = 16.0
NEARLY = 10.0  # how far off a number may be that is too small to be one


@dataclass(frozen=True, eq=False)
class Cells:
    """A tensor over `axes`.

    subject    label of the law, map or function; own whether it is one of this project's own, held to have no red cell
    quantity   what is computed; arithmetic in which numbers, by what text
    value, reference, error  same shape; `error` is compared with `bound`, NaN where nothing is known
    unjudged   why, where cells are not judged
    inside     where the law says that it holds
    codes      `Verdict` of each; law, dtype  what computed it, and of what type its numbers are
    twin       beside a text in half: the classes of the same text at the same arguments in float32
    refused    beside a text that is misused: what the law in Python refuses by name
    stated     the law's own stated error of this quantity against the half space [-], NaN where none is known
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
    law: Any = None
    dtype: type = np.float64
    twin: Codes | None = None
    refused: Mask | None = None
    stated: float = math.nan
    unjudged: str = ""

    @property
    def shape(self) -> tuple[int, ...]:
        return tuple(axis.values.size for axis in self.axes)

    def along(self, name: str) -> Floats | None:
        """The values of an argument, ready to broadcast to `shape`; None if there is no such axis."""
        for i, axis in enumerate(self.axes):
            if axis.name == name:
                return axis.values.reshape([-1 if j == i else 1 for j in range(len(self.axes))])
        return None

    @property
    def verdicts(self) -> set[Verdict]:
        """The classes that occur."""
        return {Verdict(int(code)) for code in np.unique(self.codes)}

    def spread(self, name: str, default: float) -> Floats:
        """The values of an argument at every cell, or one value where the tensor has no such axis."""
        found = self.along(name)
        return np.broadcast_to(default if found is None else found, self.shape)

    @property
    def failures(self) -> Mask:
        """Red cells where the law says that it holds."""
        found: Mask = (self.codes >= Verdict.INACCURATE) & self.inside
        return found


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
    """The class of every cell: where there is no reference, NaN the error or the bound no number, not judged.

    dim        where the right number is too small for the format to reach it, besides where it is itself too small
    wrong_way  where a value went the wrong way from its neighbour
    """
    limits, lost = np.finfo(dtype), np.broadcast_to(dim, value.shape)
    codes = np.full(value.shape, Verdict.RIGHT, np.int8)
    size = np.abs(reference)
    large, small = size > float(limits.max), ((size < float(limits.tiny)) & (size > 0)) | dim
    with np.errstate(invalid="ignore", over="ignore"):
        codes[inside & (np.isnan(error) | ~np.isfinite(bound))] = Verdict.NOT_JUDGED
        codes[~inside] = Verdict.OUTSIDE
        off = error > bound
        codes[inside & off & ~large & ~small] = Verdict.INACCURATE
        absurd = np.abs(value) > NEARLY * np.maximum(size, float(limits.tiny))
        faint = inside & small & ~large
        codes[faint] = Verdict.BEYOND
        codes[faint & absurd & off & ~lost] = Verdict.INACCURATE
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
    inside: Mask,
) -> Cells:
    """Cells that are judged everywhere, in the format of their arithmetic."""
    dtype = np.float64 if arithmetic == FLOAT64 else np.float32
    codes = judged(value, reference, error, bound, np.ones(value.shape, bool), dtype)
    return Cells(subject, own, quantity, arithmetic, axes, value, reference, error, bound, inside, codes, dtype=dtype)


def steps_down(value: Floats, axis: int, dtype: type, scale: Floats | float = 0.0) -> Mask:
    """Where a value is less than its neighbour before it along an axis, by more than rounding; `scale` adds to it."""
    allowance = ROUNDED_STEPS * float(np.finfo(dtype).eps)
    lower, upper = _neighbours(value, axis)
    with np.errstate(invalid="ignore", over="ignore"):
        size = np.abs(lower) + _neighbours(np.broadcast_to(scale, value.shape), axis)[0]
        falls = upper - lower < -allowance * size - float(np.finfo(dtype).tiny)
    return _padded(falls & np.isfinite(lower) & np.isfinite(upper), axis)


def steps_up(value: Floats, axis: int, dtype: type, scale: Floats | float = 0.0) -> Mask:
    """Where a value is more than its neighbour before it, likewise."""
    return steps_down(-value, axis, dtype, scale)


def relative(value: Floats, reference: Floats) -> Floats:
    """|value / reference - 1|; 0 where both are the same, infinite ones too."""
    with np.errstate(all="ignore"):
        found = np.abs(value - reference) / np.abs(reference)
    return np.where(value == reference, 0.0, np.where(reference == 0, np.where(value == 0, 0.0, np.inf), found))


def absolute(value: Floats, reference: Floats) -> Floats:
    """|value - reference|; 0 where both are the same, infinite ones too."""
    with np.errstate(all="ignore"):
        return np.where(value == reference, 0.0, np.abs(value - reference))


def cell_count(fields: list[Cells]) -> int:
    return sum(math.prod(one.shape) for one in fields)


def _neighbours(value: Floats, axis: int) -> tuple[Floats, Floats]:
    moved = np.moveaxis(value, axis, 0)
    return np.moveaxis(moved[:-1], 0, axis), np.moveaxis(moved[1:], 0, axis)


def _padded(found: Mask, axis: int) -> Mask:
    """With the first cell of the axis, which has none before it."""
    widths = [(1 if i == axis else 0, 0) for i in range(found.ndim)]
    return np.pad(found, widths)


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
    """The functions of a law's or map's shader source, or of one in Python as such, computed in one type throughout."""

    def __init__(self, law: AlbedoLaw | ProfileLaw | str, dtype: type) -> None:
        self.dtype = dtype
        if not isinstance(law, str):
            text = emit.map_text if isinstance(law, AlbedoLaw) else emit.law_text
            law = text(law, "python", NAME)  # type: ignore[arg-type]
        self._names: dict[str, Any] = {"np": Rounded(dtype)}
        exec(compile(law.replace(NUMPY_HEAD, "", 1), f"{NAME}.py", "exec"), self._names)

    def call(self, function: str, *arguments: Any) -> Any:
        """A function of the text, by its name less the prefix, of arrays that are rounded to the type first."""
        given = [one.astype(self.dtype) if isinstance(one, np.ndarray) else one for one in arguments]
        with np.errstate(all="ignore"):  # what is no number is what is looked for
            return self._names[f"{NAME}_{function}"](*given)

    def replace(self, function: str, other: Callable[..., Any]) -> None:
        """Have the text call another function by that name, less the prefix."""
        self._names[f"{NAME}_{function}"] = other
