"""Every law that loads, measured against the exact half space of its own setting: profiles, maps, samplers."""

from __future__ import annotations

import os
from collections.abc import Callable, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.setting import Setting
from profilefit import catalogue, record
from profilefit.laws import published
from profilefit.laws.base import Sampler
from profilefit.laws.beam_diffusion import BeamDiffusion
from profilefit.pipelines import QUALITY_ALBEDOS
from profilefit.quality import AlbedoQuality, Quality, albedo_quality, profile_quality
from profilefit.report.content import converged
from profilefit.sampling import LAST_SHARE, ExactTarget, SamplerQuality, sampler_quality
from profilefit.targets import albedo_values

Floats = NDArray[np.float64]
Records = Sequence[str] | None
Measured = TypeVar("Measured")
# What tells a map's name in `published.SETS` and in `catalogue.REGENERATED` from a profile law's.
PRINTED_MAP, REGENERATED_MAP = "_albedo", "albedo "
# Where laws are judged: albedos that were not fitted. Samplers take longer and hardly change with alpha.
ALBEDOS = np.asarray(albedo_values(QUALITY_ALBEDOS))
SAMPLED_ALBEDOS = (0.1, 0.5, 0.9)
# Laws whose cdf is a quadrature of tens of milliseconds, which their sampler inverts step by step: one will do.
SLOW, SLOW_ALBEDOS = (BeamDiffusion,), (0.5,)
SHARES = 256


@dataclass(frozen=True)
class Named:
    """A law with its constants, at home in one setting.

    name     of the law in the catalogue; constants the printed set or the records they come from, "" if it has none
    records  the names of those records
    """

    name: str
    constants: str
    law: Any
    records: tuple[str, ...] = ()

    @property
    def label(self) -> str:
        """What a table calls it: its record, or law and printed set."""
        if self.records:
            return self.records[0]
        return f"{self.name}, {self.constants}" if self.constants else self.name

    @property
    def setting(self) -> Setting:
        setting: Setting = self.law.setting
        return setting


@dataclass(frozen=True)
class MeasuredSampler:
    """One sampler of a law.

    quality      for the light of the law itself
    exact_error  (m,) max over xi in [0, 0.999] of |exact cdf(r(xi)) - xi| at the same albedos [-]
    """

    of: Named
    name: str
    quality: SamplerQuality
    exact_error: Floats


def profile_laws(folder: Path, records: Records = None) -> list[Named]:
    """Profile laws of every setting that has an exact profile; only those of `records`, where such are named.

    Records of failed fits have no law.
    """
    return [*_whole_laws(folder, records), *_single_records(folder, records, ("profile", "as-published"))]


def sampled_laws(folder: Path, records: Records = None) -> list[Named]:
    """Laws whose samplers are worth measuring: whole ones, and inverse cdfs beside a printed profile."""
    return [*_whole_laws(folder, records), *_single_records(folder, records, ("inverse",))]


def albedo_laws(folder: Path, records: Records = None) -> list[Named]:
    """Maps between alpha and A of every setting that has an exact A."""
    printed = [
        Named(name, s.name, catalogue.albedo_law(name, s.name, folder=folder))
        for s in published.SETS
        if (name := s.law.removesuffix(PRINTED_MAP)) != s.law
    ]
    keys = [key for key in catalogue.REGENERATED if key.startswith(REGENERATED_MAP)]
    return _asked([*printed, *_regenerated(folder, keys)], records)


def for_each(measure: Callable[[Named], Measured], laws: Sequence[Named]) -> list[Measured]:
    """`measure` of every law, in order, side by side: most of it is compiling and small arrays, which take one core."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(pool.map(measure, laws))


def measured_profile(one: Named, alpha: ArrayLike = ALBEDOS) -> Quality:
    """The measures of a profile law at `alpha` (m,)."""
    return profile_quality(one.law, alpha)


def measured_map(one: Named) -> AlbedoQuality:
    """The measures of an A -> alpha map."""
    return albedo_quality(one.law)


def measured_samplers(one: Named, alpha: Sequence[float] | None = None) -> list[MeasuredSampler]:
    """Every sampler of a profile law at `alpha` (m,)."""
    albedos = alpha or (SLOW_ALBEDOS if isinstance(one.law, SLOW) else SAMPLED_ALBEDOS)
    found = []
    for name, sampler in one.law.samplers.items():
        errors = np.array([_exact_error(sampler, float(value)) for value in albedos])
        found.append(MeasuredSampler(one, name, sampler_quality(sampler, albedos), errors))
    return found


def _exact_error(sampler: Sampler, alpha: float) -> float:
    xi = np.linspace(0.0, LAST_SHARE, SHARES)
    share = ExactTarget(sampler.law.setting).cdf(np.asarray(sampler.sample(xi, alpha)), alpha)
    return float(np.max(np.abs(share - xi)))


def _whole_laws(folder: Path, records: Records) -> list[Named]:
    """Printed sets, laws without constants, and laws made of all their regenerated records."""
    known = catalogue.PROFILE_LAWS
    printed = [
        Named(s.law, s.name, catalogue.load(s.law, s.name, folder=folder)) for s in published.SETS if s.law in known
    ]
    bare = [name for name, kind in known.items() if not kind.constant_names()]
    physical = [Named(name, "", catalogue.load(name, folder=folder)) for name in bare]
    keys = [key for key in catalogue.REGENERATED if not key.startswith(REGENERATED_MAP)]
    return _asked([*printed, *physical, *_regenerated(folder, keys)], records)


def _regenerated(folder: Path, keys: Sequence[str]) -> list[Named]:
    """The laws under these keys of `catalogue.REGENERATED`, in every setting whose records all are in the folder."""
    there = _usable(folder)
    settings = dict.fromkeys(catalogue.record_setting(content) for content in there.values())
    found = []
    for key in keys:
        name = key.removeprefix(REGENERATED_MAP)
        load = catalogue.load if name == key else catalogue.albedo_law
        for setting in settings:
            records = tuple(catalogue.record_name(base, setting) for base in catalogue.REGENERATED[key])
            if all(one in there for one in records):
                law = load(name, setting=setting, folder=folder)
                found.append(Named(name, " + ".join(records), law, records))
    return found


def _single_records(folder: Path, records: Records, pipelines: tuple[str, ...]) -> list[Named]:
    """Records that no law takes by its name alone; constants that they do not hold are as printed."""
    taken = {name for one in _regenerated(folder, list(catalogue.REGENERATED)) for name in one.records}
    found = []
    for name, content in _usable(folder).items():
        if name not in taken and content["pipeline"] in pipelines:
            law = catalogue.load(content["law"], str(folder / f"{name}.json"), folder=folder)
            found.append(Named(content["law"], name, law, (name,)))
    return _asked(found, records)


def _usable(folder: Path) -> dict[str, dict[str, Any]]:
    """The records of fits that converged, in settings that have an exact profile."""
    found = {name: record.read(path, whole=True) for name, path in record.available(folder).items()}
    return {name: content for name, content in found.items() if "constants" in content and _is_usable(content)}


def _is_usable(content: dict[str, Any]) -> bool:
    return converged(content) and catalogue.record_setting(content).is_matched_isotropic


def _asked(found: list[Named], records: Records) -> list[Named]:
    return found if records is None else [one for one in found if set(one.records) & set(records)]
