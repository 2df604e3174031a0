"""Estimates with standard errors, and how counts of photons make them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, cast

import numpy as np
from numpy.typing import NDArray

from mcml_sim.media.arrays import Floats

# At 100 effective samples the standard error of an estimate is itself known to about 10 %, and its distribution is
# near enough to a normal one for tests and weights to trust it.
ENOUGH_SAMPLES = 100.0


@dataclass(frozen=True)
class Estimate:
    """Numbers from a simulation with their errors: arrays of one shape, or floats."""

    value: float | Floats
    """Value of the estimate, in the unit its maker states."""
    standard_error: float | Floats
    """Standard error, in the same unit. Meaningless where `effective_samples` is small: see `is_sampled`."""
    effective_samples: float | Floats
    """Number of equally weighted photons that would be worth as much, (sum w)^2 / sum w^2 [-]."""

    def __float__(self) -> float:
        if np.ndim(self.value):
            raise TypeError(f"only a scalar estimate is a float, this one has shape {np.shape(self.value)}")
        return float(self.value)

    def is_sampled(self, at_least: float = ENOUGH_SAMPLES) -> bool | NDArray[np.bool_]:
        """Return True where enough photons arrived to believe value and standard error.

        Where the photons that carry most of the light were never seen, the standard error collapses along with the
        value: a small error bar there is no sign of accuracy.
        """
        return cast("bool | NDArray[np.bool_]", np.greater_equal(self.effective_samples, at_least))

    def mapped(self, function: Callable[[Any], Any]) -> Estimate:
        """Return the estimate with all its numbers passed through a function, such as an index."""
        return Estimate(*map(function, (self.value, self.standard_error, self.effective_samples)))

    def scaled(self, factor: float | Floats) -> Estimate:
        """Return the estimate times a positive constant, which broadcasts against it."""
        return Estimate(self.value * factor, self.standard_error * factor, self.effective_samples)


@dataclass(frozen=True)
class ProfileEstimate(Estimate):
    """Profiles of albedos, with the transport mean free path that belongs to each."""

    mfp: float | Floats
    """Transport mean free path 1 / (mu_s' + mu_a), in the unit of the profile's radii."""


def estimate(counts: NDArray[np.int64], weights: Floats, photons: int) -> Estimate:
    """Return the mean weight per photon started, of photons counted by bin, in float64.

    counts (rows, bins), weights (..., bins) per photon of a bin -> Estimate of shape (..., rows). A photon that adds
    to no bin adds 0, so the variance of the mean is (sum w^2 - (sum w)^2 / N) / (N (N - 1)): infinite for one photon.
    """
    total = weights @ counts.T.astype(np.float64)
    squares = weights**2 @ counts.T.astype(np.float64)
    spread = np.maximum(squares - total**2 / photons, 0)
    variance = spread / (photons * (photons - 1.0)) if photons > 1 else np.full_like(spread, np.inf)
    effective = np.divide(total**2, squares, out=np.zeros_like(total), where=squares > 0)
    return Estimate(total / photons, np.sqrt(variance), effective)


def covariance_factor(counts: NDArray[np.int64], weights: Floats, photons: int, rank: int) -> tuple[Floats, float]:
    """Return factors of each row's covariance between weightings, truncated to `rank` directions.

    counts (rows, bins), weights (alphas, bins) -> L (rows, alphas, rank) with L L^T the covariance of the row's means,
    (sum_n H_n g_n(a) g_n(b) / N - E(a) E(b)) / (N - 1), and the largest share of any one variance that truncation
    drops: on the diagonal the variance of `estimate`. One photon says nothing of its error and counts as without.
    The covariance is a sum over all photons of (g(a) - E(a)) (g(b) - E(b)), those that add 0 included. Its factor is
    decomposed, not itself: squaring would lose half the digits of a nearly singular matrix. Each weighting counts in
    units of its own standard deviation, or the strong ones would take all the directions.
    """
    rank = min(rank, len(weights), weights.shape[1])
    factors = np.empty((len(counts), len(weights), rank))
    dropped = 0.0
    silent = np.concatenate([weights, np.zeros((len(weights), 1))], axis=1)
    for row, hits in enumerate(counts):
        number = np.append(hits, photons - hits.sum()).astype(np.float64)
        share = np.sqrt(number / (photons * max(photons - 1.0, 1.0)))
        centred = (silent - (silent @ number / photons)[:, None]) * share
        deviation = np.sqrt(np.sum(centred**2, axis=1, keepdims=True))
        unit = np.divide(centred, deviation, out=np.zeros_like(centred), where=deviation > 0)
        left, singular, _ = np.linalg.svd(unit, full_matrices=False)
        factors[row] = deviation * left[:, :rank] * singular[:rank]
        dropped = max(dropped, float(np.max(np.sum((left[:, rank:] * singular[rank:]) ** 2, axis=1), initial=0.0)))
    return factors, dropped
