"""Bootstrap over batches: how much constants move when the run is made of other batches of its photons.

It knows nothing of scattering orders, weights or covariances: batches are drawn with replacement, added up and fitted
again (Efron, Annals of Statistics 7, 1979), so it checks the closed forms from outside. B batches know an error to
1 / sqrt(2 B) of it, and B drawn from B scatter by sqrt(1 - 1/B) too little, which is put right.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from mcml_sim.errors import InputError
from mcml_sim.orders import Orders
from profilefit.estimate import Fit
from profilefit.replicates import refitted

Floats = NDArray[np.float64]
FEWEST = 10  # batches: fewer know their own scatter to worse than a quarter


@dataclass(frozen=True)
class Bootstrap:
    """Constants of refits (k, p), how many refits failed, and the covariance (p, p) that their scatter gives."""

    names: tuple[str, ...]
    constants: Floats
    failed: int
    batches: int

    @property
    def covariance(self) -> Floats:
        scale = self.batches / (self.batches - 1)
        return np.atleast_2d(scale * np.cov(self.constants, rowvar=False))

    @property
    def standard_error(self) -> Floats:
        return np.sqrt(np.diag(self.covariance))


def bootstrap(batches: Sequence[Orders], fit: Fit, number: int = 400, seed: int = 0) -> Bootstrap:
    """Refit `fit` to `number` resamples of the runs in `batches`, equally large ones on the rings of the fit.

    InputError for fewer than ten batches, unequal ones, or other rings or light.
    """
    energy = energies(batches, fit)
    drawn = np.random.default_rng(seed).multinomial(len(batches), np.full(len(batches), 1.0 / len(batches)), number)
    found, converged = refitted(fit, np.einsum("kb,bai->kai", drawn / len(batches), energy))
    return Bootstrap(fit.free, found[converged], int(np.sum(~converged)), len(batches))


def energies(batches: Sequence[Orders], fit: Fit) -> Floats:
    """Energies (b, m, n + 1) of each batch on the rings of `fit`, the light beyond the last one last."""
    if len(batches) < FEWEST:
        raise InputError(f"batches must be at least {FEWEST}, got {len(batches)}")
    if len({batch.photons for batch in batches}) > 1:
        raise InputError("batches must be of equally many photons, got different ones")
    if len({batch.seed for batch in batches}) < len(batches):
        raise InputError("batches must be of different seeds, got one twice: it would be the same photons")
    if any(batch.setting != fit.law.setting for batch in batches):
        raise InputError(f"batches must belong to {fit.law.setting}, as the fit does, got another setting")
    alpha, edges = np.asarray(fit.rings.alpha), np.asarray(fit.rings.r_edges)
    return np.stack([_energy(batch.merged(edges), alpha) for batch in batches])


def _energy(batch: Orders, alpha: Floats) -> Floats:
    return np.column_stack([batch.energy(alpha).value, batch.overflow(alpha).value])
