"""Measures of a law's distance from exact light: one name each; those of maps are defined in `AlbedoQuality`.

Records, tables, figures, shader checks and exported texts take names and words from here.

rel      mean of |law/exact - 1| of R_d over r log-uniform in [0.01 l*, r at 99.5 % of the energy]
largest  the largest such error at a single radius
ks       max over r of |cdf_law - cdf_exact|
l1       half the integral of |2 pi r (R_law - R_exact)| over r, over A: misplaced energy
mse, r2  of R'_d = r R_d on an even grid over [0, r'_max], the range of the trimming (6) of Liang et al.; `_halves` of
         its first and second half, as in that paper's Table 1
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import TypeVar

import numpy as np
from numpy.typing import ArrayLike

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.fitting.profiles import trimmed_radius
from profilefit.laws.base import AlbedoLaw, Constants, ProfileLaw
from profilefit.laws.surface import surface_of

Law = TypeVar("Law", bound=Constants)
NEAREST = 0.01
ENERGY_WITHIN = 0.995
RADII = 400


@dataclass(frozen=True)
class Measure:
    """One measure.

    name     in records
    formula  what it is, as a formula or in words behind its name; words the same in a sentence
    unit     "-" for a pure number
    short    at the head of a narrow column; symbol where only what is wrong is named
    is_high  whether large is good, as of r2
    """

    name: str
    formula: str
    words: str = ""
    unit: str = "-"
    short: str = ""
    symbol: str = ""
    is_high: bool = False

    @property
    def header(self) -> str:
        """Name at the head of a narrow column."""
        return self.short or self.name

    @property
    def meaning(self) -> str:
        """The formula, with the unit if it has one."""
        return self.formula if self.unit == "-" else f"{self.formula} [{self.unit}]"

    def worst(self, values: ArrayLike) -> float:
        """Return the worst of its values, in its own unit."""
        return float(np.min(values) if self.is_high else np.max(values))


_ALL = (
    Measure("rel", "mean |model / exact − 1| of R_d", "mean relative error of R_d", symbol="rel"),
    Measure("ks", "max |cdf − exact cdf|", "error of the cdf", symbol="ks"),
    Measure("l1", "share of misplaced energy"),
    Measure("mse", "of r R_d", unit="1/mfp²"),
    Measure("r2", "of r R_d", is_high=True),
    Measure("mse near", "of the nearer half of the trimmed range", unit="1/mfp²"),
    Measure("mse far", "of the farther half"),
    Measure("largest", "max |model / exact − 1| of R_d", "largest error of R_d at a radius"),
    Measure("r2 near", "of the nearer half of the trimmed range", is_high=True),
    Measure("r2 far", "of the farther half", is_high=True),
    Measure("inversion_error", "max |cdf(r(ξ)) − ξ|", "error in xi", short="error", symbol="xi"),
    Measure("delta_A", "max error of A", "error of A", symbol="A"),
    Measure("delta_alpha", "max error of α", symbol="α"),
    Measure("largest_s", "max |√(1 − α) / exact − 1|"),
    Measure("monotone", "rises all the way"),
    Measure("at_one", "α at A = 1"),
    Measure("fold", "A at the fold"),
)
MEASURES: dict[str, Measure] = {one.name: one for one in _ALL}
# Measures in records: errors by albedo, and those of a map as a whole.
OF_PROFILE = ("rel", "ks", "inversion_error")
OF_MAP = ("delta_A", "delta_alpha", "largest_s", "monotone", "at_one", "fold")


@dataclass(frozen=True)
class Quality:
    """Measures of a profile law at each albedo (m,); the halves are (m, 2)."""

    alpha: Floats
    rel: Floats
    ks: Floats
    l1: Floats
    mse: Floats
    r2: Floats
    mse_halves: Floats
    r2_halves: Floats
    largest: Floats


def profile_quality(law: ProfileLaw, alpha: ArrayLike, setting: Setting | None = None) -> Quality:
    """Measure a law against the exact profile of a setting at each albedo in `alpha` (m,).

    setting  one that the law spans; its own by default
    """
    albedos = np.atleast_1d(np.asarray(alpha, float))
    law, setting = _under(law, setting)
    outer = _outer(tuple(albedos), setting)
    truths = [_truth(*pair, setting) for pair in zip(albedos.tolist(), outer, strict=True)]
    # All albedos in one call of each method.
    profile, even = (
        law.profile(np.stack(r), albedos[:, None]) for r in ([t.r for t in truths], [t.even for t in truths])
    )
    cdf = law.cdf(np.stack([t.far for t in truths]), albedos[:, None])
    rows = [_measures(*row) for row in zip(truths, profile, even, cdf, strict=True)]
    return Quality(albedos, *(np.array(column) for column in zip(*rows, strict=True)))


def _under(law: Law, setting: Setting | None) -> tuple[Law, Setting]:
    """Return the law under a setting that it spans: one compiled program serves all settings."""
    return (law, law.setting) if setting is None else (law.under(surface_of(setting)), setting)


def r_squared(data: Floats, law: Floats) -> float:
    """1 - sum (data - law)^2 / sum (data - mean)^2."""
    return float(1.0 - np.sum((data - law) ** 2) / np.sum((data - data.mean()) ** 2))


@dataclass(frozen=True)
class _Truth:
    """The exact half space where the measures look: log-spaced radii, far log-spaced edges, even radii [l*]."""

    r: Floats
    profile: Floats
    far: Floats
    cdf: Floats
    even: Floats
    scaled: Floats


@lru_cache(maxsize=64)
def _outer(alpha: tuple[float, ...], setting: Setting) -> list[float]:
    """Radii of `ENERGY_WITHIN` [l*], of all albedos in one call."""
    return list(np.asarray(exact.quantile(ENERGY_WITHIN, alpha, setting=setting)).tolist())


@lru_cache(maxsize=256)
def _truth(alpha: float, outer: float, setting: Setting) -> _Truth:
    r = np.geomspace(NEAREST, outer, RADII)
    far = np.geomspace(1e-4, 20.0 * outer, 4 * RADII)
    walked = np.append(r, outer + np.arange(1, 9) / 8)  # (6) may stop one stride beyond
    profile = np.asarray(exact.profile(walked, alpha, setting=setting))
    cut = trimmed_radius(walked, walked * profile)
    even = (np.arange(RADII) + 0.5) / RADII * cut
    scaled = even * np.asarray(exact.profile(even, alpha, setting=setting))
    return _Truth(r, profile[: r.size], far, np.asarray(exact.cdf(far, alpha, setting=setting)), even, scaled)


def _measures(truth: _Truth, profile: Floats, even: Floats, law_cdf: Floats) -> tuple[float | tuple[float, float], ...]:
    """Fields of `Quality` for one albedo, from a law's R_d at the truth's radii and even radii and its cdf far out."""
    error = np.abs(profile / truth.profile - 1.0)
    ks = np.max(np.abs(law_cdf - truth.cdf))
    # Half the total variation between two measures on fine rings, each of total A.
    l1 = 0.5 * np.sum(np.abs(np.diff(law_cdf) - np.diff(truth.cdf)))
    model = truth.even * even
    (mse, r2), *halves = (
        (float(np.mean((truth.scaled[part] - model[part]) ** 2)), r_squared(truth.scaled[part], model[part]))
        for part in (slice(None), slice(RADII // 2), slice(RADII // 2, None))
    )
    mse_halves, r2_halves = zip(*halves, strict=True)
    return float(error.mean()), float(ks), float(l1), mse, r2, mse_halves, r2_halves, float(error.max())


@dataclass(frozen=True)
class AlbedoQuality:
    """Measures of an A -> alpha map.

    delta_A      max |A_law(alpha) - A| over alpha in [0, 1]; where it is NaN the law has no A, and counts as |A - 1|
    delta_alpha  max |alpha_law(A) - alpha|; largest_s max |sqrt(1 - alpha_law) / sqrt(1 - alpha) - 1|, alpha < 1
    monotone     whether alpha_law rises up to the largest A there is; at_one alpha_law there, which is A = 1 where
                 nothing refracts; fold A where it turns (1 if it does not)
    """

    delta_A: float
    delta_alpha: float
    largest_s: float
    monotone: bool
    at_one: float
    fold: float


def albedo_quality(law: AlbedoLaw, setting: Setting | None = None) -> AlbedoQuality:
    """Measure a map on 1000 albedos even in sqrt(1 - alpha), and its shape on even reflectances.

    setting  one that the map spans; its own by default
    """
    law, setting = _under(law, setting)
    s = (np.arange(1000) + 0.5) / 1000
    alpha = 1.0 - s**2
    truth = np.asarray(exact.reflectance(alpha, setting=setting))
    mapped = np.asarray(law.reflectance(alpha))
    mapped_alpha = np.asarray(law.alpha(truth))
    with np.errstate(invalid="ignore"):
        ratio = np.sqrt(1.0 - mapped_alpha) / s
    even = np.linspace(0.0, law.reflectances.high, 20001)
    curve = np.asarray(law.alpha(even))
    rising = np.diff(curve) > 0
    fold = 1.0 if rising.all() else float(even[np.argmax(~rising)])
    return AlbedoQuality(
        float(np.max(np.where(np.isnan(mapped), 1.0 - truth, np.abs(mapped - truth)))),
        float(np.max(np.abs(mapped_alpha - alpha))),
        float(np.max(np.abs(np.nan_to_num(ratio, nan=np.inf) - 1.0))),
        bool(rising.all()),
        float(law.alpha(even[-1])),
        fold,
    )
