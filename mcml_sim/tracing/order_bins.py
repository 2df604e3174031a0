"""Photons by ring and scattering order: counts, bins of order, and where roulette is played.

Every order to 256 has its own bin; then 64 bins an octave to the last order. All powers of two are bin edges, so the
roulette weight is constant in a bin. What alpha^n is inside a bin that holds several orders is taken as its mean
under the density n^-3/2 of a half space's long paths. Where the density is n^p instead, that mean is off by the
share |p + 3/2| n |ln alpha| 1.6e-5 of itself, which is never more than 6e-6 |p + 3/2| of a photon.

Each time the order doubles from the first roulette on, half the photons are dropped and the others count twice. Light
that scatters forwards takes 1 / (1 - g) scatterings to turn as far as one does where scattering has no direction
(similarity), so roulette and cap come that much later, by a power of two.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, fields
from functools import cached_property, lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from mcml_sim.media.arrays import Floats
from mcml_sim.media.setting import Setting

LAST_EXACT = 256
BINS_PER_OCTAVE = 64
LONG_PATHS = -1.5  # exponent of the order's density in a conservative half space
# Where g = 0. Below 64 most of the reflectance is made; without roulette six sevenths of all events would go to the
# few photons beyond it.
FIRST_ROULETTE, MAX_ORDER = 64, 8192
FARTHEST = 64  # reach, at most: MAX_ORDER times it is a whole float32


@dataclass(frozen=True)
class OrderBins:
    """Bins of order for a half space where one scattering turns light as far as 1 / `reach` of isotropic ones."""

    reach: int = 1  # power of two from 1 to FARTHEST

    @property
    def first_roulette(self) -> int:
        """Order after which half the photons end, and the others count twice."""
        return FIRST_ROULETTE * self.reach

    @property
    def max_order(self) -> int:
        """Order after which nobody goes on."""
        return MAX_ORDER * self.reach

    @cached_property
    def stops(self) -> NDArray[np.int32]:
        """Orders of roulette, int32: the first, twice that, ... and at last `max_order`."""
        doublings = round(np.log2(MAX_ORDER / FIRST_ROULETTE))
        return self.first_roulette * 2 ** np.arange(1 + doublings, dtype=np.int32)

    @cached_property
    def orders(self) -> NDArray[np.int64]:
        """Orders 1 ... max_order."""
        return np.arange(1, self.max_order + 1)

    @cached_property
    def last_orders(self) -> NDArray[np.int64]:
        """Highest order in each bin, int64 (bins,)."""
        steps = np.arange(1, 1 + round(BINS_PER_OCTAVE * np.log2(self.max_order / LAST_EXACT)))
        geometric = np.rint(LAST_EXACT * 2.0 ** (steps / BINS_PER_OCTAVE)).astype(np.int64)
        return np.concatenate([np.arange(1, LAST_EXACT + 1), geometric])

    @cached_property
    def first_orders(self) -> NDArray[np.int64]:
        """Lowest order in each bin, int64 (bins,)."""
        return np.concatenate([[1], self.last_orders[:-1] + 1])

    @property
    def bin_of_order(self) -> NDArray[np.int64]:
        """Bin of order n at index n - 1, (max_order,)."""
        return np.repeat(np.arange(self.last_orders.size), self.last_orders - self.first_orders + 1)

    @cached_property
    def mean_orders(self) -> Floats:
        """Representative order of each bin, float64 (bins,)."""
        return self.mean(self.orders.astype(float))

    @cached_property
    def roulette_weights(self) -> NDArray[np.int64]:
        """Photons that one photon of each bin counts for, int64 (bins,)."""
        return self.roulette_weight(self.last_orders)

    def roulette_weight(self, order: ArrayLike) -> NDArray[np.int64]:
        """Return how many photons one that leaves (or is cut) at this order stands for: 1 before the first roulette."""
        return 2 ** np.ceil(np.log2(np.maximum(np.asarray(order) / self.first_roulette, 1))).astype(np.int64)

    def mean(self, values: Floats, exponent: float = LONG_PATHS) -> Floats:
        """Return means per bin, under the density n^exponent, of values by order: (..., max_order) -> (..., bins)."""
        density = self.orders**exponent
        starts = self.first_orders - 1
        return np.add.reduceat(values * density, starts, axis=-1) / np.add.reduceat(density, starts)

    def weights(self, alpha: Floats) -> Floats:
        """Return what a photon of each bin adds to the reflectance at albedo alpha: (...) -> (..., bins)."""
        return self.roulette_weights * self._each(alpha, lambda alpha: alpha**self.orders)

    def weight_derivatives(self, alpha: Floats) -> Floats:
        """Return d weights / d alpha: (...) -> (..., bins)."""
        return self.roulette_weights * self._each(alpha, lambda alpha: self.orders * alpha ** (self.orders - 1))

    def _each(self, alpha: Floats, power: Callable[[float], NDArray]) -> Floats:
        """Return the mean per bin of a power of one albedo after the other: the orders of all would fill the memory."""
        means: Floats = np.stack([self.mean(power(albedo)) for albedo in np.ravel(alpha)])
        return means.reshape(*np.shape(alpha), -1)


def bins_of(setting: Setting) -> OrderBins:
    """Return the bins of a half space."""
    turned = max(1.0 - setting.g, 1.0 / FARTHEST)
    return _bins(2 ** max(round(np.log2(1.0 / turned)), 0))


_bins = lru_cache(OrderBins)


@dataclass(frozen=True)
class Ledger:
    """Numbers of photons by how they ended: started = exited + rouletted + cut."""

    started: int
    exited: int
    rouletted: int
    cut: int


@dataclass(frozen=True, eq=False)
class Counts:
    """Whole photons of one or more batches."""

    exits: NDArray[np.int64]  # photons that left, by ring (the last row: beyond) and bin of order, (rings + 1, bins)
    rouletted: int  # photons ended by roulette
    cut: int  # photons ended by the cap on the order
    started: int

    def __add__(self, other: Counts) -> Counts:
        return Counts(*(getattr(self, part.name) + getattr(other, part.name) for part in fields(self)))

    def arrays(self) -> dict[str, NDArray]:
        """Return all parts by name, as a store keeps them: of `exits`, which is mostly 0, only the other cells."""
        cells = np.flatnonzero(self.exits)
        rest = np.array([self.rouletted, self.cut, self.started], np.int64)
        return {"cells": cells, "exits": self.exits.ravel()[cells], "rest": rest}

    @classmethod
    def from_arrays(cls, arrays: Mapping[str, NDArray], shape: tuple[int, int]) -> Counts:
        """Return the counts of `arrays`, `shape` being that of `exits`; ValueError if they are none."""
        try:
            if any(arrays[name].dtype.kind != "i" or np.any(arrays[name] < 0) for name in ("cells", "exits", "rest")):
                raise TypeError("numbers of cells and photons are whole and >= 0")
            exits = np.zeros(shape, np.int64)
            exits.ravel()[arrays["cells"]] = arrays["exits"]
            rouletted, cut, started = map(int, arrays["rest"])
        except (LookupError, TypeError) as error:
            raise ValueError(f"these are no counts of shape {shape}: {error}") from None
        counts = cls(exits, rouletted, cut, started)
        if not counts.is_closed:
            raise ValueError("its photons do not add up")
        return counts

    @property
    def ledger(self) -> Ledger:
        """Ledger of these photons."""
        return Ledger(self.started, int(self.exits.sum()), self.rouletted, self.cut)

    @property
    def is_closed(self) -> bool:
        """Whether every photon started is accounted for."""
        ledger = self.ledger
        return ledger.started == ledger.exited + ledger.rouletted + ledger.cut

    def require_closed(self) -> None:
        """Raise RuntimeError if a photon was lost: a defect of the tracer, not of its input."""
        if not self.is_closed:
            raise RuntimeError(f"photons were lost or made: {self.ledger}")
