"""What is fitted to the data: which law, what is held, what else is known."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from profilefit.errors import InputError
from profilefit.laws.base import ProfileLaw
from profilefit.measured.model import NAMES, u_of

Floats = NDArray[np.float64]
LEAST, MOST = 1e-9, 1.0 - 1e-9  # albedos that can be held


@dataclass(frozen=True)
class Known:
    """A number with its standard error."""

    value: float
    error: float


@dataclass(frozen=True)
class Question:
    """A law to fit, by the medium's albedo, its transport mean free path and the scale of the values.

    held    coordinates that stay where they are, by name: alpha, l, scale, as values (not logarithms)
    total   the total reflectance A [-], if that was measured as well; scale known to within an error
    """

    law: ProfileLaw
    held: dict[str, float] = field(default_factory=dict)
    total: Known | None = None
    scale: Known | None = None

    @property
    def free(self) -> tuple[int, ...]:
        """Which of the three coordinates move."""
        return tuple(at for at, name in enumerate(NAMES) if name not in self.held)

    @property
    def base(self) -> Floats:
        """(3,) the held coordinates; 0 for free ones."""
        point = np.zeros(len(NAMES))
        for at, name in enumerate(NAMES):
            if name in self.held:
                point[at] = u_of(self.held[name]) if name == "alpha" else np.log(self.held[name])
        return point


def held_albedo(law: ProfileLaw, name: str, value: float) -> float:
    """The albedo at which `alpha` or `A` is `value`; InputError where the law has none."""
    if name == "alpha":
        if not LEAST <= value <= MOST:
            raise InputError(f"held alpha must be a single-scattering albedo in (0, 1), got {value:g}")
        return value
    with np.errstate(all="ignore"):
        low, high = (float(np.asarray(law.total(np.float64(end)))) for end in (LEAST, MOST))
    if not low <= value <= high:
        raise InputError(
            f"held A must be a total reflectance in [{low:.3g}, {high:.5g}] of this light and surface, got {value:g}"
        )
    return float(brentq(lambda alpha: float(np.asarray(law.total(np.float64(alpha)))) - value, LEAST, MOST, xtol=1e-14))
