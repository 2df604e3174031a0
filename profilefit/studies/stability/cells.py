"""Cells of a quantity in one arithmetic over all its arguments: value, reference and class of each; and their regions.

float64           the law in Python, as called with numpy
float32           the same code, run by jax in single precision
float32 text      the shader source, every operation in single precision
float16 stored    the text in single precision, its A, r, l and result kept in half
float16 text      the text, every operation in half precision
model             the law in float64 against the exact half space: what no arithmetic can mend

The cells along each argument: both ends, denormals, powers of two next to 0 and to 1, neighbours, huge numbers. Every
value is one of the format that it is made for, so that rounding an argument is no error of what is judged.
"""

from __future__ import annotations

import enum
from collections.abc import Callable, Iterable, Iterator
from dataclasses import InitVar, dataclass
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import ndimage

from mcml_sim.media.arrays import Floats
from profilefit.laws.base import POSITIVE, AlbedoLaw, ProfileLaw
from profilefit.shader import emit

Mask = NDArray[np.bool_]
PROFILE, CDF, SAMPLE, PDF = "R_d", "cdf", "sample", "pdf"
QUANTITIES = (PROFILE, CDF, SAMPLE, PDF)
ALPHA_OF, REFLECTANCE_OF = "α(A)", "A(α)"
FLOAT64, FLOAT32, TEXT32 = "float64", "float32", "float32 text"
STORED16, TEXT16, MODEL = "float16 stored", "float16 text", "model"
ARITHMETICS = (FLOAT64, FLOAT32, TEXT32, STORED16, TEXT16, MODEL)
# Half precision is measured, and no law is held to it: texts ask for highp.
HELD = (FLOAT64, FLOAT32, TEXT32, MODEL)
DTYPES: dict[str, type] = {
    **{FLOAT64: np.float64, MODEL: np.float64, FLOAT32: np.float32, TEXT32: np.float32},
    **{STORED16: np.float16, TEXT16: np.float16},
}
# Mean free paths, in whatever unit, whose squares and inverse squares stay in the format with room for R_d l^2.
LENGTHS: dict[type, tuple[float, float]] = {
    np.float64: POSITIVE,
    np.float32: (1e-12, 1e12),
    np.float16: (2.0**-5, 2.0**5),
}
# What a number kept in half costs by itself: half a unit in the last place, of it and of an argument.
HALF_BOUND = 2.0**-10
# Ordinary values between the ends; neighbours of some of them show noise that wider steps hide.
ALPHA = (1e-12, 1e-6, 1e-3, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999, 0.9999)
REFLECTANCE = (1e-12, 1e-6, 1e-3, 0.01, 0.05, *np.linspace(0.1, 0.9, 17).tolist(), 0.92, 0.95, 0.98, 0.99)
RADIUS = (1e-12, 1e-9, 1e-6, 1e-4, 1e-3, 0.01, 0.03, 0.1, 0.3, 1.0, 2.0, 3.0, 5.0, 10.0, 20.0, 30.0, 50.0, 100.0, 1e3)
FARTHER = (1e6, 1e8, 1e15)
SHARE = (
    *(1e-12, 1e-6, 1e-4, 1e-3, 5e-3, 0.0099, 0.0101, 0.02, 0.05),
    *(0.1, 0.2, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999),
)
LENGTH = (1e-3, 1.0, 1e3)
POWERS = (10, 11, 24, 53)  # k of 2^-k and 1 - 2^-k: what half, float32 and float64 can and cannot hold
NEIGHBOURS = (0.1, 0.5, 1.0, 10.0)


@dataclass(frozen=True)
class ArgumentAxis:
    """An argument's cells: `name` as in formulas, `unit` without brackets, `values` rising; `labels` if no number."""

    name: str
    unit: str
    values: Floats
    labels: tuple[str, ...] = ()

    def label(self, index: int) -> str:
        return self.labels[index] if self.labels else shown(float(self.values[index]))

    def span(self, low: int, high: int) -> str:
        """Return the cells from one to another, in words."""
        if self.labels:
            return ", ".join(self.labels[low : high + 1])
        if low == high:
            return f"{self.name} {self.label(low)}"
        whole = low == 0 and high == self.values.size - 1
        return f"all {self.name}" if whole else f"{self.name} {self.label(low)} … {self.label(high)}"

    def nearest(self, value: float) -> int:
        """Return the cell of a value, or the nearest one."""
        return int(np.argmin(np.abs(self.values - value)))


Axes = tuple[ArgumentAxis, ...]


def axis(name: str, values: ArrayLike, unit: str = "-") -> ArgumentAxis:
    """Return the axis of some numbers."""
    return ArgumentAxis(name, unit, np.array(values, float))


def labelled(name: str, labels: Iterable[str]) -> ArgumentAxis:
    """Return the axis of things that are no numbers."""
    words = tuple(labels)
    return ArgumentAxis(name, "-", np.arange(len(words), dtype=float), words)


def unit_axis(name: str, dtype: type) -> ArgumentAxis:
    """Return albedos α, reflectances A or uniform numbers ξ in [0, 1], of which no generator should give 1 itself."""
    between = {"α": ALPHA, "A": REFLECTANCE, "ξ": (*SHARE, *_pairs(dtype, (0.1, 0.5)))}[name]
    return axis(name, _cells(dtype, (*between, *_ends(dtype), *(1.0 - 2.0**-k for k in POWERS), 1.0)))


def radius_axis(dtype: type) -> ArgumentAxis:
    """Return radii r/l from 0 to infinity."""
    largest = float(np.finfo(dtype).max)
    far = (*FARTHER, largest**0.5, 0.1 * largest, largest, np.inf)
    return axis("r/l", _cells(dtype, (*RADIUS, *far, *_ends(dtype), *_pairs(dtype, NEIGHBOURS))))


def length_axis(dtype: type, beyond: bool) -> ArgumentAxis:
    """Return mean free paths > 0 in any unit: both ends of what is accepted, and `beyond` them those of the format."""
    limits = np.finfo(dtype)
    ends = (float(limits.tiny), float(limits.max)) if beyond else ()
    inside = np.clip(np.asarray(LENGTHS[dtype]).astype(dtype), limits.tiny, limits.max).astype(float)
    return axis("l", _cells(dtype, (*LENGTH, *inside, *ends)), "length")


def shown(value: float) -> str:
    """Return a number as a person writes it: powers of two near 0 and 1 as such."""
    if value == 0 or not np.isfinite(value):
        return f"{value:g}"
    if 0.5 < value < 1.0 and _power(1.0 - value) >= min(POWERS):
        return f"1-2^-{_power(1.0 - value)}"
    if value < 1e-2 and min(POWERS) <= _power(value) < 100:
        return f"2^-{_power(value)}"
    return f"{value:.4g}" if value < 0.9995 or value >= 1.0 else f"1-{1.0 - value:.1g}"


def _power(value: float) -> int:
    """Return k where value is 2^-k, else -1."""
    mantissa, exponent = np.frexp(value)
    return int(1 - exponent) if mantissa == 0.5 else -1


def _ends(dtype: type) -> tuple[float, ...]:
    """Return 0, the least denormal, the least normal number, powers of two."""
    limits = np.finfo(dtype)
    return (0.0, float(limits.smallest_subnormal), float(limits.tiny), *(2.0**-k for k in POWERS))


def _pairs(dtype: type, values: Iterable[float]) -> list[float]:
    """Return values and their next neighbours."""
    return [float(one) for value in values for one in (dtype(value), np.nextafter(dtype(value), dtype(np.inf)))]


def _cells(dtype: type, values: Iterable[float]) -> Floats:
    """Return the values that the format distinguishes, rising, without finite ones that it turns into infinity."""
    given = np.asarray(list(values), float)
    with np.errstate(over="ignore", under="ignore"):
        rounded = given.astype(dtype).astype(float)
    return np.unique(rounded[np.isfinite(rounded) | np.isinf(given)])


@dataclass(frozen=True)
class ArgumentGrid:
    """Arguments of one format: r and l as rounded."""

    dtype: type
    alpha: ArgumentAxis
    x: ArgumentAxis
    xi: ArgumentAxis
    mfp: ArgumentAxis

    @classmethod
    def of(cls, dtype: type, beyond: bool = True) -> ArgumentGrid:
        """Return the grid of a format; `beyond` takes in lengths that the law does not accept."""
        alpha, xi = unit_axis("α", dtype), unit_axis("ξ", dtype)
        return cls(dtype, alpha, radius_axis(dtype), xi, length_axis(dtype, beyond))

    @property
    def arguments(self) -> tuple[Floats, Floats, Floats, Floats]:
        """r, xi, alpha, mfp, ready to broadcast."""
        with np.errstate(over="ignore", under="ignore"):
            r = (self.x.values[:, None] * self.mfp.values).astype(self.dtype).astype(float)[None]
        return r, self.xi.values[None, :, None], self.alpha.values[:, None, None], self.mfp.values

    @property
    def accepted(self) -> Mask:
        """(l,) lengths that a law accepts, within `LENGTHS`, whose ends are rounded to the type."""
        low, high = np.asarray(LENGTHS[self.dtype]).astype(self.dtype).astype(float)
        return (self.mfp.values >= low) & (self.mfp.values <= high)


class Verdict(enum.IntEnum):
    """Class of a cell; of several, the last one here counts. NOT_JUDGED: a number in order, but without a reference."""

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


WORDS = (
    *("right", "outside its range", "beyond the format", "not judged"),
    *("inaccurate", "not monotone", "negative", "NaN or Inf", "raises"),
)
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
    value, reference, error  are broadcast to the axes; `error` is compared with `bound`, NaN where nothing is known
    bound      in half at least what keeping a number costs
    inside     where the law says that it holds; in half, which is measured only, nowhere
    codes      `Verdict` of each cell, by default as value, reference and error say: not judged without a reference,
               where the error is NaN or the bound infinite
    unjudged   why, where cells are not judged;  advice  what helps where they are red, by default `ADVICE`'s
    judge      where errors count, by default everywhere: cells elsewhere are outside
    dim        where the reference is too small for the format to reach it, besides where it is itself too small
    wrong_way  where a value went the wrong way from its neighbour
    """

    subject: str
    own: bool
    quantity: str
    arithmetic: str
    axes: Axes
    value: Floats
    reference: Floats
    error: Floats
    bound: float
    inside: Mask | bool = True
    codes: Any = None
    unjudged: str = ""
    advice: str = ""
    judge: InitVar[Mask | bool] = True
    dim: InitVar[Mask | bool] = False
    wrong_way: InitVar[Mask | None] = None

    def __post_init__(self, judge: Mask | bool, dim: Mask | bool, wrong_way: Mask | None) -> None:
        shape = tuple(one.values.size for one in self.axes)
        if DTYPES[self.arithmetic] is np.float16:
            object.__setattr__(self, "bound", max(self.bound, HALF_BOUND))
            object.__setattr__(self, "inside", False)
        for name in ("value", "reference", "error", "inside"):
            object.__setattr__(self, name, np.broadcast_to(getattr(self, name), shape))
        if self.codes is None:
            object.__setattr__(self, "codes", self._judged(np.broadcast_to(judge, shape), dim, wrong_way))

    @property
    def verdicts(self) -> set[Verdict]:
        """Classes that occur."""
        return {Verdict(int(code)) for code in np.unique(self.codes)}

    def _judged(self, judge: Mask, dim: Mask | bool, wrong_way: Mask | None) -> NDArray[np.int8]:
        """Return the class of every cell."""
        value, reference, limits = self.value, self.reference, np.finfo(DTYPES[self.arithmetic])
        codes, lost = np.full(value.shape, Verdict.RIGHT, np.int8), np.broadcast_to(dim, value.shape)
        size = np.abs(reference)
        large, small = size > float(limits.max), ((size < float(limits.tiny)) & (size > 0)) | dim
        with np.errstate(invalid="ignore", over="ignore"):
            codes[judge & (np.isnan(self.error) | ~np.isfinite(self.bound))] = Verdict.NOT_JUDGED
            codes[~judge] = Verdict.OUTSIDE
            exceeds = self.error > self.bound
            codes[judge & exceeds & ~large & ~small] = Verdict.INACCURATE
            absurd = np.abs(value) > NEARLY * np.maximum(size, float(limits.tiny))
            faint = judge & small & ~large
            codes[faint] = Verdict.BEYOND
            codes[faint & absurd & exceeds & ~lost] = Verdict.INACCURATE
            codes[judge & large & np.isfinite(reference)] = Verdict.BEYOND
            if wrong_way is not None:
                codes[judge & wrong_way & ~small] = Verdict.NOT_MONOTONE
            codes[value < 0] = Verdict.NEGATIVE
            infinite = np.isinf(value) & ~large & ~lost & ~np.isinf(reference) & judge
            codes[np.isnan(value) | infinite] = Verdict.NOT_FINITE
        return codes


def steps_down(value: Floats, along: int, dtype: type, scale: Floats | float = 0.0) -> Mask:
    """Return where a value falls from its neighbour before it on an axis, by more than rounding of it and `scale`."""
    moved, size = (np.moveaxis(np.broadcast_to(one, value.shape), along, 0)[:-1] for one in (value, scale))
    lower, upper = moved, np.moveaxis(value, along, 0)[1:]
    with np.errstate(invalid="ignore", over="ignore"):
        allowance = ROUNDED_STEPS * float(np.finfo(dtype).eps) * (np.abs(lower) + size)
        falls = (upper - lower < -allowance - float(np.finfo(dtype).tiny)) & np.isfinite(lower) & np.isfinite(upper)
    return np.moveaxis(np.concatenate([np.zeros_like(falls[:1]), falls]), 0, along)  # the first has none before it


def steps_up(value: Floats, along: int, dtype: type, scale: Floats | float = 0.0) -> Mask:
    """Return where a value is more than its neighbour before it, likewise."""
    return steps_down(-value, along, dtype, scale)


def relative(value: Floats, reference: Floats) -> Floats:
    """Return |value / reference - 1|; 0 where both are the same, infinite ones too."""
    with np.errstate(all="ignore"):
        error = np.abs(value - reference) / np.abs(reference)
    return np.where(value == reference, 0.0, np.where(reference == 0, np.where(value == 0, 0.0, np.inf), error))


def absolute(value: Floats, reference: Floats) -> Floats:
    """Return |value - reference|; 0 where both are the same, infinite ones too."""
    with np.errstate(all="ignore"):
        return np.where(value == reference, 0.0, np.abs(value - reference))


@dataclass(frozen=True)
class Region:
    """Neighbouring cells of one subject, quantity, arithmetic and class.

    count   of cells;  inside  how many of them lie where the law says that it holds
    where   span along each axis, in words;  place, value, reference, error  of the worst cell
    advice  one sentence: what helps, or why the cells are not judged
    """

    subject: str
    own: bool
    quantity: str
    arithmetic: str
    verdict: Verdict
    count: int
    inside: int
    where: str
    place: str
    value: float
    reference: float
    error: float
    bound: float
    advice: str

    @property
    def is_failure(self) -> bool:
        """Whether one of this project's laws breaks its promise."""
        return self.own and self.inside > 0 and self.verdict.is_red


def regions_of(cells: Cells) -> list[Region]:
    """Return the red regions of a tensor, largest first, and after them those that are not judged."""
    verdicts = [one for one in sorted(cells.verdicts) if one.is_red or one == Verdict.NOT_JUDGED]
    regions = [_region(cells, part, verdict) for verdict in verdicts for part in _parts(cells, verdict)]
    return sorted(regions, key=lambda one: (not one.verdict.is_red, -one.count))


def _parts(cells: Cells, verdict: Verdict) -> Iterator[Mask]:
    """Yield the connected parts of a class; all of it at once where the first axis has labels for values."""
    chosen = cells.codes == verdict
    if cells.axes[0].labels:
        yield chosen
        return
    labels, count = ndimage.label(chosen, structure=np.ones((3,) * chosen.ndim, int))
    yield from (labels == number for number in range(1, count + 1))


def _region(cells: Cells, part: Mask, verdict: Verdict) -> Region:
    held = part & cells.inside
    errors = np.where(held if np.any(held) else part, np.nan_to_num(cells.error, nan=np.inf, posinf=np.inf), -1.0)
    worst = np.unravel_index(int(np.argmax(errors)), part.shape)
    at = np.argwhere(part)
    spans = [one.span(int(at[:, i].min()), int(at[:, i].max())) for i, one in enumerate(cells.axes)]
    place = "; ".join(one.span(int(i), int(i)) for one, i in zip(cells.axes, worst, strict=True))
    value, reference, error = (float(each[worst]) for each in (cells.value, cells.reference, cells.error))
    advice = (cells.advice or ADVICE[cells.arithmetic]) if verdict.is_red else cells.unjudged
    return Region(
        cells.subject, cells.own, cells.quantity, cells.arithmetic, verdict, int(part.sum()), int(held.sum()),
        "; ".join(spans), place, value, reference, error, float(cells.bound), advice,
    )  # fmt: skip


def functions_of(law: Any) -> dict[str, Callable[..., Any]]:
    """Return the functions in Python of a map or of a profile law, by quantity."""
    if isinstance(law, AlbedoLaw):
        return {ALPHA_OF: law.alpha, REFLECTANCE_OF: law.reflectance}
    return {PROFILE: law.profile, CDF: law.cdf, SAMPLE: law.sampler.sample, PDF: law.sampler.pdf}


NAME = "law"
# Functions of texts that have another name than their quantity.
CALLED = {PROFILE: "profile", ALPHA_OF: "alpha", REFLECTANCE_OF: "map_reflectance"}
# 64 bits of mantissa and 15 of exponent on x86: float64's own rounding and overflow are seen from outside. Where it is
# no more than float64, what float64 does wrong to its last digits goes unseen.
EXTENDED = np.longdouble


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
        exec(compile(law.replace("import numpy as np\n", "", 1), f"{NAME}.py", "exec"), self._names)

    def call(self, function: str, *arguments: Any) -> Any:
        """Call a quantity's or another function, by its name less the prefix, with arrays that are rounded first."""
        given = [one.astype(self.dtype) if isinstance(one, np.ndarray) else one for one in arguments]
        with np.errstate(all="ignore"):  # what is no number is what is looked for
            return self._names[f"{NAME}_{CALLED.get(function, function)}"](*given)

    def replace(self, function: str, other: Callable[..., Any]) -> None:
        """Replace a function of the text, by that name less the prefix, with another."""
        self._names[f"{NAME}_{function}"] = other
