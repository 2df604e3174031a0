"""Quantities, arithmetics, and the grid of arguments of each format.

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

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profilefit.laws.evaluate import POSITIVE

Floats = NDArray[np.float64]
# Ordinary values between the ends; neighbours of some of them show noise that wider steps hide.
ALPHA = (1e-12, 1e-6, 1e-3, 0.01, 0.05, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7, 0.8, 0.9, 0.95, 0.99, 0.999, 0.9999)
REFLECTANCE = (1e-12, 1e-6, 1e-3, 0.01, 0.05, *(float(v) for v in np.linspace(0.1, 0.9, 17)), 0.92, 0.95, 0.98, 0.99)
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


def alpha(dtype: type) -> ArgumentAxis:
    """Return single-scattering albedos in [0, 1]."""
    return ArgumentAxis("α", "-", _cells(dtype, (*ALPHA, *_ends(dtype), *_around_one(dtype))))


def reflectance(dtype: type) -> ArgumentAxis:
    """Return total reflectances in [0, 1]."""
    return ArgumentAxis("A", "-", _cells(dtype, (*REFLECTANCE, *_ends(dtype), *_around_one(dtype))))


def share(dtype: type) -> ArgumentAxis:
    """Return uniform numbers in [0, 1]; 1 itself, which no generator should give, is outside."""
    given = (*SHARE, *_ends(dtype), *_around_one(dtype), *_pairs(dtype, (0.1, 0.5)))
    return ArgumentAxis("ξ", "-", _cells(dtype, given))


def radius(dtype: type) -> ArgumentAxis:
    """Return radii r/l from 0 to infinity."""
    largest = float(np.finfo(dtype).max)
    far = (*FARTHER, largest**0.5, 0.1 * largest, largest, np.inf)
    return ArgumentAxis("r/l", "-", _cells(dtype, (*RADIUS, *far, *_ends(dtype), *_pairs(dtype, NEIGHBOURS))))


def length(dtype: type, accepted: tuple[float, float], beyond: bool) -> ArgumentAxis:
    """Return mean free paths > 0 in any unit: both ends of what is accepted, and `beyond` them those of the format."""
    limits = np.finfo(dtype)
    ends = (float(limits.tiny), float(limits.max)) if beyond else ()
    inside = [float(one) for one in np.clip(np.asarray(accepted).astype(dtype), limits.tiny, limits.max)]
    return ArgumentAxis("l", "length", _cells(dtype, (*LENGTH, *inside, *ends)))


def shown(value: float) -> str:
    """Return a number as a person writes it: powers of two near 0 and 1 as such."""
    if value == 0 or not np.isfinite(value):
        return f"{value:g}"
    if 0.5 < value < 1.0 and _power(1.0 - value) >= min(POWERS):
        return f"1-2^-{_power(1.0 - value)}"
    if value < 1e-2 and _power(value) >= min(POWERS) and _power(value) < 100:
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


def _around_one(dtype: type) -> tuple[float, ...]:
    return (*(1.0 - 2.0**-k for k in POWERS), 1.0)


def _pairs(dtype: type, values: Iterable[float]) -> list[float]:
    """Return values and their next neighbours."""
    return [float(one) for value in values for one in (dtype(value), np.nextafter(dtype(value), dtype(np.inf)))]


def _cells(dtype: type, values: Iterable[float]) -> Floats:
    """Return the values that the format distinguishes, rising, without finite ones that it turns into infinity."""
    given = np.asarray(list(values), float)
    with np.errstate(over="ignore", under="ignore"):
        rounded = given.astype(dtype).astype(float)
    return np.unique(rounded[np.isfinite(rounded) | np.isinf(given)])


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


def accepted(length: Floats, dtype: type) -> NDArray[np.bool_]:
    """Return which mean free paths are within `LENGTHS`, whose ends are rounded to the type."""
    low, high = np.asarray(LENGTHS[dtype]).astype(dtype).astype(float)
    return (length >= low) & (length <= high)


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
        return cls(dtype, alpha(dtype), radius(dtype), share(dtype), length(dtype, LENGTHS[dtype], beyond))

    @property
    def r(self) -> Floats:
        """(1, x, l)."""
        with np.errstate(over="ignore", under="ignore"):
            return (self.x.values[:, None] * self.mfp.values).astype(self.dtype).astype(float)[None]

    @property
    def arguments(self) -> tuple[Floats, Floats, Floats, Floats]:
        """r, xi, alpha, mfp, ready to broadcast."""
        return self.r, self.xi.values[None, :, None], self.alpha.values[:, None, None], self.mfp.values

    @property
    def accepted(self) -> NDArray[np.bool_]:
        """(l,) lengths that a law accepts."""
        return accepted(self.mfp.values, self.dtype)
