"""Derived quantities with their errors: reflectance, radius of a share of the energy, profile, by a fit's covariances.

Two errors each. Statistical: the photons' covariance of the constants, carried over by the derivative. Model: how far
the law that was fitted is from the truth, by the process that its residuals are a draw of (`discrepancy`).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.stats import norm

from mcml_sim.errors import InputError
from profilefit.fitting import discrepancy
from profilefit.fitting.discrepancy import Discrepancy, predicted, unit_energy
from profilefit.fitting.estimate import Fit, ResidualFunction
from profilefit.fitting.objectives import NO_LIMITS, Rings
from profilefit.fitting.profiles import Profiles
from profilefit.fitting.quality import ENERGY_WITHIN
from profilefit.laws.base import OF_MAPS
from profilefit.laws.liang import QUANTILES

Floats = NDArray[np.float64]
# Albedos that a record's table shows.
SHOWN = (0.2, 0.5, 0.8, 0.95, 0.99)
# Rings fine enough that their middles stand for them, from the source to where no light is left [mfp].
EDGES = np.concatenate([[0.0], np.geomspace(1e-3, 1e3, 601)])


@dataclass(frozen=True)
class Quantity:
    """Numbers (k,) with two standard errors; statistical is NaN where the truth had no photon noise."""

    value: Floats
    statistical: Floats
    model: Floats

    @property
    def error(self) -> Floats:
        """Both together (k,)."""
        return np.hypot(np.nan_to_num(self.statistical), self.model)

    def interval(self, level: float = 0.95) -> tuple[Floats, Floats]:
        """Low and high ends (k,) of the interval that holds the truth with probability `level`."""
        half = norm.isf(0.5 - level / 2) * self.error
        return self.value - half, self.value + half


@dataclass(frozen=True)
class LawWithErrors:
    """A law with what its fit knows of its errors.

    law, free names of its constants, objective it was fitted by; statistical (p, p), None without photon noise
    """

    law: Any
    free: tuple[str, ...]
    objective: str
    statistical: Floats | None
    discrepancy: Discrepancy | None

    @classmethod
    def of_fit(cls, fit: Fit, process: Discrepancy | None) -> LawWithErrors:
        return cls(fit.law, fit.free, fit.objective, fit.statistical, process)

    @classmethod
    def of_record(cls, law: Any, content: Mapping[str, Any], arrays: Mapping[str, Floats]) -> LawWithErrors:
        """`law` with the constants of a record, and what that record says; old ones say nothing of the model."""
        covariance = content.get("covariance", {})
        statistical = covariance.get("statistical")
        noise = None if statistical is None else np.asarray(statistical, float)
        objective = content["protocol"]["weighting"]["objective"]
        return cls(law, tuple(covariance.get("names", ())), objective, noise, discrepancy.read(content, arrays))

    @property
    def reduced(self) -> Any:
        """The law of the reduced albedos and radii that all quantities here are of."""
        return self.law.in_reduced()

    @property
    def is_map(self) -> bool:
        return self.objective in OF_MAPS

    def statistical_error(self, slope: Floats) -> Floats:
        """Return statistical errors (k,) of quantities whose derivatives are `slope` (k, p)."""
        if self.statistical is None:
            return np.full(len(slope), np.nan)
        return np.sqrt(np.einsum("kp,pq,kq->k", slope, self.statistical, slope))


@dataclass(frozen=True)
class AtAlbedo:
    """A profile law at one albedo, ring by ring of `EDGES`.

    energy (n,) [-]; slope (n, p) d energy / d constants
    """

    known: LawWithErrors
    alpha: float

    @cached_property
    def _predicted(self) -> tuple[Floats, Floats]:
        problem = ResidualFunction(self.known.objective, self.known.free)
        total = float(self.known.reduced.albedo.reflectance(self.alpha))
        alone, none = np.array([self.alpha]), np.zeros((1, EDGES.size - 1))
        rings = Rings(alone, EDGES, none, np.array([total]), none, alone, np.array(NO_LIMITS), np.zeros(0))
        energy, slope = predicted(problem, self.known.reduced, rings)
        lit = energy[0] > 0  # (7) ends where it falls below zero
        return np.where(lit, energy[0], 0.0), np.where(lit[:, None], slope[0], 0.0)

    @property
    def energy(self) -> Floats:
        return self._predicted[0]

    @property
    def slope(self) -> Floats:
        return self._predicted[1]

    @cached_property
    def covariance(self) -> Floats:
        """Covariance (n, n) of the model's error in ring energies."""
        process, n = self.known.discrepancy, EDGES.size - 1
        if process is None:
            return np.full((n, n), np.nan)
        unit = unit_energy(self.known.objective, self.energy[None], np.array([self.alpha]), EDGES)[0]
        unit = np.where(self.energy > 0, unit, 0.0)
        relative = self.slope / np.where(unit > 0, unit, 1.0)[:, None]
        u, s = np.log(self.middle), process.places(np.full(n, self.alpha), self.known.law.setting)
        return process.law_covariance(u, s, np.where(unit[:, None] > 0, relative, 0.0)) * np.outer(unit, unit)

    @property
    def middle(self) -> Floats:
        """(n,) [mfp]."""
        return np.sqrt(EDGES[1:] * np.maximum(EDGES[:-1], 0.25 * EDGES[1:]))

    def radius(self, share: float) -> tuple[float, float, float]:
        """Within which `share` of the energy leaves [mfp], and its two errors."""
        total = self.energy.sum()
        inside = np.cumsum(self.energy) / total
        place = int(np.searchsorted(inside, share))
        weight = (np.arange(inside.size) <= place) * 1.0
        before = inside[place - 1] if place else 0.0
        part = (share - before) / (inside[place] - before)
        weight[place] = part
        value = EDGES[place] + part * (EDGES[place + 1] - EDGES[place])
        density = (inside[place] - before) / (EDGES[place + 1] - EDGES[place])
        moved = -(weight - share) / total / density  # d radius / d ring energy
        gain = moved @ self.slope
        model = float(np.sqrt(max(moved @ self.covariance @ moved, 0.0))) if self.known.discrepancy else np.nan
        return float(value), float(self.known.statistical_error(gain[None])[0]), model


def radius(known: LawWithErrors, alpha: ArrayLike, share: float = ENERGY_WITHIN) -> Quantity:
    """Radius (k,) [mfp] within which `share` of the reflected light leaves, at albedos `alpha` (k,).

    Its model error does not include light beyond 99.5 % of the energy, where the discrepancy is not fitted: for
    shares near that, `tail_error` states the error of such radii.
    """
    if known.is_map or not 0 < share < 1:
        raise InputError(f"share must be in (0, 1), of a profile law, got {share!r} of {type(known.law).__name__}")
    rows = [AtAlbedo(known, float(a)).radius(share) for a in np.atleast_1d(alpha)]
    return Quantity(*np.array(rows).T)


def profile(known: LawWithErrors, r: ArrayLike, alpha: float) -> Quantity:
    """R_d (k,) [1/mfp^2] at radii `r` (k,) [mfp] of one albedo."""
    if known.is_map or known.objective in QUANTILES:
        raise InputError(f"objective must be of a fit to profiles, got {known.objective!r}")
    here, radii = AtAlbedo(known, float(alpha)), np.atleast_1d(np.asarray(r, float))
    value = np.asarray(known.reduced.profile(radii, alpha), float)
    energy = np.where(here.energy > 0, here.energy, 1.0)
    noise = known.statistical_error(here.slope) / energy
    model = np.sqrt(np.maximum(np.diag(here.covariance), 0.0)) / energy
    at = np.log(radii)
    relative = [np.interp(at, np.log(here.middle), np.where(here.energy > 0, part, np.nan)) for part in (noise, model)]
    return Quantity(value, np.abs(value) * relative[0], np.abs(value) * relative[1])


def reflectance(known: LawWithErrors, alpha: ArrayLike) -> Quantity:
    """Total reflectance A (k,) [-] at albedos `alpha` (k,), by a map."""
    if not known.is_map:
        raise InputError(f"known must be of a map between alpha and A, got {type(known.law).__name__}")
    albedos = np.atleast_1d(np.asarray(alpha, float))
    one, none = np.ones(albedos.size), np.zeros((albedos.size, 1))
    rings = Rings(albedos, np.array([0.0, 1.0]), none, one, none, one, np.array(NO_LIMITS), np.zeros(0))
    energy, slope = predicted(ResidualFunction(known.objective, known.free), known.reduced, rings)
    value = energy[:, 0]
    model = np.full(value.size, np.nan)
    if known.discrepancy is not None:
        spread = known.discrepancy.law_covariance(
            0.0 * albedos, known.discrepancy.places(albedos, known.law.setting), slope[:, 0] / energy
        )
        model = value * np.sqrt(np.maximum(np.diag(spread), 0.0))
    return Quantity(value, known.statistical_error(slope[:, 0]), model)


def tail_error(known: LawWithErrors, profiles: Profiles, share: float = ENERGY_WITHIN) -> float:
    """Return the root mean square of law/data - 1 of the radius of `share` [-], over the albedos that hold it.

    Where profiles are of several settings, those of the law's setting count.
    """
    errors = []
    settings = profiles.settings or (known.law.setting,) * profiles.alpha.size
    for alpha, cdf, setting in zip(profiles.alpha, profiles.cdf, settings, strict=True):
        if setting == known.law.setting and alpha < 1.0 and cdf[-1] > share:
            truth = float(np.interp(share, cdf, profiles.r_edges))
            errors.append(AtAlbedo(known, float(alpha)).radius(share)[0] / truth - 1.0)
    return float(np.sqrt(np.mean(np.square(errors)))) if errors else np.nan


def summary(known: LawWithErrors, profiles: Profiles) -> dict[str, Any]:
    """Return a record's table of A, or of the radius that holds 99.5 % of the energy, at a few albedos."""
    if known.is_map:
        return {"alpha": SHOWN, "quantity": "reflectance", **vars(reflectance(known, SHOWN))}
    radii = radius(known, SHOWN)
    model = np.fmax(radii.model, radii.value * tail_error(known, profiles))
    return {"alpha": SHOWN, "quantity": "radius", **vars(replace(radii, model=model))}
