"""The A -> alpha map of Liang et al., equation (8)."""

from __future__ import annotations

import equinox as eqx
import jax.numpy as jnp
from jax import Array

from mcml_sim.media.setting import Setting
from profilefit.laws.base import AlbedoLaw
from profilefit.laws.entry import Entry, Range, Text
from profilefit.laws.evaluate import evaluated


class LiangAlbedo(AlbedoLaw):
    """alpha = p A / (A^2 + q A + w)   (8).

    Rises only up to A = sqrt(w); beyond that it folds back, so that two reflectances share one albedo, and
    alpha(1) = p / (1 + q + w) is not 1 unless the constants say so.

    p, q, w  constants [-]; as printed 5.67, 3.84, 0.84
    """

    setting: Setting = eqx.field(static=True)
    p: float
    q: float
    w: float
    entry = Entry(
        "liang",
        "map of Liang et al.",
        is_map=True,
        records=("albedo-liang",),
        as_fitted=True,
        text=Text("liang_albedo", (), clamps="A(alpha) to where it turns; alpha(A) to 1"),
    )

    def text_numbers(self) -> dict[str, float]:
        """Return the reflectance where it turns [-]."""
        return {"fold": self.fold}

    @property
    def albedos(self) -> Range:
        """Albedos below the largest, at the fold: it has no A for others."""
        return Range(0.0, float(self.alpha(self.fold)), open_high=True)

    @evaluated
    def alpha(self, reflectance) -> Array:
        """Single-scattering albedo alpha [-] at total reflectance A [-]."""
        return self.p * reflectance / (reflectance**2 + self.q * reflectance + self.w)

    @evaluated
    def reflectance(self, alpha) -> Array:
        """Total reflectance A [-] on the rising branch; NaN above the largest albedo that the map reaches."""
        half = 0.5 * (self.p - self.q * alpha)
        return alpha * self.w / (half + jnp.sqrt(half**2 - self.w * alpha**2))

    @property
    def fold(self) -> float:
        """The reflectance above which the map falls again [-]."""
        return float(self.w) ** 0.5
