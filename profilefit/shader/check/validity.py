"""Validity of a law: where it holds, and what its paper promises of its printed constants.

What lies outside of where it holds is counted apart and breaks nothing. Promises are measured in float64, where
rounding is no excuse; equation numbers are those of `laws.liang` and `laws.printed_maps`.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim import exact
from profilefit.laws.base import EVERYWHERE, AlbedoLaw, Entry, Range
from profilefit.laws.liang import Liang
from profilefit.laws.printed_maps import LiangAlbedo
from profilefit.recipes.catalogue import LoadedLaw, profile_laws
from profilefit.recipes.record import Folder, Records
from profilefit.shader.check.bounds import ALBEDOS, MODEL_FACTOR, Bound
from profilefit.shader.check.dense_grid import ULP

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
SHARES = np.linspace(0.0, 1.0, 2**12, endpoint=False)


@dataclass(frozen=True)
class Validity:
    """Range of a profile law: `alpha` of its profile and cdf, `drawn` and `xi` of its sampler; None nowhere."""

    alpha: Range | None
    drawn: Range | None
    xi: Range = EVERYWHERE


def of_profile(loaded: LoadedLaw, folder: Folder) -> Validity:
    """Return a law's own range; a fitted inverse may hold for the albedos of its record only, and for some of xi.

    A record that is of the profile alone, or of the inverse alone, states nothing of the other.
    """
    entry: Entry = loaded.law.entry
    if not (entry.as_fitted and loaded.records):
        return Validity(entry.alpha, entry.alpha)
    contents = [Records.of(folder).content(name) for name in loaded.records]
    inverse = next((content for content in contents if content["pipeline"] == "inverse"), None)
    whole = inverse is None or len(contents) > 1
    return Validity(entry.alpha if whole else None, _fitted(inverse) if inverse else None, entry.xi)


def _fitted(content: dict[str, Any]) -> Range:
    """Return the albedos of a record's protocol."""
    albedos = content["protocol"]["albedos"]
    return Range(albedos["low"], albedos["high"])


def masks(valid: Validity, alpha: Floats, xi: Floats) -> tuple[Mask, Mask]:
    """Return masks of the albedos (m, 1, 1) of the profile, and of albedos and shares (m, n, 1) of the sampler."""
    profiled, drawn = (
        np.zeros(alpha.shape, bool) if span is None else span.holds(alpha) for span in (valid.alpha, valid.drawn)
    )
    return profiled[:, None, None], drawn[:, None, None] & valid.xi.holds(xi)[:, None]


def of_map(loaded: LoadedLaw, folder: Folder) -> tuple[Range, Range]:
    """Reflectances A and albedos alpha of a map: by its own statement, and of its record where it holds no further."""
    law: AlbedoLaw = loaded.law
    if not (law.entry.as_fitted and loaded.records):
        return law.reflectances, law.albedos
    fitted = _fitted(Records.of(folder).content(loaded.records[0]))
    low, high = np.asarray(exact.reflectance([fitted.low, fitted.high], setting=law.setting))
    return Range(float(low), float(high)), Range(fitted.low, min(fitted.high, law.albedos.high), open_high=True)


def promised_by_profile(loaded: LoadedLaw, folder: Folder) -> list[Bound]:
    """Return what Liang et al. say of (17), (21) and of alpha = 0; none of other laws, nor of regenerated constants."""
    if not isinstance(loaded.law, Liang) or loaded.records:
        return []
    regenerated = [law.law for law in profile_laws(folder) if law.records and isinstance(law.law, Liang)]
    least = max(float(np.max(np.abs(energy_ratio(law) - 1.0))) for law in regenerated[:1]) if regenerated else 0.0
    ratio = energy_ratio(loaded.law)
    worst = int(np.argmax(np.abs(ratio - 1.0)))
    drawn = np.asarray(loaded.law.sampler.unclipped(SHARES, 0.5))
    empty = np.isnan(loaded.law.profile(1.0, 0.0)) or np.isnan(loaded.law.cdf(1.0, 0.0))
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
            f"ξ < {loaded.law.eps:g}",
        ),
        Bound("the law is 0/0 (1 if so); the source takes 1e-6 for α", float(empty), 0.0, "α 0"),
    ]


def promised_by_map(loaded: LoadedLaw) -> list[Bound]:
    """Return what they say of (8): one alpha for each A, and alpha(1) = 1."""
    if not isinstance(loaded.law, LiangAlbedo) or loaded.records:
        return []
    fold, white = loaded.law.fold, float(loaded.law.alpha(1.0))
    return [
        Bound(f"map (8) at A = 1, |α - 1|; α is {white:.5f}", abs(white - 1.0), ULP, "A 1"),
        Bound(f"map (8), share of [0, 1] beyond its fold at A = {fold:.4f}", 1.0 - fold, 0.0),
    ]


def energy_ratio(law: Liang) -> Floats:
    """cdf(r_max) of (17) [-] at each of `ALBEDOS`, which should be 1."""
    whole = np.asarray(law.unscaled_energy(law.largest_radius(ALBEDOS), ALBEDOS))
    return whole / np.asarray(law.albedo.reflectance(ALBEDOS))
