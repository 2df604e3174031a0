"""Fields of a renderer for a medium: a colour and a length, by product, version and method.

Most engines turn the typed colour into an albedo by a map of their own, so that the number to type is the map's inverse
at the medium's alpha, and not its A. Engines that blur with a profile multiply by the colour: for these it is A under
an index-matched surface, whatever n the medium has. What a renderer then shows is A only where light enters as the map
assumes: `Engine.renders` has what Cycles' walks show instead.

Numbers and formulas are quoted from the sources that `Engine.source` names, read on 2026-11-30; no code is.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from profilefit.convert.colour import reflectance_of
from profilefit.convert.lengths import Factor

Floats = NDArray[np.float64]
Colour = Callable[[Floats, float, float], Floats]  # of reduced albedo, index n of the surface, and g
METRES = {"um": 1e-6, "µm": 1e-6, "μm": 1e-6, "mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254}
ANY_G, ISOTROPIC = (-1.0, 1.0), (0.0, 0.0)


@dataclass(frozen=True, kw_only=True)
class Engine:
    """Two numbers that fields of a renderer take for a medium.

    name     key of the row in --json
    version  of the product, that the numbers hold for
    fields   names of the colour, of the length and of the world's scale in the product; the last may be ""
    colour   what is typed; None where no source says
    length   what is typed over the transport mean free path [-]
    power    -1 where the inverse of that length is typed
    unit     that the length's field has; "" for whatever one unit of the scene is
    scale    value of the world's scale with which the field has that unit
    formula  how both numbers follow
    source   of the formulas, with version or date
    checked  against what: source, measurement, an unofficial copy, a manual's wording
    g        range that the product takes, or that the source was read for
    renders  A [-] that it shows of the albedo, seen from the normal, where that is neither its A nor unknown
    """

    name: str
    product: str
    version: str
    method: str
    fields: tuple[str, str, str]
    colour: Colour | None
    length: Factor
    power: int = 1
    unit: str = ""
    scale: float | None = None
    formula: str
    source: str
    checked: str = "source"
    g: tuple[float, float] = ANY_G
    renders: Callable[[Floats], Floats] | None = None

    @property
    def title(self) -> str:
        """Product, version and method."""
        return f"{self.product} {self.version} {self.method}"

    def typed_colour(self, alpha: Floats, n: float = 1.0, g: float = 0.0) -> Floats | None:
        """Return the colour to type [-]: None where no source says, NaN where the product has no such g."""
        if self.colour is None:
            return None
        return np.asarray(self.colour(alpha, n, g)) if self._takes(g) else np.full_like(alpha, np.nan)

    def typed_length(self, alpha: Floats, mfp: Floats, g: float = 0.0, unit: str = "") -> Floats:
        """Return the length to type, of an mfp in this unit; in that of mfp where either has none."""
        if not self._takes(g):
            return np.full_like(alpha, np.nan)
        units = METRES[unit] / METRES[self.unit] if unit and self.unit else 1.0
        return (units * mfp * self.length(alpha, g)) ** self.power

    def rendered(self, alpha: Floats, g: float = 0.0) -> Floats | None:
        """Return the A [-] that the product shows of this medium; None where that is its A, or unknown."""
        return self.renders(alpha) if self.renders and g == 0.0 else None

    def _takes(self, g: float) -> bool:
        return self.g[0] <= g <= self.g[1]


def diffuse(alpha: Floats, n: float, g: float) -> Floats:
    """Return A [-] under diffuse illumination and an index-matched surface."""
    del n
    return reflectance_of(alpha, "diffuse", 1.0, g)


def searchlight(alpha: Floats, n: float, g: float) -> Floats:
    """Return A [-] under a pencil beam and an index-matched surface."""
    del n
    return reflectance_of(alpha, "searchlight", 1.0, g)


def by(colour: Callable[[Floats], Floats]) -> Colour:
    """Return the colour as one of reduced albedo alone."""
    return lambda alpha, n, g: colour(alpha)
