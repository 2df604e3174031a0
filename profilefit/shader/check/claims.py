"""What the paper of Liang et al. promises of its printed constants, measured in float64, where rounding is no excuse.

Equation numbers are those of `laws.liang` and `laws.liang_albedo`.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from profilefit.laws.liang import Liang
from profilefit.laws.liang_albedo import LiangAlbedo
from profilefit.recipes.inventory import Named, profile_laws
from profilefit.recipes.record_folder import Folder
from profilefit.shader.check.bounds import ALBEDOS, MODEL_FACTOR, Bound
from profilefit.shader.check.dense_grid import ULP

Floats = NDArray[np.float64]
SHARES = np.linspace(0.0, 1.0, 2**12, endpoint=False)


def of_profile(one: Named, folder: Folder) -> list[Bound]:
    """The promises of (17), (21) and of alpha = 0; none for other laws, nor for constants that were regenerated."""
    if not isinstance(one.law, Liang) or one.records:
        return []
    regenerated = [law.law for law in profile_laws(folder) if law.records and isinstance(law.law, Liang)]
    least = max(float(np.max(np.abs(energy_ratio(law) - 1.0))) for law in regenerated[:1]) if regenerated else 0.0
    ratio = energy_ratio(one.law)
    worst = int(np.argmax(np.abs(ratio - 1.0)))
    drawn = np.asarray(one.law.sampler.unclipped(SHARES, 0.5))
    empty = np.isnan(one.law.profile(1.0, 0.0)) or np.isnan(one.law.cdf(1.0, 0.0))
    return [
        Bound(
            f"energy by (17), |cdf(r_max) - 1|; cdf(r_max) is {ratio.min():.3g} to {ratio.max():.3g}",
            float(np.abs(ratio - 1.0)[worst]),
            MODEL_FACTOR * least,
            f"α {ALBEDOS[worst]:.3g}",
        ),
        Bound(
            "share of radii min(g, r_max) (21) that are negative; the source takes |g|",
            float(np.mean(drawn < 0)),
            0.0,
            f"ξ < {one.law.eps:g}",
        ),
        Bound("the law is 0/0 (1 if so); the source takes 1e-6 for α", float(empty), 0.0, "α 0"),
    ]


def of_map(one: Named) -> list[Bound]:
    """The promises of (8): one alpha for each A, and alpha(1) = 1."""
    if not isinstance(one.law, LiangAlbedo) or one.records:
        return []
    fold, white = one.law.fold, float(one.law.alpha(1.0))
    return [
        Bound(f"map (8) at A = 1, |α - 1|; α is {white:.5f}", abs(white - 1.0), ULP, "A 1"),
        Bound(f"map (8), share of [0, 1] beyond its fold at A = {fold:.4f}", 1.0 - fold, 0.0),
    ]


def energy_ratio(law: Liang) -> Floats:
    """cdf(r_max) of (17) [-] at each of `ALBEDOS`, which should be 1."""
    whole = np.asarray(law.unscaled_energy(law.largest_radius(ALBEDOS), ALBEDOS))
    return whole / np.asarray(law.albedo.reflectance(ALBEDOS))
