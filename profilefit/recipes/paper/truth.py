"""Truths: where reflectances and fine, even rings come from, without noise or from photons."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from mcml_sim import exact
from mcml_sim.media.setting import Setting
from mcml_sim.results.orders import Orders
from profilefit.fitting.profiles import Profiles

Floats = NDArray[np.float64]
SEARCHLIGHT = Setting()
# MCML's usual hundredth of a mean free path; beyond 25 mfp (6) never walks for alpha <= .9986 [mfp].
RING_WIDTH, LAST_RADIUS = 0.01, 30.0


class Truth(Protocol):
    """Source of reflectances and fine even rings."""

    def reflectance(self, alpha: Floats) -> Floats:
        """A (m,) [-]."""

    def profiles(self, alpha: Floats) -> Profiles:
        """On even rings from 0."""


@dataclass(frozen=True)
class ExactTruth:
    """The half space without noise, on rings of `ring_width` up to `last_radius` [mfp]."""

    ring_width: float = RING_WIDTH
    last_radius: float = LAST_RADIUS
    setting: Setting = SEARCHLIGHT

    def reflectance(self, alpha: Floats) -> Floats:
        return np.asarray(exact.reflectance(alpha, setting=self.setting))

    def profiles(self, alpha: Floats) -> Profiles:
        """Ring energies by Simpson's rule on a spline of ln(2 pi r R_d): within 1e-5 of the exact integrals."""
        half = np.arange(2 * round(self.last_radius / self.ring_width) + 1) * self.ring_width / 2
        nodes = np.geomspace(half[1] / 2, half[-1], 120)
        values = 2 * np.pi * nodes * np.asarray(exact.profile(nodes, alpha[:, None], setting=self.setting))
        density = np.exp(CubicSpline(np.log(nodes), np.log(values), axis=1)(np.log(np.maximum(half, nodes[0]))))
        energy = self.ring_width / 6 * (density[:, :-2:2] + 4 * density[:, 1::2] + density[:, 2::2])
        inside = np.asarray(exact.cdf(half[2], alpha, setting=self.setting))  # r ln r at the source defeats Simpson
        energy[:, 0] = self.reflectance(alpha) * inside
        beyond = self.reflectance(alpha) - energy.sum(axis=1)
        none = np.zeros_like(energy)
        return Profiles(alpha, half[::2], energy, none, none + np.inf, beyond, "exact", self.setting)


@dataclass(frozen=True)
class TallyTruth:
    """Reflectances and rings of photons: an order-resolved run on fine even rings up to 25 mfp or more."""

    orders: Orders

    def reflectance(self, alpha: Floats) -> Floats:
        return np.asarray(self.orders.reflectance(alpha).value)

    def profiles(self, alpha: Floats) -> Profiles:
        # Without the covariance between albedos, which no reading uses and sixty albedos would wait minutes for.
        energy = self.orders.energy(alpha)
        return Profiles(
            alpha,
            self.orders.grid.r_edges,
            np.asarray(energy.value),
            np.asarray(energy.standard_error),
            np.asarray(energy.effective_samples),
            np.asarray(self.orders.overflow(alpha).value),
            "orders",
            self.orders.setting,
            self.orders.photons,
        )
