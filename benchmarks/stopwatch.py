"""Timing on a machine that others use too: pinned to one core, in turns, and compared turn by turn."""

from __future__ import annotations

import os
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import numpy as np

Work = Callable[[int], int]
"""Does its work once, with that seed; returns how many photons it traced."""


def cores() -> list[int]:
    """Cores this process may use; on systems that do not say, all of them."""
    return sorted(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else list(range(os.cpu_count() or 1))


def pin(*to: int) -> bool:
    """Keep this process, and the threads it will start, on these cores; False where the system cannot."""
    if not hasattr(os, "sched_setaffinity"):
        return False
    os.sched_setaffinity(0, to)
    return True


@dataclass(frozen=True)
class Rates:
    """Photons a second in each turn, of several works that took turns."""

    by_name: dict[str, list[float]]

    def best(self, name: str) -> float:
        """The undisturbed rate: that of the fastest turn [1/s]."""
        return max(self.by_name[name])

    def ratio(self, name: str, over: str, factor: float = 1.0) -> Ratio:
        """Median of the ratios turn by turn, times `factor`, with their spread."""
        ratios = factor * np.array(self.by_name[name]) / np.array(self.by_name[over])
        return Ratio(float(np.median(ratios)), float(ratios.min()), float(ratios.max()))


@dataclass(frozen=True)
class Ratio:
    """How many times as fast."""

    median: float
    least: float
    most: float

    def __str__(self) -> str:
        middle, *ends = (f"{x:.2f}" if self.median < 10 else f"{x:.1f}" for x in (self.median, self.least, self.most))
        return middle if self.least == self.most else f"{middle} ({' ... '.join(ends)})"


def take_turns(works: Mapping[str, Work], turns: int) -> Rates:
    """Time every work once a turn, after one untimed time that compiles it."""
    for work in works.values():
        work(0)
    rates: dict[str, list[float]] = {name: [] for name in works}
    for turn in range(turns):
        for name, work in works.items():
            begin = time.perf_counter()
            photons = work(turn + 1)
            rates[name].append(photons / (time.perf_counter() - begin))
    return Rates(rates)
