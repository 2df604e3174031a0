"""Order-resolved run: one simulation without absorption answers for every albedo, and for its derivative."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.errors import InputError
from mcml_sim.exact import single_scattering
from mcml_sim.exact.light import unreduced
from mcml_sim.media.arrays import Floats, checked_range, checked_whole, scalar_or_array
from mcml_sim.media.grid import Grid
from mcml_sim.media.setting import Setting
from mcml_sim.results import estimate
from mcml_sim.results.estimate import Estimate, ProfileEstimate
from mcml_sim.tracing.order_bins import Counts, Ledger, OrderBins, bins_of


@dataclass(frozen=True, eq=False)
class Orders:
    """Photons of a conservative half space by ring and number of scatterings.

    Radii are in units of 1 / (mu_s + mu_a), whatever g: one run serves every albedo. Every method takes the reduced
    albedo `alpha` in [0, 1], a number or an array, InputError otherwise; `mfp(alpha)` is the transport mean free path
    in that unit, 1 where g = 0. Estimates have the shape of alpha, then that of the rings. All albedos come from the
    same photons, so their errors are strongly correlated: `covariance_factor` says how. What was scattered once is
    known exactly and not taken from the photons (`once`), so standard errors and effective samples are those of the
    rest. Photons with more than 8192 / (1 - g) scatterings, about, are cut: `cut` bounds what that takes from the
    reflectance.
    """

    grid: Grid
    photons: int
    seed: int
    setting: Setting
    counts: Counts
    """Whole numbers from which all estimates come."""

    def reflectance(self, alpha: ArrayLike) -> Estimate:
        """Return the total diffuse reflectance A [-], beyond the last ring included."""
        return self._of_row(self.counts.exits.sum(axis=0), self._shares.sum(), alpha)

    def energy(self, alpha: ArrayLike) -> Estimate:
        """Return the integral of 2 pi r R_d over each ring [-]."""
        return self._estimate(self.ring_order_counts, self._shares[:-1], alpha)

    def overflow(self, alpha: ArrayLike) -> Estimate:
        """Return the reflectance beyond the last ring [-]."""
        return self._of_row(self.counts.exits[-1], self._shares[-1], alpha)

    def mfp(self, alpha: ArrayLike) -> float | Floats:
        """Return the transport mean free path 1 / (mu_s' + mu_a) in the grid's unit, 1 / (mu_s + mu_a)."""
        return scalar_or_array(1.0 / (1.0 - self._whole(alpha) * self.setting.g))

    def profile(self, alpha: ArrayLike) -> ProfileEstimate:
        """Return the mean of R_d over the area of each ring [1/unit^2], and the transport mean free path [unit].

        R_d rises as 1/r to r = 0 within the first ring. The unit is the grid's.
        """
        of = self.energy(alpha).scaled(1 / self.grid.r_areas)
        return ProfileEstimate(of.value, of.standard_error, of.effective_samples, self.mfp(alpha))

    def profile_derivative(self, alpha: ArrayLike) -> Estimate:
        """Return d profile / d alpha [1/unit^2], from the same photons, at the grid's radii.

        With a = mu_s / (mu_s + mu_a) it is the sum over n of n a^(n-1) R_n, times da / d alpha.
        """
        whole, g = self._whole(alpha), self.setting.g
        weights, ones = self._bins.weight_derivatives(whole), np.ones_like(whole)
        slope = self._from_weights(self.ring_order_counts, weights, np.multiply.outer(ones, self._shares[:-1]))
        by_alpha = (1.0 - whole * g) ** 2 / (1.0 - g)
        return slope.scaled(np.multiply.outer(by_alpha, 1 / self.grid.r_areas))

    def once(self, alpha: ArrayLike) -> Floats:
        """Return light scattered once, by ring, the last beyond the last ring [-]: part of `energy`, without error."""
        return np.multiply.outer(self._whole(alpha), self._shares)

    def covariance_factor(self, alpha: ArrayLike, rank: int = 8, overflow: bool = False) -> tuple[Floats, float]:
        """Return the covariance of `energy` between albedos, ring by ring, in closed form.

        alpha (alphas,) -> L (rings, alphas, rank) with L[i] @ L[i].T the covariance of ring i, and the largest share
        of any one variance that the truncation drops. Many albedos of one ring are nearly dependent (32 of them:
        condition number 1e16), so a small rank holds all there is. Between rings i != j the covariance is
        -E_i E_j / (N - 1), E without `once`, which no factor holds: next to nothing when there are many rings. With
        `overflow` a last row stands for the light beyond the last ring.
        """
        albedos = np.atleast_1d(self._whole(alpha))
        if albedos.ndim != 1:
            raise InputError(f"alpha must be a number or a list of numbers, got an array of shape {albedos.shape}")
        limit = checked_whole("rank", rank, lowest=1, highest=self._bins.last_orders.size)
        counts = self.counts.exits if overflow else self.ring_order_counts
        return estimate.covariance_factor(
            counts[:, 1:], self.weights(alpha).reshape(albedos.size, -1)[:, 1:], self.photons, limit
        )

    def merged(self, r_edges: ArrayLike) -> Orders:
        """Return these photons on fewer, wider rings: `r_edges` rise from 0, each one an edge of this grid."""
        grid = Grid.from_edges(r=r_edges)
        index = np.searchsorted(self.grid.r_edges, grid.r_edges)
        if index[-1] >= self.grid.r_edges.size or np.any(self.grid.r_edges[index] != grid.r_edges):
            raise InputError(f"r_edges must be edges of the run's own grid, got {grid.rings} annuli that are not")
        exits = np.add.reduceat(self.counts.exits, index, axis=0)  # the last piece gathers all beyond the last edge
        return replace(self, grid=grid, counts=replace(self.counts, exits=exits))

    def cut(self, alpha: ArrayLike) -> float | Floats:
        """Return an upper bound on the reflectance that ending photons at the highest order took away [-]."""
        last = self._bins.max_order
        lost = self.entered * float(self._bins.roulette_weight(last)) * self.counts.cut / self.photons
        return scalar_or_array(lost * self._whole(alpha) ** last)

    @property
    def ledger(self) -> Ledger:
        """Ledger of all photons started."""
        return self.counts.ledger

    @property
    def ring_order_counts(self) -> NDArray[np.int64]:
        """Photons by ring and bin of order, without the overflow, int64 (rings, bins)."""
        return self.counts.exits[:-1]

    @property
    def orders(self) -> Floats:
        """Representative order of each bin [-], float64 (bins,)."""
        return self._bins.mean_orders

    def weights(self, alpha: ArrayLike) -> Floats:
        """Return what one counted photon of each bin adds to the energy, times N [-]: shape of alpha, then (bins,)."""
        return self.entered * self._bins.weights(self._whole(alpha))

    @property
    def entered(self) -> float:
        """Share of the light that the surface lets in [-]; the photons counted are of this light."""
        return single_scattering.entered(self.setting)

    @property
    def _bins(self) -> OrderBins:
        return bins_of(self.setting)

    @cached_property
    def _shares(self) -> Floats:
        """Light scattered once at alpha = 1, (rings + 1,)."""
        return self.entered * single_scattering.ring_shares(self.grid.r_edges, self.setting)

    def _estimate(self, counts: NDArray[np.int64], shares: Floats, alpha: ArrayLike) -> Estimate:
        whole = self._whole(alpha)
        return self._from_weights(counts, self._bins.weights(whole), np.multiply.outer(whole, shares))

    def _whole(self, alpha: ArrayLike) -> Floats:
        """Return mu_s / (mu_s + mu_a) of reduced albedos."""
        return np.asarray(
            unreduced(checked_range("alpha", alpha, "a reduced albedo in [0, 1]", 0.0, 1.0), self.setting.g)
        )

    def _from_weights(self, counts: NDArray[np.int64], weights: Floats, exact: Floats) -> Estimate:
        """Return the estimate from `exact`, light scattered once, and the counted photons scattered more often."""
        later = estimate.estimate(counts[:, 1:], self.entered * weights[..., 1:], self.photons)
        return replace(later, value=later.value + exact)

    def _of_row(self, counts: NDArray[np.int64], share: float, alpha: ArrayLike) -> Estimate:
        """Return the estimate from one row of counts, in the shape of alpha."""
        rows = self._estimate(counts[None, :], np.array([share]), alpha)
        return rows.mapped(lambda part: scalar_or_array(part[..., 0]))
