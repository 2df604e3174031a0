"""Bounds of the error of float32, a tenth of the model's own, which its record states; where a law holds, and promises.

What lies outside of where a law holds is counted apart and breaks nothing. What its paper promises of printed constants
is measured in float64, where rounding is no excuse; equation numbers are those of `laws.liang` and `laws.printed_maps`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from mcml_sim import exact
from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting
from profilefit.errors import RecordError
from profilefit.fitting.quality import MEASURES, OF_MAP, OF_PROFILE, albedo_quality, profile_quality
from profilefit.laws.base import EVERYWHERE, AlbedoLaw, Entry, Range
from profilefit.laws.liang import Liang
from profilefit.laws.printed_maps import LiangAlbedo
from profilefit.recipes.catalogue import LoadedLaw, albedo_laws, profile_laws
from profilefit.recipes.pipelines import QUALITY_ALBEDOS
from profilefit.recipes.record import Folder, Records, record_setting
from profilefit.recipes.targets import albedo_values

Mask = NDArray[np.bool_]
ULP = 2.0**-24  # half a step of float32 below 1: what rounding a share costs
ALBEDOS = np.asarray(albedo_values(QUALITY_ALBEDOS))  # those of the records: none of them was fitted
# Rounding shall not show beside the model's error, nor change it.
ROUNDING_SHARE, MODEL_FACTOR = 0.1, 1.1
SHARES = np.linspace(0.0, 1.0, 2**12, endpoint=False)
PROFILE_MEASURES, MAP_MEASURES = OF_PROFILE, OF_MAP[:2]


@dataclass(frozen=True)
class Bound:
    """A number and the largest that it may be; where it is found, in words. NaN breaks every bound."""

    name: str
    value: float
    limit: float
    where: str = ""

    @property
    def broken(self) -> bool:
        return not self.value <= self.limit

    def __str__(self) -> str:
        over = f", {self.value / self.limit:.3g} times that" if self.limit > 0 and np.isfinite(self.value) else ""
        place = f" at {self.where}" if self.where else ""
        return f"{self.name}: {self.value:.4g}{place}; bound {self.limit:.4g}{over}"


@dataclass(frozen=True)
class ModelError:
    """A law's errors [-], worst over albedos, by the names of `quality`; `source` says which record states them."""

    values: dict[str, float]
    source: str

    def get(self, measure: str) -> float | None:
        return self.values.get(measure)


def model_of_profile(loaded: LoadedLaw, folder: Folder) -> ModelError:
    """Return the errors of a profile law, from its records or from the regenerated law of its name and setting.

    An error that no record states is measured on the float64 law, where the setting has an exact profile.
    """
    records = Records.of(folder)
    model = _stated(loaded, records, profile_laws, PROFILE_MEASURES)
    held = {name for each in loaded.records for name in records.content(each)["constants"]}
    whole = not loaded.records or held >= set(loaded.law.constant_names())
    if whole and "rel" not in model.values and loaded.setting.is_solved:
        quality = profile_quality(loaded.law, ALBEDOS)
        model.values.update({name: MEASURES[name].worst(getattr(quality, name)) for name in ("rel", "ks")})
    if not model.values:
        raise RecordError(f"{loaded.label} cannot be judged: no record states its errors; regenerate it")
    return model


def model_of_map(loaded: LoadedLaw, folder: Folder) -> ModelError:
    """Return the errors of a map, from its records or from the regenerated map of its name and setting."""
    model = _stated(loaded, Records.of(folder), albedo_laws, MAP_MEASURES)
    if missing := [name for name in MAP_MEASURES if name not in model.values]:
        quality = albedo_quality(loaded.law)
        model.values.update({name: getattr(quality, name) for name in missing})
    return model


def _stated(
    loaded: LoadedLaw, records: Records, laws: Callable[..., list[LoadedLaw]], measures: Sequence[str]
) -> ModelError:
    """Return what the records of a law, or of the regenerated one of its name and setting, state at its setting.

    Of another index or g than their own they state what they measured around it.
    """
    names: Sequence[str] = loaded.records
    if not names:
        own = loaded.name, loaded.setting
        same = (law.records for law in laws(records, matched=False) if (law.name, law.setting) == own)
        names = next(filter(None, same), ())
    found: dict[str, float] = {}
    for name in names:
        content = records.content(name)
        quality: dict[str, Any] = content.get("quality", {})
        try:
            if loaded.setting == record_setting(content):
                known = quality.get("regenerated", {})
                found |= {measure: MEASURES[measure].worst(known[measure]) for measure in measures if measure in known}
            else:
                found |= _around(loaded.setting, quality["by_index"], measures)
        except (KeyError, TypeError, ValueError):
            raise RecordError(f"record {name} is damaged: its quality has no numbers; regenerate it") from None
    return ModelError(found, " + ".join(names) if found else "measured here")


def _around(setting: Setting, by_index: dict[str, list[float]], measures: Sequence[str]) -> dict[str, float]:
    """Return the value at a measured index, else the worse of both neighbours; nothing below the least index.

    Where a law has g, return the worst of all.
    """
    near: slice = slice(None)
    if not setting.g:
        known, n = by_index["n"], setting.n
        i = int(np.searchsorted(known, n))
        if n < known[0]:
            return {}
        near = slice(i, i + 1) if i < len(known) and known[i] == n else slice(i - 1, i + 1)
    return {measure: float(np.max(by_index[measure][near])) for measure in measures if measure in by_index}


@dataclass(frozen=True)
class Validity:
    """Range of a profile law: `alpha` of its profile and cdf, `drawn` and `xi` of its sampler; None nowhere."""

    alpha: Range | None
    drawn: Range | None
    xi: Range = EVERYWHERE


def valid_profile(loaded: LoadedLaw, folder: Folder) -> Validity:
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


def valid_map(loaded: LoadedLaw, folder: Folder) -> tuple[Range, Range]:
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
    energy = f"energy by (17), |cdf(r_max) - 1|; cdf(r_max) is {ratio.min():.3g} to {ratio.max():.3g}"
    off, share = float(np.abs(ratio - 1.0)[worst]), float(np.mean(drawn < 0))
    negative = "share of radii min(g, r_max) (21) that are negative; the source takes |g|"
    return [
        Bound(energy, off, MODEL_FACTOR * least, f"α {ALBEDOS[worst]:.3g}"),
        Bound(negative, share, 0.0, f"ξ < {loaded.law.eps:g}"),
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
