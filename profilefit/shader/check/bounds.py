"""Bounds of the error of float32: a tenth of the model's own error, which its record states."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from mcml_sim.media.setting import Setting
from profilefit.errors import RecordError
from profilefit.fitting.measures import MEASURES, OF_MAP, OF_PROFILE
from profilefit.fitting.quality import albedo_quality, profile_quality
from profilefit.recipes.catalogue import LoadedLaw, albedo_laws, profile_laws
from profilefit.recipes.pipelines import QUALITY_ALBEDOS
from profilefit.recipes.record import Folder, Records, record_setting
from profilefit.recipes.targets import albedo_values

ALBEDOS = np.asarray(albedo_values(QUALITY_ALBEDOS))  # those of the records: none of them was fitted
# Rounding shall not show beside the model's error, nor change it.
ROUNDING_SHARE, MODEL_FACTOR = 0.1, 1.1
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


def of_profile(loaded: LoadedLaw, folder: Folder) -> ModelError:
    """Return the errors of a profile law, from its records or from the regenerated law of its name and setting.

    An error that no record states is measured on the float64 law, where the setting has an exact profile.
    """
    records = Records.of(folder)
    owner = loaded if loaded.records else _regenerated(loaded, profile_laws(records, matched=False))
    found = _recorded(owner.records if owner else (), PROFILE_MEASURES, records, loaded.setting)
    source = " + ".join(owner.records) if owner and found else "measured here"
    held = {name for each in loaded.records for name in records.content(each)["constants"]}
    whole = not loaded.records or held >= set(loaded.law.constant_names())
    if whole and "rel" not in found and loaded.setting.is_solved:
        quality = profile_quality(loaded.law, ALBEDOS)
        found |= {measure: MEASURES[measure].worst(getattr(quality, measure)) for measure in ("rel", "ks")}
    if not found:
        raise RecordError(f"{loaded.label} cannot be judged: no record states its errors; regenerate it")
    return ModelError(found, source)


def of_map(loaded: LoadedLaw, folder: Folder) -> ModelError:
    """Return the errors of a map, from its records or from the regenerated map of its name and setting."""
    records = Records.of(folder)
    owner = loaded if loaded.records else _regenerated(loaded, albedo_laws(records, matched=False))
    found = _recorded(owner.records, MAP_MEASURES, records, loaded.setting) if owner else {}
    source = " + ".join(owner.records) if owner and found else "measured here"
    if missing := [name for name in MAP_MEASURES if name not in found]:
        quality = albedo_quality(loaded.law)
        found |= {name: getattr(quality, name) for name in missing}
    return ModelError(found, source)


def _regenerated(loaded: LoadedLaw, laws: Sequence[LoadedLaw]) -> LoadedLaw | None:
    same = (law for law in laws if law.records and (law.name, law.setting) == (loaded.name, loaded.setting))
    return next(same, None)


def _recorded(names: Sequence[str], measures: Sequence[str], records: Records, setting: Setting) -> dict[str, float]:
    """Return what records state at a setting: of another index or g than their own what they measured around it."""
    found: dict[str, float] = {}
    for name in names:
        content = records.content(name)
        quality: dict[str, Any] = content.get("quality", {})
        try:
            if setting == record_setting(content):
                own = quality.get("regenerated", {})
                found |= {measure: MEASURES[measure].worst(own[measure]) for measure in measures if measure in own}
            else:
                found |= _around(setting, quality["by_index"], measures)
        except (KeyError, TypeError, ValueError):
            raise RecordError(f"record {name} is damaged: its quality has no numbers; regenerate it") from None
    return found


def _around(setting: Setting, by_index: dict[str, list[float]], measures: Sequence[str]) -> dict[str, float]:
    """Return the value at a measured index, else the worse of both neighbours; nothing below the least index.

    Where a law has g, return the worst of all.
    """
    if setting.g:
        return {measure: float(np.max(by_index[measure])) for measure in measures if measure in by_index}
    known, n = by_index["n"], setting.n
    i = int(np.searchsorted(known, n))
    if n < known[0]:
        return {}
    near = slice(i, i + 1) if i < len(known) and known[i] == n else slice(i - 1, i + 1)
    return {measure: float(np.max(by_index[measure][near])) for measure in measures if measure in by_index}
