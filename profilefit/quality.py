"""How far a law is from the exact profile: one name and one definition for each measure, used everywhere.

rel      mean of |law/exact - 1| of R_d over r log-uniform in [0.01 l, r at 99.5 % of the energy]
ks       max over r of |cdf_law - cdf_exact|
l1       half the integral of |2 pi r (R_law - R_exact)| over r, over A: misplaced energy
mse, r2  of R'_d = r R_d on an even grid over the first half, the second half and the whole of [0, r_max']
delta_A  max |A_law - A_exact|
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim import exact
from profilefit.laws.base import AlbedoLaw, ProfileLaw

Floats = NDArray[np.float64]
NEAREST = 0.01
ENERGY_WITHIN = 0.995
RADII = 400


@dataclass(frozen=True)
class Quality:
    """Measures of a profile law at each albedo (m,)."""

    alpha: Floats
    rel: Floats
    ks: Floats
    l1: Floats
    mse: Floats
    r2: Floats


def profile_quality(law: ProfileLaw, alpha: ArrayLike) -> Quality:
    """Measure a law against the exact profile of its own setting at each albedo in `alpha` (m,)."""
    albedos = np.atleast_1d(np.asarray(alpha, float))
    rows = [_at(law, float(value)) for value in albedos]
    return Quality(albedos, *(np.array(column) for column in zip(*rows, strict=True)))


def r_squared(data: Floats, law: Floats) -> float:
    """1 - sum (data - law)^2 / sum (data - mean)^2."""
    return float(1.0 - np.sum((data - law) ** 2) / np.sum((data - data.mean()) ** 2))


def _at(law: ProfileLaw, alpha: float) -> tuple[float, ...]:
    setting = law.setting
    outer = exact.quantile(ENERGY_WITHIN, alpha, setting=setting)
    r = np.geomspace(NEAREST, outer, RADII)
    truth = np.asarray(exact.profile(r, alpha, setting=setting))
    rel = np.mean(np.abs(law.profile(r, alpha) / truth - 1.0))
    far = np.geomspace(1e-4, 20.0 * outer, 4 * RADII)
    true_cdf = np.asarray(exact.cdf(far, alpha, setting=setting))
    law_cdf = law.cdf(far, alpha)
    ks = np.max(np.abs(law_cdf - true_cdf))
    # Half the total variation between two measures on fine rings, each of total A.
    l1 = 0.5 * np.sum(np.abs(np.diff(law_cdf) - np.diff(true_cdf)))
    even = (np.arange(RADII) + 0.5) / RADII * outer
    data = even * np.asarray(exact.profile(even, alpha, setting=setting))
    model = even * law.profile(even, alpha)
    return float(rel), float(ks), float(l1), float(np.mean((data - model) ** 2)), r_squared(data, model)


@dataclass(frozen=True)
class AlbedoQuality:
    """Measures of an A -> alpha map.

    delta_A      max |A_law(alpha) - A| over alpha in [0, 1]; where it is NaN the law has no A, and counts as |A - 1|
    delta_alpha  max |alpha_law(A) - alpha|; largest_s max |sqrt(1 - alpha_law) / sqrt(1 - alpha) - 1|, alpha < 1
    monotone     whether alpha_law rises all the way; at_one alpha_law(A = 1); fold A where it turns (1 if it does not)
    """

    delta_A: float
    delta_alpha: float
    largest_s: float
    monotone: bool
    at_one: float
    fold: float


def albedo_quality(law: AlbedoLaw) -> AlbedoQuality:
    """Measure a map on 1000 albedos even in sqrt(1 - alpha), and its shape on reflectances even in [0, 1]."""
    s = (np.arange(1000) + 0.5) / 1000
    alpha = 1.0 - s**2
    truth = np.asarray(exact.reflectance(alpha, setting=law.setting))
    mapped = np.asarray(law.reflectance(alpha))
    mapped_alpha = np.asarray(law.alpha(truth))
    with np.errstate(invalid="ignore"):
        ratio = np.sqrt(1.0 - mapped_alpha) / s
    even = np.linspace(0.0, 1.0, 20001)
    curve = np.asarray(law.alpha(even))
    rising = np.diff(curve) > 0
    fold = 1.0 if rising.all() else float(even[np.argmax(~rising)])
    return AlbedoQuality(
        float(np.max(np.where(np.isnan(mapped), 1.0 - truth, np.abs(mapped - truth)))),
        float(np.max(np.abs(mapped_alpha - alpha))),
        float(np.max(np.abs(np.nan_to_num(ratio, nan=np.inf) - 1.0))),
        bool(rising.all()),
        float(law.alpha(1.0)),
        fold,
    )
