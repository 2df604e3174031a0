"""Scattering that forgets where the light came from."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from mcml_sim.media.phase.phase import Phase


@dataclass(frozen=True)
class Isotropic(Phase):
    """Uniform density in all directions: p(c) = 1 / (4 pi) [1/sr].

    Henyey and Greenstein's phase function of g = 0, to the last bit of `deflection`: the cosine is v itself, which is
    what the kernels of the matched half space draw.
    """

    def pdf(self, cosine: Any) -> Any:
        """Return 1 / (4 pi) [1/sr]."""
        return 0.0 * cosine + 1 / (4 * np.pi)

    def invert(self, cosine: Any) -> Any:
        """Return (1 + c) / 2 [-]."""
        return 0.5 * (1 + cosine)

    def deflection(self, v: Any) -> tuple[Any, Any]:
        """Return 1 - v and 1 + v [-]."""
        return 1 - v, 1 + v

    def moment(self, l: int) -> Any:  # noqa: E741 - the field's letter
        """Return 1 for l = 0, else 0 [-]."""
        return 1.0 * (l == 0)
