"""The exact profile of one material as a table: what a law's closed form must beat to be worth having."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import jax.numpy as jnp
import numpy as np
from jax import Array
from numpy.typing import ArrayLike, NDArray

from mcml_sim import Setting, exact
from profilefit.shader.truth.exact_table import FARTHEST, NEAREST, STEP, Curves, exact_table
from profilefit.tradeoff.contenders import Contender

Floats = NDArray[np.float64]
NAME = "exact, tabulated"
SEARCHLIGHT = Setting()


@dataclass(frozen=True)
class Tabulated:
    """The exact half space under a searchlight, cubics between knots of ln r: as a law answers, one albedo a call."""

    setting: Setting = SEARCHLIGHT

    def curves(self, alpha: float) -> Curves:
        """The cubics of one albedo."""
        return exact_table(self.setting.illumination).curves([float(exact.reflectance(alpha, self.setting))])

    def profile(self, r: ArrayLike, alpha: float) -> Floats:
        """R_d [1/mfp^2] at radii (n,) [mfp], looked up in float32: its rounding is nearly all of the error."""
        return np.asarray(looked_up(self.curves(alpha), jnp.asarray(r, jnp.float32)), float)

    def cdf(self, r: ArrayLike, alpha: float) -> Floats:
        """Share of the energy within radii (n,) [mfp] [-]."""
        return self.curves(alpha).share(np.asarray(r, float)[None])[0]


def looked_up(curves: Curves, x: Array) -> Array:
    """R_d [1/mfp^2] at x [mfp]: a logarithm for the place, four numbers of the table, an exponential."""
    rows = jnp.asarray(curves.profile[0], x.dtype)
    near = jnp.clip(x, NEAREST, FARTHEST)
    place = (jnp.log(near) - float(np.log(NEAREST))) * (1.0 / STEP)
    k = jnp.minimum(place.astype(int), len(rows) - 1)
    t, c = place - k, rows[k]
    cubic = c[..., 0] + t * (c[..., 1] + t * (c[..., 2] + t * c[..., 3]))
    return float(curves.reflectance[0]) * jnp.exp(cubic - float(curves.kappa[0]) * near)


@dataclass(frozen=True)
class TableContender(Contender):
    """The table of one material, whatever the albedo. No sampler."""

    curves: Curves | None = None

    def profile(self, x: Array, alpha: Array) -> Array:
        if self.curves is None:
            raise ValueError("a table contender needs curves")
        del alpha
        return looked_up(self.curves, x)

    @property
    def parts(self) -> dict[str, Any]:
        return {"profile": self.profile}


def table_contender(material: float) -> TableContender:
    """The table as a contender; its error is that at every albedo, its time that of one material."""
    law: Any = Tabulated()
    return TableContender(NAME, law, law, (0, 0), None, law, curves=law.curves(material))
