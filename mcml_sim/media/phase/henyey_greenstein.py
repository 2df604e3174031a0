"""Henyey and Greenstein's phase function, the one of tissue optics; and scattering that forgets the direction."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax
import numpy as np

from mcml_sim.media.arrays import namespace
from mcml_sim.media.checks import is_number, require
from mcml_sim.media.phase.phase import Phase


@dataclass(frozen=True)
class HenyeyGreenstein(Phase):
    """Density (1 - g^2) / (4 pi (1 + g^2 - 2 g c)^(3/2)) [1/sr] (Henyey & Greenstein, Astrophys. J. 93, 70, 1941).

    g  mean cosine of the scattering angle [-], -1 < g < 1; InputError beyond, but not of a jax array, which nobody can
       look into while jax compiles

    All forms here are free of the usual division by g and of its cancellation: g = 0 is no special case, and 1 - c and
    1 + c keep their relative precision near c = 1 and -1.
    """

    g: Any

    def __post_init__(self) -> None:
        is_real = is_number(self.g) or isinstance(self.g, np.ndarray)
        is_cosine = isinstance(self.g, jax.Array) or (is_real and np.all(np.abs(self.g) < 1))
        require(is_cosine, "g", "a mean cosine in (-1, 1)", self.g)

    def pdf(self, cosine: Any) -> Any:
        xp = namespace(self.g, cosine)
        square = self._square(cosine)
        return (1 - self.g * self.g) / (2 * square * xp.sqrt(square)) / (2 * np.pi)

    def invert(self, cosine: Any) -> Any:
        xp, g = namespace(self.g, cosine), self.g
        distance = xp.sqrt(self._square(cosine))
        return 0.5 + 0.5 * (2 * cosine - 3 * g + g * g * g) / (distance * (1 - g * g + distance))

    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - c and 1 + c [-] for the sample of xi = (1 + v) / 2; both >= 0, and g -> -g, v -> -v swaps them."""
        g = self.g
        reciprocal = 1 / (1 + g * v)
        half_square = 0.5 * reciprocal * reciprocal
        below_one = (1 - g) * (1 - g) * half_square * ((1 - v) * (2 + g * (1 + v)))
        above_minus_one = (1 + g) * (1 + g) * half_square * ((1 + v) * (2 - g * (1 - v)))
        return below_one, above_minus_one

    def moment(self, l: int) -> Any:  # noqa: E741 - the field's letter
        return self.g**l

    def _square(self, cosine: Any) -> Any:
        """Return 1 + g^2 - 2 g c, without cancellation at c = 1."""
        g = self.g
        return (1 - g) * (1 - g) + 2 * g * (1 - cosine)


@dataclass(frozen=True)
class Isotropic(Phase):
    """Uniform density in all directions: p(c) = 1 / (4 pi) [1/sr].

    Henyey and Greenstein's phase function of g = 0, to the last bit of `deflection`: the cosine is v itself, which is
    what the kernels of the matched half space draw.
    """

    def pdf(self, cosine: Any) -> Any:
        return 0.0 * cosine + 1 / (4 * np.pi)

    def invert(self, cosine: Any) -> Any:
        return 0.5 * (1 + cosine)

    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - v and 1 + v [-]."""
        return 1 - v, 1 + v

    def moment(self, l: int) -> Any:  # noqa: E741 - the field's letter
        return 1.0 * (l == 0)
