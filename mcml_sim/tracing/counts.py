"""Whole photons of one or more batches, by ring and order, and the ledger that they must close."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray


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

    exits: NDArray[np.int64]
    """Photons that left, by ring (the last row: beyond the last ring) and bin of order, (rings + 1, bins)."""
    rouletted: int
    """Photons ended by roulette."""
    cut: int
    """Photons ended by the cap on the order."""
    started: int

    def __add__(self, other: Counts) -> Counts:
        return Counts(
            self.exits + other.exits,
            self.rouletted + other.rouletted,
            self.cut + other.cut,
            self.started + other.started,
        )

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
