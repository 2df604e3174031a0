"""What is looked at: quantities, arithmetics, and the grid of arguments of each format.

float64           the law in Python, as called with numpy
float32           the same code, run by jax in single precision
float32 text      the shader text, every operation in single precision
float16 stored    the text in single precision, its A, r, l and result kept in half
float16 text      the text, every operation in half precision
model             the law in float64 against the exact half space: what no arithmetic can mend
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from profilefit.laws.evaluate import POSITIVE
from profilefit.stability import axes
from profilefit.stability.axes import Axis

Floats = NDArray[np.float64]
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
    """Which mean free paths are within `LENGTHS`, whose ends are rounded to the type."""
    low, high = np.asarray(LENGTHS[dtype]).astype(dtype).astype(float)
    return (length >= low) & (length <= high)


@dataclass(frozen=True)
class Grid:
    """Arguments of one format: r and l as rounded."""

    dtype: type
    alpha: Axis
    x: Axis
    xi: Axis
    mfp: Axis

    @classmethod
    def of(cls, dtype: type, beyond: bool = True) -> Grid:
        """`beyond` takes in lengths that the law does not accept."""
        length = axes.length(dtype, LENGTHS[dtype], beyond)
        return cls(dtype, axes.alpha(dtype), axes.radius(dtype), axes.share(dtype), length)

    def thinned(self) -> Grid:
        """Fewer of all, for a law that takes a thousand nodes for a number."""
        alpha, x, xi = (
            replace(one, values=one.values[::step]) for one, step in ((self.alpha, 5), (self.x, 4), (self.xi, 4))
        )
        return Grid(self.dtype, alpha, x, xi, replace(self.mfp, values=np.array([1.0])))

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
