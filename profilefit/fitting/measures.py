"""The measures of a law's error: what each is called, what it is, in what unit, and which of its values is the worst.

Their definitions are those of `quality`, of `sampling` for the inversion; records, tables, figures, shader checks and
exported texts take names and words from here.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike


@dataclass(frozen=True)
class Measure:
    """One measure.

    name     in records
    formula  what it is, as a formula or in words behind its name; words the same in a sentence
    unit     "-" for a pure number
    short    at the head of a narrow column; symbol where only what is wrong is named
    is_high  whether large is good, as of r2
    """

    name: str
    formula: str
    words: str = ""
    unit: str = "-"
    short: str = ""
    symbol: str = ""
    is_high: bool = False

    @property
    def header(self) -> str:
        """Name at the head of a narrow column."""
        return self.short or self.name

    @property
    def meaning(self) -> str:
        """The formula, with the unit if it has one."""
        return self.formula if self.unit == "-" else f"{self.formula} [{self.unit}]"

    def worst(self, values: ArrayLike) -> float:
        """Return the worst of its values, in its own unit."""
        return float(np.min(values) if self.is_high else np.max(values))


_ALL = (
    Measure("rel", "mean |law / exact − 1| of R_d", "mean relative error of R_d", symbol="rel"),
    Measure("ks", "max |cdf − exact cdf|", "error of the cdf", symbol="ks"),
    Measure("l1", "share of misplaced energy"),
    Measure("mse", "of r R_d", unit="1/mfp²"),
    Measure("r2", "of r R_d", is_high=True),
    Measure("mse near", "of the nearer half of the trimmed range", unit="1/mfp²"),
    Measure("mse far", "of the farther half"),
    Measure("largest", "max |law / exact − 1| of R_d", "largest error of R_d at a radius"),
    Measure("r2 near", "of the nearer half of the trimmed range", is_high=True),
    Measure("r2 far", "of the farther half", is_high=True),
    Measure("inversion_error", "max |cdf(r(ξ)) − ξ|", "error in xi", short="error", symbol="xi"),
    Measure("delta_A", "max error of A", "error of A", symbol="A"),
    Measure("delta_alpha", "max error of α", symbol="α"),
    Measure("largest_s", "max |√(1 − α) / exact − 1|"),
    Measure("monotone", "rises all the way"),
    Measure("at_one", "α at A = 1"),
    Measure("fold", "A where it turns"),
)
MEASURES: dict[str, Measure] = {one.name: one for one in _ALL}
# Measures in records: errors by albedo, and those of a map as a whole.
OF_PROFILE = ("rel", "ks", "inversion_error")
OF_MAP = ("delta_A", "delta_alpha", "largest_s", "monotone", "at_one", "fold")
