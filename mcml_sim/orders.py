"""The order-resolved run: one simulation without absorption answers for every albedo, and for its derivative."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim import order_bins, single, tally, tracer
from mcml_sim.checks import (
    MAX_PHOTONS,
    checked_folder,
    checked_numbers,
    checked_whole,
    checked_workers,
    require_own_process,
)
from mcml_sim.errors import InputError
from mcml_sim.grid import Grid, require_resolved
from mcml_sim.isotropic import FIRST_ROULETTE, MAX_ORDER, roulette_weight
from mcml_sim.run import run_batches
from mcml_sim.setting import Setting
from mcml_sim.store import Store
from mcml_sim.tally import Counts, Estimate, Ledger

Floats = NDArray[np.float64]

SEARCHLIGHT = Setting()


@dataclass(frozen=True, eq=False)
class Orders:
    """Photons of a white half space by ring and number of scatterings; lengths in mean free paths [mfp].

    Every method takes the single-scattering albedo `alpha` in [0, 1], a number or an array, InputError otherwise;
    estimates have the shape of alpha, then that of the rings. All albedos come from the same photons, so their
    errors are strongly correlated: `covariance_factor` says how. What was scattered once is known exactly and not
    taken from the photons (`once`), so standard errors and effective samples are those of the rest. Photons with more
    than 8192 scatterings are cut: `cut` bounds what that takes from the reflectance.
    """

    grid: Grid
    photons: int
    seed: int
    setting: Setting
    counts: Counts
    """The whole-numbered result from which all estimates come."""

    def reflectance(self, alpha: ArrayLike) -> Estimate:
        """Total diffuse reflectance A [-], beyond the last ring included."""
        return self._of_row(self.counts.exits.sum(axis=0), self._shares.sum(), alpha)

    def energy(self, alpha: ArrayLike) -> Estimate:
        """Integral of 2 pi r R_d over each ring [-]."""
        return self._estimate(self.ring_order_counts, self._shares[:-1], alpha)

    def overflow(self, alpha: ArrayLike) -> Estimate:
        """Reflectance beyond the last ring [-]."""
        return self._of_row(self.counts.exits[-1], self._shares[-1], alpha)

    def profile(self, alpha: ArrayLike) -> Estimate:
        """Mean of R_d over the area of each ring [1/mfp^2]: not its value at the middle, R_d rises as 1/r to r = 0."""
        return self.energy(alpha).scaled(1 / self.grid.r_areas)

    def profile_derivative(self, alpha: ArrayLike) -> Estimate:
        """d profile / d alpha [1/mfp^2], from the same photons: sum over n of n alpha^(n-1) R_n."""
        albedo = _checked_alpha(alpha)
        weights, ones = order_bins.weight_derivatives(albedo), np.ones_like(albedo)
        slope = self._from_weights(self.ring_order_counts, weights, np.multiply.outer(ones, self._shares[:-1]))
        return slope.scaled(1 / self.grid.r_areas)

    def once(self, alpha: ArrayLike) -> Floats:
        """Light scattered exactly once, by ring, the last beyond the last ring [-]: part of `energy`, without error."""
        return np.multiply.outer(_checked_alpha(alpha), self._shares)

    def covariance_factor(self, alpha: ArrayLike, rank: int = 8, overflow: bool = False) -> tuple[Floats, float]:
        """Covariance of `energy` between albedos, ring by ring, in closed form.

        alpha (alphas,) -> L (rings, alphas, rank) with L[i] @ L[i].T the covariance of ring i, and the largest share
        of any one variance that the truncation drops. Many albedos of one ring are nearly dependent (32 of them:
        condition number 1e16), so a small rank holds all there is. Between rings i != j the covariance is
        -E_i E_j / (N - 1), E without `once`, which no factor holds: next to nothing when there are many rings. With
        `overflow` a last row stands for the light beyond the last ring.
        """
        albedos = np.atleast_1d(_checked_alpha(alpha))
        if albedos.ndim != 1:
            raise InputError(f"alpha must be a number or a list of numbers, got an array of shape {albedos.shape}")
        limit = checked_whole("rank", rank, lowest=1, highest=len(order_bins.LAST_ORDERS))
        counts = self.counts.exits if overflow else self.ring_order_counts
        return tally.covariance_factor(counts[:, 1:], self.weights(albedos)[:, 1:], self.photons, limit)

    def merged(self, r_edges: ArrayLike) -> Orders:
        """The same photons on fewer, wider rings: `r_edges` [mfp] rise from 0, each one an edge of this grid."""
        grid = Grid.from_edges(r=r_edges)
        index = np.searchsorted(self.grid.r_edges, grid.r_edges)
        if index[-1] >= self.grid.r_edges.size or np.any(self.grid.r_edges[index] != grid.r_edges):
            raise InputError(f"r_edges must be edges of the run's own grid, got {grid.rings} rings that are not")
        exits = np.add.reduceat(self.counts.exits, index, axis=0)  # the last piece gathers all beyond the last edge
        return replace(self, grid=grid, counts=replace(self.counts, exits=exits))

    def cut(self, alpha: ArrayLike) -> float | Floats:
        """Upper bound on the reflectance that ending photons at the highest order took away [-]."""
        lost = self.entered * float(roulette_weight(MAX_ORDER)) * self.counts.cut / self.photons
        return _scalar_or_array(lost * _checked_alpha(alpha) ** MAX_ORDER)

    @property
    def ledger(self) -> Ledger:
        """What became of every photon started."""
        return self.counts.ledger

    @property
    def ring_order_counts(self) -> NDArray[np.int64]:
        """Photons by ring and bin of order, without the overflow, int64 (rings, bins)."""
        return self.counts.exits[:-1]

    @property
    def orders(self) -> Floats:
        """Representative order of each bin [-], float64 (bins,)."""
        return order_bins.MEAN_ORDERS

    def weights(self, alpha: ArrayLike) -> Floats:
        """What one counted photon of each bin adds to the energy, times N [-]: shape of alpha, then (bins,)."""
        return self.entered * order_bins.weights(_checked_alpha(alpha))

    @property
    def entered(self) -> float:
        """Share of the light that the surface lets in [-]; the photons counted are of that."""
        return single.entered(self.setting)

    @cached_property
    def _shares(self) -> Floats:
        """`once` at alpha = 1, (rings + 1,)."""
        return self.entered * single.ring_shares(self.grid.r_edges, self.setting)

    def _estimate(self, counts: NDArray[np.int64], shares: Floats, alpha: ArrayLike) -> Estimate:
        albedo = _checked_alpha(alpha)
        return self._from_weights(counts, order_bins.weights(albedo), np.multiply.outer(albedo, shares))

    def _from_weights(self, counts: NDArray[np.int64], weights: Floats, exact: Floats) -> Estimate:
        """Estimate from `exact`, the light scattered once, and the counted photons that were scattered again."""
        again = tally.estimate(counts[:, 1:], self.entered * weights[..., 1:], self.photons)
        return replace(again, value=again.value + exact)

    def _of_row(self, counts: NDArray[np.int64], share: float, alpha: ArrayLike) -> Estimate:
        """Estimate from one row of counts, in the shape of alpha."""
        rows = self._estimate(counts[None, :], np.array([share]), alpha)
        parts = (np.asarray(part)[..., 0] for part in (rows.value, rows.standard_error, rows.effective_samples))
        return Estimate(*map(_scalar_or_array, parts))


def simulate_orders(
    grid: Grid,
    photons: int,
    seed: int = 0,
    setting: Setting = SEARCHLIGHT,
    store: str | Path | None = None,
    workers: int | None = None,
    progress: bool | None = None,
    scheduler: str | None = None,
) -> Orders:
    """Simulate a white half space, resolved by scattering order.

    grid      rings, edges in mean free paths [mfp]
    photons   how many to start, 1 to 1e13
    seed      whole number >= 0; equal seeds start with equal photons
    setting   the light and the surface; Setting() and its diffuse twin are the fastest
    store     folder that keeps each finished batch of 2^20 photons; a run that finds batches there resumes
    workers   threads, by default one a core; the result does not depend on it
    progress  show a bar on stderr; by default only if that is a terminal
    scheduler address of a Dask scheduler whose workers trace the batches, instead of threads here

    InputError on other arguments; StoreError if the folder is another run's or cannot be written; a damaged batch is
    named in a warning and traced again. Ctrl-C stops after the batches in flight, which the store keeps too.
    """
    number, key = _checked_run(grid, photons, seed, setting)
    threads, folder = checked_workers(workers, scheduler), checked_folder(store)
    kept = None if folder is None else _store(folder, grid, key, setting)
    counts = run_batches(
        partial(tracer.trace_batch, grid, key, setting=setting),
        tracer.BATCH_PHOTONS,
        number,
        workers=threads,
        store=kept,
        progress=progress,
        scheduler=scheduler,
    )
    return Orders(grid, number, key, setting, counts)


def trace_share(
    share: int,
    shares: int,
    grid: Grid,
    photons: int,
    seed: int = 0,
    setting: Setting = SEARCHLIGHT,
    *,
    store: str | Path,
) -> int:
    """Trace the batches share, share + shares, share + 2 shares, ... of `simulate_orders` into its store, on one core.

    For jobs that share a folder but no network: when each of them has traced its share, `simulate_orders` with the same
    arguments and that `store` reads all batches and traces none. Returns the number of batches that had to be traced.

    share     which of the shares [-], 0 ... shares - 1; the other arguments as for `simulate_orders`
    InputError, StoreError as there; what is finished stays, and the same call goes on from it.
    """
    number, key = _checked_run(grid, photons, seed, setting)
    parts = checked_whole("shares", shares, lowest=1)
    first = checked_whole("share", share, lowest=0, highest=parts - 1)
    if (folder := checked_folder(store)) is None:
        raise InputError("store must be the path of a folder, got None")
    kept, traced = _store(folder, grid, key, setting), 0
    for batch in range(first, -(-number // tracer.BATCH_PHOTONS), parts):
        size = min(tracer.BATCH_PHOTONS, number - batch * tracer.BATCH_PHOTONS)
        found = kept.load(batch)
        if found is None or found.started < size:
            kept.save(batch, tracer.trace_batch(grid, key, batch, size, setting=setting))
            traced += 1
    return traced


def _checked_run(grid: Grid, photons: int, seed: int, setting: Setting) -> tuple[int, int]:
    """How many photons, and the seed."""
    require_own_process()
    if not isinstance(setting, Setting):
        raise InputError(f"setting must be a mcml_sim.Setting, got {setting!r}")
    require_resolved(grid)
    return checked_whole("photons", photons, lowest=1, highest=MAX_PHOTONS), checked_whole("seed", seed, lowest=0)


def _store(folder: Path, grid: Grid, seed: int, setting: Setting) -> Store[Counts]:
    return Store(folder, _made_by(grid, seed, setting), partial(Counts.from_arrays, shape=_shape(grid)))


def _made_by(grid: Grid, seed: int, setting: Setting) -> dict[str, object]:
    """What decides which photons a batch holds and how they are counted."""
    return {
        "kind": "orders",
        "setting": str(setting),
        "seed": seed,
        "grid": grid.digest,
        "r_edges": grid.r_edges.tolist(),
        "batch_photons": tracer.BATCH_PHOTONS,
        "max_order": MAX_ORDER,
        "first_roulette": FIRST_ROULETTE,
        "last_exact_order": order_bins.LAST_EXACT,
        "order_bins_per_octave": order_bins.BINS_PER_OCTAVE,
    }


def _shape(grid: Grid) -> tuple[int, int]:
    return grid.rings + 1, len(order_bins.LAST_ORDERS)


def _checked_alpha(alpha: ArrayLike) -> Floats:
    albedos = checked_numbers("alpha", alpha, "a single-scattering albedo in [0, 1]")
    outside = ~((albedos >= 0) & (albedos <= 1))
    if np.any(outside):
        raise InputError(f"alpha must be a single-scattering albedo in [0, 1], got {albedos[outside].flat[0]:g}")
    return albedos


def _scalar_or_array(values: Floats) -> float | Floats:
    return values if np.ndim(values) else float(values)
