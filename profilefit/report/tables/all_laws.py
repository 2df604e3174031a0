"""The laws of the inventory, measured against the exact half space of its own setting: profiles, maps, samplers."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from typing import Any, TypeVar

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.exact.light import unreduced
from profilefit.fitting.quality import AlbedoQuality, Quality, albedo_quality, profile_quality
from profilefit.fitting.sampling import LAST_SHARE, ExactTarget, SamplerQuality, drawn_by, sampler_quality
from profilefit.laws.base import Sampler
from profilefit.recipes.catalogue import Named
from profilefit.recipes.pipelines import QUALITY_ALBEDOS
from profilefit.recipes.targets import albedo_values

Floats = NDArray[np.float64]
Measured = TypeVar("Measured")
Track = Callable[[Iterator[Any], str, int], Iterator[Any]]
"""Items as they come, what they are, how many -> the items, as they are shown to come."""
# Where laws are judged: held-out albedos. Samplers take longer and hardly change with alpha.
ALBEDOS = np.asarray(albedo_values(QUALITY_ALBEDOS))
SAMPLED_ALBEDOS = (0.1, 0.5, 0.9)
# A law without a shader source is a quadrature of tens of milliseconds, which its sampler inverts in many steps: one
# albedo will do.
SLOW_ALBEDOS = (0.5,)
SHARES = 256


@dataclass(frozen=True)
class MeasuredSampler:
    """One sampler of a law.

    quality      for the light of the law itself, at reduced albedos, its lengths in l*
    exact_error  (m,) max over xi in [0, 0.999] of |exact cdf(r(xi)) - xi| at the same albedos [-]; of two xi that draw
                 one radius, the one meant
    """

    of: Named
    name: str
    quality: SamplerQuality
    exact_error: Floats


def untracked(items: Iterator[Measured], title: str, total: int) -> Iterator[Measured]:
    """The items, without any progress shown."""
    del title, total
    return items


def for_each(
    measure: Callable[[Named], Measured], laws: Sequence[Named], track: Track = untracked, title: str = ""
) -> list[Measured]:
    """`measure` of every law, in order, side by side: most of it is compiling and small arrays, which take one core."""
    with ThreadPoolExecutor(os.cpu_count()) as pool:
        return list(track(pool.map(measure, laws), title, len(laws)))


def measured_profile(one: Named, alpha: ArrayLike = ALBEDOS) -> Quality:
    """The measures of a profile law at `alpha` (m,)."""
    return profile_quality(one.law, alpha)


def measured_map(one: Named) -> AlbedoQuality:
    """The measures of an A -> alpha map."""
    return albedo_quality(one.law)


def measured_samplers(one: Named, alpha: Sequence[float] | None = None) -> list[MeasuredSampler]:
    """Every sampler of a profile law at (reduced) `alpha` (m,)."""
    albedos = alpha or (SAMPLED_ALBEDOS if one.law.entry.has_text else SLOW_ALBEDOS)
    found = []
    for name, sampler in one.law.in_reduced().samplers.items():
        errors = np.array([_exact_error(one.law.samplers[name], float(value)) for value in albedos])
        found.append(MeasuredSampler(one, name, sampler_quality(sampler, albedos), errors))
    return found


def _exact_error(sampler: Sampler, reduced: float) -> float:
    xi, setting = np.linspace(0.0, LAST_SHARE, SHARES), sampler.law.setting
    share = drawn_by(sampler, xi, float(unreduced(reduced, setting.g)), ExactTarget(setting))
    return float(np.max(np.abs(share - xi)))
