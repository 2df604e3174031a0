"""What is fitted to the data: which law, what is held, what else is known."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace

import jax
import jax.numpy as jnp
import numpy as np
from numpy.typing import NDArray
from scipy.optimize import brentq

from mcml_sim.media.setting import Setting
from profilefit.errors import InputError
from profilefit.measured.beam import Gaussian
from profilefit.measured.exact_light import light_at_hand
from profilefit.measured.instrument import PENCIL, Instrument
from profilefit.measured.model import NAMES, Light, U, u_of
from profilefit.measured.oblique import Oblique

Floats = NDArray[np.float64]
MEDIUM = ("n", "g")
LEAST, MOST = 1e-9, 1.0 - 1e-9  # albedos that can be held


@dataclass(frozen=True)
class Known:
    """A number with its standard error."""

    value: float
    error: float


@dataclass(frozen=True)
class FitSpec:
    """What to fit: exact light or a law, by the albedo, the transport mean free path and the scale of the values.

    instrument  the beam, and what a row is averaged over
    held    what stays where it is, by name: alpha or A, l, scale, as values (not logarithms)
    total   the total reflectance A [-], if that was measured as well; scale known to within an error; oblique the
            centre of light that fell in aslant
    ranges  (low, high) of what is known no better: n, g, a Gaussian beam's 1/e^2 radius; assumed those of n and g that
            nobody named
    """

    law: Light
    held: dict[str, float] = field(default_factory=dict)
    total: Known | None = None
    scale: Known | None = None
    oblique: Oblique | None = None
    instrument: Instrument = PENCIL
    ranges: Mapping[str, tuple[float, float]] = field(default_factory=dict)
    assumed: tuple[str, ...] = ()

    @property
    def free(self) -> tuple[int, ...]:
        """Which of the three coordinates move."""
        held = {"alpha" if name == "A" else name for name in self.held}
        return tuple(at for at, name in enumerate(NAMES) if name not in held)

    @property
    def base(self) -> Floats:
        """(3,) the held coordinates; 0 for free ones."""
        point = np.zeros(len(NAMES))
        for name, value in self.held.items():
            if name in ("alpha", "A"):
                point[U] = u_of(held_albedo(self.law, name, value))
            else:
                point[NAMES.index(name)] = np.log(value)
        return point

    def under(self, values: Mapping[str, float]) -> FitSpec:
        """The same where those of the ranges have these values."""
        setting = Setting.of(self.law.setting.as_table() | {name: values[name] for name in MEDIUM if name in values})
        seen = replace(self.instrument, beam=Gaussian(values["beam"])) if "beam" in values else self.instrument
        return replace(self, law=self.law if setting == self.law.setting else light_at_hand(setting), instrument=seen)


def held_albedo(law: Light, name: str, value: float) -> float:
    """The albedo at which `alpha` or `A` is `value`; InputError where the law has none."""
    if name == "alpha":
        if not LEAST <= value <= MOST:
            raise InputError(f"held alpha must be a single-scattering albedo in (0, 1), got {value:g}")
        return value

    def total(alpha: float) -> float:
        with jax.enable_x64(True), np.errstate(all="ignore"):
            return float(law.total(jnp.float64(alpha)))

    low, high = (total(end) for end in (LEAST, MOST))
    if not low <= value <= high:
        raise InputError(
            f"held A must be a total reflectance in [{low:.3g}, {high:.5g}] of this light and surface, got {value:g}"
        )
    return float(brentq(lambda alpha: total(alpha) - value, LEAST, MOST, xtol=1e-14))
