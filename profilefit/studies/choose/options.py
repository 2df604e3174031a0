"""The ways to scatter light that are chosen from, none of them more than a few lines of a shader."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profilefit.laws.base import ProfileLaw

Floats = NDArray[np.float64]
SAMPLES = (4, 8, 16, 32, 64, 128, 256)
TAPS = (9, 17, 33)
GAUSSIANS = (2, 3, 4)
GAUSSIAN_TAPS = (17, 33)


@dataclass(frozen=True)
class Option:
    """A way to scatter light.

    kind    "nothing", Lambert; "separable", the skin kernel stretched to the material; "gaussians", a filter for each
            of `count`; "sampled", a law's radii
    number  of taps or samples;  law  that is sampled, with the name of its record
    """

    kind: str
    number: int = 0
    count: int = 1
    law: ProfileLaw | None = None
    name: str = ""

    @property
    def label(self) -> str:
        """What a table calls it."""
        if self.kind == "nothing":
            return "nothing (Lambert)"
        if self.kind == "separable":
            return f"separable, {self.number} taps"
        if self.kind == "gaussians":
            return f"{self.count} Gaussians, {self.number} taps each"
        return f"{self.name}, {self.number} samples"


NOTHING = Option("nothing")


def filters() -> list[Option]:
    """Lambert and all filters."""
    separable = [Option("separable", taps) for taps in TAPS]
    gaussians = [Option("gaussians", taps, count) for count in GAUSSIANS for taps in GAUSSIAN_TAPS]
    return [NOTHING, *separable, *gaussians]


def sampled(law: ProfileLaw, name: str) -> list[Option]:
    """A law with every number of samples."""
    return [Option("sampled", samples, law=law, name=name) for samples in SAMPLES]


def is_filter(option: Option) -> bool:
    """True for what blurs along rows and columns, without noise."""
    return option.kind in ("separable", "gaussians")
