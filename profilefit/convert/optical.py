"""One medium, to and from every convention of albedo and length."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from mcml_sim import Setting
from mcml_sim.exact.light import unreduced
from mcml_sim.media.arrays import Floats, require
from profilefit.convert.colour import LARGEST, checked, reflectance_of
from profilefit.convert.engine import TYPED_LENGTHS
from profilefit.convert.lengths import QUANTITIES, Length
from profilefit.errors import InputError

LENGTHS = (*QUANTITIES, *TYPED_LENGTHS)
BY_NAME = {length.name: length for length in LENGTHS}


@dataclass(frozen=True, eq=False)
class Optical:
    """A medium: alpha its reduced albedo [-] in [0, 1], mfp = 1 / (mu_s' + mu_a) [length] > 0, g its mean cosine [-].

    alpha and mfp are arrays of one shape, an element per channel; numbers and lists broadcast. Raises InputError.
    """

    alpha: Floats
    mfp: Floats
    g: float = 0.0

    def __post_init__(self) -> None:
        Setting(g=self.g)  # refuses a mean cosine that is none
        alpha, mfp = _checked({"alpha": self.alpha, "mfp": self.mfp})
        object.__setattr__(self, "alpha", alpha)
        object.__setattr__(self, "mfp", mfp)

    @classmethod
    def from_length(cls, name: str, value: ArrayLike, alpha: ArrayLike, g: float = 0.0) -> Optical:
        """Return the medium of this reduced albedo whose length `name`, one of `BY_NAME`, has this value [length]."""
        Setting(g=g)
        length = _named(name)
        albedo, lengths = _checked({"alpha": alpha, name: value})
        factor = length.factor(albedo, g)
        if not np.all(np.isfinite(factor)):
            raise InputError(f"{name} must be another length at alpha = 1: it is infinite where nothing is absorbed")
        return cls(albedo, lengths / factor, g)

    @classmethod
    def from_coefficients(cls, mu_a: ArrayLike, mu_s: ArrayLike, g: float = 0.0) -> Optical:
        """Return the medium of these absorption and reduced scattering coefficients [1/length], >= 0 and not both 0."""
        absorption, scattering = _checked({"mu_a": mu_a, "mu_s": mu_s})
        both = absorption + scattering
        require(np.all(both > 0), "mu_a + mu_s", "> 0: there is no medium", 0)
        return cls(scattering / both, 1.0 / both, g)

    @property
    def mu_a(self) -> Floats:
        """Absorption coefficient [1/length]."""
        return (1.0 - self.alpha) / self.mfp

    @property
    def mu_s(self) -> Floats:
        """Reduced scattering coefficient mu_s' = mu_s (1 - g) [1/length]."""
        return self.alpha / self.mfp

    @property
    def alpha_unreduced(self) -> Floats:
        """Albedo mu_s / (mu_s + mu_a) [-]."""
        return np.asarray(unreduced(self.alpha, self.g))

    def reflectance(self, illumination: str, n: float = 1.0) -> Floats:
        """Return A [-] under "searchlight" or "diffuse" illumination, of index n >= 1; see `reflectance_of`."""
        return reflectance_of(self.alpha, illumination, n, self.g)

    def length(self, name: str) -> Floats:
        """Return the length `name`, one of `BY_NAME` [length]; infinite where the medium has none."""
        return self.mfp * _named(name).factor(self.alpha, self.g)


def _named(name: str) -> Length:
    require(name in BY_NAME, "length", f"one of {', '.join(BY_NAME)}", name)
    return BY_NAME[name]


def _checked(named: dict[str, ArrayLike]) -> list[Floats]:
    """Return arrays of one shape, by name: alpha is at most 1, and a length is not 0."""
    numbers = [checked(name, values, 0.0, 1.0 if name == "alpha" else LARGEST) for name, values in named.items()]
    for name, values in zip(named, numbers, strict=True):
        require(name not in BY_NAME or np.all(values != 0.0), name, "> 0 and finite", 0)
    try:
        return [np.array(values) for values in np.broadcast_arrays(*numbers)]
    except ValueError:
        shapes = " and ".join(str(values.size) for values in numbers)
        raise InputError(f"{' and '.join(named)} must have one value or equally many, got {shapes}") from None
